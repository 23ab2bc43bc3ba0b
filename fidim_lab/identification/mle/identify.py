"""From a campaign to an IdentificationResult by maximum likelihood: fit, predict held-out windows, judge.

The numbers of the equations of motion that spec/formats.md asks for too (σ_W, C, σ⊥) come from total least squares on
the side; where that cannot be had they stay unknown.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from fidim_lab.data.records import Campaign, Role, Window
from fidim_lab.errors import FidimError, RefusedError
from fidim_lab.identification.choice import soft_mode
from fidim_lab.identification.cleaning.knocked import moved_in
from fidim_lab.identification.equations import total_least_squares
from fidim_lab.identification.equations.estimate import Estimate
from fidim_lab.identification.equations.problem import Problem, build
from fidim_lab.identification.mle import findings, held_out
from fidim_lab.identification.mle.encoder_zeros import anchors_by_encoders
from fidim_lab.identification.mle.figures import figures_of
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.geometry import Surveyed, begin_surveyed, fit_surveyed
from fidim_lab.identification.mle.geometry_words import geometry_warnings, told_geometry
from fidim_lab.identification.mle.judge import Remainder
from fidim_lab.identification.mle.odd_windows.changed import changed
from fidim_lab.identification.mle.odd_windows.odd_window import (
    contradicts,
    costs_much,
    misses_much,
    odd_window,
    taken_in_again,
)
from fidim_lab.identification.mle.odd_windows.touched import (
    IN_VAIN,
    LEFT_OUT,
    TouchedEnd,
    beside_cuts,
    left_by_window,
    together,
    untouched,
)
from fidim_lab.identification.mle.soft import SoftFit, fit_soft
from fidim_lab.identification.mle.starts.contradiction import contradicting
from fidim_lab.identification.mle.trajectories.likelihood import Simulation
from fidim_lab.identification.mle.trajectories.recordings import FollowedSamples, prepare
from fidim_lab.identification.mle.undetermined import tried_out
from fidim_lab.identification.motion.recipe import BEST
from fidim_lab.identification.motion.trajectory import Prediction
from fidim_lab.identification.results import validation
from fidim_lab.identification.results.result import IdentificationResult, Residual, WindowVerdict
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.sampling import sampled

VARIANT = "trajectory"
"""how a window's motion was measured: as a simulated one that fits"""
CUTS = 3
"""sixths of a window that are tried to be left out at an end: half of it"""


@dataclass(frozen=True, eq=False)
class _Side:
    """What the equations of motion say of the same windows."""

    problem: Problem
    estimate: Estimate


def identify(campaign: Campaign, *, native: bool = False, predict: bool = True) -> IdentificationResult:
    """Identify the body from the `identify` windows by maximum likelihood, judge it on all windows.

    Where the cables hardly hold one direction (`choice.soft_mode`), with elastic cables (`soft`).

    native: with compiled C where there is a compiler: the same digits, some five times faster after a few seconds of
    building, once for each robot. predict: also judge the held-out windows.
    Raises RefusedError where no window can be used or simulated.
    """
    begin = perf_counter()
    soft = fit_soft(campaign, native=native) if soft_mode(campaign) is not None else None
    mechanism = Mechanism(campaign.robot, native=native)
    odd = contradicting(mechanism, campaign.windows) if soft is None else {}
    surveyed, touched = _fitted(mechanism, campaign, odd) if soft is None else (Surveyed(soft.found), soft.sentences)
    found = surveyed.found if soft is not None else tried_out(surveyed.found)
    surveyed = replace(surveyed, found=found)
    side = _side(replace(campaign, windows=tuple(w for w in campaign.windows if w.id not in odd)))
    predicted = odd | _held_out(campaign, found, soft, odd) if predict else {}
    windows = tuple(_verdict(window, found, predicted, side) for window in campaign.windows)
    figures = figures_of(found, campaign.robot.nominal)
    geometry = replace(told_geometry(surveyed), encoders=anchors_by_encoders([campaign]))
    outcome = findings.outcome(found, figures, windows)
    lacks = findings.cause(found, surveyed.exact)
    if not (lacks or outcome.answers or soft is not None):
        lacks = changed(mechanism, [window for window in campaign.windows if window.id not in odd])
    told = findings.FitAnswer(
        outcome,
        findings.answer(outcome, found, figures, lacks),
        windows,
        (
            *touched,
            *geometry_warnings(surveyed, geometry, answers=outcome.answers),
            *findings.warnings(found, figures, windows),
        ),
        noise_ratio=float(np.sqrt(found.excess)),
    )
    return replace(
        figures.result(campaign.name, campaign.robot, told, begin),
        sigma_W=side.estimate.sigma_W if isinstance(side, _Side) else None,
        C=side.estimate.C if isinstance(side, _Side) else None,
        geometry=None if soft is not None else geometry,
        cause=lacks,
    )


