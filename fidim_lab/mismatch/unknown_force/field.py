"""The fitted wrench along the fitted motions: the input of pictures and sentences."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.identification.mle.fit import Fit
from fidim_lab.mismatch.unknown_force.family import Courses
from fidim_lab.mismatch.unknown_force.latent import LatentForce
from fidim_lab.mismatch.unknown_force.thresholds import UNKNOWN_FORCE


@dataclass(frozen=True, eq=False)
class Field:
    """Samples of the unknown wrench; S in all, window after window."""

    windows: tuple[str, ...]
    """of each sample"""
    t: Float[np.ndarray, " S"]
    """s on the window's own clock"""
    places: Float[np.ndarray, "S 3"]
    """of P, m"""
    centres: Float[np.ndarray, "S 3"]
    """of the centre of mass, m"""
    velocities: Float[np.ndarray, "S 3"]
    """of the centre of mass, m/s"""
    spins: Float[np.ndarray, "S 3"]
    """rad/s"""
    forces: Float[np.ndarray, "S 3"]
    """N, world frame"""
    torques: Float[np.ndarray, "S 3"]
    """N m about the centre of mass, world frame"""

    @property
    def power(self) -> Float[np.ndarray, " S"]:
        """The power that it adds to the motion, W; negative where it brakes."""
        return (self.forces * self.velocities).sum(axis=1) + (self.torques * self.spins).sum(axis=1)

    def thinned(self, most: int) -> "Field":
        """At most so many samples, evenly taken: enough arrows for a picture."""
        step = max(1, -(-len(self.t) // most))
        take = slice(None, None, step)
        arrays = (self.places, self.centres, self.velocities, self.spins, self.forces, self.torques)
        return Field(self.windows[take], self.t[take], *(array[take] for array in arrays))


def field_of(found: Fit, latents: Sequence[LatentForce], only: int | None = None) -> Field:
    """The sum of the last effects of a fit, `latents`, along its motions; or of one of them (0-based)."""
    parts = [_window(found, latents, only, w) for w in range(len(found.likelihood.recordings))]
    ids = [recording.window.id for recording in found.likelihood.recordings]
    windows = tuple(id for id, part in zip(ids, parts, strict=True) for _ in range(len(part[0])))
    return Field(windows, *(np.concatenate(column) for column in zip(*parts, strict=True)))


def _window(found: Fit, latents: Sequence[LatentForce], only: int | None, w: int) -> tuple[np.ndarray, ...]:
    simulation, shared = found.journey.optimum.simulation, found.values
    phases = found.journey.optimum.point.states.astray
    trajectories, place = simulation.trajectory_of(w)
    use = np.flatnonzero(trajectories.grid.t <= simulation.ends[w] + 1e-9)[:: UNKNOWN_FORCE.field_every]
    t = trajectories.begins[place] + trajectories.grid.t[use]
    positions, rotations = trajectories.positions[place][use], trajectories.rotations[place][use]
    twists = trajectories.twists[place][use]
    arms = rotations @ shared[:3]
    wrench = np.zeros((len(t), 6))
    motion = (positions, rotations, twists)
    first = len(shared) - sum(len(latent.parameters) for latent in latents)
    for k, latent in enumerate(latents):
        last = first + len(latent.parameters)
        if only in (None, k) and latent.family is not None and latent.shape is not None:
            courses = Courses(latent.family, found.likelihood.mechanism, shared)
            shape = latent.shape_at(shared[first:last])
            time = t if phases is None or not latent.extra_states else latent.own_time(t, shape, phases[w, -1])
            directions, features = courses.at([x[np.newaxis] for x in (time[:, np.newaxis], *motion)], shape)
            table = latent.weights(shared[first:last]).reshape(directions.shape[-1], -1)
            wrench += np.einsum("sxd,dk,sk->sx", directions[0], table, features[0])
        first = last
    torques = wrench[:, 3:] - np.cross(arms, wrench[:, :3])
    velocities = twists[:, :3] + np.cross(twists[:, 3:], arms)
    return t, positions, positions + arms, velocities, twists[:, 3:], wrench[:, :3], torques
