"""Cables as springs in a trajectory fit: which ones, their first stiffness, and what is known at a start.

A mechanism whose effects stretch cables is fitted with springs (`with_springs`), because only they are exact, and only
they hold where directions are soft (spec/model.md §6). Their twelve freedoms need priors: one marker shows three.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from fidim_lab.identification.mle.starts.start import OPENING
from fidim_lab.identification.mle.trajectories.likelihood import SpringPrior
from fidim_lab.identification.mle.trajectories.recordings import FollowedSamples
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import sprung
from fidim_lab.model.sensitivity.integrate import States
from fidim_lab.model.sensitivity.starts import quiet_springs
from fidim_lab.model.slots import Effect

TENSION = 0.25
"""of the mean tension: by so much that of a spring may be off that of a rigid cable at the start of a window"""
SOFTER = (3.0, 10.0)
"""times a proposed compliance. From 20 times too soft a fit finds the right one, from 4 times too stiff it may not:
the motion of stiff cables does not depend on how stiff they are"""
SLOWEST = 1e-4
"""m/s, the smallest uncertainty of a rate of stretch"""


def stretches(effect: Effect) -> bool:
    """Whether an effect makes cables give way under tension."""
    return type(effect).compliance is not Effect.compliance


def with_springs(mechanism: Mechanism) -> Mechanism:
    """The same mechanism with springs if an effect stretches cables; one without any effect of that kind is returned.

    A compliance that is absent starts from what its effect proposes (`start`).
    """
    if mechanism.springs or not any(stretches(effect) for effect in mechanism.effects):
        return mechanism
    theta = mechanism.theta.copy()
    for effect, part in _parts(mechanism):
        if stretches(effect) and not theta[part.start] > 0:
            theta[part] = getattr(effect, "start", theta[part])
    return Mechanism(mechanism.robot, mechanism.effects, theta.tolist(), native=mechanism.native, springs=True)


def starts(mechanism: Mechanism) -> tuple[Float[np.ndarray, " theta"], ...]:
    """θ from which a fit of the mechanism (as it was asked for) should be tried, the asked-for or proposed one first.

    More than one where a compliance is absent from it: then its size is unknown, and softer ones are tried too.
    """
    proposed = with_springs(mechanism).theta
    unknown = np.zeros(len(proposed), dtype=bool)
    for effect, part in _parts(mechanism):
        unknown[part.start : part.start + 1] = stretches(effect) and not mechanism.theta[part.start] > 0
    if not unknown.any():
        return (proposed,)
    return tuple(np.where(unknown, factor * proposed, proposed) for factor in (1.0, *SOFTER))


def _parts(mechanism: Mechanism) -> list[tuple[Effect, slice]]:
    ends = np.cumsum([len(effect.parameters) for effect in mechanism.effects])
    return [
        (effect, slice(int(end) - len(effect.parameters), int(end)))
        for effect, end in zip(mechanism.effects, ends, strict=True)
    ]


def spring_prior(
    mechanism: Mechanism, shared: Float[np.ndarray, " shared"], guesses: States, recordings: Sequence[FollowedSamples]
) -> SpringPrior | None:
    """What is known of the springs at the starts; None where there are none."""
    if not mechanism.springs:
        return None
    begins = np.array([recording.begin for recording in recordings])
    quiet = quiet_springs(mechanism, shared, guesses, begins)
    size = float(np.linalg.norm(mechanism.robot.gravity)) / mechanism.n
    sd = TENSION * np.maximum(np.abs(quiet.tensions).mean(axis=1, keepdims=True), size)
    sd = np.broadcast_to(sd, quiet.tensions.shape)
    rate_sd = np.maximum(sd * quiet.rate_per_tension, SLOWEST)
    weighed = np.array([_weighed(mechanism, recording) for recording in recordings])
    known = np.isfinite(weighed)
    return SpringPrior(np.where(known, weighed, quiet.tensions), sd, rate_sd)


def _weighed(mechanism: Mechanism, recording: FollowedSamples) -> Float[np.ndarray, " springs"]:
    """Tensions of the springs by load cells (the window's columns f1 …, N) at the begin, N/kg; NaN where unknown."""
    window, mass = recording.window, mechanism.robot.mass
    early = (window.t - window.t[0] >= recording.begin) & (window.t - window.t[0] <= recording.begin + OPENING[0])
    found = np.full(mechanism.n, np.nan)
    for k in range(mechanism.n):
        cell = window.further.get(f"f{k + 1}")
        if cell is not None and np.isfinite(cell[early]).any():
            found[k] = float(np.nanmean(cell[early])) / mass
    return found[list(sprung(mechanism))]
