"""Recordings that are not as one thinks of them: a marker never seen, windows of other lengths and other clocks."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fidim_lab.data.records import Campaign, Robot, Role, Window
from fidim_lab.identification.cleaning.free_motion import PART
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.mismatch.cleaning import residual_checks
from fidim_lab.mismatch.cleaning.contacts import Contact, at_the_same_time, deforms
from fidim_lab.mismatch.cleaning.restarts import parts_of
from fidim_lab.mismatch.cleaning.segments import Segmented, fit_segments
from fidim_lab.mismatch.conclusion.explanation import Explanation, Verdict
from fidim_lab.mismatch.conclusion.message import body_parameters, figures_of
from fidim_lab.mismatch.conclusion.parts import Before
from fidim_lab.mismatch.conclusion.unnamed import with_unknown
from fidim_lab.mismatch.conclusion.verdict import Judged
from fidim_lab.mismatch.explain import explain
from fidim_lab.mismatch.fitting.baseline import Baseline
from fidim_lab.mismatch.fitting.holdout import HeldOut
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.selection.candidates import Candidate
from fidim_lab.mismatch.unknown_force.family import Dependence
from fidim_lab.mismatch.unknown_force.unknown import Term, UnknownForce
from fidim_lab.model.mechanism import Mechanism
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign

DOF = 21_000
"""of the fits that `fit_with` makes"""


@pytest.fixture(scope="module")
def dragged(irma4: Robot) -> Campaign:
    """Two markers, a drag."""
    robot = replace(irma4, extra_markers=(np.array([0.1, 0.05, 0.0]),))
    plan = random_plan(robot, "short", 3, 1, 3)
    world = make_world(robot, np.random.default_rng(3), (parse_effect("air-drag-linear:c=0.5", robot.n),))
    return simulate_campaign(robot, plan, world, np.random.default_rng(4), recording=Sampling(4.0))[0]


def unseen(campaign: Campaign, marker: int, places: range) -> Campaign:
    windows = list(campaign.windows)
    for k in places:
        markers = windows[k].markers.copy()
        markers[:, marker] = np.nan
        windows[k] = replace(windows[k], markers=markers)
    return replace(campaign, windows=tuple(windows))


@pytest.mark.parametrize("places", [range(1, 2), range(4)], ids=["in one window", "anywhere"])
@pytest.mark.sampled(1)
def test_a_marker_that_is_never_seen_does_not_end_an_explanation(dragged: Campaign, places: range) -> None:
    found = explain(unseen(dragged, 1, places))
    assert found.verdict is Verdict.EXPLAINED
    assert [cause.id for cause in found.effects] == ["air-drag-linear"]


def test_segments_need_one_marker_and_not_all(dragged: Campaign) -> None:
    campaign = unseen(dragged, 0, range(4))
    found = fit_segments(Mechanism(campaign.robot, native=True), campaign.windows)
    assert all(np.isfinite(one.chi2_per_dof).all() for one in found.windows)


def test_parts_of_a_window_are_on_its_own_clock(baseline_of: Callable[..., Baseline]) -> None:
    baseline = baseline_of(seed=4, windows=2, seconds=3.0)
    model = baseline.as_it_is
    plain = parts_of(model, (), {"i01"})["i01"].t
    likelihood = model.fit.likelihood
    recordings = [replace(one, window=replace(one.window, t=one.window.t + 100.0)) for one in likelihood.recordings]
    later = replace(model.fit, likelihood=replace(likelihood, recordings=tuple(recordings)))
    found = parts_of(Completed((), later, whole=True), (), {"i01"})["i01"].t
    np.testing.assert_allclose(found, plain + 100.0)


def segmented(name: str, chi2: list[float], begin: float = 0.0) -> Segmented:
    edges = begin + 2.0 * np.arange(len(chi2) + 1)
    window = Window(name, Role.IDENTIFY, edges, np.zeros((len(edges), 1, 3)), None, None)
    return Segmented(window, edges, np.array(chi2), np.full(len(chi2), 600.0))


def test_a_longer_window_does_not_hide_a_push_of_all_others() -> None:
    pushed = [segmented(f"i{k:02d}", [1.0, 1.0, 1.6, 1.0, 1.0], begin=k) for k in range(8)]
    longer = segmented("i09", [1.0, 1.0, 1.6, 1.0, 1.0, 1.0])
    found = at_the_same_time([*pushed, longer])
    assert [one.window for one in found] == [one.window.id for one in pushed]
    assert {one.begin - k for k, one in enumerate(found)} == {4.0}
    assert at_the_same_time([*pushed[:3], longer]) == ()


def test_a_hand_with_a_weak_shoulder_is_cut_where_the_kinematics_are_contradicted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    part = f"i01{PART}2"
    wide, narrow = Contact(part, 7.75, 12.25, 60.0, 0.25), Contact(part, 9.75, 12.25, 60.0, 0.25)
    other = Contact(part, 2.0, 3.0, 2.0, 0.25)
    monkeypatch.setattr(residual_checks, "find_contacts", lambda segments, strict: (narrow,))
    monkeypatch.setattr(residual_checks, "stumble", lambda *_: None)
    monkeypatch.setattr(residual_checks, "_gone", lambda *_: None)
    t = np.arange(0.0, 20.0, 0.01)
    window = Window(part, Role.IDENTIFY, t, np.zeros((len(t), 1, 3)), None, None)
    robot = SimpleNamespace(markers=np.zeros((1, 3)))
    campaign = Campaign("c", robot, 100.0, (window,))  # type: ignore[arg-type]
    cleaned = residual_checks.Cleaned(campaign, SimpleNamespace(contradicts_kinematics=True))  # type: ignore[arg-type]
    segments = SimpleNamespace(windows=(SimpleNamespace(window=window),), fit=None)
    after = residual_checks._cut(cleaned, segments, (other, wide), lambda _: None)  # type: ignore[arg-type]
    assert [(one.window, one.begin) for one in after.contacts] == [("i01", 7.75)]
    assert len(after.campaign.windows) == 2


def test_standard_deviations_grow_with_noise_that_was_not_declared(
    quiet: Baseline, fit_with: Callable[..., Fit]
) -> None:
    declared = fit_with(np.zeros(0), DOF - 9.0)
    noise = 3 * quiet.fit.likelihood.noise
    left = tuple(replace(one, chi2=9 * one.chi2, noise=noise) for one in declared.remainders)
    found = replace(declared, remainders=left)
    assert (found.chi2_per_dof, found.excess) == pytest.approx((9.0, 1.0))
    told = body_parameters(found, quiet.campaign)
    np.testing.assert_allclose([one.sd for one in told.values()], 3 * declared.sd)


def test_without_held_out_windows_no_wrench_without_a_name_is_judged(
    quiet: Baseline, claim: Callable[..., Candidate]
) -> None:
    nothing = HeldOut(0.0, 0, float("nan"), {})
    term = Term("one", Dependence.SPEED, None, 3.0, (), (), True)
    wrench = UnknownForce((term,), 0.9, nothing, nothing, (), None, (), (), quiet.fit, 1.0)
    chi2, rms = Before(10.0, None), Before(1.0, None)
    told = Explanation("c", Verdict.UNKNOWN_PHYSICS, (), (), chi2, rms, (), {}, {}, None, "Something is missing.", 1.0)
    judged = Judged(Verdict.UNKNOWN_PHYSICS, claim(), wrench)
    said, _ = with_unknown(told, judged, quiet.campaign, lambda _: None)
    assert "cannot be judged" in said.message
    assert said.unknown is None


def test_what_is_told_without_held_out_windows_is_of_the_fitted_ones(claim: Callable[..., Candidate]) -> None:
    def one(chi2: float, dof: int) -> Candidate:
        seen = HeldOut(chi2 * dof, dof, 1e-3 if dof else float("nan"), {})
        return replace(claim(fitted=chi2), held_out=seen)

    before, after = one(19.8, 0), one(1.0, 0)
    assert figures_of(before, after) == (
        "χ²/dof of the fitted windows 19.8 → 1, without held-out windows to confirm it"
    )
    assert figures_of(before, before).startswith("χ²/dof of the fitted windows 19.8, without held-out")
    assert before.held_out.says == "no window held out to judge it"
    held = one(19.8, 100), one(1.0, 100)
    assert figures_of(*held) == "held-out χ²/dof 19.8 → 1, rms 1 → 1 mm"
    assert figures_of(held[1], held[1]) == "held-out χ²/dof 1, rms 1 mm"


@pytest.mark.parametrize(("during", "bent"), [(3e-3, True), (0.0, False)])
def test_a_marker_that_is_seen_for_a_while_and_elsewhere_is_no_hand(during: float, bent: bool) -> None:
    """As where cameras see one marker from one side alone: the others fit as well then as before and after."""
    rng, t = np.random.default_rng(3), np.arange(500) / 50
    places = rng.normal(scale=0.2, size=(4, 3))
    markers = places + np.sin(t)[:, np.newaxis, np.newaxis] + rng.normal(scale=5e-4, size=(500, 4, 3))
    inside = (t >= 3.0) & (t <= 7.0)
    markers[:, 1] = np.where(inside[:, np.newaxis], markers[:, 1] + during * np.array([0.6, 0.0, 0.8]), np.nan)
    window = Window("i01", Role.IDENTIFY, t, markers, None, None)
    assert deforms(window, places, Contact("i01", 3.0, 7.0, 4.0, 0.1)) is bent
    assert not deforms(replace(window, markers=markers[:, :1]), places[:1], Contact("i01", 3.0, 7.0, 4.0, 0.1))
