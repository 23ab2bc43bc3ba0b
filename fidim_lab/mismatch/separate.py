"""The next best experiment: which windows and sensors tell a named effect from those that may stand in its place.

What the named effect does to the recordings of a window, and what every rival can imitate of it with its own size, the
body and the window's start adjusted, are columns of the same information matrix. What remains between the two is the
non-centrality λ of a χ² whose degrees of freedom are the effect's parameters; it adds up over windows. The odds are
those of exceeding what a clear verdict takes (2 × 5 nats). First order, noise and encoders as the robot file has them;
`noise` makes up for a model that is not perfect.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.stats import ncx2

from fidim_lab.data.records import Pose, Robot, Role, Window
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.mle.likelihood import Likelihood, Point, simulate
from fidim_lab.identification.mle.recordings import Recording
from fidim_lab.mismatch.columns import Scorer
from fidim_lab.mismatch.hypotheses import Hypotheses, Hypothesis, hypotheses
from fidim_lab.mismatch.score import eliminated, window_grams
from fidim_lab.mismatch.views import ENOUGH
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.model.sensitivity.grid import QUICK
from fidim_lab.model.sensitivity.integrate import States

RATE = 25.0
"""samples a second that are computed with; the noise is made smaller for those left out"""
CLEAR = 0.9
"""odds at which an experiment is said to separate"""
MOST_WINDOWS = 12
"""further windows that a set may have"""


@dataclass(frozen=True)
class Claim:
    """An effect that was named, and what may stand in its place."""

    id: str
    cable: int | None
    theta: tuple[float, ...]
    """as found, in the order of the effect's parameters"""
    rivals: tuple[str, ...]
    """ids"""


@dataclass(frozen=True, eq=False)
class Trial:
    """One window that could be recorded: let go at `start` with the motors locked at `lengths`."""

    lengths: Float[np.ndarray, " n"]
    """m"""
    displacement: Float[np.ndarray, " free"]
    """m, of the marker"""
    start: Pose


@dataclass(frozen=True)
class Odds:
    """How likely a set of windows tells a claim from its most stubborn rival."""

    rival: str
    non_centrality: float
    probability: float

    @property
    def clear(self) -> bool:
        """Whether that is often enough."""
        return self.probability >= CLEAR


@dataclass(frozen=True, eq=False)
class Proposal:
    """What to record next for one claim."""

    claim: Claim
    windows: tuple[Trial, ...]
    """in order; the first tells most"""
    before: Odds
    """with what has been recorded"""
    after: tuple[Odds, ...]
    """with the first, the first two, … of the windows beside it"""
    markers: int
    """that the platform must carry"""

    @property
    def separates(self) -> bool:
        """Whether it is likely to give a clear verdict."""
        return self.after[-1].clear if self.after else self.before.clear

    @property
    def says(self) -> str:
        """A sentence for a person."""
        last = self.after[-1] if self.after else self.before
        what = f"{self.claim.id} and {last.rival}"
        now = f"{100 * self.before.probability:.0f} %"
        then = f"{100 * last.probability:.0f} %"
        sensors = f" with {self.markers} markers on the platform" if self.markers > 1 else ""
        if not self.separates:
            return (
                f"{what} are told apart in {then} of cases even after {len(self.windows)} more windows{sensors} "
                f"(now: {now}): free motion hardly separates them."
            )
        count = f"{len(self.windows)} more window{'s' * (len(self.windows) != 1)}"
        return f"{what} are told apart in {then} of cases after {count}{sensors} (now: {now})."


def separating(
    robot: Robot,
    claim: Claim,
    recorded: Sequence[Trial],
    pool: Sequence[Trial],
    body: Float[np.ndarray, "9"] | None = None,
    *,
    more: int = 3,
    noise: float = 1.0,
    native: bool = True,
) -> Proposal:
    """The windows of the pool, at most `more`, that separate a claim from its rivals best, and the odds.

    recorded: the windows there are. body: nine base parameters as identified; nominal without. noise: times the robot
    file's, √(χ²/dof) of a fit that is not perfect. Raises InfeasibleError for a claim that no score knows.
    """
    tried, own, rivals = _pair(robot, claim)
    mechanism = Mechanism(robot, native=native)
    grams = _grams(mechanism, tried, [*recorded, *pool], body, noise)
    theta = np.array(claim.theta)[list(tried.direct[own].scored)]
    known = grams[: len(recorded)].sum(axis=0)
    judge = _Judge(tried, own, rivals, theta, len(grams[0]))
    before, after, chosen = judge.odds(known), list[Odds](), list[int]()
    left = list(range(len(pool)))
    while left and len(chosen) < min(more, MOST_WINDOWS) and not (after and after[-1].clear):
        best = max(left, key=lambda k: judge.odds(known + grams[len(recorded) + k]).non_centrality)
        known = known + grams[len(recorded) + best]
        left.remove(best)
        chosen.append(best)
        after.append(judge.odds(known))
    return Proposal(claim, tuple(pool[k] for k in chosen), before, tuple(after), len(robot.markers))


