"""Windows fitted by their initial states alone, with the body held: how well does this motion fit that body?"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fidim_lab.data.records import Window
from fidim_lab.errors import RefusedError
from fidim_lab.identification.mle import held_out
from fidim_lab.identification.mle.fit import Fit, likelihood_of
from fidim_lab.identification.mle.judge import Remainder, remainder
from fidim_lab.identification.mle.starts.start import Guess
from fidim_lab.identification.mle.trajectories.likelihood import Likelihood, Point, simulate
from fidim_lab.identification.mle.trajectories.normal import Prior
from fidim_lab.identification.mle.trajectories.optimise import ON_THE_WAY, optimise
from fidim_lab.identification.mle.trajectories.recordings import prepare
from fidim_lab.identification.mle.trajectories.stages import grow
from fidim_lab.mismatch.fitting.sprung import guesses_of
from fidim_lab.model.sensitivity.grid import QUICK


def followed(found: Fit, window: Window, seconds: float) -> tuple[Remainder, float] | None:
    """The residual of a window of which only the first seconds are fitted, and the noise (m); None where that fails."""
    prepared = _prepared(found, [window])
    if prepared is None:
        return None
    likelihood, start, prior, held = prepared
    optimum = optimise(likelihood, start, np.array([seconds]), prior, ON_THE_WAY, held)
    if optimum is None:
        return None
    whole = simulate(likelihood, optimum.point, np.array([likelihood.recordings[0].end]), QUICK)
    return None if whole is None else (remainder(likelihood, whole, 0), likelihood.noise)


def left_of(found: Fit, windows: Sequence[Window]) -> tuple[Remainder, ...] | None:
    """The residuals of whole windows; None where one cannot be used."""
    prepared = _prepared(found, windows)
    if prepared is None:
        return None
    likelihood, start, prior, held = prepared
    journey = grow(likelihood, start, prior, held, held_out.HORIZONS)
    if journey is None:
        return None
    return tuple(remainder(likelihood, journey.optimum.simulation, w) for w in range(len(windows)))


def _prepared(found: Fit, windows: Sequence[Window]) -> tuple[Likelihood, Point, Prior, np.ndarray] | None:
    mechanism = found.likelihood.mechanism
    try:
        recordings = tuple(prepare(window, mechanism.robot) for window in windows)
    except RefusedError:
        return None
    guesses = guesses_of(mechanism, found.values, recordings)
    known = [guess for guess in guesses if isinstance(guess, Guess)]
    if len(known) < len(guesses):
        return None
    likelihood = likelihood_of(mechanism, found.values, recordings, known, mechanism.robot.sensors)
    known_of = found.likelihood
    likelihood = replace(likelihood, noise=known_of.noise, resolution=known_of.resolution)
    prior = Prior(mean=found.values, sd=np.full(len(found.values), np.inf))
    return likelihood, Point(found.values, likelihood.guesses), prior, np.zeros(len(found.values), dtype=bool)
