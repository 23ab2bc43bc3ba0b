"""An unknown wrench fitted jointly with body, effects and window starts."""

from dataclasses import replace

import numpy as np

from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.judge import remainder
from fidim_lab.identification.mle.trajectories.likelihood import Likelihood, Point
from fidim_lab.identification.mle.trajectories.normal import Prior
from fidim_lab.identification.mle.trajectories.optimise import FINAL, Effort, optimise
from fidim_lab.identification.mle.trajectories.stages import FAR_PRIOR, Journey, grow
from fidim_lab.mismatch.unknown_force.latent import LatentForce
from fidim_lab.mismatch.unknown_force.thresholds import UNKNOWN_FORCE
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.model.sensitivity.grid import FINE, QUICK
from fidim_lab.model.sensitivity.starts import tied

JOINTLY = Effort(resolution=FINE, promise=0.1, rounds=15, damping=1e-6, idle=3.0)
"""to a third of a standard deviation: beyond, a wrench without a name creeps along what the data do not tell"""


def near(base: Fit, seconds: float) -> tuple[Likelihood, Journey] | None:
    """The model of a fit, fitted anew to the first seconds of its windows; None where that cannot be done."""
    likelihood = replace(base.likelihood, recordings=tuple(base.likelihood.recordings))
    ends = np.minimum(np.array([recording.end for recording in likelihood.recordings]), seconds)
    free = np.ones(len(base.values), dtype=bool)
    start = Point(base.values, base.journey.optimum.point.states)
    optimum = optimise(likelihood, start, ends, base.prior, FINAL, free)
    return None if optimum is None else (likelihood, Journey(optimum, ends, {}, ()))


def fitted(base: Fit, donor: Point, latent: LatentForce, seconds: float) -> Fit | None:
    """The base with the latent force added; None where the motion cannot be simulated.

    donor: shared parameters of the base and states from which to start, known to be good for so many seconds.
    """
    known = base.likelihood.mechanism
    start = latent.start
    theta = [*donor.shared[BODY:].tolist(), *start.tolist()]
    mechanism = Mechanism(known.robot, (*known.effects, latent), theta, native=known.native)
    likelihood = replace(base.likelihood, mechanism=mechanism)
    ones = np.ones(len(start))
    prior = Prior(np.append(base.prior.mean, np.zeros(len(start))), np.append(base.prior.sd, ones))
    shared = np.append(donor.shared, start)
    states = donor.states if latent.phases is None else replace(donor.states, astray=latent.phases[:, np.newaxis])
    point = Point(shared, tied(mechanism, shared, states, likelihood.begins))
    free = np.ones(len(shared), dtype=bool)
    longest = max(recording.end for recording in likelihood.recordings)
    if seconds < longest:
        ends = np.minimum(np.array([recording.end for recording in likelihood.recordings]), seconds)
        first = optimise(likelihood, point, ends, prior, replace(JOINTLY, resolution=QUICK), free)
        if first is None:
            return None
        point = first.point
    # `grow` takes FAR_PRIOR times the standard deviations beyond its first seconds: these are meant as they stand
    strides = tuple(h for h in UNKNOWN_FORCE.joint_strides if h > seconds) or (longest,)
    journey = grow(likelihood, point, replace(prior, sd=prior.sd / FAR_PRIOR), free, strides, JOINTLY)
    if journey is None:
        return None
    simulation = journey.optimum.simulation
    return replace(
        base,
        likelihood=likelihood,
        journey=journey,
        remainders=tuple(remainder(likelihood, simulation, w) for w in range(len(likelihood.recordings))),
        prior=prior,
        plausible=np.append(base.plausible, ones),
        names=(*base.names, *(parameter.name for parameter in latent.parameters)),
    )
