"""The growing horizon: 0.3 s, 1 s, 3 s, 10 s, … so that no window can lock in a slipped cycle.

From CAD values 20 % off a 10 s window is thirty cycles long and has many optima; its first 0.3 s have one. After every
horizon the fit is looked at: a window whose end the simulation misses by the size of the motion has lost its phase,
and the way there is taken again in smaller strides; one that is lost even so is used only as far as it was found, and
is tried again when the others have shown the parameters. A window in which a cable goes slack ends there: the model
says nothing of what follows.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from fidim_lab.arrays import motion_rms
from fidim_lab.data.records import Body
from fidim_lab.identification.equations.consistency import can_exist
from fidim_lab.identification.mle.trajectories.likelihood import Likelihood, Point, Simulation, simulate
from fidim_lab.identification.mle.trajectories.normal import NearBody, Prior
from fidim_lab.identification.mle.trajectories.optimise import (
    ASTRAY,
    FINAL,
    ON_THE_WAY,
    ROUGH,
    Effort,
    Ending,
    Optimum,
    carry_on,
    optimise,
)
from fidim_lab.identification.mle.trajectories.per_window import optimise_apart
from fidim_lab.model.sensitivity.grid import QUICK

HORIZONS = (0.3, 1.0, 3.0, 10.0)
"""s; then always three times as far"""
NEARLY = 1.3
"""a horizon nearer than this to the end is the end"""
EARLY = 3.1
"""s; up to here the weak prior on the body counts fully, beyond a hundredth of it"""
FAR_PRIOR = 10.0
LOST = 0.7
"""of the motion's own rms: a window's last quarter that is missed by more has lost its phase"""
STROLL = 0.2
"""of the pace of a fit that misses more than noise: what one that hardly does keeps up on its way"""
FIRST_ROUNDS = 6
"""iterations on a grid that is fine enough for the way, after which it is seen whether a window is lost"""
LAST_PART = 0.25
FAINT = 5.0
"""times the marker noise: a smaller error is no lost phase, however faint the motion"""
SMALLEST_STRIDE = 1.4
"""ratio of horizons below which no smaller stride is tried"""
TRUSTED = 0.9
"""s; after shorter horizons the parameters are too vague to believe a tension of zero"""
CUTS, SAME = 4, 1e-3
"""how often a window's end may move, and by how much at least (s)"""
MARGIN = 0.02
"""s before a tension of zero: the model's zero is not exactly the cable's"""
SHORTEST = 0.2
"""s; a window that loses its tension earlier tells nothing"""


@dataclass(frozen=True, eq=False)
class Journey:
    """Where the growing horizon led."""

    optimum: Optimum
    ends: Float[np.ndarray, " W"]
    """how far each recording was used, s"""
    slack: dict[int, tuple[float, int]]
    """recordings that end where a cable goes slack: time (s since their begin) and cable (1-based)"""
    lost: tuple[int, ...]
    """recordings whose end the simulation cannot follow"""


@dataclass(frozen=True, eq=False)
class _Way:
    """One optimisation task while its horizon grows."""

    likelihood: Likelihood
    prior: Prior
    free: Bool[np.ndarray, " shared"]
    limits: Float[np.ndarray, " W"]
    slack: dict[int, tuple[float, int]]
    last: Effort
    """at full length; before, its pace is asked for too"""
    near: NearBody | None
    """a body near which to search until it is known well; None: anywhere"""
    lost: tuple[int, ...] = ()
    whole: tuple[int, ...] = ()
    """recordings that are used to their limit whatever the horizon"""
    near_until: float = EARLY
    """s, the horizon from which it is searched anywhere"""

    def effort(self, before: float) -> Effort:
        """How hard to try before full length, having come so far (s)."""
        pace = {"creep": self.last.creep, "crawl": self.last.crawl, "stroll": STROLL * self.last.crawl}
        return replace(ON_THE_WAY if before else ROUGH, **pace)

    def ends(self, horizon: float) -> Float[np.ndarray, " W"]:
        ends = np.minimum(self.limits, horizon)
        ends[list(self.whole)] = self.limits[list(self.whole)]
        return ends

    def optimise(self, start: Point, horizon: float, effort: Effort) -> Optimum | None:
        if not self.free.any():
            return optimise_apart(self.likelihood, start, self.ends(horizon), effort)
        return optimise(self.likelihood, start, self.ends(horizon), self._prior(horizon), effort, self.free)

    def carry_on(self, found: Optimum, horizon: float, effort: Effort) -> Optimum | None:
        """From where one of the same horizon has ended."""
        if not self.free.any():
            return self.optimise(found.point, horizon, effort)
        return carry_on(self.likelihood, found, self._prior(horizon), effort, self.free)

    def _prior(self, horizon: float) -> Prior:
        if self.near is not None and horizon < self.near_until:
            return self.prior.by_existing(self.near)
        return self.prior.loosened(1.0 if horizon < EARLY else FAR_PRIOR)


