"""Trajectories and cable lengths where they are asked for: at any times, or at thousands of poses.

A trajectory comes as a `Motion`; lengths of platforms at rest with their derivatives by the pose alone. What `starts`
gives beside (free twists, derivatives by everything that is shared) would cost ten times as much.
"""

import casadi as ca
import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline

from fidim_lab.arrays import Series
from fidim_lab.data.records import Motion
from fidim_lab.model.batch import from_rows, function, over_samples, rows
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity import markers
from fidim_lab.model.sensitivity.equations import slopes, sprung
from fidim_lab.model.sensitivity.integrate import States, Trajectories
from fidim_lab.model.sensitivity.starts import compiled_starts, quiet_springs

AXES = np.vstack([np.zeros(3), np.eye(3)])
"""origin and tips of the body's axes, as markers: quintic polynomials of these give pose and rotation"""


def sampled(mechanism: Mechanism, shared: np.ndarray, trajectories: Trajectories, window: int, times: Series) -> Motion:
    """Pose, twist and acceleration of one window at `times` (s from the grid's 0, which is also the motion's clock).

    Poses are good to 1e-9 m, twists to 1e-5 m/s, accelerations those of the equations of motion there.
    """
    index, weights = markers.hermite(trajectories.grid.t, times)
    tips = markers.between(markers.at_nodes(trajectories.only(window), AXES)[0], index, weights)
    positions = tips[:, 0]
    rotations = np.swapaxes(tips[:, 1:] - tips[:, :1], 1, 2)
    rotations = rotations @ (1.5 * np.eye(3) - 0.5 * np.swapaxes(rotations, 1, 2) @ rotations)  # polar, one Newton step
    twists = _cubic(trajectories, window, index, times)
    clock = trajectories.begins[window] + times
    moving = np.concatenate([twists, own_states(trajectories, window, times)], axis=1)
    sample = (clock[:, np.newaxis], positions, rotations, moving, trajectories.constants(shared)[window])
    found = over_samples(slopes(mechanism), len(times), *sample)[0]
    return Motion(t=times, positions=positions, rotations=rotations, twists=twists, accelerations=found[:, :6])


def own_states(trajectories: Trajectories, window: int, times: Series) -> Float[np.ndarray, "T extra"]:
    """Effects' own states of one window at `times`, by cubic splines through the nodes."""
    if trajectories.extra is None:
        return np.zeros((len(times), 0))
    return CubicSpline(trajectories.grid.t, trajectories.extra[window])(times)


def _cubic(trajectories: Trajectories, window: int, index: np.ndarray, times: Series) -> np.ndarray:
    """Twists by cubic Hermite polynomials from twists and accelerations at the nodes."""
    nodes, v, a = trajectories.grid.t, trajectories.twists[window], trajectories.accelerations[window]
    h = (nodes[index + 1] - nodes[index])[:, np.newaxis]
    s = (times - nodes[index])[:, np.newaxis] / h
    begin = (1 - s) ** 2 * ((1 + 2 * s) * v[index] + s * h * a[index])
    return begin + s**2 * ((3 - 2 * s) * v[index + 1] - (1 - s) * h * a[index + 1])


def lengths_at_rest(
    mechanism: Mechanism,
    shared: Float[np.ndarray, " shared"],
    positions: Float[np.ndarray, "K 3"],
    rotations: Float[np.ndarray, "K 3 3"],
    begins: Float[np.ndarray, " K"],
) -> tuple[Float[np.ndarray, "K n"], Float[np.ndarray, "K n 6"]]:
    """Lengths as `Starts.lengths` has them (m), and their derivatives by [δp; δφ]; NaN at singular poses.

    begins: s on each window's own clock. Springs are as quiet as they can be (`quiet_springs`).
    """
    compiled = mechanism.compiled("sensitivity: lengths", _compile)
    count = len(positions)
    still, springs, astray = (np.zeros((count, compiled.numel_in(k))) for k in (3, 5, 6))
    if sprung(mechanism):
        springs = quiet_springs(mechanism, shared, States(positions, rotations, still), begins).tensions
    given = (begins[:, np.newaxis], positions, rotations, still, shared, springs, astray)
    lengths, by_pose = over_samples(compiled, count, *given)
    return lengths, by_pose.reshape(count, mechanism.n, 6)


def _compile(mechanism: Mechanism) -> ca.Function:
    starts = compiled_starts(mechanism)
    inputs = starts.sx_in()
    lengths, by = starts.call(inputs)[:2]
    by_pose = from_rows(by, mechanism.n, by.numel() // mechanism.n)[:, :6]
    return function("lengths_at_rest", inputs, [lengths, rows(by_pose)])
