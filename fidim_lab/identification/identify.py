"""From a campaign to a judged result: the function that combines all parts of this package."""

from collections import defaultdict
from dataclasses import replace
from time import perf_counter

import numpy as np

from fidim_lab.data.records import PARAMETER_NAMES, Campaign, Role
from fidim_lab.errors import SetupError
from fidim_lab.identification.cleaning.clean import clean_recordings
from fidim_lab.identification.cleaning.free_motion import were_used, window_count
from fidim_lab.identification.cleaning.low_pass import low_passed
from fidim_lab.identification.equations import consistency, tls
from fidim_lab.identification.equations.estimate import Estimate
from fidim_lab.identification.equations.estimators import ESTIMATORS, Method
from fidim_lab.identification.equations.problem import Problem, build
from fidim_lab.identification.equations.refusals import bare
from fidim_lab.identification.equations.slackness import slack_notes
from fidim_lab.identification.equations.uncertainty import jackknife_sd
from fidim_lab.identification.input_check import check
from fidim_lab.identification.markers.thresholds import MARKERS
from fidim_lab.identification.mle import identify as mle
from fidim_lab.identification.mle.by_rates import identify_by_rates, shown_by_rates
from fidim_lab.identification.mle.periods.by_periods import identify_by_periods
from fidim_lab.identification.motion.recipe import BEST, Recipe
from fidim_lab.identification.results.result import (
    IdentificationResult,
    InertialParameter,
    ResultOutcome,
    ShortAnswer,
    WindowVerdict,
)
from fidim_lab.identification.results.validation import THOROUGH, Checks, expected_sigma_perp, verdicts
from fidim_lab.identification.two_clocks import by_both, two_clocks

MODEL_ERROR = 1.5
"""an rms of the equations so many times what noise explains is a model error"""
SPREAD_SEEN = 5.0
"""spread between windows over nominal sd beyond which the model lacks something …"""
ENOUGH_WINDOWS = 8
"""… with so many windows: with fewer, leaving one out can unbalance the excitation, and a spread says nothing of it"""
UNFILTERED = "Export the markers as the cameras saw them: no filter, no smoothing, the cameras' own rate."
"""what to do where they were not"""
OPTIMISM = 3.0
"""a spread so many times the nominal sd is worth a warning"""


def identify(
    campaign: Campaign,
    method: Method = Method.TLS,
    recipe: Recipe = BEST,
    checks: Checks = THOROUGH,
    *,
    native: bool = False,
) -> IdentificationResult:
    """Identify the body from the `identify` windows, judge it on all windows.

    recipe: of the methods that work on equations; native: simulate with compiled C, see `mle`.
    Raises RefusedError when no window can be used or the windows do not identify a body, SetupError when what was asked
    for does not fit the campaign.
    """
    rates = not campaign.periods and shown_by_rates(campaign)
    if (rates or campaign.periods) and method is not Method.MLE:
        shown = "a gyroscope shows none" if rates else "periods show none"
        raise SetupError(
            f"--method {method} needs the pose of every sample, and {shown}.",
            hint="Leave --method out: maximum likelihood fits what was recorded as it is.",
        )
    if campaign.periods:
        return identify_by_periods(campaign)
    if rates:
        return identify_by_rates(campaign, native=native, predict=checks.predict)
    notes = check(campaign)
    recordings = clean_recordings(campaign).recordings
    clocks = two_clocks(campaign)

    def by_method(cleaned: Campaign) -> IdentificationResult:
        if method is Method.MLE:
            return mle.identify(cleaned, native=native, predict=checks.predict)
        return _by_equations(cleaned, method, recipe, checks, native=native)

    cleaned = recordings.campaign
    result = by_method(cleaned) if clocks is None else by_both(cleaned, clocks, by_method)
    notes = (*notes, *recordings.notes)
    filtered = None if _leaves_nothing(result) else low_passed(recordings.campaign)
    if filtered is not None and not result.outcome.answers:  # what it leaves unexplained is the filter's
        answer = replace(result.answer, verdict=f"{filtered.says} {result.answer.verdict}", next=UNFILTERED)
        result = replace(result, answer=answer, warnings=())  # what is missed, and how, follows from the filter
    elif filtered is not None:
        notes = (*notes, filtered.says)
    return replace(result, removed=recordings.removed, warnings=(*notes, *result.warnings))