def grow(
    likelihood: Likelihood,
    start: Point,
    prior: Prior,
    free: Bool[np.ndarray, " shared"],
    horizons: tuple[float, ...] = HORIZONS,
    last: Effort = FINAL,
    *,
    once: bool = False,
    near: Body | None = None,
) -> Journey | None:
    """The optimum at full length, reached by growing horizons; None where not even the first can be simulated.

    last: how hard to try at full length, and at which pace on the way. once: windows that get lost on the way are not
    tried again. near: a body that can exist; the first horizons, which hardly determine one, are searched for bodies
    that can exist, too.
    """
    limits = np.array([recording.end for recording in likelihood.recordings])
    nearby = None if near is None else NearBody(near)
    begun = _Way(likelihood, prior, free, limits, {}, last, nearby, near_until=min(EARLY, float(limits.max())))
    way, optimum = _grown(begun, start, horizons)
    if optimum is None:
        return None
    if optimum.ending is Ending.STUCK and nearby is not None and not can_exist(optimum.point.body):
        way, optimum = _among_possible(begun, start, horizons, (way, optimum))
    journey = Journey(optimum, way.ends(np.inf), way.slack, way.lost)
    return journey if once or not free.any() else found_again(likelihood, journey, prior, free, horizons, last)


def found_again(
    likelihood: Likelihood,
    journey: Journey,
    prior: Prior,
    free: Bool[np.ndarray, " shared"],
    horizons: tuple[float, ...] = HORIZONS,
    last: Effort = FINAL,
) -> Journey:
    """Lost windows grown once more, now that the others have shown the parameters; the better of both ways.

    They have not where the model misses them by far, too.
    """
    optimum, ends = journey.optimum, journey.ends
    lost = np.isin(np.arange(len(ends)), journey.lost)
    if not lost.any() or lost.all() or optimum.misfit > ASTRAY:
        return journey
    kept = tuple(int(w) for w in np.flatnonzero(~lost))
    slack = {w: when for w, when in journey.slack.items() if not lost[w]}
    limits = np.where(lost, [recording.end for recording in likelihood.recordings], ends)
    way = _Way(likelihood, prior, free, limits, slack, last, near=None, whole=kept)
    way, found = _grown(way, optimum.point, horizons)
    if found is None or len(way.lost) >= len(journey.lost):
        return journey
    return Journey(found, way.ends(np.inf), way.slack, way.lost)


def _among_possible(
    begun: _Way, start: Point, horizons: tuple[float, ...], stuck: tuple[_Way, Optimum]
) -> tuple[_Way, Optimum]:
    """The way begun once more, to full length among bodies that can exist, where that settles and is better.

    Along what the data do not determine a fit may run to bodies that cannot, where no derivative holds. Where it does
    so even from the best of those that can, this one is taken: the data do not tell others from it.
    """
    way, found = _grown(replace(begun, near_until=np.inf), start, horizons)
    if found is None or len(way.lost) > len(stuck[0].lost):
        return stuck
    way = replace(way, near_until=begun.near_until)
    free = way.optimise(found.point, float(way.limits.max()), way.last)
    ended = [one for one in (free, found) if one is not None and one.ending.settled and one.cost < stuck[1].cost]
    return (way, ended[0]) if ended else stuck


def _grown(way: _Way, start: Point, horizons: tuple[float, ...]) -> tuple[_Way, Optimum | None]:
    """From the shortest horizon to the end; None where one of them cannot be simulated."""
    stops = stages(float(way.limits.max()), horizons)
    before, point, optimum = 0.0, start, None
    for stop in stops:
        last = stop == stops[-1]
        effort = way.last if last else way.effort(before)
        way, found = _advance(way, point, before, stop, effort)
        if found is None:
            return way, None
        optimum, point, before = found, found.point, stop
    return way, optimum


def stages(longest: float, horizons: tuple[float, ...] = HORIZONS) -> tuple[float, ...]:
    """The horizons for recordings of at most so many seconds; the last one holds them whole."""
    found = list(horizons)
    while found[-1] * NEARLY < longest:
        found.append(3 * found[-1])
    return (*(h for h in found if h * NEARLY < longest), longest)


