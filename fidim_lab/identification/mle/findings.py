"""A trajectory fit in words: outcome, answer, warnings. No number is computed here except for comparison."""

from dataclasses import dataclass
from time import perf_counter

import numpy as np
from jaxtyping import Bool, Float

from fidim_lab.data.records import PARAMETER_NAMES, Body, Robot, Role
from fidim_lab.identification.cleaning.free_motion import were_used, window_count
from fidim_lab.identification.equations import consistency, tls
from fidim_lab.identification.equations.estimators import Method
from fidim_lab.identification.equations.refusals import bare
from fidim_lab.identification.markers.thresholds import MARKERS
from fidim_lab.identification.mle.dissipated import decays, lost_energy
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.starts.possible import distance_to_boundary
from fidim_lab.identification.mle.trajectories.optimise import Ending
from fidim_lab.identification.mle.trajectories.stages import TRUSTED, Journey
from fidim_lab.identification.results.result import (
    IdentificationResult,
    InertialParameter,
    ResultOutcome,
    ShortAnswer,
    WindowVerdict,
)
from fidim_lab.model.sensitivity.equations import EASE
from fidim_lab.units import millimetres, percent, plain

MISFIT = 1.5
"""χ²/dof, for the noise that the residuals themselves show, above which the model does not explain the recordings"""
COLOURED = 2.0
"""whiteness above which what is left is not noise"""
MOST_LOST = 0.5
"""share of the windows beyond which a lost phase is no matter of single windows"""
OPTIMISM = 3.0
"""a spread so many times the nominal sd is worth a warning"""
SOMETHING = "Something is missing from it"
OTHER_NOISE = "The residuals show a marker noise of"
"""begin of the sentence that says so"""
FAR = 1000
"""sd; beyond it the number says no more than that the body can exist"""
SLACK_SEEN = 0.01
"""s for which a cable must hang slack to be named"""
CONTRADICTION_MM = 2.0
"""mm between markers and lengths at the start of a window that are worth a warning"""


@dataclass(frozen=True, eq=False)
class FitAnswer:
    """What is said of a fit beside its parameters."""

    outcome: ResultOutcome
    answer: ShortAnswer
    windows: tuple[WindowVerdict, ...]
    warnings: tuple[str, ...]
    noise_ratio: float
    """what is left over what noise alone leaves"""


@dataclass(frozen=True, eq=False)
class Figures:
    """The nine parameters with every kind of uncertainty."""

    parameters: dict[str, InertialParameter]
    non_essential: tuple[str, ...]
    covariance: Float[np.ndarray, "9 9"]
    leave_one_out: Float[np.ndarray, "W 9"] | None
    moved: float = 0.0
    """sd by which the estimate was moved to a body that exists, along what the recordings hardly tell"""
    agree: bool = True
    """whether windows that are explained show one body, but for chance; else their spread is in the sd"""

    @property
    def body(self) -> Body:
        """The body of the parameters."""
        return Body.from_vector(np.array([parameter.value for parameter in self.parameters.values()]))

    def result(self, campaign: str, robot: Robot, told: FitAnswer, begin: float) -> IdentificationResult:
        """As a result by maximum likelihood, of markers, rates or periods. begin: by `perf_counter`, s."""
        return IdentificationResult(
            campaign=campaign,
            method=Method.MLE,
            **vars(told),
            parameters=self.parameters,
            non_essential=self.non_essential,
            sigma_W=None,
            C=None,
            seconds=perf_counter() - begin,
            covariance=self.covariance,
            leave_one_out=self.leave_one_out,
            attachment_plane=robot.attachment_plane,
            freedoms=robot.freedoms,
        )

    @property
    def unseen(self) -> tuple[str, ...]:
        """Parameters of which these recordings say nothing."""
        return tuple(name for name, parameter in self.parameters.items() if not parameter.seen)

    @property
    def sd(self) -> Float[np.ndarray, "9"]:
        """Nominal standard deviations."""
        return np.array([parameter.sd for parameter in self.parameters.values()])

    @property
    def spread(self) -> Float[np.ndarray, "9"]:
        """The largest of nominal sd, bootstrap and jackknife."""
        return np.array([max(parameter.sd, parameter.spread or 0.0) for parameter in self.parameters.values()])


