"""The part of each window that a fit uses: first some seconds, where no phase can slip, then the whole length.

With physics missing, a fit of whole windows can lock in at a slipped phase, and is slow and meaningless; the first
3 s are followed by nearly any model. So what is missing is looked for there first, wherever the model as it is does not
follow the whole.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.data.records import PARAMETER_NAMES, Window
from fidim_lab.identification.mle.fit import Fit, fit
from fidim_lab.identification.mle.judge import remainder
from fidim_lab.identification.mle.trajectories.likelihood import Likelihood, Point
from fidim_lab.identification.mle.trajectories.normal import Prior
from fidim_lab.identification.mle.trajectories.optimise import FINAL, ON_TRIAL, Effort, optimise
from fidim_lab.identification.mle.trajectories.recordings import FollowedSamples
from fidim_lab.identification.mle.trajectories.stages import FAR_PRIOR, HORIZONS, Journey, grow
from fidim_lab.mismatch.fitting.sprung import AT_LAST, begins_anew, bounded, carried_on, grown, likelihood_with
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.model.sensitivity.grid import FINE, QUICK
from fidim_lab.model.slots import Effect

IN_PASSING = Effort(resolution=QUICK, promise=0.1, rounds=12, damping=1e-6, crawl=SHARED.crawl)
"""a short look at one of many models"""
IN_FULL = replace(ON_TRIAL, creep=0.1, crawl=SHARED.crawl, idle=0.3)
"""whole windows for the first time: what gets nowhere is given up"""
BESIDE = Effort(resolution=FINE, promise=1e-2, rounds=10, damping=1e-6)
"""whole windows that are followed already: to a tenth of a standard deviation"""


@dataclass(frozen=True, eq=False)
class Ground:
    """The data of every fit: recordings, cut to the fitted length, and prior knowledge of the body."""

    likelihood: Likelihood
    """of the model as it is"""
    known: Prior
    """of the body's nine, in force for short recordings, which whole ones weaken; and behind them of the geometry that
    its survey leaves open, always in force"""
    whole: bool
    """recordings at their whole length"""

    @property
    def geometry(self) -> tuple[Effect, ...]:
        """Geometry that the survey leaves open: the last effects of every model."""
        return self.likelihood.mechanism.effects

    def prior(self, mean: np.ndarray, sd: np.ndarray) -> Prior:
        """In force at the optimum, θ with these means and standard deviations between body and geometry."""
        factor, (before, behind) = FAR_PRIOR if self.whole else 1.0, (self.known.mean, self.known.sd)
        means = np.concatenate([before[:BODY], mean, before[BODY:]])
        sds = np.concatenate([factor * behind[:BODY], factor * sd, behind[BODY:]])
        return Prior(means, sds, firm=BODY + len(mean))

    def as_far_as(self, found: Fit) -> "Ground":
        """The part of the recordings to which that was fitted."""
        return Ground(replace(self.likelihood, recordings=found.likelihood.recordings), self.known, whole=False)


def short_fit(mechanism: Mechanism, windows: Sequence[Window], theta_sd: np.ndarray | None = None) -> Fit:
    """The fit of the first seconds of all windows.

    theta_sd: of the geometry that the mechanism leaves open. Raises RefusedError where no window can be fitted at all.
    """
    shorter = [shortened(window, HORIZONS[2]) for window in windows]
    found = fit(mechanism, shorter, theta_sd=theta_sd)
    return replace(found, prior=Prior(found.prior.mean, found.plausible, firm=BODY))


def ground_of(found: Fit) -> Ground:
    """The ground on which a short fit of the baseline stands."""
    return Ground(found.likelihood, Prior(found.prior.mean, found.plausible, firm=BODY), whole=False)


def whole_ground(short: Ground, windows: Sequence[Window]) -> Ground:
    """The same windows at their whole length."""
    whole = {window.id: window for window in windows}
    recordings = tuple(_recorded(recording, whole[recording.window.id]) for recording in short.likelihood.recordings)
    return replace(short, likelihood=replace(short.likelihood, recordings=recordings), whole=True)


def settle(
    ground: Ground,
    donor: Fit,
    mechanism: Mechanism,
    start: Point,
    prior: Prior,
    free: np.ndarray,
    wanted: float = np.inf,
) -> Fit | None:
    """The fit of a model from a start near its optimum; None where it does not get there.

    prior: as `ground.prior` gives it. free: which shared parameters move. wanted: the sum of squares above which the
    fit is of no use, so that it may be given up.
    """
    prior = bounded(prior, mechanism)
    if begins_anew(mechanism, donor):
        if donor.excess < SHARED.near and _is_whole(ground, donor):
            found = carried_on(ground.likelihood, donor, mechanism, start, prior, free)
        else:
            found = grown(ground.likelihood, donor, mechanism, prior, free)
        return None if found is None else as_fit(donor, *found, prior)
    likelihood = likelihood_with(ground.likelihood, mechanism, start.shared)
    if ground.whole and not _is_whole(ground, donor):
        nearby = prior.loosened(1 / FAR_PRIOR)
        in_full = replace(IN_FULL, hopeless=SHARED.hopeless * donor.noise_ratio**2)
        last = replace(AT_LAST if mechanism.springs else in_full, wanted=wanted)
        journey = grow(likelihood, start, nearby, free, HORIZONS[2:], last, once=donor.excess >= SHARED.near)
    else:
        effort = replace(BESIDE if ground.whole else IN_PASSING, wanted=wanted)
        ends = np.minimum(donor.journey.ends, [recording.end for recording in likelihood.recordings])
        optimum = optimise(likelihood, start, ends, prior, effort, free)
        journey = None if optimum is None else replace(donor.journey, optimum=optimum, ends=ends)
    return None if journey is None else as_fit(donor, likelihood, journey, prior)


def _is_whole(ground: Ground, donor: Fit) -> bool:
    """Whether the donor has followed the same recordings, so that nothing can get lost any more on the way."""
    there = [recording.end for recording in donor.likelihood.recordings]
    return there == [recording.end for recording in ground.likelihood.recordings] and not donor.journey.lost


def nearer(found: Fit, seconds: float) -> Fit | None:
    """The same model fitted to so many seconds only."""
    recordings = tuple(recording.until(seconds) for recording in found.likelihood.recordings)
    likelihood = replace(found.likelihood, recordings=recordings)
    ends = np.array([recording.end for recording in recordings])
    free = np.ones(len(found.values), dtype=bool)
    optimum = optimise(likelihood, found.journey.optimum.point, ends, found.prior, FINAL, free)
    return None if optimum is None else as_fit(found, likelihood, Journey(optimum, ends, {}, ()), found.prior)


def as_fit(donor: Fit, likelihood: Likelihood, journey: Journey, prior: Prior) -> Fit:
    """A fit like `donor`, of another model or of another length."""
    effects = likelihood.mechanism.effects
    theta = [str(getattr(p, "name", p)) for effect in effects for p in effect.parameters]
    simulation = journey.optimum.simulation
    return replace(
        donor,
        likelihood=likelihood,
        journey=journey,
        remainders=tuple(remainder(likelihood, simulation, w) for w in range(len(likelihood.recordings))),
        prior=prior,
        plausible=prior.sd,
        names=(*PARAMETER_NAMES, *theta),
    )


def shortened(window: Window, seconds: float) -> Window:
    """The rows of a window up to so many seconds after its first marker."""
    seen = np.flatnonzero(np.isfinite(window.markers).any(axis=(1, 2)))
    if not len(seen):
        return window
    last = int(np.searchsorted(window.t, window.t[seen[0]] + seconds + 1e-9, side="right"))
    return window.of_rows(slice(last))


def _recorded(short: FollowedSamples, window: Window) -> FollowedSamples:
    """The whole recording of which `short` is the first part."""
    rows = np.flatnonzero(np.isfinite(window.markers).any(axis=(1, 2)))
    t = window.t[rows] - window.t[rows[0]]
    return replace(short, window=window, t=t, markers=window.markers[rows])
