"""The simulated release's magnet in the simulated world: it takes over the platform that a hand brings to it."""

import numpy as np

from sim_backends.plant.plant import HandLaw, Plant

LETTING_GO = 0.005
"""s in which its force fades"""


class SimulatedMagnet:
    """Holds the marker where it is when power is on and the platform is brought to it; off, it lets go at once.

    Not simulated: how far it attracts (a hand brings the platform right to it), a weight beyond its force, a tether.
    """

    def __init__(self, plant: Plant) -> None:
        self.energised = False
        self.fetches = 0.0
        """m by which it pulls the platform aside by itself when it is switched on, along x; 0: a hand brings it"""
        self._plant = plant
        self._holds: HandLaw | None = None

    def switch(self, on: bool) -> None:
        """Power on or off."""
        self.energised = on
        if on and self.fetches:
            self.take(self._plant.markers()[0] + np.array([self.fetches, 0.0, 0.0]))
        if not on and self._holds is not None:
            plant, law = self._plant, self._holds
            self._holds = None
            plant.hand = HandLaw(
                target=law.target,
                stiffness=law.stiffness,
                damping=law.damping,
                rotation_damping=law.rotation_damping,
                fading=plant.t,
                until=plant.t + LETTING_GO,
            )
            plant.begin_window()

    def take(self, target: np.ndarray, stiffness: np.ndarray | None = None) -> bool:
        """Hold the marker by a spring to `target` (m); False where there is no power to hold it with."""
        if not self.energised:
            return False
        mass, w = self._plant.world.mass, 2.0 * np.pi * 2.5
        stiff = mass * w**2 * np.array([1.0, 1.0, 0.0]) if stiffness is None else stiffness
        damping = 2.0 * 0.8 * mass * w
        self._holds = self._plant.hand = HandLaw(
            target=np.array(target, dtype=float),
            stiffness=stiff,
            damping=damping * np.array([1.0, 1.0, 0.0]),
            rotation_damping=0.1 * damping,
        )
        return True
