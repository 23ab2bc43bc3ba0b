"""What truly happened, told by the plant at every step of its own: tensions, cable lengths, speeds, power."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.rehearsal import Stage
from fidim_lab.errors import InfeasibleError
from sim_backends.drive.axis.machine import State

POWERED = (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT_REACTION)
TURNS = 1e-3
"""m/s of cable: a drum that turns"""


@dataclass(frozen=True, eq=False)
class Truth:
    """Rows are steps of the plant (at most 5 ms while a drum turns); columns are cables."""

    t: np.ndarray
    """(N,) s, the host's clock"""
    tensions: np.ndarray
    """(N, n) N"""
    lengths: np.ndarray
    """(N, n) m that is paid out, whatever an encoder says"""
    speeds: np.ndarray
    """(N, n) m/s by the drums"""
    powered: np.ndarray
    """(N, n) whether the drive has power"""
    slipped: np.ndarray
    """(N, n) m of `lengths` that came or went without the drum's turning"""

    def since(self, t: float) -> slice:
        return slice(int(np.searchsorted(self.t, t - 1e-9)), None)

    def between(self, start: float, end: float) -> slice:
        return slice(*np.searchsorted(self.t, (start - 1e-9, end + 1e-9)).tolist())


class Witness:
    """Looks on; changes nothing."""

    def __init__(self) -> None:
        self._rows: list[tuple[Any, ...]] = []
        self.stage: Stage | None = None

    def attach(self, stage: Stage) -> None:
        """From now on."""
        self.stage, plant, began = stage, stage.rig.laboratory.plant, stage.rig.laboratory.began
        advance = plant.advance

        def note(t: float, lengths=None, rates=None, accelerations=None) -> None:
            advance(t, lengths, rates, accelerations)
            speeds = np.zeros(plant.world.n) if rates is None else rates
            powered = [drive.state in POWERED for drive in stage.rig.drives]
            slipped = [drum.home_length for drum in stage.rig.laboratory.drums]
            now = plant.t + began
            self._rows.append((now, plant.tensions, plant.encoder_lengths(), np.array(speeds), powered, slipped))

        plant.advance = note

    def truth(self) -> Truth:
        """Up to now."""
        return Truth(*(np.array(column) for column in zip(*self._rows, strict=True)))

    def place(self, lengths: np.ndarray) -> np.ndarray:
        """(3,) m, where the main marker truly rests with these lengths (m); NaN where nothing rests."""
        assert self.stage is not None  # noqa: S101
        try:
            return np.asarray(self.stage.rig.laboratory.plant.rest(lengths).marker)
        except InfeasibleError:
            return np.full(3, np.nan)

    def stiffness(self, lengths: np.ndarray) -> np.ndarray:
        """(n, n) N/m: the change of cable i's tension with the length of cable k, at rest with these lengths."""
        assert self.stage is not None  # noqa: S101
        plant, step = self.stage.rig.laboratory.plant, 1e-3
        columns = [
            (plant.rest(lengths + step * way).tensions - plant.rest(lengths - step * way).tensions) / (2.0 * step)
            for way in np.eye(len(lengths))
        ]
        return np.array(columns).T