def _advance(way: _Way, start: Point, before: float, stop: float, effort: Effort) -> tuple[_Way, Optimum | None]:
    """From one horizon to the next, in smaller strides where a window gets lost."""
    promise = max(effort.promise, ON_THE_WAY.promise)
    rough = replace(effort, rounds=FIRST_ROUNDS, resolution=QUICK, promise=promise, hopeless=np.inf)
    found = way.optimise(start, stop, rough)
    astray = _astray(way, found, before, stop)
    if not astray.any():
        if found is not None and effort.resolution != QUICK and found.misfit < ASTRAY:
            found = way.optimise(found.point, stop, effort)
        elif found is not None and found.ending is Ending.EXHAUSTED:
            found = way.carry_on(found, stop, replace(effort, resolution=QUICK))
        return _cut_slack(way, found, stop, effort)
    slackening = _slackening(way, start, before, stop, astray)
    if slackening is not None:
        return _advance(slackening, start, before, stop, effort)
    between = float(np.sqrt(before * stop)) if before > 0 else stop / 2
    if stop / between > SMALLEST_STRIDE and between > HORIZONS[0] / 2:
        way, halfway = _advance(way, start, before, between, way.effort(between))
        if halfway is None:
            return way, None
        return _advance(way, halfway.point, between, stop, effort)
    if before == 0:
        return way, None if found is None else way.carry_on(found, stop, effort)
    way = replace(
        way,
        limits=np.where(astray, np.minimum(way.limits, before), way.limits),
        lost=(*way.lost, *(int(w) for w in np.flatnonzero(astray))),
    )
    return _cut_slack(way, way.optimise(start, stop, effort), stop, effort)


def _astray(way: _Way, found: Optimum | None, before: float, stop: float) -> Bool[np.ndarray, " W"]:
    """Which windows have lost their phase; those that grew, if nothing could be simulated."""
    grown = way.ends(stop) > way.ends(before) if before > 0 else np.ones(len(way.limits), dtype=bool)
    if found is None:
        return grown
    return grown & np.array([is_lost(way.likelihood, found.simulation, w) for w in range(len(grown))])


def _slackening(way: _Way, start: Point, before: float, stop: float, astray: Bool[np.ndarray, " W"]) -> _Way | None:
    """The way with those lost windows ended in which the motion found so far, carried on, lets a cable go slack."""
    if before < TRUSTED:
        return None
    further = simulate(way.likelihood, start, way.ends(stop), QUICK)
    if further is None:
        return None
    slack, limits = dict(way.slack), way.limits.copy()
    for w in (int(w) for w in np.flatnonzero(astray)):
        trajectories, place = further.trajectory_of(w)
        first = trajectories.first_slack(place)
        if first is not None and before + MARGIN < first[0] < limits[w]:
            slack[w], limits[w] = first, first[0] - MARGIN
    return replace(way, slack=slack, limits=limits) if len(slack) > len(way.slack) else None


def is_lost(likelihood: Likelihood, simulation: Simulation, w: int) -> bool:
    """Whether the simulation misses the last part of a recording by as much as the motion itself."""
    recording, end = likelihood.recordings[w], simulation.ends[w]
    use, seen = recording.seen_until(end)
    left = np.full(seen.shape, np.nan)
    left[seen] = likelihood.coloured(w, simulation.residuals[w].markers, seen)
    late = recording.t[use] >= (1 - LAST_PART) * end
    if not seen[late].any():
        return False
    missed = float(np.sqrt(np.nanmean(left[late] ** 2)))
    return missed > LOST * motion_rms(recording.markers[use]) and missed > FAINT * likelihood.noise


def _cut_slack(way: _Way, found: Optimum | None, stop: float, effort: Effort) -> tuple[_Way, Optimum | None]:
    """End windows where a cable goes slack, and fit again without what follows until that moves no end any more."""
    for _ in range(CUTS):
        if found is None or (stop < TRUSTED and effort is not way.last):
            break
        slack, limits = dict(way.slack), way.limits.copy()
        for w in range(len(limits)):
            trajectories, place = found.simulation.trajectory_of(w)
            first = trajectories.first_slack(place)
            if first is not None and first[0] < found.simulation.ends[w] - SAME:
                slack[w], limits[w] = first, max(first[0] - MARGIN, SHORTEST)
        if np.array_equal(limits, way.limits):
            break
        way = replace(way, limits=limits, slack=slack)
        found = way.optimise(found.point, stop, effort)
    return way, found