def _fitted(mechanism: Mechanism, campaign: Campaign, odd: dict[str, str]) -> tuple[Surveyed, tuple[str, ...]]:
    """On the windows that are not odd; what those are is in its `unused`, and one more that it finds so in `odd`.

    Also returns what is said of ends of windows that seem to be touched.
    """
    windows = [window for window in campaign.of_role(Role.IDENTIFY) if window.id not in odd]
    begun = begin_surveyed(mechanism, windows)
    begun, windows, said = _without_touched_ends(mechanism, begun, windows)
    surveyed: Surveyed | None = None
    if (name := odd_window(begun)) is not None:
        others = [window for window in windows if window.id != name]
        without = _explaining(mechanism, others)
        again = None if without is None or begun.explained else taken_in_again(begun, without)
        if again is not None:
            begun = again
        elif without is not None and costs_much(begun, without, name):
            # what is missed by little may be the geometry
            surveyed = None if begun.explained or misses_much(begun) else fit_surveyed(begun, windows)
            if surveyed is None or costs_much(surveyed.found, without, name):
                odd[name] = contradicts(name, begun, without) + moved_in(campaign, name)
                begun, windows, surveyed = without, others, None
    surveyed = surveyed or fit_surveyed(begun, windows)
    unused = surveyed.found.unused | {w.id: odd[w.id] for w in campaign.of_role(Role.IDENTIFY) if w.id in odd}
    return replace(surveyed, found=replace(surveyed.found, unused=unused)), said


def _explaining(mechanism: Mechanism, windows: list[Window]) -> Fit | None:
    """The first fit of these windows where it leaves noise alone, which a hasty one tells sooner."""
    return begin_surveyed(mechanism, windows) if begin_surveyed(mechanism, windows, hasty=True).explained else None


def _without_touched_ends(
    mechanism: Mechanism, begun: Fit, windows: list[Window]
) -> tuple[Fit, list[Window], tuple[str, ...]]:
    """The fit without what a hand still touched, if that leaves noise alone; else as it was. And what is said of it."""
    found, kept, cuts = begun, windows, list[TouchedEnd]()
    for _ in range(CUTS):
        shorter, cut = _shorter(kept, found)
        if all(new is old for new, old in zip(shorter, kept, strict=True)):
            break
        cuts += cut
        found, kept = begin_surveyed(mechanism, shorter, hasty=True), shorter
    if found.explained:
        found = begin_surveyed(mechanism, kept) if cuts else begun
        return found, kept, tuple(f"{one.says}{LEFT_OUT}" for one in together(cuts))
    return begun, windows, tuple(f"{one.says}{IN_VAIN}" for one in together(cuts))


def _shorter(windows: list[Window], found: Fit) -> tuple[list[Window], list[TouchedEnd]]:
    """Without the ends that stand out by much; where little is missed, without those beside a cut."""
    if not misses_much(found):
        return beside_cuts(windows, found)
    noise = found.noise_ratio * found.likelihood.noise
    return untouched(windows, left_by_window(found), noise)


