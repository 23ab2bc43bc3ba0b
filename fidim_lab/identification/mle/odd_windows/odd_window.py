"""One window with another body or force than all others: without it the rest is explained.

A payload left on the platform, a cable that touched, a window of another robot. Where the fit misses, each window is
left out in turn to first order; where the others then come down to their noise without one of them, and at least three
others agree on it, the fit is made again without it. Missing physics is in every window, and leaves none to blame. The
geometry is asked afterwards: opened wide it bends around such a window; only where little is missed it comes first, and
the window goes where it costs the others as much even so. Where the fit does not miss, because body and geometry have
bent around a window already, that window costs the others more χ² than its samples have noise.

The window may be innocent: markers that do not show the pose leave its first orientation to a guess, and from a wrong
one a search may end in a place of its own. So it is followed anew with the body of the others, and taken in again where
that explains it. A fit that misses by little keeps the window even so: a wrong clock, too, is explained better by fewer
windows.
"""

from dataclasses import replace

import numpy as np

from fidim_lab.errors import RefusedError
from fidim_lab.identification.mle import held_out
from fidim_lab.identification.mle.findings import MISFIT
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.judge import Remainder
from fidim_lab.identification.mle.spread import Quadratic
from fidim_lab.identification.mle.trajectories.likelihood import Point
from fidim_lab.identification.mle.warm_start import gone_on

FEWEST = 3
"""windows that must agree without it: two of three may be two that are alike in their error"""
SHARE = 0.5
"""of what is left above noise that must go with it, to first order, so that the fit is made again"""
COST = 4.5
"""standard deviations of χ² by which one window may cost the others more than its noise: in 30 campaigns of four
windows (`python -m benchmarks.spoilt --seed 77`) none costs more than 3.0, one of another body that a survey hides 6"""


def odd_window(found: Fit) -> str | None:
    """The id of a window that most of what is left goes with; None where nothing is left, or there is none such."""
    count = len(found.remainders)
    if count <= FEWEST:
        return None
    chi2 = np.array([_foretold(found, out) for out in range(count)])
    if found.explained:
        costs = np.array([_cost(found, found.remainders[out], chi2[out]) for out in range(count)])
        beyond = np.flatnonzero(costs > COST)  # a wrong clock, say, makes each window cost the others
        return found.likelihood.recordings[beyond[0]].window.id if len(beyond) == 1 else None
    left = [one / max(1, _dof(found, out)) for out, one in enumerate(chi2)]
    best = int(np.argmin(left))
    return found.likelihood.recordings[best].window.id if left[best] - 1 < SHARE * (found.excess - 1) else None


def costs_much(found: Fit, without: Fit, window: str) -> bool:
    """Whether a window is farther from what the others say than its noise allows."""
    ids = [recording.window.id for recording in found.likelihood.recordings]
    chi2 = sum(one.chi2 for one in without.remainders) / found.noise_ratio**2
    return _cost(found, found.remainders[ids.index(window)], chi2) > COST


def misses_much(found: Fit) -> bool:
    """Whether more than a little is missed: χ²/dof of `MISFIT` and beyond."""
    return found.excess >= MISFIT


def taken_in_again(whole: Fit, others: Fit) -> Fit | None:
    """The fit of all windows from that of all but one; None where the body of the others does not explain that one."""
    ids = [recording.window.id for recording in others.likelihood.recordings]
    states, ends = whole.journey.optimum.point.states, np.array([one.end for one in whole.likelihood.recordings])
    robot = whole.likelihood.mechanism.robot
    for w, recording in enumerate(whole.likelihood.recordings):
        if recording.window.id in ids:
            place = ids.index(recording.window.id)
            states = states.with_one(w, others.journey.optimum.point.states, place)
            ends[w] = others.journey.ends[place]
            continue
        try:
            anew = held_out.predict(others.likelihood.mechanism, others.values, recording, robot.sensors)
        except RefusedError:
            return None
        if anew.lost:
            return None
        states = states.with_one(w, anew.journey.optimum.point.states, 0)
        ends[w] = anew.journey.ends[0]
    begun = replace(whole, journey=replace(whole.journey, ends=ends, slack={}, lost=()))
    found = gone_on(begun, whole.likelihood, Point(others.values, states), whole.prior, whole.plausible)
    return found if found is not None and found.explained else None


def _foretold(found: Fit, out: int) -> float:
    """χ² of the other windows over their noise, after one step without this one."""
    kept = np.delete(np.arange(len(found.remainders)), out)
    quadratic = Quadratic.of(found.tables[kept], found.prior_rows)
    step = quadratic.step(np.ones(len(quadratic.gradient), dtype=bool), np.zeros(len(quadratic.gradient)))
    chi2 = sum(found.remainders[k].chi2 for k in kept) + float(quadratic.gradient @ step)
    return max(chi2, 0.0) / found.noise_ratio**2


def _dof(found: Fit, out: int) -> int:
    return sum(one.dof for k, one in enumerate(found.remainders) if k != out) - len(found.values)


def _cost(found: Fit, own: Remainder, others: float) -> float:
    """Standard deviations of χ²; others: their χ² without that window."""
    whole = sum(one.chi2 for one in found.remainders) / found.noise_ratio**2
    return (whole - others - own.dof) / np.sqrt(2 * max(1, own.dof))


def contradicts(window: str, before: Fit, after: Fit) -> str:
    """A sentence for a person."""
    return (
        f"Window {window}: its motion contradicts that of the other {len(after.remainders)}, which one body explains "
        f"(χ²/dof {after.chi2_per_dof:.2f}, with it {before.chi2_per_dof:.3g}). Another body or payload, a touch, or a "
        "cable that slipped there."
    )