def _leaves_nothing(result: IdentificationResult) -> bool:
    """Whether the motion that no filter has touched is followed more closely than any noise is judged by."""
    left = [window.chi2_per_dof for window in result.windows if window.used and window.chi2_per_dof is not None]
    return bool(left) and max(left) < MARKERS.finest**2


def _by_equations(
    campaign: Campaign, method: Method, recipe: Recipe, checks: Checks, *, native: bool
) -> IdentificationResult:
    begin = perf_counter()
    problem = build(campaign, recipe, native=native)
    estimate = ESTIMATORS[method](problem)
    windows = verdicts(problem, estimate, checks)
    parameters = _parameters(problem, estimate)
    outcome = _outcome(estimate)
    return IdentificationResult(
        campaign=campaign.name,
        method=method,
        outcome=outcome,
        answer=_answer(outcome, estimate, windows),
        parameters=parameters,
        non_essential=estimate.non_essential,
        sigma_W=estimate.sigma_W,
        C=estimate.C,
        windows=windows,
        warnings=_warnings(problem, estimate, windows),
        seconds=perf_counter() - begin,
        noise_ratio=estimate.noise_ratio,
        covariance=estimate.covariance,
        leave_one_out=estimate.leave_one_out,
        alone={a.window: a.values for a in estimate.alone},
        attachment_plane=campaign.robot.attachment_plane,
        freedoms=campaign.robot.freedoms,
        scaling_effect=estimate.scaling_effect,
    )


def _parameters(problem: Problem, estimate: Estimate) -> dict[str, InertialParameter]:
    nominal = problem.campaign.robot.nominal.vector
    jackknife = None if estimate.leave_one_out is None else jackknife_sd(estimate.leave_one_out)
    return {
        name: InertialParameter(
            value=float(estimate.values[k]),
            sd=float(estimate.sd[k]),
            sd_bootstrap=_entry(estimate.sd_bootstrap, k),
            sd_jackknife=_entry(jackknife, k),
            nominal=float(nominal[k]),
            without_non_essential=_entry(estimate.reduced, k),
        )
        for k, name in enumerate(PARAMETER_NAMES)
    }


def _entry(values: np.ndarray | None, k: int) -> float | None:
    return None if values is None else float(values[k])


def _outcome(estimate: Estimate) -> ResultOutcome:
    if not consistency.can_move(estimate.body):
        return ResultOutcome.IMPOSSIBLE_BODY
    if _lacks_something(estimate):
        return ResultOutcome.MISFIT
    return ResultOutcome.DOUBTFUL if _doubtful(estimate) else ResultOutcome.CONVERGED


def _lacks_something(estimate: Estimate) -> bool:
    """Whether equations or windows contradict each other by far more than noise makes them."""
    if (estimate.noise_ratio or 0.0) > MODEL_ERROR:
        return True
    if estimate.leave_one_out is None or len(estimate.leave_one_out) < ENOUGH_WINDOWS:
        return False
    spread = jackknife_sd(estimate.leave_one_out)
    if estimate.sd_bootstrap is not None:
        spread = np.maximum(spread, estimate.sd_bootstrap)
    seen = estimate.sd > 0
    return bool((spread[seen] > SPREAD_SEEN * estimate.sd[seen]).any())


def _doubtful(estimate: Estimate) -> tuple[str, ...]:
    """Parameters over 10 % by nominal sd or by the spread between windows, and not near zero."""
    spread = np.zeros(9) if estimate.leave_one_out is None else jackknife_sd(estimate.leave_one_out)
    size = np.abs(estimate.values)
    loose = spread > size * tls.WELL_IDENTIFIED_PERCENT / 100
    essential = ~tls.near_zero(estimate.values)
    by_spread = {n for n, is_loose in zip(PARAMETER_NAMES, loose & essential, strict=True) if is_loose}
    return tuple(n for n in PARAMETER_NAMES if n in by_spread or n in estimate.doubtful)


