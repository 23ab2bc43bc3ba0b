"""The answer in four short parts: what each says, that it is short, and which windows its figure is of."""

from dataclasses import replace

import pytest

from fidim_lab.effects.equivalences import shared_by
from fidim_lab.identification.results.result import Geometry, Moved
from fidim_lab.mismatch.conclusion.answer import with_answer
from fidim_lab.mismatch.conclusion.explanation import (
    ClassMember,
    Explanation,
    NamedCause,
    Reading,
    ShortAnswer,
    Verdict,
)
from fidim_lab.mismatch.conclusion.parts import Before, EffectParameter, HeldOutFigures, LawTerm
from fidim_lab.mismatch.residuals.channels import Channel

DRY = {"c": EffectParameter(0.01, 2e-4, "N m")}
SWIVEL = NamedCause("swivel-friction", None, (), DRY, "says", single=True)
ROTATION = ClassMember("rotational-drag", None, 1.2, {"c": EffectParameter(0.03, None, "N m s")})
EITHER = replace(SWIVEL, equivalent_to=("rotational-drag",), members=(ROTATION,), single=False)
ANCHOR = NamedCause("anchor-offset", 2, (), {"dx": EffectParameter(0.03, float("nan"), "m")}, "says", single=True)


def explanation(verdict: Verdict, *effects: NamedCause, next_experiment: str | None = None) -> Explanation:
    return Explanation(
        "c", verdict, effects, (), Before(41.0, 1.02), Before(0.6, 0.1), (), {}, {}, next_experiment, "message", 1.0
    )


def answer(told: Explanation) -> ShortAnswer:
    found = with_answer(told).answer
    assert found is not None
    assert sum(len(said.split()) for _, said in found.parts) < 120
    assert max(len(said.split()) for _, said in found.parts) < 60
    return found


def test_a_single_name_is_certain_with_its_size() -> None:
    found = answer(explanation(Verdict.EXPLAINED, SWIVEL))
    assert found.verdict.startswith("Left out: swivel-friction. χ²/dof 41 → 1.02")
    assert found.certain == "swivel-friction: c = 0.01 ± 0.0002 N m."
    assert found.not_known.startswith("Nothing;")


def test_what_is_seen_of_a_cause_is_told_before_what_is_not() -> None:
    """A torque about y that ten standard deviations tell, after forces that none does."""
    values = {"fx": (0.016, 0.026, "N"), "fy": (-0.017, 0.025, "N"), "ty": (0.029, 0.003, "N m")}
    parameters = {name: EffectParameter(*value) for name, value in values.items()}
    body = NamedCause("body-force", None, (), parameters, "says", single=True)
    said = answer(explanation(Verdict.EXPLAINED, body)).certain
    assert said == "body-force: ty = 0.029 ± 0.003 N m, fx = 0.02 ± 0.03 N."


def test_of_sizes_without_spread_the_largest_are_told() -> None:
    """What stands for a fast clock: hardly a force to the side, and one along gravity."""
    forces = {"fx": (-0.008, "N"), "fy": (-0.007, "N"), "fz": (0.16, "N")}
    steady = {name: EffectParameter(value, None, unit) for name, (value, unit) in forces.items()}
    cause = replace(EITHER, members=(ClassMember("constant-force", None, 0.0, steady),))
    assert "constant-force: fz = 0.16 N, fx = -0.008 N" in answer(explanation(Verdict.EXPLAINED, cause)).not_known


def test_a_part_ends_with_how_many_are_left_out() -> None:
    """A body that changes, told at length, after an effect and before the geometry."""
    step = "The body changes between two windows, from window i02 on: " + "very " * 45 + "much."
    reading = Reading("body-step", None, (), {}, step, "Fasten whatever may have shifted.")
    moved = Geometry(10.0, (Moved("anchor", 1, (2e-3, -2e-3, 2e-3), (1e-4,) * 3),))
    told = answer(replace(explanation(Verdict.EXPLAINED, SWIVEL), readings=(reading,), geometry=moved))
    assert told.certain == "swivel-friction: c = 0.01 ± 0.0002 N m. 2 more in the tables."
    alone = answer(replace(explanation(Verdict.EXPLAINED), readings=(reading,)))
    assert alone.certain == step, "the first is told, however long"


def test_a_channel_that_shows_more_than_the_markers_is_told() -> None:
    noise = Channel("lengths", white=True, p=0.4, trend_over_windows=0.3)
    creeping = replace(noise, white=False, p=1e-9)
    null = explanation(Verdict.NOTHING_MISSING)
    assert answer(replace(null, channels=(noise,))).not_known == "No effect was named."
    assert "although the winches are held" in answer(replace(null, channels=(creeping,))).not_known
    assert "winches" not in answer(replace(explanation(Verdict.UNKNOWN_PHYSICS), channels=(creeping,))).not_known


def test_models_that_hold_95_percent_of_the_weight() -> None:
    told = explanation(Verdict.EXPLAINED, EITHER, ANCHOR)
    models, weights = zip(*told.weights, strict=True)
    assert models == (
        (("swivel-friction", None), ("anchor-offset", 2)),
        (("rotational-drag", None), ("anchor-offset", 2)),
    )
    assert weights == pytest.approx((0.7685, 0.2315), abs=1e-4)
    assert explanation(Verdict.NOTHING_MISSING).weights == [((), 1.0)]
    assert explanation(Verdict.UNKNOWN_PHYSICS).weights == []


