"""The next best experiment: which windows and sensors tell a named effect from its rivals.

What the named effect does to the recordings of a window, and what every rival can imitate of it with its own size, the
body and the window's start adjusted, are columns of the same information matrix. What remains between the two is the
non-centrality λ of a χ² whose degrees of freedom are the effect's parameters; it adds up over windows. The odds are
those of exceeding what a clear verdict takes (2 × 5 nats). First order, noise and encoders as the robot file has them;
`noise` makes up for a model that is not perfect. An explanation names a few rivals; `completed` finds all that what was
recorded leaves in the claim's place. Rivals that no windows tell from it are set aside and said.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.stats import ncx2

from fidim_lab.data.records import Robot, Role, Window
from fidim_lab.effects.plausibility import Context
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.mle.trajectories.likelihood import Likelihood, Point, simulate
from fidim_lab.identification.mle.trajectories.recordings import FollowedSamples
from fidim_lab.mismatch.linearised.columns import Scorer
from fidim_lab.mismatch.linearised.hypotheses import Hypotheses, Hypothesis, hypotheses
from fidim_lab.mismatch.next_experiment.proposal import Claim, Odds, Proposal, ProposedTrial
from fidim_lab.mismatch.next_experiment.thresholds import NEXT_EXPERIMENT
from fidim_lab.mismatch.scores.score import eliminated, imitated, window_grams
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.model.sensitivity.grid import Resolution
from fidim_lab.model.sensitivity.integrate import States

EXACT = Resolution(intervals=16)
"""of integration: less finely, effects that imitate each other exactly would seem to be told apart"""


@dataclass(frozen=True, eq=False)
class KnownRobot:
    """A robot, and what is known of it before any further window."""

    robot: Robot
    recorded: Sequence[ProposedTrial]
    """the windows there are"""
    body: Float[np.ndarray, "9"] | None = None
    """base parameters as identified; None: as the robot file has them"""
    noise: float = 1.0
    """times the robot file's, √(χ²/dof) of a fit that is not perfect"""
    native: bool = True
    marked: Robot | None = None
    """the robot with the markers that further windows would have, where these are more"""

    @property
    def later(self) -> Robot:
        """The model for further windows."""
        return self.marked or self.robot

    def grams(self, tried: Hypotheses, pool: Sequence[ProposedTrial] = ()) -> Float[np.ndarray, "W G G"]:
        """What each window would say of body and effects, its own unknowns eliminated: those there are, then the pool.

        Raises InfeasibleError where one cannot be simulated.
        """
        parts = [(self.robot, self.recorded), (self.later, pool)]
        found = [
            _grams(Mechanism(robot, native=self.native), tried, trials, self.body, self.noise)
            for robot, trials in parts
            if len(trials)
        ]
        size = BODY + sum(len(h.scored) for h in tried.direct) + 1
        return np.concatenate([np.zeros((0, size, size)), *found])


def separating(known: KnownRobot, claim: Claim, pool: Sequence[ProposedTrial], *, more: int = 3) -> Proposal:
    """The windows of the pool, at most `more`, that separate a claim from its rivals best, and the odds.

    Raises InfeasibleError for a claim that no score knows.
    """
    tried = _pair(known.robot, claim)
    grams = known.grams(tried, pool)
    judge = _Judge(tried, _theta(tried, claim), Context.of(known.robot))
    told, fresh = grams[: len(known.recorded)].sum(axis=0), grams[len(known.recorded) :]
    most = min(more, NEXT_EXPERIMENT.most_windows)
    rivals, beyond = judge.rivals, tuple[str, ...]()
    chosen, after = _greedy(judge, told, fresh, rivals, most)
    if len(rivals) > 1 and not (after and after[-1].clear):
        within = tuple(id for id in rivals if _together(judge, told, fresh, id, most).clear)
        if set(within) & set(claim.rivals):  # else the verdict that was given stays as it is
            beyond = tuple(id for id in rivals if id not in within)
            rivals = within
            chosen, after = _greedy(judge, told, fresh, rivals, most)
    windows = tuple(pool[k] for k in chosen)
    return Proposal(claim, windows, judge.odds(told, rivals), tuple(after), len(known.later.markers), beyond)


