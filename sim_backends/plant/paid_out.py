"""From what the drums have paid out to the true unstretched lengths: what no encoder sees.

Encoder zeros, creep, growth and slip over the session, and eccentric drums.
"""

import numpy as np

from fidim_lab.arrays import PerCable
from sim_backends.plant.hidden import HiddenEffect
from sim_backends.plant.world import World

HOUR = 3600.0
"""s"""
ROUNDS = 8
"""in which the place of an eccentric drum is found, each a hundred times nearer"""
MOVING = 1e-6
"""m/s of drum above which a cable is not being held"""


class PaidOut:
    """Holds creep and growth of every cable. Not simulated: layers of cable on the drum, slip under tension."""

    def __init__(self, world: World) -> None:
        self._bias = np.zeros(world.n)
        self._final, self._decay = np.zeros((2, world.n))
        for effect in world.effects("cable-length-bias"):
            self._bias += [effect["bias"] * effect.concerns(i) for i in range(world.n)]
        for effect in world.effects("cable-creep"):
            here = np.array([effect.concerns(i) for i in range(world.n)])
            self._final[here], self._decay[here] = effect["delta"], 1.0 / effect["T"]
        self._rate = np.zeros(world.n)
        for effect in world.effects("length-drift"):
            self._rate += [effect["rate"] / HOUR * effect.concerns(i) for i in range(world.n)]
        self._slips, self._wheels = world.effects("length-step"), world.effects("length-scatter")
        self.t = 0.0
        """s of the session"""
        self._crept = np.zeros(world.n)
        self._held = np.ones(world.n, dtype=bool)

    def restart(self, t: float) -> None:
        """Every cable is held from now (s of the session) on, and has not crept yet."""
        self.t = t
        self._crept[:], self._held[:] = 0.0, True

    def pass_time(self, dt: float, rates: PerCable) -> None:
        """Let dt (s) pass: cables grow, and creep towards their final length, or back where the drum turns.

        rates: of the drums, m/s.
        """
        self.t += dt
        self._held = np.abs(rates) < MOVING
        towards = np.where(self._held, self._final, 0.0)
        self._crept += (towards - self._crept) * -np.expm1(-dt * self._decay)

    def true(self, drums: PerCable) -> PerCable:
        """True unstretched lengths, m."""
        return drums + self._unseen + sum((self._off(wheel, drums)[0] for wheel in self._wheels), np.zeros(len(drums)))

    def drums(self, true: PerCable) -> PerCable:
        """What the encoders would say of these true unstretched lengths, m."""
        found = true - self._unseen
        for _ in range(ROUNDS if self._wheels else 0):
            found = found + true - self.true(found)
        return found

    def true_motion(self, drums: PerCable, rates: PerCable, accelerations: PerCable) -> tuple[PerCable, PerCable]:
        """Rates (m/s) and accelerations (m/s²) of the true lengths, given the drums and theirs."""
        creeping = (np.where(self._held, self._final, 0.0) - self._crept) * self._decay
        slope, bend = np.ones(len(drums)), np.zeros(len(drums))
        for wheel in self._wheels:
            _, by, twice = self._off(wheel, drums)
            slope, bend = slope + by, bend + twice
        speeding = slope * accelerations + bend * rates**2
        return slope * rates + creeping + self._rate, speeding - creeping * self._decay

    @property
    def _unseen(self) -> PerCable:
        """True less paid out, m, wherever the drums stand."""
        off = self._crept - self._bias + self._rate * self.t
        for slip in self._slips:
            off = off + [slip["by"] * slip.concerns(i) * (self.t >= slip["at"]) for i in range(len(off))]
        return off

    def _off(self, wheel: HiddenEffect, drums: PerCable) -> tuple[PerCable, PerCable, PerCable]:
        """What an eccentric drum adds to a length, m, and its first two derivatives by what is paid out."""
        size = np.array([wheel["size"] * wheel.concerns(i) for i in range(len(drums))])
        turn = drums / wheel["radius"]
        sine, cosine = np.sin(turn), np.cos(turn)
        return size * sine, size * cosine / wheel["radius"], -size * sine / wheel["radius"] ** 2
