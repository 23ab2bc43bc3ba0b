"""A plant whose winches carry out chains of strokes, without drives and bus: for many trials of a plan, quickly.

Rehearse with real bytes where drives matter (`fidim dry-run --excite`). Not simulated here: anything of a drive but
that its set-points come a little late, all winches alike.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import PerCable
from sim_backends.plant.plant import Plant

LOOK = 0.01
"""s between two samples"""


@dataclass(frozen=True, eq=False)
class Swung:
    """What was seen of the free motion after the strokes, and the tensions of everything."""

    t: Float[np.ndarray, " N"]
    """s since the winches hold"""
    markers: Float[np.ndarray, "N M 3"]
    """true, m"""
    lengths: Float[np.ndarray, "N n"]
    tensions: Float[np.ndarray, "N n"]
    """true tensions at the samples, N"""
    tension: tuple[float, float]
    """N, smallest and largest from the first stroke on"""


def carry_out(
    plant: Plant,
    held: PerCable,
    pieces: Sequence[tuple[Float[np.ndarray, "pieces 3"], PerCable, float]],
    seconds: float,
    jitter: Sequence[float] = (),
) -> Swung:
    """Strokes from the lengths held (m), then `seconds` of free motion.

    pieces: for each chain its pieces (begin, duration, unit acceleration), direction (m), and begin (s). jitter: s by
    which the k-th stroke comes late.
    """
    begin, low, high = plant.t, np.inf, -np.inf
    offset, rate, k = np.zeros(plant.world.n), np.zeros(plant.world.n), 0

    def look() -> None:
        nonlocal low, high
        low, high = min(low, float(plant.tensions.min())), max(high, float(plant.tensions.max()))

    for table, direction, since in pieces:
        for up, down in zip(table[::2], table[1::2], strict=True):
            late = jitter[k] if k < len(jitter) else 0.0
            k += 1
            for piece_begin, duration, unit in (up, down):
                plant_at = begin + since + piece_begin + late
                _wait(plant, held + offset, plant_at, look)
                acceleration = unit * direction
                steps = max(1, int(np.ceil(duration / LOOK)))
                for _ in range(steps):
                    h = duration / steps
                    plant.advance(plant.t + h, held + offset, rate, acceleration)
                    offset, rate = offset + rate * h + acceleration * h**2 / 2, rate + acceleration * h
                    look()
            rate = np.zeros_like(rate)
    hold = plant.t
    times = np.arange(round(seconds / LOOK) + 1) * LOOK
    markers, lengths, tensions = [], [], []
    for t in times:
        plant.advance(max(hold + t, plant.t), held + offset, np.zeros_like(rate), np.zeros_like(rate))
        look()
        markers.append(plant.markers())
        lengths.append(plant.encoder_lengths())
        tensions.append(plant.tensions)
    return Swung(times, np.array(markers), np.array(lengths), np.array(tensions), (low, high))


def _wait(plant: Plant, lengths: PerCable, until: float, look: Callable[[], None]) -> None:
    none = np.zeros(plant.world.n)
    while until - plant.t > 1e-9:
        plant.advance(min(until, plant.t + LOOK), lengths, none, none)
        look()