def completed(known: KnownRobot, claim: Claim) -> Claim:
    """The claim with all further rivals that the recorded windows leave in its place.

    An effect of another cable is no rival. Raises InfeasibleError as `separating`.
    """
    own = _own(known.robot, claim)
    others = [h for h in hypotheses(known.robot).direct if len(h.scored) and h.effect.id != claim.id]
    tried = Hypotheses((own, *(h for h in others if h.effect.cable in (None, claim.cable))), (), ())
    gram = known.grams(tried).sum(axis=0)
    judge = _Judge(tried, _theta(tried, claim), Context.of(known.robot))
    further = (id for id in judge.rivals if id not in claim.rivals)
    return replace(
        claim, open=tuple(id for id in further if judge.odds(gram, (id,)).non_centrality < 2 * SHARED.enough)
    )


def evidence(known: KnownRobot, claim: Claim) -> float:
    """Non-centrality of an effect of this size against none at all: far above 10 it is seen in these windows.

    Raises InfeasibleError as `separating`; rivals play no part.
    """
    tried = Hypotheses((_own(known.robot, claim),), (), ())
    gram = known.grams(tried).sum(axis=0)
    left = eliminated(gram, np.arange(BODY), BODY + np.arange(len(tried.direct[0].scored)))
    theta = _theta(tried, claim)
    return max(0.0, float(theta @ left @ theta))


def with_markers(robot: Robot, size: float = 0.1) -> Robot:
    """The robot with three markers, where it has fewer: two more beside the main one, `size` (m) apart."""
    if len(robot.markers) >= 3:
        return robot
    first = robot.marker
    beside = np.array([[size, 0.0, 0.0], [0.0, size, 0.5 * size]])
    return replace(robot, extra_markers=tuple(first + beside))


@dataclass(frozen=True, eq=False)
class _Judge:
    """The first of what is tried against the others."""

    tried: Hypotheses
    theta: np.ndarray
    """of the first one, as far as it is scored"""
    context: Context

    @property
    def rivals(self) -> tuple[str, ...]:
        """Ids."""
        return tuple(dict.fromkeys(h.effect.id for h in self.tried.direct[1:]))

    def odds(self, gram: np.ndarray, rivals: Sequence[str]) -> Odds:
        """Against that one of these rivals that imitates most, with sizes that are possible."""
        own, ends = len(self.theta), np.cumsum([len(h.scored) for h in self.tried.direct])
        rest = eliminated(gram, np.arange(BODY), np.arange(BODY, BODY + int(ends[-1])))
        whole = float(self.theta @ rest[:own, :own] @ self.theta)
        found: list[tuple[float, str]] = []
        for rival, end in zip(self.tried.direct[1:], ends[1:], strict=True):
            if rival.effect.id in rivals:
                at = slice(int(end) - len(rival.scored), int(end))
                _, taken = imitated(rest[at, at], rest[at, :own] @ self.theta, *self._possible(rival))
                found.append((max(0.0, whole - taken), rival.effect.id))
        least, id = min(found)
        probability = float(ncx2.sf(2 * SHARED.enough, df=own, nc=least)) if least > 0 else 0.0
        return Odds(id, least, probability)

    def _possible(self, rival: Hypothesis) -> tuple[np.ndarray, np.ndarray]:
        low, high = rival.effect.bounds(self.context)
        return low[list(rival.scored)], high[list(rival.scored)]


def _greedy(
    judge: _Judge, known: np.ndarray, fresh: np.ndarray, rivals: Sequence[str], most: int
) -> tuple[list[int], list[Odds]]:
    """Which of the fresh windows to take until it is clear, at most so many, and the odds after each."""
    chosen, after = list[int](), list[Odds]()
    left = list(range(len(fresh)))
    while left and len(chosen) < most and not (after and after[-1].clear):
        best = max(left, key=lambda k: judge.odds(known + fresh[k], rivals).non_centrality)
        known = known + fresh[best]
        left.remove(best)
        chosen.append(best)
        after.append(judge.odds(known, rivals))
    return chosen, after


