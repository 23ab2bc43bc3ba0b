"""The motion capture's clock against the winches': free motion does not show an offset, motor currents do.

With locked motors every window's start takes up a shift of its markers' time. The currents of held motors follow the
tensions of the fitted motion on the winches' own clock, i = a + b τ(t − offset + rate t) for each window and cable, a
and b being free (losses and scale of currents are not known to some per cent). What all of them say together is the
offset, and how much faster the cameras' clock runs: far finer than what free motion says of a rate.

Both are judged against the fitted motion, which is too quick or too slow itself where physics is missing, for the
markers as for the currents: the rate is what the currents say less what the markers say.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Campaign
from fidim_lab.mismatch.conclusion.explanation import Explanation, NamedCause, Verdict
from fidim_lab.mismatch.conclusion.parts import EffectParameter
from fidim_lab.mismatch.conclusion.thresholds import CONCLUSION
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.residuals.currents import courses
from fidim_lab.mismatch.thresholds import SHARED

OFFSET = "time-offset"
RATE = "clock-rate"
DISTORTED = frozenset(("pulley-friction",))
"""friction between winch and platform makes currents differ from tensions as an offset would"""


@dataclass(frozen=True)
class Timing:
    """A frame stamped t was taken at t + offset − rate t on the winches' clock, t since the start of its window."""

    offset: float
    """s"""
    sd: float
    """by the scatter between windows and cables"""
    rate: float
    rate_sd: float
    courses: int
    """windows × cables that were usable"""

    @property
    def is_off(self) -> bool:
        """Whether an offset is believed."""
        return abs(self.offset) > max(SHARED.certain * self.sd, CONCLUSION.timing_smallest)

    @property
    def runs_away(self) -> bool:
        """Whether another rate is believed."""
        return abs(self.rate) > max(SHARED.certain * self.rate_sd, CONCLUSION.timing_slowest)

    def excludes(self, rate: float) -> bool:
        """Whether the clocks differ by clearly less than this, if at all."""
        return abs(self.rate) + max(SHARED.certain * self.rate_sd, CONCLUSION.timing_slowest) < SHARED.half * abs(rate)


def timing(model: Completed) -> Timing | None:
    """By the motor currents of the windows that were fitted; None where there are none, or too few that are usable."""
    windows, margin = range(len(model.fit.likelihood.recordings)), CONCLUSION.timing_farthest
    usable = [course for w in windows for course in courses(model.fit, w, margin)]
    if len(usable) < SHARED.fewest:
        return None
    looks = np.arange(
        -CONCLUSION.timing_farthest, CONCLUSION.timing_farthest + CONCLUSION.timing_stride / 2, CONCLUSION.timing_stride
    )
    start = float(looks[np.argmin([sum(course.misfit(look) for course in usable) for look in looks])])
    found, steps, weights = np.array([start, 0.0]), np.zeros((0, 2)), np.zeros((0, 2, 2))
    for _ in range(SHARED.rounds):
        tries = [course.step(*found.tolist()) for course in usable]
        steps, weights = np.array([step for step, _ in tries]), np.array([weight for _, weight in tries])
        found = found + _mean(steps, weights)
    sds = _sds(steps, weights)
    markers, markers_sd = _rate_of_markers(model)
    return Timing(
        float(found[0]), float(sds[0]), float(found[1]) - markers, float(np.hypot(sds[1], markers_sd)), len(usable)
    )


def _sds(steps: Float[np.ndarray, "K 2"], weights: Float[np.ndarray, "K 2 2"]) -> Float[np.ndarray, "2"]:
    """Of their mean, by their weights and by their scatter, whichever says more."""
    off = steps - _mean(steps, weights)
    spread = float(np.einsum("ki,kij,kj->", off, weights, off)) / (2 * max(1, len(steps) - 1))
    return np.sqrt(max(1.0, spread) * np.diag(np.linalg.inv(weights.sum(axis=0))))


