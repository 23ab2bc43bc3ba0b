"""A check after every window of a session: does the model hold so far, and if not, what is suspected?

    watch = Watch(robot)
    for window in session: watch.look([window]).says

The fit of the windows so far is the start of the next, and a new window first finds its own initial state, so a look
takes a second where `explain` takes many. It refits no effect and predicts nothing held out: what it suspects are
scores, to be followed up by `explain` once the campaign is whole. Evidence is a ratio of likelihoods, so the chance
that a sound model is ever suspected, however often one looks, is below e^−SHARED.enough for each hypothesis (Ville's
inequality).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.data.records import Campaign, Robot, Role, Window
from fidim_lab.errors import RefusedError
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.held_out import HeldOutPrediction, predict_all
from fidim_lab.identification.mle.trajectories.likelihood import Point
from fidim_lab.identification.mle.trajectories.optimise import optimise
from fidim_lab.identification.mle.trajectories.recordings import FollowedSamples, prepare
from fidim_lab.identification.mle.trajectories.stages import HORIZONS, Journey
from fidim_lab.mismatch.cleaning.clean import clean
from fidim_lab.mismatch.fitting.baseline import context_of, ready
from fidim_lab.mismatch.fitting.fit_data import (
    BESIDE,
    IN_PASSING,
    as_fit,
    ground_of,
    nearer,
    settle,
    short_fit,
    whole_ground,
)
from fidim_lab.mismatch.linearised.columns import Scorer
from fidim_lab.mismatch.linearised.hypotheses import hypotheses
from fidim_lab.mismatch.scores.score import Projected, Score, WindowGram, projected, single_scores, window_grams
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.model.sensitivity.integrate import States
from fidim_lab.say import counted


@dataclass(frozen=True)
class Suspicion:
    """One effect that the windows so far ask for."""

    id: str
    cable: int | None
    log_evidence: float
    """of the model with it against the model as it is, nats; its size by its score, to first order"""
    would_leave: float
    """χ²/dof"""


@dataclass(frozen=True)
class SoFar:
    """The state of the model by the windows so far."""

    windows: int
    """that were fitted"""
    chi2_per_dof: float | None
    """of the fit of these, for the noise that they show; None before there is one"""
    rms: float | None
    """of the marker residuals, m"""
    seconds: float | None
    """of each window that were followed: 3 where the model loses the motion later"""
    holds: bool
    """nothing but noise is left, and no effect is suspected"""
    suspected: tuple[Suspicion, ...]
    """the most evident first, at most three, one for each effect"""
    says: str
    """all that in one sentence"""


class Watch:
    """The fit of a session's windows as they come, and what each says of every hypothesis."""

    def __init__(self, robot: Robot, *, native: bool = True) -> None:
        """native: with compiled C where there is a compiler; it is built while the first looks are taken without."""
        self._robot = robot
        self._mechanism = ready(robot, native=native)
        self._scorer = Scorer(self._mechanism, hypotheses(robot))
        self._windows: list[Window] = []
        self._fitted = 0
        """of these that are in the fit"""
        self._refused: dict[str, str] = {}
        self._found: Fit | None = None
        self._seconds: float | None = None
        """as far as windows are looked at; None: whole"""
        self._grams: list[WindowGram] = []
        """one for each window of the fit"""

    def look(self, windows: Sequence[Window]) -> SoFar:
        """Take in new windows (usually one), and say what all of them say."""
        for window in windows:
            try:
                self._windows.append(clean(self._campaign([window])).campaign.windows[0])
            except RefusedError as refusal:  # nothing moves, or the robot file is not of this robot
                self._refused[window.id] = str(refusal)
        refusal = next(iter(self._refused.values()), "")
        if len(self._windows) < SHARED.fewest:
            self._look_ahead()
            says = (
                refusal
                or f"{counted(len(self._windows), 'window')} so far: {SHARED.fewest} are needed to check the model."
            )
            return SoFar(len(self._windows), None, None, None, not refusal, (), says)
        try:
            found = self._refitted()
        except RefusedError as problem:
            return SoFar(len(self._windows), None, None, None, False, (), str(problem))
        return _told(found, self._scored(found), refusal)

    def _look_ahead(self) -> None:
        """What the third look needs, while there is nothing to tell: builds with one window, fits and scores two.

        The fit of one window is thrown away: its body is too far off for scores that are carried along.
        """
        try:
            self._scored(self._refitted() if len(self._windows) == SHARED.fewest - 1 else self._begun())
        except RefusedError:
            self._found = None

    def _refitted(self) -> Fit:
        """The fit of all windows: the last one extended, or begun."""
        found = None
        if self._found is not None:
            found = extended(self._found, self._windows[self._fitted :], self._seconds)
        if found is None or (self._seconds != HORIZONS[1] and found.excess >= SHARED.near):
            self._grams = []
            found = self._begun()
        self._found, self._fitted = found, len(self._windows)
        return found

    def _begun(self) -> Fit:
        """From nominal values, with growing horizons, as far as the model follows."""
        windows = self._campaign(self._windows).windows
        short = short_fit(self._mechanism, windows)
        if short.excess < SHARED.near:
            whole = followed(short, windows)
            self._seconds = HORIZONS[2] if whole is None else None
            return whole or short
        self._seconds = HORIZONS[1]
        return nearer(short, HORIZONS[1]) or short

    def _scored(self, found: Fit) -> tuple[Projected, tuple[Score, ...]]:
        """All scores; of windows that have been looked at before, their first-order statements are carried along."""
        simulation, known = found.journey.optimum.simulation, len(self._grams)
        new = range(known, len(found.likelihood.recordings))
        self._grams += window_grams(self._scorer, found.likelihood, simulation, new)
        seen = projected(self._scorer, found, self._grams)
        return seen, single_scores(seen, context_of(found))

    def _campaign(self, windows: Sequence[Window]) -> Campaign:
        """All of them to be fitted: what is held out later is `explain`'s matter."""
        as_fitted = tuple(replace(window, role=Role.IDENTIFY) for window in windows)
        steps = [float(np.median(np.diff(window.t))) for window in windows if len(window.t) > 1]
        return Campaign("session", self._robot, 1 / float(np.median(steps)) if steps else 100.0, as_fitted)