def _together(judge: _Judge, known: np.ndarray, fresh: np.ndarray, rival: str, most: int) -> Odds:
    """The odds against one rival with those fresh windows that each alone tell most, at most so many."""
    alone = [judge.odds(known + one, (rival,)).non_centrality for one in fresh]
    return judge.odds(known + fresh[np.argsort(alone)[-most:]].sum(axis=0), (rival,))


def _pair(robot: Robot, claim: Claim) -> Hypotheses:
    """The claim, then its rivals."""
    own = _own(robot, claim)
    every = [h for h in hypotheses(robot).direct if len(h.scored)]
    rivals = [h for h in every if h.effect.id in (*claim.rivals, *claim.open) and h.effect.id != claim.id]
    if not rivals:
        raise InfeasibleError(f"Odds for {claim.id}: none of its rivals has a score.")
    return Hypotheses((own, *rivals), (), ())


def _theta(tried: Hypotheses, claim: Claim) -> Float[np.ndarray, " scored"]:
    return np.array(claim.theta)[list(tried.direct[0].scored)]


def _own(robot: Robot, claim: Claim) -> Hypothesis:
    """What is claimed, at the nearest of its places that are scanned."""
    every = [h for h in hypotheses(robot).direct if len(h.scored)]
    own = [h for h in every if h.effect.id == claim.id and h.effect.cable == claim.cable]
    own = [h for h in own if len(h.absent) == len(claim.theta)] or own
    if not own or len(own[0].absent) != len(claim.theta):
        raise InfeasibleError(f"Odds for {claim.id}: it has no score of its own, so nothing can be computed.")
    return min(own, key=lambda h: _scan_distance(h, claim.theta))


def _scan_distance(tried: Hypothesis, theta: Sequence[float]) -> float:
    scanned = [k for k in range(len(tried.absent)) if k not in tried.scored]
    return float(np.linalg.norm(tried.absent[scanned] - np.array(theta)[scanned])) if scanned else 0.0


def _grams(
    mechanism: Mechanism, tried: Hypotheses, trials: Sequence[ProposedTrial], body: np.ndarray | None, noise: float
) -> Float[np.ndarray, "W G G"]:
    """What each window would say of body and effects, its own unknowns eliminated."""
    robot = mechanism.robot
    shared = robot.nominal.vector if body is None else body
    states = States(
        np.array([one.start.position for one in trials]),
        np.array([one.start.rotation for one in trials]),
        np.zeros((len(trials), 6)),
    )
    t = np.arange(0.0, 10.0 + 1e-9, 1 / NEXT_EXPERIMENT.separate_rate)
    recordings = tuple(_recording(robot, one, t, f"trial {k + 1}") for k, one in enumerate(trials))
    sparser = np.sqrt(NEXT_EXPERIMENT.separate_rate / 100.0)
    likelihood = Likelihood(
        mechanism,
        recordings,
        states,
        noise * sparser * robot.sensors.marker_noise,
        noise * robot.sensors.encoder_resolution,
    )
    ends = np.full(len(trials), t[-1])
    simulation = simulate(likelihood, Point(shared, states), ends, EXACT)
    if simulation is None:
        raise InfeasibleError("Odds: the body is impossible, or a trial's motion cannot be simulated.")
    found = window_grams(Scorer(mechanism, tried), likelihood, simulation)
    return np.array([one.gram for one in found])


def _recording(robot: Robot, trial: ProposedTrial, t: np.ndarray, name: str) -> FollowedSamples:
    """Stamps and lengths as they would be; what markers would show plays no part in information."""
    markers = np.zeros((len(t), len(robot.markers), 3))
    window = Window(name, Role.IDENTIFY, t, markers, np.broadcast_to(trial.lengths, (len(t), robot.n)), None)
    return FollowedSamples(window, 0.0, t, markers, trial.lengths, trial.lengths)
