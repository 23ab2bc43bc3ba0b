"""Windows that the fit has not seen: only their own initial state is fitted, the shared parameters are held."""

from dataclasses import dataclass

import numpy as np

from fidim_lab.data.records import Body, Sensors
from fidim_lab.errors import RefusedError
from fidim_lab.identification.mle.fit import likelihood_of
from fidim_lab.identification.mle.judge import Remainder, remainder
from fidim_lab.identification.mle.likelihood import Point
from fidim_lab.identification.mle.normal import Prior
from fidim_lab.identification.mle.recordings import Recording
from fidim_lab.identification.mle.stages import Journey, grow
from fidim_lab.identification.mle.start import Guess, first_guess
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import BODY

HORIZONS = (0.5, 3.0)
"""s; the parameters are known, so the strides may be long"""


@dataclass(frozen=True, eq=False)
class Prediction:
    """One window as the model predicts it from its own initial state."""

    journey: Journey
    remainder: Remainder


def predict(
    mechanism: Mechanism, shared: np.ndarray, recording: Recording, sensors: Sensors, guess: Guess | None = None
) -> Prediction:
    """Fit the initial state of one recording with the shared parameters held.

    guess: where to begin, found from the first samples unless given. Raises RefusedError, naming the window, where its
    lengths contradict its markers, or where the motion cannot be simulated at all.
    """
    body = Body.from_vector(shared[:BODY])
    guess = first_guess(mechanism, body, recording, shared[BODY:]) if guess is None else guess
    likelihood = likelihood_of(mechanism, shared, (recording,), [guess], sensors)
    guesses = likelihood.guesses
    nothing = Prior(mean=shared, sd=np.full(len(shared), np.inf))
    held = np.zeros(len(shared), dtype=bool)
    journey = grow(likelihood, Point(shared, guesses), nothing, held, HORIZONS)
    if journey is None:
        raise RefusedError(f"Window {recording.window.id}: its motion cannot be simulated with these parameters.")
    return Prediction(journey, remainder(likelihood, journey.optimum.simulation, 0))
