"""Lengths and markers held against each other: exchanged drives, wrong drums, slipped cables, markers that moved."""

import asyncio
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fidim_lab.api import Robot
from fidim_lab.app import cli
from fidim_lab.data.records import Body
from procedures.handlers.placing import PERIODS
from procedures.outcomes import Outcome
from procedures.recording.journal import read_journal


def drum(*cables: int, **changes: Callable[[Any], Any]) -> Callable[[Any], None]:
    """A drive's counts mean something else than the rig file says; the load's sign at the motor stays."""

    def change(stage: Any) -> None:
        laboratory = stage.rig.laboratory
        old, new = laboratory.drums, list(laboratory.drums)
        for cable in cables:
            new[cable - 1] = replace(old[cable - 1], **{key: make(old[cable - 1]) for key, make in changes.items()})
        laboratory.drums = tuple(new)

        def read() -> None:
            currents = laboratory._currents.read(laboratory.plant.tensions)
            for one, shaft, current in zip(old, laboratory.shafts, currents, strict=True):
                shaft.set_load(-one.direction * float(current))

        laboratory._read_currents = read

    return change


def exchanged(first: int, second: int) -> Callable[[Any], None]:
    def change(stage: Any) -> None:
        shafts = list(stage.rig.laboratory.shafts)
        shafts[first - 1], shafts[second - 1] = shafts[second - 1], shafts[first - 1]
        stage.rig.laboratory.shafts = tuple(shafts)

    return change


def slipped(cable: int, by: float) -> Callable[[Any], None]:
    def change(stage: Any) -> None:
        drums = list(stage.rig.laboratory.drums)
        drums[cable - 1] = replace(drums[cable - 1], home_length=drums[cable - 1].home_length + by)
        stage.rig.laboratory.drums = tuple(drums)

    return change


def tensions(rehearsal: Any) -> list[np.ndarray]:
    """The true ones, from the first step on."""
    seen: list[np.ndarray] = []

    def begin(stage: Any) -> None:
        async def sample() -> None:
            while True:
                stage.rig.laboratory.refresh(stage.now())
                seen.append(np.array(stage.rig.laboratory.plant.tensions))
                await stage.rig.rig.clock.sleep(0.01)

        stage.tasks.append(asyncio.ensure_future(sample()))

    rehearsal.at("TryWinches", begin)
    return seen


BEFORE = {
    "polarity": (drum(2, direction=lambda d: -d.direction), "winch 2: it turns against its encoder"),
    "gear of one": (drum(2, metres_per_count=lambda d: 2 * d.metres_per_count), "winch 2: it moves 2 times as far"),
    "half a gear": (drum(3, metres_per_count=lambda d: 0.3 * d.metres_per_count), "winch 3: it moves 0.3"),
    "drums of all": (
        drum(1, 2, 3, 4, metres_per_count=lambda d: 1.1 * d.metres_per_count),
        "are the sizes of drums or gears",
    ),
    "two drives": (exchanged(1, 3), "winch 1: it moves cable 3"),
    "two drives that turn otherwise": (exchanged(2, 3), "The tension guard"),
    "a cable": (slipped(2, 0.045), ""),
    "marker": (lambda stage: stage.mocap.add("jumps", 1e3, (0.0, 0.3, 0.0)), "origin of motion capture, is off by"),
}


@pytest.mark.parametrize("kind", BEFORE)
@pytest.mark.sampled(2)
def test_what_is_wrong_is_found_before_anything_moves_farther(rehearsal: Any, kind: str) -> None:
    fault, says = BEFORE[kind]
    rehearsal.at("", fault)
    true = tensions(rehearsal)
    ended = rehearsal.run()
    report = ended.check()
    assert report.outcome in (Outcome.FAIL, Outcome.ERROR)
    assert says in report.reason
    assert "MoveTo" not in ended.begun
    low, high = rehearsal.robot.limits.tension
    assert low <= np.min(true) or kind == "a cable", "but for the one that is slack by the fault itself"
    assert np.max(true) <= high


AFTER = {
    "a cable slips": (slipped(2, 0.03), "cable 2 is 2"),
    "another marker": (lambda stage: stage.mocap.add("jumps", 1e3, (1.5, 0.3, 0.7)), "origin of motion capture"),
    "origin": (lambda stage: stage.mocap.add("jumps", 1e3, (0.0, 0.04, 0.0)), "off by (-1 +41 -0) mm"),
}


WITHIN = {
    "cable 2 slips": slipped(2, 0.03),
    "origin": AFTER["origin"][0],
    "another marker": AFTER["another marker"][0],
    **{f"cable {cable} slips": slipped(cable, 0.03) for cable in (1, 3, 4)},
    "origin, sideways and down": lambda stage: stage.mocap.add("jumps", 1e3, (-0.01, 0.012, -0.02)),
}


