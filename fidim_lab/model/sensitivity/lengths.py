"""Cable lengths of platforms at rest with their derivatives by the pose alone: for searches among thousands of poses.

What `starts` gives beside (free twists, derivatives by everything that is shared) would cost ten times as much.
"""

import casadi as ca
import numpy as np
from jaxtyping import Float

from fidim_lab.model.batch import evaluate, from_rows, function, rows
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
    room = _round(count)
    still, springs, astray = (np.zeros((count, compiled.numel_in(k))) for k in (3, 5, 6))
    if sprung(mechanism):
        springs = quiet_springs(mechanism, shared, States(positions, rotations, still), begins).tensions
    given = [begins, positions, rotations, still, np.broadcast_to(shared, (count, len(shared))), springs, astray]
    filled = [np.concatenate([part, np.broadcast_to(part[:1], (room - count, *part.shape[1:]))]) for part in given]
    lengths, by_pose = evaluate(
        mechanism.compiled(f"sensitivity: {room} lengths", lambda _: compiled.map(room)), *filled
    )
    return lengths[:count], by_pose[:count].reshape(count, mechanism.n, 6)


def _compile(mechanism: Mechanism) -> ca.Function:
    starts = compiled_starts(mechanism)
    inputs = starts.sx_in()
    lengths, by = starts.call(inputs)[:2]
    by_pose = from_rows(by, mechanism.n, by.numel() // mechanism.n)[:, :6]
    return function("lengths_at_rest", inputs, [lengths, rows(by_pose)])


def _round(count: int) -> int:
    """The next of 1, 2, 3, 4, 6, 8, 12, 16, …: so many at once, lest CasADi makes a map for every count."""
    power = 1 << max(0, (count - 1).bit_length())
    return power * 3 // 4 if power >= 4 and count <= power * 3 // 4 else power