def non_essential(
    values: Float[np.ndarray, "9"], sd: Float[np.ndarray, "9"], bootstrap: Float[np.ndarray, "9"] | None
) -> Bool[np.ndarray, "9"]:
    """Parameters near zero with σ% over 10 (§3.2), by the larger of nominal and bootstrap sd."""
    known = sd if bootstrap is None else np.maximum(sd, bootstrap)
    return tls.near_zero(values) & (known > tls.WELL_IDENTIFIED_PERCENT / 100 * np.abs(values))


def largest(*known: Float[np.ndarray, "9"] | None) -> Float[np.ndarray, "9"]:
    """The largest of several standard deviations, of those that are known."""
    return np.max([sd for sd in known if sd is not None], axis=0)


def doubtful(figures: Figures) -> tuple[str, ...]:
    """Parameters that are not near zero and known to no better than 10 %."""
    values = figures.body.vector
    loose = figures.spread > tls.WELL_IDENTIFIED_PERCENT / 100 * np.abs(values)
    marks = loose & (~tls.near_zero(values) | ~np.array([p.seen for p in figures.parameters.values()]))
    return tuple(name for name, mark in zip(PARAMETER_NAMES, marks, strict=True) if mark)


def outcome(found: Fit, figures: Figures, windows: tuple[WindowVerdict, ...]) -> ResultOutcome:
    """How it ended; the worst of what applies. Held-out windows count as much as those of the fit."""
    if not consistency.can_exist(figures.body) or figures.moved > consistency.ALLOWED:
        return ResultOutcome.IMPOSSIBLE_BODY
    if len(_unfollowed(found.journey)) > MOST_LOST * len(found.remainders):
        return ResultOutcome.LOST_PHASE
    if not found.settled and not found.explained:  # the edge of what can move may keep a search from settling
        return ResultOutcome.NOT_CONVERGED
    held = _held_out(windows)
    held_excess = float(np.mean(held)) / found.noise_ratio**2 if held else 0.0
    if max(found.excess, held_excess) > MISFIT:
        return ResultOutcome.MISFIT
    if len(figures.unseen) == len(figures.parameters):
        return ResultOutcome.UNSEEN
    return ResultOutcome.DOUBTFUL if doubtful(figures) else ResultOutcome.CONVERGED


def _unfollowed(journey: Journey) -> set[int]:
    """Windows whose motion is lost, or in which a cable gets slack at once: no recording of a free swing begins so."""
    return {*journey.lost, *(w for w, (time, _) in journey.slack.items() if time < TRUSTED)}


def cause(found: Fit, exact: Fit | None) -> str:
    """What the model visibly lacks, as a sentence; may be empty.

    exact: with the file's geometry, where `found` has another: that takes up a part of what decays, but loses nothing.
    """
    fits = () if found.excess <= MISFIT else (found,) if exact is None else (found, exact)
    losses = (lost_energy(one.remainders, one.likelihood.noise) for one in fits)
    lost = next((lost for lost in losses if lost is not None), None)
    if lost is None and not found.settled and not found.explained:  # there may be no motion to compare with
        lost = decays(found.likelihood.recordings, found.likelihood.noise * found.noise_ratio)
    return "" if lost is None else lost.says


def answer(ended: ResultOutcome, found: Fit, figures: Figures, lacks: str) -> ShortAnswer:
    """In four parts for a person. lacks: `cause`."""
    eigenvalue, in_sd = distance_to_boundary(figures.body, figures.covariance)
    parts = [
        f"{were_used(r.window.id for r in found.likelihood.recordings)}; χ²/dof is {plain(found.chi2_per_dof)}.",
        consistency.sentence(figures.body),
    ]
    if 0 < figures.moved <= consistency.ALLOWED:
        parts.append(
            f"The best fit is {figures.moved:.2g} sd outside of the possible bodies, in a direction that these "
            "recordings hardly determine; the nearest possible body is given."
        )
    elif eigenvalue > 0:
        far = plain(in_sd) if in_sd <= FAR else f"more than {FAR}"
        parts.append(f"The nearest body that cannot exist is {far} sd away.")
    ending = found.ending.value if ended is ResultOutcome.NOT_CONVERGED or found.ending is Ending.EDGE else ""
    verdict = " ".join(filter(None, (ended.value, lacks, ending)))
    more_than_noise = ended is ResultOutcome.CONVERGED and not found.explained
    advice = (ResultOutcome.MISFIT if more_than_noise else ended).next
    if ended.good and not more_than_noise and figures.leave_one_out is None:
        advice = "Record three windows or more: only the spread between them shows how good the parameters are."
    return ShortAnswer(verdict, " ".join(parts), not_known(figures), advice)