def _answer(outcome: ResultOutcome, estimate: Estimate, windows: tuple[WindowVerdict, ...]) -> ShortAnswer:
    used, loose = were_used(w.id for w in windows if w.used and w.role is Role.IDENTIFY), _doubtful(estimate)
    return ShortAnswer(
        verdict=outcome.value,
        certain=f"{consistency.sentence(estimate.body)} {used}.",
        not_known=f"Not well identified: {', '.join(loose)}." if loose else "",
        next=outcome.next,
    )


def _warnings(problem: Problem, estimate: Estimate, windows: tuple[WindowVerdict, ...]) -> tuple[str, ...]:
    warnings = [f"Window {u.window.id} is not used: {bare(u.window.id, u.reason)}" for u in problem.unused]
    warnings += _grouped_notes(windows)
    warnings += slack_notes(problem, estimate.values)
    warnings += _spread_warning(estimate)
    if not consistency.can_exist(estimate.body):
        warnings.append(consistency.sentence(estimate.body))
    warnings += _noise_warning(estimate)
    warnings += _held_out_warning(problem, estimate, windows)
    warnings += estimate.notes
    if estimate.scaling_effect is not None:
        in_sd = np.abs(estimate.scaling_effect) / np.maximum(estimate.sd, 1e-300)
        worst = int(np.argmax(in_sd))
        if in_sd[worst] > 1:
            warnings.append(
                f"Scaling the columns to equal norm (the paper's scaling, used here, is none) would move "
                f"{PARAMETER_NAMES[worst]} by {estimate.scaling_effect[worst]:.2e}, {in_sd[worst]:.1f} sd."
            )
    return tuple(warnings)


def _grouped_notes(windows: tuple[WindowVerdict, ...]) -> list[str]:
    """One line for a note that many windows share in kind; the first window's figures stand for it."""
    groups: dict[str, list[tuple[str, str]]] = defaultdict(list)
    for window in windows:
        if window.used:
            for note in window.notes:
                kind = " ".join(word for word in note.split() if not any(c.isdigit() for c in word))
                groups[kind].append((window.id, note))
    lines: list[str] = []
    for members in groups.values():
        first, note = members[0]
        ids = list(dict.fromkeys(window for window, _ in members))
        if len(ids) == 1:
            lines.append(f"Window {first}: {note}.")
        else:
            lines.append(f"{window_count(ids)} ({', '.join(ids)}), as in {first}: {note}.")
    return lines


def _spread_warning(estimate: Estimate) -> list[str]:
    if estimate.leave_one_out is None:
        return ["Fewer than three windows: the spread from window to window is unknown, and the sd are nominal only."]
    ratio = jackknife_sd(estimate.leave_one_out) / np.maximum(estimate.sd, 1e-300)
    worst = int(np.argmax(ratio))
    if ratio[worst] < OPTIMISM:
        return []
    return [
        f"The spread between windows is up to {ratio[worst]:.0f} times the sd ({PARAMETER_NAMES[worst]}): "
        "some windows are worse than others, or the model lacks something; use the spread as the uncertainty."
    ]


def _noise_warning(estimate: Estimate) -> list[str]:
    if estimate.noise_ratio is None or estimate.noise_ratio < MODEL_ERROR:
        return []
    return [
        f"The equations are off by {estimate.noise_ratio:.1f} times what marker noise explains: something is missing "
        "from the model, or the noise in the robot file is too small."
    ]


def _held_out_warning(problem: Problem, estimate: Estimate, windows: tuple[WindowVerdict, ...]) -> list[str]:
    if estimate.sigma_W is None:
        return []
    expected = expected_sigma_perp(estimate.sigma_W, estimate.body, problem.campaign.robot.freedoms)
    held_out = [w for w in windows if w.role is Role.VALIDATE and w.sigma_perp is not None]
    bad = [w.id for w in held_out if w.sigma_perp is not None and w.sigma_perp > 2 * expected]
    if not bad:
        return []
    return [
        f"Held-out windows {', '.join(bad)} fit at least twice as badly as the identified ones "
        f"(σ⊥ over 2 √λ ‖χ‖ σ_W = {2 * expected:.3g})."
    ]
