"""The simulated laboratory: plant, drives, cameras and a hand in one world, moved on by whoever looks at it.

Nobody drives the plant: a drive that is asked for its load, a camera that exposes, or a shaft that is told to move lets
the plant live up to that moment. So the order of events is that of the clock, and the same seed gives the same bytes.
"""

import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from drivers.ports import Clock
from fidim_lab.arrays import PerCable
from fidim_lab.data.records import Robot
from fidim_lab.errors import SetupError
from sim_backends.drive.axis import DrumShaft, Profile, ShaftMotion
from sim_backends.drive.node import SimulatedDrive
from sim_backends.drive.objects import read_eds
from sim_backends.hand import SimulatedHand
from sim_backends.magnet import SimulatedMagnet
from sim_backends.mocap.encoders import Encoder
from sim_backends.mocap.faults import Faults
from sim_backends.mocap.server import MocapServer, StreamTiming
from sim_backends.plant.plant import Plant
from sim_backends.plant.sensors import Cameras, CurrentSensors, Noise
from sim_backends.plant.world import World

TICK = 0.005
"""s; while a drum turns, its acceleration is taken as constant for so long"""


@dataclass(frozen=True)
class DrumGeometry:
    """How counts of a simulated drive turn into cable length: l = home_length + direction · counts · per_count."""

    home_length: float
    """m of cable at count 0, where the drive is when the power comes"""
    direction: int
    """+1 where rising counts pay cable out"""
    metres_per_count: float


class Laboratory:
    """One world with its simulated devices.

    Thread-safe as far as its devices are used from other threads (`--real-time`). Not simulated: what plant, drives,
    server and hand say in their own docstrings; a cable's way between drum and pulley.
    """

    def __init__(
        self,
        robot: Robot,
        world: World,
        start: PerCable,
        rng: np.random.Generator,
        now: Callable[[], float],
        noise: Noise | None = None,
        drums: Sequence[DrumGeometry] | None = None,
        grain: float = 0.0,
    ) -> None:
        """Begin at rest at the cable lengths `start` (m).

        now: monotonic s. drums: unless given they turn alternately, with count 0 at the start. grain: s by which motor
        currents may be old; in real time every look has another time, and each would cost a step of the world. Raises
        SetupError where the robot file has no winches, InfeasibleError without such a rest.
        """
        if robot.winches is None:
            raise SetupError("The robot file has no [winch] table: drives cannot be simulated without drum and gear.")
        noise = noise or Noise.of(robot)
        cameras, currents, self._hand_rng, self._mocap_rng, self._gauge_rng = rng.spawn(5)
        self.plant = _SharedPlant(world)
        self.magnet = SimulatedMagnet(self.plant)
        self.drums = tuple(
            drums or (DrumGeometry(float(length), (-1) ** cable, noise.encoder) for cable, length in enumerate(start))
        )
        self.shafts = tuple(LaboratoryShaft(self, now) for _ in self.drums)
        self._cameras = Cameras(world, noise.marker, cameras)
        self._currents = CurrentSensors(robot.winches, noise.current, currents)
        self._grain = grain
        self._origin = now()
        self.plant.settle(np.asarray(start, dtype=float), t=0.0)
        self._read_currents()

    @property
    def began(self) -> float:
        """Host time at plant time 0, s."""
        return self._origin

    def drives(self, eds: Path) -> tuple[SimulatedDrive, ...]:
        """One drive node for each cable, node ids from 1, with the object dictionary of this EDS file."""
        return tuple(
            SimulatedDrive(node, read_eds(eds, node), shaft) for node, shaft in enumerate(self.shafts, start=1)
        )

    def mocap_server(self, encoder: Encoder, rate: float, faults: Faults | None = None) -> MocapServer:
        """A motion-capture server that looks at this world; the world's own cameras add noise and their errors."""
        drift = self._cameras.exposure(1.0) - self._cameras.exposure(0.0) - 1.0
        return MocapServer(
            truth=self._see,
            encoder=encoder,
            rng=self._mocap_rng,
            timing=StreamTiming(rate=rate, drift=drift),
            noise=0.0,
            faults=faults or Faults(),
        )

    def hand(self, clock: Clock) -> SimulatedHand:
        """An operator's hand in this world."""
        return SimulatedHand(self.plant, clock, self._hand_rng, magnet=self.magnet)

    def load_cells(self, t: float, noise: float) -> dict[str, float]:
        """True tensions at host time t by cable number, "1" …, N, with so much white noise (N)."""
        with self.plant.lock:
            self.refresh(t)
            tensions = self.plant.tensions
        return {str(cable): float(self._noisy(tension, noise)) for cable, tension in enumerate(tensions, start=1)}

    def inclination(self, t: float, noise: float) -> dict[str, float]:
        """Rotations "x", "y", "z" about the world's axes in this order at host time t, rad, with white noise (rad)."""
        with self.plant.lock:
            self.refresh(t)
            rotation = self.plant.pose.rotation
        angles = Rotation.from_matrix(rotation).as_euler("xyz")
        return {axis: float(self._noisy(angle, noise)) for axis, angle in zip("xyz", angles, strict=True)}

    def _noisy(self, value: float, noise: float) -> float:
        return value + noise * self._gauge_rng.standard_normal()

    def advance(self, t: float) -> None:
        """Let the world live until host time t (s); no effect where it has got there already."""
        with self.plant.lock:
            end = t - self._origin
            if end <= self.plant.t + 1e-9:
                return
            while end > self.plant.t + 1e-9:
                self._step(end)
            self._read_currents()

    def refresh(self, t: float) -> None:
        """As `advance`, unless the world has got to within the grain of host time t (s)."""
        if t - self._origin - self.plant.t >= self._grain:
            self.advance(t)

    def _step(self, end: float) -> None:
        begin = self.plant.t
        motions = [shaft.motion(begin + self._origin) for shaft in self.shafts]
        turning = any(motion.velocity or motion.acceleration for motion in motions)
        due = min(end, (math.floor(begin / TICK + 1e-6) + 1) * TICK) if turning else end
        lengths, rates, accelerations = np.array(
            [_cable(drum, motion) for drum, motion in zip(self.drums, motions, strict=True)]
        ).T
        self.plant.advance(due, lengths, rates, accelerations)

    def _read_currents(self) -> None:
        for drum, shaft, current in zip(self.drums, self.shafts, self._currents.read(self.plant.tensions), strict=True):
            shaft.set_load(-drum.direction * float(current))  # the motor pulls cable in

    def _see(self, t: float) -> np.ndarray:
        """What the cameras make of the markers in a frame taken at host time t."""
        return self._cameras.see(t - self._origin, self._markers(t + self._cameras.exposure(0.0)))

    def _markers(self, t: float) -> np.ndarray:
        """True marker positions (M, 3) at host time t, m.

        In real time somebody else may have moved the world on since: a frame shows what was, not what is.
        """
        with self.plant.lock:
            self.advance(t)
            return self.plant.markers(max(t - self._origin, self.plant.remembered_since))


