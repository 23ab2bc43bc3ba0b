"""Any fault at any moment, alone or with a second one: the run ends, in a sentence, and nothing moves afterwards."""

import itertools

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sim_backends.bus_faults import FrameRule

LAST = 8.5
"""s, before a run without faults is over"""

FAULTS = {
    "silent": lambda cable: lambda stage: setattr(stage.drive(cable).faults, "silent", True),
    "SDO silent": lambda cable: lambda stage: setattr(stage.drive(cable).faults, "sdo_silent", True),
    "fault word": lambda cable: lambda stage: stage.drive(cable).faults.raise_fault(0x4210),
    "encoder": lambda cable: lambda stage: stage.drive(cable).faults.jump_encoder(700 * cable),
    "reset": lambda cable: lambda stage: stage.bus.inject(0x000, bytes([129, cable])),
    "pre-operational": lambda cable: lambda stage: stage.bus.inject(0x000, bytes([128, cable])),
    "slack": lambda cable: lambda stage: stage.add_tension(cable, -150.0),
    "overload": lambda cable: lambda stage: stage.add_tension(cable, 400.0),
    "strange words": lambda cable: lambda stage: stage.bus.inject(0x180 + cable, b"\xff" * 7),
    "process data lost": lambda cable: (
        lambda stage: stage.bus.rules.append(FrameRule(frozenset({0x180 + cable}), drop=True))
    ),
    "cut": lambda _: lambda stage: setattr(stage.bus, "cut", True),
    "unplugged": lambda _: lambda stage: setattr(stage.bus, "fault", "unplugged"),
    "host": lambda _: (
        lambda stage: [
            stage.bus.rules.append(FrameRule(frozenset({0x77F}), drop=True)),
        ]
    ),
    "hidden": lambda cable: lambda stage: stage.mocap.add("occlusions", 1.0 * cable),
    "frozen": lambda cable: lambda stage: stage.mocap.add("freezes", 1.0 * cable),
    "no stream": lambda cable: lambda stage: stage.mocap.add("silences", 1.0 * cable),
    "swapped": lambda cable: lambda stage: stage.mocap.add("jumps", 0.1 * cable, (0.0, 0.03, 0.0)),
}
NUMBERS = itertools.count()

moments = st.floats(0.0, LAST).map(lambda t: round(t, 3))
plants = st.tuples(st.sampled_from(sorted(FAULTS)), st.integers(1, 4), moments)


SETTINGS = {"deadline": None, "derandomize": True, "suppress_health_check": [HealthCheck.function_scoped_fixture]}


def check_run(scene, first, second):
    rehearsal = scene.make(folder=f"run{next(NUMBERS)}")
    rehearsal.settings = scene.short(repeats=1)
    for kind, cable, after in filter(None, (first, second)):
        rehearsal.at("Enable", FAULTS[kind](cable), after=after)
    ended = rehearsal.run()
    report = ended.check(held=ended.report.held)
    assert report.exit_code in (0, 1, 3)
    assert (report.exit_code == 0) == (len(report.accepted) == 1 and report.held)
    if not report.held:
        assert "NOT VERIFIED" in report.held_says or "cut the power by hand" in report.held_says
        assert report.exit_code == 3


@settings(max_examples=4, **SETTINGS)
@given(first=plants, second=st.none() | plants)
def test_a_few_faults_end_held(scene, first, second):
    check_run(scene, first, second)


@pytest.mark.slow
@settings(max_examples=40, **SETTINGS)
@given(first=plants, second=st.none() | plants)
def test_any_fault_ends_held(scene, first, second):
    check_run(scene, first, second)
