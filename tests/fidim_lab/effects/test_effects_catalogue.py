"""The catalogue as data: ids, order, parameters, plausibility, equivalences, and the page in docs."""

import pickle
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from docs.tools.effects import page
from fidim_lab.effects.catalogue import by_id, catalogue
from fidim_lab.effects.equivalences import EQUIVALENCES
from fidim_lab.effects.geometry.cable_geometry import PulleyRadius
from fidim_lab.errors import SetupError

IDS = [  # spec/model.md §5, in its order
    "air-drag-linear",
    "air-drag-quadratic",
    "rotational-drag",
    "rotational-drag-quadratic",
    "swivel-friction",
    "swivel-damping",
    "swivel-inertia",
    "pulley-friction",
    "attachment-friction",
    "cable-elasticity",
    "winch-hold-compliance",
    "frame-compliance",
    "cable-creep",
    "cable-mass",
    "lay-torque",
    "cable-torsion",
    "anchor-offset",
    "attachment-offset",
    "pulley-radius",
    "cable-length-bias",
    "gravity-tilt",
    "marker-offset",
    "marker-stalk",
    "frame-misalignment",
    "capture-scale",
    "clock-rate",
    "time-offset",
    "periodic-force",
    "constant-force",
    "body-force",
    "umbilical",
    "loose-mass",
    "frame-sway",
    "hand-contact",
    "sensor-fault",
    "unknown",
]
DOCS = Path(__file__).parents[3] / "docs" / "effects.md"


def test_every_id_of_the_physics_page_is_there_in_its_order(irma4):
    assert list(dict.fromkeys(effect.id for effect in catalogue(irma4))) == IDS


def test_the_catalogue_is_the_same_every_time_and_says_each_thing_once(irma4):
    every = catalogue(irma4)
    assert every == catalogue(irma4)
    assert len({effect.label for effect in every}) == len(every) == 94
    assert pickle.loads(pickle.dumps(every)) == every


@pytest.mark.parametrize("id", ["swivel-friction", "anchor-offset", "cable-elasticity"])
def test_each_cable_has_its_own(irma4, id):
    assert {effect.cable for effect in by_id(irma4, id)} >= {1, 2, 3, 4}
    assert [effect.cable for effect in by_id(irma4, id, 3)] == [3]


def test_one_cable_is_not_named_twice(irma4):
    lone = replace(irma4, cables=irma4.cables[:1])
    assert [effect.cable for effect in by_id(lone, "swivel-damping")] == [None]
    assert [effect.cable for effect in by_id(lone, "anchor-offset")] == [1]


def test_what_is_not_there_is_said(irma4):
    with pytest.raises(SetupError, match="Known: air-drag-linear"):
        by_id(irma4, "air-drag")
    with pytest.raises(SetupError, match="none for cable 5 of a robot with 4"):
        by_id(irma4, "anchor-offset", 5)
    with pytest.raises(SetupError, match="air-drag-linear: there is none for cable 1"):
        by_id(irma4, "air-drag-linear", 1)


def test_parameters_are_in_order(effect):
    low, high = effect.bounds()
    assert (low < high).all()
    assert (low <= effect.start).all()
    assert (effect.start <= high).all()
    assert all(parameter.scale > 0 for parameter in effect.parameters)
    assert len({parameter.name for parameter in effect.parameters}) == len(effect.parameters)
    for point in effect.scan_points:
        assert ((low <= point) & (point <= high)).all()
        assert all(scanned or value == 0 for value, scanned in zip(point, effect.scanned, strict=True))
    assert effect.says
    assert effect.source


def test_the_context_makes_bounds_no_wider_and_leaves_room(effect, context):
    low, high = effect.bounds()
    closer_low, closer_high = effect.bounds(context)
    assert (closer_low >= low).all()
    assert (closer_high <= high).all()
    assert (closer_low <= effect.absent).all()
    for parameter, most in zip(effect.parameters, closer_high, strict=True):
        assert most > 2 * parameter.scale


def test_what_lies_within_the_bounds_is_plausible_and_what_lies_beyond_is_not(effect, context, middle):
    assert effect.plausible(middle(effect), context) is None
    low, high = effect.bounds(context)
    for k, parameter in enumerate(effect.parameters):
        for bound, beyond in ((low[k], -1e-9), (high[k], 1e-9)):
            values = middle(effect)
            values[k] = bound + beyond * (1 + abs(bound))
            said = effect.plausible(values, context)
            assert said is not None
            assert said.startswith(f"{effect.label}: {parameter.name} = ")


@pytest.mark.parametrize(
    ("id", "values", "says"),
    [
        (
            "pulley-friction",
            [0.0, 3.0],
            r"dry = 3 N m, but friction on a pulley of 30 mm under 55 N cannot exceed μ T r",
        ),
        ("pulley-friction", [20.0, 0.0], r"viscous = 20 N m s, but friction .* at 0\.15 rad/s: at most 6\.6 N m s"),
        ("swivel-damping", [11.0], r"c = 11 N m s, but friction .* at 0\.15 rad/s"),
        ("air-drag-linear", [111.0], r"c = 111 N s/m is outside 0…100"),
        ("air-drag-quadratic", [60.0], r"but ½ ρ C A of a platform"),
        ("swivel-friction", [-0.01], r"is outside 0…10 N m \(friction takes energy\)"),
        ("attachment-friction", [0.04, 0.14], None),
        ("rotational-drag", [0.2], None),
        ("cable-elasticity", [20e-6 / 1.5, 40.0], None),
        ("cable-elasticity", [9.9e-4, 40.0], r"no rope stretches by 5 % under 55 N"),
    ],
)
def test_the_lessons_of_the_real_robot(irma4, context, id, values, says):
    """spec/irma4u.md §3: what fits there, and what is impossible on pulleys of 30 mm under 55 N."""
    real = replace(context, mass=13.0, weight=127.0, tension=(55.0,) * 4, radii=(0.03,) * 4, swivel_rate=0.15)
    real = replace(real, wrap_rate=0.15, slip_rate=0.5)
    effect = by_id(irma4, id)[0]
    said = effect.plausible(np.array(values), real)
    if says is None:
        assert said is None
    else:
        assert re.search(says, said)


def test_a_radius_does_not_become_negative(context):
    low, _ = PulleyRadius().bounds(context)
    assert low == pytest.approx([-0.025])
    assert "negative radius" in PulleyRadius().plausible(np.array([-0.03]), context)


def test_equivalences_name_effects_of_the_catalogue():
    for known in EQUIVALENCES:
        assert set(known.ids) <= set(IDS)
        assert known.why
        assert known.separate


def test_the_page_in_docs_is_current():
    text = DOCS.read_text(encoding="utf-8")
    assert page(text) == text, "run: python -m docs.tools.effects docs/effects.md"


def test_the_worked_example_works():
    blocks = re.findall(r"```python\n(.*?)```", DOCS.read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) >= 4
    names: dict[str, object] = {"__name__": "worked_example"}
    for block in blocks:
        exec(block, names)  # the page's own code