def _held_out(
    campaign: Campaign, found: Fit, soft: SoftFit | None, odd: Mapping[str, str]
) -> dict[str, held_out.HeldOutPrediction | str]:
    """What each window that is not fitted and not odd says; a sentence where it cannot be predicted."""
    predicted: dict[str, held_out.HeldOutPrediction | str] = {}
    recordings: list[FollowedSamples] = []
    for window in (*campaign.of_role(Role.VALIDATE), *campaign.of_role(Role.TEST)):
        if window.id in odd:
            continue
        try:
            if soft is None:
                recordings.append(prepare(window, campaign.robot))
            else:
                predicted[window.id] = soft.predict(window)
        except RefusedError as refusal:
            predicted[window.id] = str(refusal)
    said = held_out.predict_all(found.likelihood.mechanism, found.values, recordings, campaign.robot.sensors)
    for recording, one in zip(recordings, said, strict=True):
        predicted[recording.window.id] = str(one) if isinstance(one, RefusedError) else one
    return predicted


def _side(campaign: Campaign) -> _Side | str:
    """Or why the equations say nothing."""
    try:
        problem = build(campaign, BEST)
        return _Side(problem, total_least_squares.estimate(problem))
    except FidimError as error:
        return str(error)


def _verdict(
    window: Window, found: Fit, predicted: dict[str, held_out.HeldOutPrediction | str], side: _Side | str
) -> WindowVerdict:
    ids = [recording.window.id for recording in found.likelihood.recordings]
    if window.id in ids:
        w = ids.index(window.id)
        left, simulation = found.remainders[w], found.journey.optimum.simulation
        return _judged(
            window, left, _predicted(found, simulation, w, left), findings.window_notes(found, w), found, side
        )
    held = predicted.get(window.id, found.unused.get(window.id))
    if held is None:
        return _unpredicted(window, found, side)
    if isinstance(held, str):
        return WindowVerdict(window.id, window.role, used=False, notes=(held,))
    left = held.remainder
    prediction = _predicted(found, held.journey.optimum.simulation, held.place, left)
    return _judged(window, left, prediction, findings.journey_notes(held.journey, held.place), found, side)


def _unpredicted(window: Window, found: Fit, side: _Side | str) -> WindowVerdict:
    """What the equations of motion alone say of a window."""
    epsilon, conditioning, why = _equations(window, found, side)
    sigma = None if epsilon is None else validation.sigma_perp(epsilon)
    samples = int(np.isfinite(window.markers).any(axis=(1, 2)).sum())
    return WindowVerdict(
        window.id,
        window.role,
        used=True,
        samples=samples,
        sigma_perp=sigma,
        conditioning=conditioning,
        residual=epsilon,
        no_sigma=why,
    )


def _predicted(found: Fit, simulation: Simulation, w: int, left: Remainder) -> Prediction:
    trajectories, place = simulation.trajectory_of(w)
    mechanism, since = found.likelihood.mechanism, left.t - left.t[0]
    motion = replace(sampled(mechanism, found.values, trajectories, place, since), t=left.t)
    return Prediction(left.rms, left.chi2_per_dof, left.residuals, left.t, left.predicted, motion)


def _judged(
    window: Window,
    left: Remainder,
    prediction: Prediction,
    notes: tuple[str, ...],
    found: Fit,
    side: _Side | str,
) -> WindowVerdict:
    epsilon, conditioning, why = _equations(window, found, side)
    return WindowVerdict(
        id=window.id,
        role=window.role,
        used=True,
        variant=VARIANT,
        samples=len(left.t),
        sigma_perp=None if epsilon is None else validation.sigma_perp(epsilon),
        rms_mm=left.rms * 1e3,
        chi2_per_dof=left.chi2_per_dof,
        conditioning=conditioning,
        notes=notes,
        residual=epsilon,
        prediction=prediction,
        no_sigma=why,
    )


def _equations(window: Window, found: Fit, side: _Side | str) -> tuple[Residual | None, float | None, str]:
    """ε = W χ of a window with the body found here, the conditioning of its coordinates; or why there are none."""
    if isinstance(side, str):
        return None, None, side
    for equations in side.problem.equations:
        if equations.window.id == window.id:
            epsilon = validation.residual(equations, found.body, side.estimate.weights)
            return epsilon, float(equations.measured.conditioning.max()), ""
    reasons = {unused.window.id: unused.reason for unused in side.problem.unused}
    return None, None, reasons.get(window.id, "the equations of motion were not asked")