def test_a_law_without_a_name_is_certain_with_its_sizes() -> None:
    values = {"c": EffectParameter(0.0866, 0.004, "N at 1 m/s"), "p": EffectParameter(0.529, 0.02, "1")}
    law = (LawTerm("a drag flatter than air's", "says", values),)
    found = answer(replace(explanation(Verdict.UNKNOWN_PHYSICS), law=law))
    assert found.certain == "It acts like a drag flatter than air's: c = 0.087 ± 0.004 N at 1 m/s, p = 0.53 ± 0.02."


def test_a_class_is_told_by_what_its_members_share_each_with_its_size() -> None:
    found = answer(explanation(Verdict.EXPLAINED, EITHER))
    assert found.verdict.startswith("Left out: dissipation of rotation.")
    assert found.certain == "Dissipation of rotation, whatever its place."
    size = "swivel-friction: c = 0.01 ± 0.0002 N m or rotational-drag: c = 0.03 N m s"
    assert found.not_known == f"Whether it is {size} (77 % for the first)."
    assert "design --after" in found.next


def test_a_steady_force_is_never_certain_for_gravity_may_be_tilted() -> None:
    """As on the paper's takes with two cables: no rival was left, and the force was told as a fact."""
    steady = NamedCause("constant-force", None, (), {"fx": EffectParameter(0.11, 0.02, "N")}, "says")
    found = answer(explanation(Verdict.PARTLY_EXPLAINED, steady))
    assert "constant-force or a similar effect" in found.verdict
    assert found.certain == "Nothing beyond the verdict."
    assert found.not_known == "Whether it is constant-force: fx = 0.11 ± 0.02 N or gravity-tilt or clock-rate."


def test_what_is_told_holds_95_percent_of_the_weight() -> None:
    near, far = replace(ROTATION, loss=0.0), replace(ROTATION, id="swivel-damping", loss=4.0)
    cause = replace(EITHER, members=(near, far))
    assert cause.weights == pytest.approx((0.4955, 0.4955, 0.0091), abs=1e-4)
    assert cause.likely == (near,)
    assert "swivel-damping" not in answer(explanation(Verdict.EXPLAINED, cause)).not_known


def test_what_is_held_has_no_spread() -> None:
    assert answer(explanation(Verdict.EXPLAINED, ANCHOR)).certain == "anchor-offset (cable 2): dx = 0.03 m."


@pytest.mark.parametrize(
    ("figures", "which"),
    [
        ((), "χ²/dof 41 → 1.02, 0.1 mm (held-out windows, which were also used to choose the model)."),
        (("left_out",), "χ²/dof 30 → 1.1, 0.2 mm (each window predicted from the others)."),
        (("test",), "χ²/dof 30 → 1.1, 0.2 mm (test windows, used only here)."),
    ],
)
def test_the_figure_says_of_which_windows_it_is(figures: tuple[str, ...], which: str) -> None:
    found = HeldOutFigures(Before(30.0, 1.1), Before(0.5, 0.2))
    told = replace(explanation(Verdict.EXPLAINED, SWIVEL), **dict.fromkeys(figures, found))
    assert answer(told).verdict.endswith(which)


def test_geometry_within_its_survey_is_no_cause() -> None:
    geometry = Geometry(10.0, (Moved("anchor", 1, (1e-3, -1e-3, 1e-3), (1e-4,) * 3),))
    found = answer(replace(explanation(Verdict.NOTHING_MISSING), geometry=geometry))
    assert "anchors in the robot file are wrong by 1 mm" in found.certain
    assert found.not_known == "No effect was named."
    assert "[survey]" in found.next


def test_a_stated_survey_is_not_asked_for_again() -> None:
    within = Geometry(10.0, (Moved("anchor", 1, (1e-4, 1e-4, 1e-4), (1e-4,) * 3),), stated=True)
    told = explanation(Verdict.NOTHING_MISSING)
    assert answer(replace(told, geometry=within)).next == "Nothing more is needed."
    beyond = replace(within, moved=(Moved("anchor", 1, (9e-3, 1e-4, 1e-4), (1e-4,) * 3),))
    assert answer(replace(told, geometry=beyond)).next.startswith("Measure again what is clearly wrong")


@pytest.mark.parametrize("verdict", list(Verdict))
def test_every_verdict_is_short(verdict: Verdict) -> None:
    many = [replace(EITHER, members=(ROTATION,) * 5), *(replace(ANCHOR, cable=k) for k in range(1, 5))]
    named = verdict in (Verdict.EXPLAINED, Verdict.PARTLY_EXPLAINED)
    answer(explanation(verdict, *(many if named else ()), next_experiment="Repeat one window at half the size."))


@pytest.mark.parametrize(
    ("ids", "said"),
    [
        (("swivel-friction", "attachment-friction"), "dissipation of rotation"),
        (("swivel-friction", "air-drag-linear"), "dissipation"),
        (("anchor-offset", "cable-length-bias"), "geometry of the robot file"),
        (("anchor-offset", "periodic-force"), None),
    ],
)
def test_what_effects_have_in_common(ids: tuple[str, ...], said: str | None) -> None:
    assert shared_by(ids) == said


def test_the_file_has_parts_members_and_test_as_values() -> None:
    table = with_answer(explanation(Verdict.EXPLAINED, EITHER)).table
    assert table["effects"][0]["members"][0]["parameters"]["c"]["value"] == 0.03
    assert table["effects"][0]["single"] is False
    assert {"certain", "not_told_apart", "next", "test", "geometry"} <= table.keys()