def _rate_of_markers(model: Completed) -> tuple[float, float]:
    """How much quicker the markers move by their stamps than the fitted motion, as `Timing.rate`, with its sd."""
    steps: list[np.ndarray] = []
    weights: list[np.ndarray] = []
    for left, recording in zip(model.fit.remainders, model.fit.likelihood.recordings, strict=True):
        t = left.t - recording.window.t[0] - recording.begin
        velocity = np.gradient(left.predicted, t, axis=0)
        seen = np.isfinite(velocity) & np.isfinite(left.residuals)
        columns = np.stack([-velocity, t[:, np.newaxis, np.newaxis] * velocity], axis=-1)[seen]
        weight = columns.T @ columns / model.fit.likelihood.noise**2
        steps.append(np.linalg.lstsq(columns, left.residuals[seen], rcond=1e-9)[0])
        weights.append(weight)
    every, all_weights = np.array(steps), np.array(weights)
    return float(_mean(every, all_weights)[1]) - _rate_of(model), float(_sds(every, all_weights)[1])


def _mean(steps: Float[np.ndarray, "K 2"], weights: Float[np.ndarray, "K 2 2"]) -> Float[np.ndarray, "2"]:
    return np.linalg.solve(weights.sum(axis=0), np.einsum("kij,kj->i", weights, steps))


def one_clock(model: Completed) -> bool:
    """Whether motor currents say that cameras and winches have one clock, where the model has another rate."""
    rate = _rate_of(model)
    found = timing(model) if rate and model.whole else None
    return found is not None and found.excludes(rate)


def _rate_of(model: Completed) -> float:
    """By which the model lets the cameras' clock run faster; 0 where it does not."""
    found = (float(model.theta_of(k)[0][0]) for k, h in enumerate(model.tried) if h.effect.id == RATE)
    return next(found, 0.0)


def retimed(campaign: Campaign, model: Completed) -> Campaign | None:
    """The campaign with its stamps on the winches' clock, by the motor currents; None where they do not run apart.

    model: fitted to whole windows of it, however well: the course of the tensions tells of a rate, not their size.
    """
    names = {h.effect.id for h in model.tried}
    found = timing(model) if model.whole and not names & DISTORTED and RATE not in names else None
    if found is None or not found.runs_away:
        return None
    slower = 1.0 / (1.0 + found.rate)
    windows = tuple(replace(w, t=w.t[0] + (w.t - w.t[0]) * slower) for w in campaign.windows)
    return replace(campaign, windows=windows)


def with_timing(told: Explanation, model: Completed, *, put_right: bool = False) -> Explanation:
    """The explanation with errors of the clocks, where all else is explained and the motor currents show them.

    model: the one that is told of; put_right: of `retimed` windows, in which the currents say the same once more.
    """
    names = {h.effect.id for h in model.tried}
    if told.verdict not in (Verdict.NOTHING_MISSING, Verdict.EXPLAINED) or names & DISTORTED:
        return told
    found = timing(model) if model.whole else None
    if found is None:
        message = f"{told.message} Not tested: {OFFSET} (no suitable motor currents)."
        return replace(told, message=message, untested=(*told.untested, OFFSET))
    causes, said = list(told.effects), [told.message]
    if found.is_off:
        says = "stamps are early: a frame stamped t was taken at t + offset"
        size = {"offset": EffectParameter(found.offset, found.sd, "s")}
        causes.append(NamedCause(OFFSET, None, (), size, says, single=True))
        figures = f"{1e3 * found.offset:.2f} ± {1e3 * found.sd:.2f} ms"
        said.append(
            f"Motor currents lag the tensions of the fitted motion by {figures} ({found.courses} time courses): the "
            "cameras' time stamps are early by this against the winches' clock."
        )
    if found.runs_away and RATE not in names:
        says = "the cameras' clock runs fast: a frame stamped t was taken at t/(1 + rate)"
        size = {"rate": EffectParameter(found.rate, found.rate_sd, "1")}
        causes.append(NamedCause(RATE, None, (), size, says, single=True))
        counts = "the fit uses corrected time stamps" if put_right else "inertia and centre of mass depend on it"
        said.append(
            f"According to the motor currents the cameras' clock runs faster than the winches' by {found.rate:.2g} ± "
            f"{found.rate_sd:.1g}, which free motion alone would hardly show; {counts}."
        )
    if len(causes) == len(told.effects):
        return told
    said[0] = said[0].replace("Nothing is missing:", "Nothing else is missing:", 1)
    return replace(told, verdict=Verdict.EXPLAINED, effects=tuple(causes), message=" ".join(said))
