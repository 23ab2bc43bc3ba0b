"""Cable lengths of platforms at rest with their derivatives by the pose alone: for searches among thousands of poses.

What `starts` gives beside (free twists, derivatives by everything that is shared) would cost ten times as much.
"""

import casadi as ca
import numpy as np
from jaxtyping import Float

from fidim_lab.model.batch import from_rows, function, over_samples, rows
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import sprung
from fidim_lab.model.sensitivity.integrate import States
from fidim_lab.model.sensitivity.starts import compiled_starts, quiet_springs


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