class LaboratoryShaft(DrumShaft):
    """A shaft that lets its world live up to the present before it tells a load or takes a new motion."""

    def __init__(self, laboratory: Laboratory, now: Callable[[], float]) -> None:
        super().__init__()
        self._laboratory = laboratory
        self._now = now

    @property
    def load_current(self) -> float:
        """A, at the present moment."""
        self._laboratory.refresh(self._now())
        return super().load_current

    def follow(self, t: float, profile: Profile) -> None:
        """Move like this from time t on."""
        self._laboratory.advance(t)
        super().follow(t, profile)


class _SharedPlant(Plant):
    """A plant that may be looked at from the hand's task while a drive's thread moves it on."""

    def __init__(self, world: World) -> None:
        self.lock = threading.RLock()
        super().__init__(world)

    def advance(
        self,
        t: float,
        lengths: PerCable | None = None,
        rates: PerCable | None = None,
        accelerations: PerCable | None = None,
    ) -> None:
        """As `Plant.advance`."""
        with self.lock:
            super().advance(t, lengths, rates, accelerations)

    def markers(self, t: float | None = None) -> np.ndarray:
        """As `Plant.markers`."""
        with self.lock:
            return super().markers(t)


def _cable(drum: DrumGeometry, motion: ShaftMotion) -> tuple[float, float, float]:
    """Cable length (m), rate, acceleration of a drum in this motion."""
    scale = drum.direction * drum.metres_per_count
    return drum.home_length + scale * motion.position, scale * motion.velocity, scale * motion.acceleration