def followed(short: Fit, windows: Sequence[Window]) -> Fit | None:
    """Whole windows from the fit of their first seconds; None where the model does not follow them."""
    ground = whole_ground(ground_of(short), windows)
    everything, prior = np.ones(len(short.values), dtype=bool), ground.prior(np.zeros(0), np.zeros(0))
    found = settle(ground, short, short.likelihood.mechanism, short.journey.optimum.point, prior, everything)
    return found if found is not None and found.excess < SHARED.near and not found.journey.lost else None


def extended(found: Fit, windows: Sequence[Window], seconds: float | None) -> Fit | None:
    """A fit with further windows, from where it is; None where it does not get there.

    seconds: as far as windows are looked at; None: whole. Windows that cannot be used are left out.
    """
    mechanism = found.likelihood.mechanism
    recordings: list[FollowedSamples] = []
    for window in windows:
        try:
            recording = prepare(window, mechanism.robot)
        except RefusedError:
            continue
        recordings.append(recording if seconds is None else recording.until(seconds))
    predicted = predict_all(mechanism, found.values, recordings, mechanism.robot.sensors)
    usable = [(r, p) for r, p in zip(recordings, predicted, strict=True) if isinstance(p, HeldOutPrediction)]
    if not usable:
        return found
    states = [p.journey.optimum.point.states.of(np.array([p.place])) for _, p in usable]
    start = Point(found.values, _joined([found.journey.optimum.point.states, *states]))
    ends = np.concatenate([found.journey.ends, [p.journey.ends[p.place] for _, p in usable]])
    likelihood = replace(
        found.likelihood,
        recordings=(*found.likelihood.recordings, *(r for r, _ in usable)),
        guesses=_joined([found.likelihood.guesses, *states]),
    )
    effort = BESIDE if seconds is None else IN_PASSING
    optimum = optimise(likelihood, start, ends, found.prior, effort, np.ones(len(found.values), dtype=bool))
    if optimum is None:
        return None
    first = len(found.likelihood.recordings)
    lost = (*found.journey.lost, *(first + k for k, (_, p) in enumerate(usable) if p.lost))
    return as_fit(found, likelihood, Journey(optimum, ends, found.journey.slack, lost), found.prior)


def _joined(states: Sequence[States]) -> States:
    """Of rigid cables and effects without states of their own."""
    parts = ((one.positions, one.rotations, one.twists) for one in states)
    return States(*(np.concatenate(each) for each in zip(*parts, strict=True)))


def _told(found: Fit, scored: tuple[Projected, tuple[Score, ...]], refusal: str) -> SoFar:
    count = len(found.likelihood.recordings)
    dof = sum(left.dof for left in found.remainders)
    left = found.excess - 1 > SHARED.certain * float(np.sqrt(2 / max(1, dof)))
    suspected = _suspected(found, *scored)
    seconds = float(max(recording.end for recording in found.likelihood.recordings))
    rms = float(np.sqrt(np.mean([one.rms**2 for one in found.remainders])))
    holds = not (left or suspected or refusal)
    says = f"{counted(count, 'window')} so far: χ²/dof {found.excess:.3g}"
    says += f" over the first {seconds:.0f} s" if seconds <= HORIZONS[2] + 1e-9 else ""
    if holds:
        says += ", the model holds: only noise is left, and no effect is suspected."
    elif suspected:
        best = suspected[0]
        place = "" if best.cable is None else f" (cable {best.cable})"
        says += f"; suspected: {best.id}{place}, log-evidence {best.log_evidence:.0f} "
        says += f"(significant from {SHARED.enough:g}); with it χ²/dof would be {best.would_leave:.3g}."
        others = dict.fromkeys(other.id for other in suspected[1:] if other.id != best.id)
        says += f" Also suspected: {', '.join(others)}." if others else ""
    else:
        says += "; something is missing that no effect of the catalogue explains."
    says += f" {refusal}" if refusal else ""
    return SoFar(count, found.excess, rms, seconds, holds, suspected, says)


def _suspected(found: Fit, seen: Projected, singles: Sequence[Score]) -> tuple[Suspicion, ...]:
    chosen: dict[object, Score] = {}
    for score in singles:
        if score.log_evidence > SHARED.enough:
            chosen.setdefault(score.tried[0].effect, score)
    scale = max(1, seen.dof) * found.noise_ratio**2
    return tuple(
        Suspicion(
            score.tried[0].effect.id,
            score.tried[0].effect.cable,
            score.log_evidence,
            (seen.left - score.gain) / scale,
        )
        for score in list(chosen.values())[: SHARED.leaders]
    )
