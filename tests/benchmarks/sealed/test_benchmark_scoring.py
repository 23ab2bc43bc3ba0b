"""Grades of explanations: a table, and the same answers as the judges' own script where it is at hand."""

import itertools
import runpy
from pathlib import Path

import pytest

from benchmarks.sealed.scoring import Marked, covers, grade, grade_surveyed, grade_without, named, sure

JUDGES = Path(__file__).parents[4] / "shared" / "tools" / "score.py"


def effect(id: str, cable: int | None = None, alike: tuple[str, ...] = ()) -> dict:
    return {"id": id, "cable": cable, "equivalent_to": list(alike), "single": False}


def said(verdict: str, *effects: dict) -> dict:
    return {"verdict": verdict, "effects": list(effects)}


DRAG, FRICTION = effect("air-drag-linear"), effect("swivel-friction")
CASES = [
    (said("nothing-missing"), [], None, Marked.RIGHT),
    (said("explained", DRAG), [], None, Marked.WRONG),
    (said("unknown-physics"), [], None, Marked.WRONG),
    (said("unknown-physics"), ["unknown"], None, Marked.RIGHT),
    (said("partly-explained", DRAG), ["unknown"], None, Marked.WRONG),
    (said("sensor-fault"), ["sensor-fault"], None, Marked.RIGHT),
    (said("nothing-missing"), ["sensor-fault"], None, Marked.WRONG),
    (said("explained", DRAG), ["air-drag-linear"], None, Marked.RIGHT),
    (said("explained", FRICTION, DRAG), ["air-drag-linear", "swivel-friction"], None, Marked.RIGHT),
    (said("explained", DRAG), ["air-drag-linear", "swivel-friction"], None, Marked.WRONG),
    (said("partly-explained", DRAG), ["air-drag-linear"], None, Marked.CLASS),
    (said("nothing-missing"), ["air-drag-linear"], None, Marked.WRONG),
    (said("explained", effect("anchor-offset", 2)), ["anchor-offset"], 2, Marked.RIGHT),
    (said("explained", effect("anchor-offset", 3)), ["anchor-offset"], 2, Marked.CLASS),
    (
        said("explained", effect("gravity-tilt", None, ("constant-force",))),
        ["constant-force"],
        None,
        Marked.CLASS,
    ),
    (
        said("explained", effect("a", None, ("b", "c", "d", "constant-force"))),
        ["constant-force"],
        None,
        Marked.WRONG,
    ),
    (said("explained", effect("a", None, ("b",)), effect("b", None, ("a",))), ["a", "a"], None, Marked.CLASS),
]


@pytest.mark.parametrize(("explanation", "label", "cable", "expected"), CASES)
def test_grade(explanation, label, cable, expected):
    assert grade(explanation, label, cable) is expected


@pytest.mark.parametrize(
    ("explanation", "expected"),
    [
        (said("unknown-physics"), Marked.RIGHT),
        (said("explained", {**FRICTION, "single": False}), Marked.CLASS),
        (said("partly-explained", {**FRICTION, "single": False}, {**DRAG, "single": True}), Marked.WRONG),
        (said("explained", {**FRICTION, "single": True}), Marked.WRONG),
        (said("nothing-missing"), Marked.WRONG),
        (None, Marked.WRONG),
    ],
)
def test_what_the_catalogue_lacks_must_not_get_a_sure_name(explanation, expected):
    assert grade_without(explanation) is expected


@pytest.mark.parametrize(
    ("hidden", "cable", "sd", "expected"),
    [
        ("anchor-offset", 2, 1e-4, Marked.CLASS),
        ("anchor-offset", 3, 1e-4, Marked.WRONG),  # of another cable
        ("anchor-offset", 2, 1e-3, Marked.WRONG),  # within what is not known
        ("attachment-offset", 2, 1e-4, Marked.CLASS),  # the geometry of that cable
        ("pulley-radius", None, 1e-4, Marked.CLASS),
        ("air-drag-linear", None, 1e-4, Marked.WRONG),
    ],
)
def test_a_place_that_is_told_off_counts_for_what_moved_it(hidden, cable, sd, expected):
    moved = {"what": "anchor", "cable": 2, "by": [1e-3, 0.0, 0.0], "sd": [sd, sd, sd]}
    explanation = {**said("nothing-missing"), "geometry": {"chi2_gain": 100.0, "moved": [moved]}}
    assert grade_without(explanation, hidden, cable) is expected