def evidence(
    robot: Robot,
    claim: Claim,
    recorded: Sequence[Trial],
    body: Float[np.ndarray, "9"] | None = None,
    *,
    noise: float = 1.0,
    native: bool = True,
) -> float:
    """Non-centrality of an effect of this size against none at all: far above 10 it is seen in these windows.

    Arguments and InfeasibleError as `separating`; rivals play no part.
    """
    tried = Hypotheses((_own(robot, claim),), (), ())
    gram = _grams(Mechanism(robot, native=native), tried, recorded, body, noise).sum(axis=0)
    scored = list(tried.direct[0].scored)
    left = eliminated(gram, np.arange(BODY), BODY + np.arange(len(scored)))
    theta = np.array(claim.theta)[scored]
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
    tried: Hypotheses
    own: int
    rivals: tuple[int, ...]
    theta: np.ndarray
    columns: int

    def odds(self, gram: np.ndarray) -> Odds:
        """Against the rival that imitates most."""
        ends = np.cumsum([len(h.scored) for h in self.tried.direct])
        places = [BODY + np.arange(end - len(h.scored), end) for h, end in zip(self.tried.direct, ends, strict=True)]
        found: list[tuple[float, str]] = []
        for rival in self.rivals:
            outside = np.concatenate([np.arange(BODY), places[rival]])
            left = eliminated(gram, outside, places[self.own])
            found.append((max(0.0, float(self.theta @ left @ self.theta)), self.tried.direct[rival].effect.id))
        least, id = min(found)
        probability = float(ncx2.sf(2 * ENOUGH, df=len(self.theta), nc=least)) if least > 0 else 0.0
        return Odds(id, least, probability)


def _pair(robot: Robot, claim: Claim) -> tuple[Hypotheses, int, tuple[int, ...]]:
    """The claim and its rivals alone, with their places."""
    nearest = _own(robot, claim)
    every = [h for h in hypotheses(robot).direct if len(h.scored)]
    rivals = [h for h in every if h.effect.id in claim.rivals and h.effect.id != claim.id]
    if not rivals:
        raise InfeasibleError(f"Odds for {claim.id}: nothing of what may stand in its place has a score.")
    tried = Hypotheses((nearest, *rivals), (), ())
    return tried, 0, tuple(range(1, 1 + len(rivals)))


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
    mechanism: Mechanism, tried: Hypotheses, trials: Sequence[Trial], body: np.ndarray | None, noise: float
) -> Float[np.ndarray, "W G G"]:
    """What each window would say of body and effects, its own unknowns eliminated."""
    robot = mechanism.robot
    shared = robot.nominal.vector if body is None else body
    states = States(
        np.array([one.start.position for one in trials]),
        np.array([one.start.rotation for one in trials]),
        np.zeros((len(trials), 6)),
    )
    t = np.arange(0.0, 10.0 + 1e-9, 1 / RATE)
    recordings = tuple(_recording(robot, one, t, f"trial {k + 1}") for k, one in enumerate(trials))
    sparser = np.sqrt(RATE / 100.0)
    likelihood = Likelihood(
        mechanism,
        recordings,
        states,
        noise * sparser * robot.sensors.marker_noise,
        noise * robot.sensors.encoder_resolution,
    )
    ends = np.full(len(trials), t[-1])
    simulation = simulate(likelihood, Point(shared, states), ends, QUICK)
    if simulation is None:
        raise InfeasibleError("Odds: the body cannot move, or a trial's motion breaks down.")
    found = window_grams(Scorer(mechanism, tried), likelihood, simulation)
    return np.array([one.gram for one in found])


def _recording(robot: Robot, trial: Trial, t: np.ndarray, name: str) -> Recording:
    """Stamps and lengths as they would be; what markers would show plays no part in information."""
    markers = np.zeros((len(t), len(robot.markers), 3))
    window = Window(name, Role.IDENTIFY, t, markers, np.broadcast_to(trial.lengths, (len(t), robot.n)), None)
    return Recording(window, 0.0, t, markers, trial.lengths, trial.lengths)
