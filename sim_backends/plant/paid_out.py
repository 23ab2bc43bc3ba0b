"""From what the drums have paid out to the true unstretched lengths: encoder zero and creep, which no encoder sees."""

import numpy as np

from fidim_lab.arrays import PerCable
from sim_backends.plant.world import World

MOVING = 1e-6
"""m/s of drum above which a cable is not being held"""


class PaidOut:
    """Holds the creep of every cable. What it does not simulate: slip on the drum, layers of cable, temperature."""

    def __init__(self, world: World) -> None:
        self._bias = np.zeros(world.n)
        self._final, self._decay = np.zeros((2, world.n))
        for effect in world.effects("cable-length-bias"):
            self._bias += [effect["bias"] * effect.concerns(i) for i in range(world.n)]
        for effect in world.effects("cable-creep"):
            here = np.array([effect.concerns(i) for i in range(world.n)])
            self._final[here], self._decay[here] = effect["delta"], 1.0 / effect["T"]
        self._crept = np.zeros(world.n)
        self._held = np.ones(world.n, dtype=bool)

    def restart(self) -> None:
        """Every cable is held from now on, and has not crept yet."""
        self._crept[:], self._held[:] = 0.0, True

    def pass_time(self, dt: float, rates: PerCable) -> None:
        """Let creep go on for dt (s) towards its final value, or back to none where the drum turns (rates, m/s)."""
        self._held = np.abs(rates) < MOVING
        towards = np.where(self._held, self._final, 0.0)
        self._crept += (towards - self._crept) * -np.expm1(-dt * self._decay)

    def true(self, drums: PerCable) -> PerCable:
        """True unstretched lengths, m."""
        return drums - self._bias + self._crept

    def drums(self, true: PerCable) -> PerCable:
        """What the encoders would say of these true unstretched lengths, m."""
        return true + self._bias - self._crept

    def true_motion(self, rates: PerCable, accelerations: PerCable) -> tuple[PerCable, PerCable]:
        """Rates (m/s) and accelerations (m/s²) of the true lengths, given those of the drums."""
        creeping = (np.where(self._held, self._final, 0.0) - self._crept) * self._decay
        return rates + creeping, accelerations - creeping * self._decay