def not_known(figures: Figures) -> str:
    """The parameters that the recordings hardly determine, or not at all."""
    loose = [name for name in doubtful(figures) if name not in figures.unseen]
    heads = (("Not determined by these recordings", figures.unseen), ("Not well identified", loose))
    return " ".join(f"{head}: {', '.join(names)}." for head, names in heads if names)


def warnings(found: Fit, figures: Figures, windows: tuple[WindowVerdict, ...]) -> tuple[str, ...]:
    """Everything that a user should know before believing the numbers, one sentence each."""
    unused = dict(found.unused) | {window.id: window.notes[0] for window in windows if _unpredicted(window)}
    said = [f"Window {name} is not used: {bare(name, why)}" for name, why in unused.items()]
    said += _grouped(windows)
    if found.start_moved:
        said.append(
            "The nominal body is impossible (its inertia about G is not positive definite); the search began at the "
            "nearest possible body."
        )
    said += [
        f"The data do not determine {combination}: it stays at its CAD value."
        for combination in found.open_combinations
        if combination.weights[0][0] in PARAMETER_NAMES  # what is fitted beside the body may stay open: it has priors
    ]
    said += _misfit_warnings(found, windows)
    said += _spread_warnings(figures)
    return tuple(said)


def closing(result: IdentificationResult) -> str:
    """How far a result of this method may be trusted, as its last sentence."""
    s_z = result.parameters["s_z"]
    lever = abs(s_z.value - result.attachment_plane)
    error = max(s_z.sd, s_z.spread or 0.0)
    size = f"s_z is good to about {millimetres(error):.2g} mm ({percent(error / lever):.2g} % of s_z − a_z)"
    size = size if s_z.seen else "s_z is not determined"
    held = _held_out(result.windows)
    judged = ""
    if held:
        values = plain(min(held)) if len(held) == 1 else f"{plain(min(held))} to {plain(max(held))}"
        judged = f"; held-out windows have χ²/dof {values}"
    spread = result.leave_one_out is not None
    basis = (
        "By the spread between windows" if spread else "By the sd only, since there are too few windows for a spread,"
    )
    if result.outcome is ResultOutcome.MISFIT:
        return (
            f"The model lacks something: its residual is {result.noise_ratio:.2g} times the noise"
            f"{judged}. {basis} {size}; an error that is the same in all windows is not included."
        )
    if any(SOMETHING in warning for warning in result.warnings):
        return f"Little more than noise is left, but more than chance explains{judged}. {basis} {size}."
    alone = "" if spread else " by the sd only, since there are too few windows for a spread"
    return f"The model explains the recordings down to noise{judged}. {size}{alone}."


def window_notes(found: Fit, w: int) -> tuple[str, ...]:
    """Notes on one window that was fitted."""
    notes = list(journey_notes(found.journey, w))
    misfit = found.misfits[w] * 1e3
    if misfit > CONTRADICTION_MM:
        notes.append(f"cable lengths and markers differ by {misfit:.1f} mm at its start")
    return tuple(notes)


def journey_notes(journey: Journey, w: int) -> tuple[str, ...]:
    """The history of one recording on the way to full length, and its springs that were slack at the end."""
    if w in journey.slack:
        t, cable = journey.slack[w]
        return (f"cable {cable} goes slack {t:.2f} s after its start; the rest is not used",)
    if w in journey.lost:
        return (f"the simulated motion loses its phase; only the first {journey.ends[w]:.2g} s are used",)
    return _slack_springs(journey, w)