def found_at_once(ended: Any) -> bool:
    """Whether markers have contradicted the encoders (a jump: for a second) before a place or a window was judged."""
    if ended.trip is None:
        return False
    report = ended.check(held=False)
    assert ended.trip.guard == "geometry"
    assert "so a drum may turn unseen; or markers or motion capture's origin moved" in report.reason
    return True


@pytest.mark.parametrize("kind", WITHIN)
@pytest.mark.parametrize("after", [0.5, 3.0])
@pytest.mark.sampled(2)
def test_what_moves_while_a_person_is_at_the_platform_is_found_in_that_window(
    rehearsal: Any, scene: Any, kind: str, after: float
) -> None:
    rehearsal.plan = scene.two
    rehearsal.at("Ask", WITHIN[kind], after=after)
    ended = rehearsal.run()
    if not found_at_once(ended):
        report = ended.check()
        assert "slips" not in kind
        assert report.outcome is Outcome.FAIL
        assert "Window i01: " in report.reason
        assert "since the platform was at rest, a cable slipped on its drum, or the marker" in report.reason
    assert not ended.report.accepted
    assert len(ended.begun.get("Record", ())) <= 1, "nobody is asked to displace a platform whose cable slipped"


@pytest.mark.parametrize("kind", AFTER)
@pytest.mark.sampled(1)
def test_what_goes_wrong_later_is_found_at_the_next_place(rehearsal: Any, scene: Any, kind: str) -> None:
    fault, says = AFTER[kind]
    rehearsal.plan = scene.two
    rehearsal.at("Accept", fault)
    true = tensions(rehearsal)
    ended = rehearsal.run()
    if not found_at_once(ended):
        report = ended.check()
        assert report.outcome is Outcome.FAIL
        assert says in report.reason
        assert ended.begun["Record"][-1] < ended.begun["ComparePlace"][-1]
    assert len(ended.begun["MoveTo"]) <= 2
    low, high = rehearsal.robot.limits.tension
    assert low <= np.min(true[-1]) <= np.max(true[-1]) <= high, "held where it was found"
    slips = kind == "a cable slips"  # the jump of a cable throws the platform about, whatever anybody does
    assert slips or np.min(true) >= 0.5 * low
    assert np.max(true) <= high or slips


def test_a_robot_as_its_file_says_is_tried_and_goes_on(rehearsal: Any) -> None:
    rehearsal.at("TryWinches", lambda stage: None)
    rehearsal.periods = PERIODS
    true = tensions(rehearsal)
    ended = rehearsal.run()
    report = ended.check()
    assert report.exit_code == 0
    (tried,) = [e for e in ended.journal if e.step == "TryWinches" and "measurements" in e.data]
    assert tried.outcome is Outcome.PASS
    low, high = rehearsal.robot.limits.tension
    assert low <= np.min(true)
    assert np.max(true) <= high


def slow(robot: Any) -> Any:
    """A platform of 45 kg below a hall's frame of 6 m by 3 m: it swings at 0.65 Hz."""
    cables = []
    for cable, (right, far) in zip(robot.cables, ((1, 1), (-1, 1), (-1, -1), (1, -1)), strict=True):
        x = np.array([-2.0 * right, -far, 0.0]) / np.sqrt(5.0)
        d, a = np.array([4.0 + 3.0 * right, 2.0 + 1.5 * far, 3.2]), np.array([0.75 * right, 0.3 * far, 0.15])
        z = np.array([0.0, 0.0, 1.0])
        cables.append(replace(cable, d=d, a=a, radius=0.05, x=x, y=np.cross(z, x), z=z))
    body = Body(np.array([0.0, 0.0, -0.1]), np.array([0.0475, 0.205, 0.2175, 0.0, 0.0, 0.0]))
    limits = replace(robot.limits, tension=(20.0, 800.0))
    marker = np.array([0.3, 0.1, -0.25])
    return replace(robot, cables=tuple(cables), nominal=body, mass=45.0, marker=marker, limits=limits)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 3])
def test_no_answer_of_a_winch_is_its_own_swing(scene: Any, tmp_path: Path, seed: int) -> None:
    """With looks of 1.5 s the errors were up to 0.65 of the answer, and half of these robots were refused."""
    Robot(**vars(slow(scene.robot))).write(tmp_path / "robot.toml")
    line = (
        f"dry-run --robot {tmp_path / 'robot.toml'} --seed {seed} --equilibria 1 --validate 0 --out {tmp_path / 'run'}"
    )
    cli.run(line.split())
    tried = [one for one in read_journal(tmp_path / "run" / "journal.jsonl") if one.step == "TryWinches"]
    assert tried[-1].outcome is Outcome.PASS