def test_no_answer_is_wrong_even_where_nothing_was_hidden():
    assert grade(None, [], None) is Marked.WRONG
    assert named(None) == "no answer"


def test_names_for_tables():
    assert named(said("explained", effect("anchor-offset", 2), DRAG)) == "anchor-offset[2] + air-drag-linear"
    assert named(said("partly-explained", DRAG)) == "air-drag-linear (partly-explained)"
    assert named(said("unknown-physics")) == "unknown-physics"


@pytest.mark.shared
def test_the_judges_script_says_the_same():
    if not JUDGES.exists():
        pytest.skip(f"{JUDGES} is not here")
    score = runpy.run_path(str(JUDGES))["score"]
    ids = ("a", "b", "unknown", "sensor-fault")
    verdicts = ("nothing-missing", "explained", "partly-explained", "unknown-physics", "sensor-fault")
    labels = [list(label) for k in (0, 1, 2) for label in itertools.product(ids, repeat=k)]
    answers = [
        [],
        [effect("a", 1)],
        [effect("b", None, ("a",))],
        [effect("b", 2, ("c", "d", "e", "a")), effect("a", 1)],
        [effect("a", None, ("b",)), effect("b", None, ("a",))],
    ]
    for label, cable, verdict, effects in itertools.product(labels, (None, 1, 2), verdicts, answers):
        explanation = said(verdict, *effects)
        theirs = score(explanation, {"case": {"label": label, "cable": cable}})
        assert grade(explanation, label, cable).value == theirs, (explanation, label, cable)


TORSION, ANCHOR = effect("cable-torsion"), effect("anchor-offset", 3)


@pytest.mark.parametrize(
    ("explanation", "label", "cable", "expected"),
    [
        (said("nothing-missing"), [], None, Marked.RIGHT),
        (said("explained", {**ANCHOR, "single": False}), [], None, Marked.CLASS),  # it is off
        (said("explained", {**ANCHOR, "single": True}), [], None, Marked.WRONG),  # but not alone
        (said("explained", {**DRAG, "single": False}), [], None, Marked.WRONG),
        (said("explained", DRAG, {**ANCHOR, "single": False}), ["air-drag-linear"], None, Marked.CLASS),
        (said("explained", DRAG, {**ANCHOR, "single": True}), ["air-drag-linear"], None, Marked.WRONG),
        (said("explained", DRAG), ["air-drag-linear", "anchor-offset"], 3, Marked.WRONG),
        (said("unknown-physics"), ["unknown"], None, Marked.RIGHT),
        (None, [], None, Marked.WRONG),
    ],
)
def test_where_the_robot_file_is_off_its_geometry_may_be_named_beside(explanation, label, cable, expected):
    assert grade_surveyed(explanation, label, cable) is expected


def test_a_single_name_for_what_was_not_hidden_is_sure():
    assert sure(said("explained", {**DRAG, "single": True}), ["umbilical"])
    assert not sure(said("explained", {**DRAG, "single": True}), ["air-drag-linear"])
    assert not sure(said("explained", {**DRAG, "single": False}), ["umbilical"])
    assert not sure(None, [])


def test_what_is_not_told_apart_covers_what_is_hidden():
    told = said("explained", {**DRAG, "equivalent_to": ["a", "b", "c"], "further_equivalent": ["umbilical"]})
    assert covers(told, ["umbilical"])
    assert not covers(told, ["loose-mass"])
    assert covers(said("nothing-missing"), ["umbilical"]) is None