def _slack_springs(journey: Journey, w: int) -> tuple[str, ...]:
    """One note on elastic cables that the simulated motion lets hang slack for a while."""
    simulation = journey.optimum.simulation
    trajectories, place = simulation.trajectory_of(w)
    within = trajectories.grid.t <= simulation.ends[w]
    t, tensions = trajectories.grid.t[within], trajectories.tensions[place][within]
    spacing = np.gradient(t) if len(t) > 1 else np.zeros(len(t))
    slack = [(k + 1, float(spacing[tensions[:, k] < EASE].sum())) for k in range(tensions.shape[1])]
    said = [f"cable {cable} for {seconds:.2f} s" for cable, seconds in slack if seconds >= SLACK_SEEN]
    return (f"elastic cables hang slack in the simulated motion: {', '.join(said)}",) if said else ()


def _held_out(windows: tuple[WindowVerdict, ...]) -> list[float]:
    return [w.chi2_per_dof for w in windows if w.role is Role.VALIDATE and w.chi2_per_dof is not None]


def _grouped(windows: tuple[WindowVerdict, ...]) -> list[str]:
    """Notes of all windows, one sentence for those of one kind; the first window's figures stand for it."""
    groups: dict[str, list[tuple[str, str]]] = {}
    for window in windows:
        for note in window.notes if window.used else ():
            kind = " ".join(word for word in note.split() if not any(letter.isdigit() for letter in word))
            groups.setdefault(kind, []).append((window.id, note))
    said: list[str] = []
    for members in groups.values():
        ids, note = ", ".join(name for name, _ in members), members[0][1]
        said.append(f"Window {ids}: {note}." if len(members) == 1 else f"Windows {ids}, as in {members[0][0]}: {note}.")
    return said


def _unpredicted(window: WindowVerdict) -> bool:
    return not window.used and window.role is Role.VALIDATE


def _misfit_warnings(found: Fit, windows: tuple[WindowVerdict, ...]) -> list[str]:
    said: list[str] = []
    declared, sensor = found.likelihood.noise, found.likelihood.sensor
    if found.noise_ratio > 1.25 or found.noise_ratio < 0.8:
        said.append(
            f"{OTHER_NOISE.replace('marker', sensor.name)} {'at most ' if found.noise_ratio <= MARKERS.finest else ''}"
            f"{found.noise_ratio * declared * 1e3:.3g} {sensor.unit}, the robot file says {declared * 1e3:.3g} "
            f"{sensor.unit} (sensors, {sensor.key})."
        )
    if not found.explained:
        left = declared * np.sqrt(max(found.chi2_per_dof - found.noise_ratio**2, 0.0)) * 1e3
        said.append(
            f"χ²/dof is {plain(found.chi2_per_dof)}: besides noise, {left:.2g} {sensor.unit} rms are left that the "
            f"model does not explain. {SOMETHING} (fidim explain)."
        )
    coloured = {
        recording.window.id: f"{recording.window.id} ({left.whiteness:.0f})"
        for recording, left in zip(found.likelihood.recordings, found.remainders, strict=True)
        if left.whiteness is not None and left.whiteness > COLOURED and left.rms > MARKERS.finest * declared
    }
    if coloured:
        where = window_count(coloured)
        said.append(f"The residual is not white (white: 1) in {where}: {', '.join(coloured.values())}.")
    worst = 2 * max(1.0, found.chi2_per_dof)
    bad = [w.id for w in windows if w.role is Role.VALIDATE and (w.chi2_per_dof or 0.0) > worst]
    if bad:
        said.append(
            f"Held-out windows {', '.join(bad)} fit at least twice as badly as those of the fit: the body was "
            "changed or touched, or the model is valid only where it was fitted."
        )
    return said


def _spread_warnings(figures: Figures) -> list[str]:
    if figures.leave_one_out is None:
        return ["Fewer than three windows: the spread from window to window is unknown, and the sd are nominal only."]
    if not figures.agree:
        return [
            "The windows show different bodies, by more than chance: every ± includes the spread between them. "
            "Something was changed or touched in one of them, or the model, or its geometry, lacks something."
        ]
    ratio = figures.spread / np.maximum(figures.sd, 1e-300)
    worst = int(np.argmax(ratio))
    if ratio[worst] < OPTIMISM:
        return []
    return [
        f"The spread between windows is up to {ratio[worst]:.0f} times the sd ({PARAMETER_NAMES[worst]}): "
        "use the spread as the uncertainty."
    ]
