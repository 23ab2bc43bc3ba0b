"""Held-out windows: only their initial state is fitted, the shared parameters are held."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.data.records import Body, Sensors
from fidim_lab.errors import RefusedError
from fidim_lab.identification.mle.fit import likelihood_of
from fidim_lab.identification.mle.judge import Remainder, remainder
from fidim_lab.identification.mle.starts.start import Guess, first_guesses
from fidim_lab.identification.mle.trajectories.likelihood import Likelihood, Point
from fidim_lab.identification.mle.trajectories.normal import Prior
from fidim_lab.identification.mle.trajectories.optimise import ON_TRIAL, Effort
from fidim_lab.identification.mle.trajectories.recordings import FollowedSamples
from fidim_lab.identification.mle.trajectories.stages import Journey, grow
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.model.sensitivity.grid import QUICK
from fidim_lab.model.sensitivity.integrate import States
from fidim_lab.model.sensitivity.starts import spreads

HORIZONS = (0.5, 3.0)
"""s; the parameters are known, so the strides may be long"""
FORETOLD = replace(ON_TRIAL, creep=0.1, idle=0.1)
"""what is far off is not followed to the last digit, nor what the window hardly tells"""
GLANCE = replace(FORETOLD, resolution=QUICK, idle=1.0)
"""the same, to choose among starts"""
GROWING, AT_ONCE = (FORETOLD, HORIZONS), (replace(GLANCE, promise=0.3), (1e6,))
"""how hard to try, and by which horizons"""


@dataclass(frozen=True, eq=False)
class HeldOutPrediction:
    """One window as the model predicts it from its own initial state."""

    journey: Journey
    """of all windows that were predicted together"""
    remainder: Remainder
    likelihood: Likelihood
    """the same of what was recorded"""
    place: int = 0
    """of this one among them"""

    @property
    def lost(self) -> bool:
        """Whether its end could not be followed; it is then predicted as far as it could."""
        return self.place in self.journey.lost


def predict(
    mechanism: Mechanism, shared: np.ndarray, recording: FollowedSamples, sensors: Sensors, guess: Guess | None = None
) -> HeldOutPrediction:
    """Fit the initial state of one recording with the shared parameters held.

    guess: where to begin, found from the first samples unless given. Raises RefusedError, naming the window, where its
    lengths contradict its markers, or where the motion cannot be simulated at all.
    """
    guesses = None if guess is None else [guess]
    found = predict_all(mechanism, shared, [recording], sensors, guesses)[0]
    if isinstance(found, RefusedError):
        raise found
    return found


def predict_all(
    mechanism: Mechanism,
    shared: np.ndarray,
    recordings: Sequence[FollowedSamples],
    sensors: Sensors,
    guesses: Sequence[Guess | RefusedError] | None = None,
    *,
    near: bool = False,
) -> tuple[HeldOutPrediction | RefusedError, ...]:
    """The same for many recordings, far sooner than one by one; for each its prediction, or why there is none.

    What they share is held, so each is fitted as if it were alone: one that cannot be followed leaves the others be.
    near: the guesses are about right, and χ² is asked for to a unit only: full length at once.
    """
    if guesses is None:
        guesses = first_guesses(mechanism, Body.from_vector(shared[:BODY]), recordings, shared[BODY:])
    begun = [(r, g) for r, g in zip(recordings, guesses, strict=True) if isinstance(g, Guess)]
    found = iter(_predicted(mechanism, shared, begun, sensors, near=near))
    return tuple(next(found) if isinstance(guess, Guess) else guess for guess in guesses)


def _predicted(
    mechanism: Mechanism,
    shared: np.ndarray,
    begun: Sequence[tuple[FollowedSamples, Guess]],
    sensors: Sensors,
    *,
    near: bool = False,
) -> list[HeldOutPrediction | RefusedError]:
    if not begun:
        return []
    recordings = tuple(recording for recording, _ in begun)
    likelihood = likelihood_of(mechanism, shared, recordings, [guess for _, guess in begun], sensors)
    start = _start(likelihood, shared)
    journey = None if start is None else _fitted(likelihood, shared, start, *(AT_ONCE if near else GROWING))
    if journey is not None:
        return [_prediction(likelihood, journey, w) for w in range(len(begun))]
    if len(begun) == 1:
        says = f"Window {recordings[0].window.id}: its motion cannot be simulated with these parameters."
        return [RefusedError(says)]
    return [_predicted(mechanism, shared, [one], sensors, near=near)[0] for one in begun]


def _fitted(
    likelihood: Likelihood,
    shared: np.ndarray,
    states: States,
    effort: Effort = FORETOLD,
    horizons: tuple[float, ...] = HORIZONS,
) -> Journey | None:
    nothing = Prior(mean=shared, sd=np.full(len(shared), np.inf))
    held = np.zeros(len(shared), dtype=bool)
    return grow(likelihood, Point(shared, states), nothing, held, horizons, effort)


def _start(likelihood: Likelihood, shared: np.ndarray) -> States | None:
    """Where to begin; None where no motion can be simulated.

    States of which nothing is known before (a phase) may be found or missed: of several values, that with which the
    first seconds of each window are followed best.
    """
    guesses, spread = likelihood.guesses, spreads(likelihood.mechanism)
    own = [state for effect in likelihood.mechanism.effects for state in effect.extra_states]
    if not np.isinf(spread).any():
        return guesses
    near = replace(likelihood, recordings=tuple(recording.until(HORIZONS[-1]) for recording in likelihood.recordings))
    nowhere = np.zeros((len(guesses.positions), len(spread)))
    most = max(len(state.tries) for state in own)
    tried = [np.array([state.tries[k % len(state.tries)] for state in own]) for k in range(most)]
    begins = [replace(guesses, astray=np.where(np.isinf(spread), values, nowhere)) for values in tried]
    journeys = [journey for begin in begins if (journey := _fitted(near, shared, begin, GLANCE)) is not None]
    if not journeys:
        return None
    chosen = journeys[0].optimum.point.states
    for w in range(len(near.recordings)):
        best = min((_prediction(near, journey, w) for journey in journeys), key=_misfit)
        chosen = chosen.with_one(w, best.journey.optimum.point.states, w)
    return chosen


def _prediction(likelihood: Likelihood, journey: Journey, w: int) -> HeldOutPrediction:
    return HeldOutPrediction(journey, remainder(likelihood, journey.optimum.simulation, w), likelihood, w)


def _misfit(found: HeldOutPrediction) -> tuple[float, float]:
    """The one that follows longest is the best, and of those the closest."""
    return -found.remainder.dof, found.remainder.chi2
