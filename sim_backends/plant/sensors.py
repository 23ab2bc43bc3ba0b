"""What the sensors make of the truth: cameras, encoders and motor currents, each with a random stream of its own.

`sensor_streams` splits one generator, so that the same seed gives the same bytes whichever sensor is asked first.
"""

from dataclasses import dataclass

import numpy as np

from fidim_lab.arrays import PerCable
from fidim_lab.data.records import Robot, WinchTorque
from sim_backends.plant.hidden import HiddenEffect
from sim_backends.plant.world import World, rotation

FAULT_PERIOD = 10.0
"""s: in each such stretch of time a faulty camera freezes once and jumps once"""


@dataclass(frozen=True)
class Noise:
    """Accuracy of the sensors; 0 is ideal."""

    marker: float
    """m, standard deviation of a marker component"""
    encoder: float
    """m of cable, one count"""
    current: float = 0.05
    """A, standard deviation of a motor current sample"""

    @staticmethod
    def of(robot: Robot) -> "Noise":
        """As the robot file states it."""
        return Noise(marker=robot.sensors.marker_noise, encoder=robot.sensors.encoder_resolution)


@dataclass(frozen=True)
class SensorStreams:
    """One generator for each sensor."""

    cameras: np.random.Generator
    encoders: np.random.Generator
    currents: np.random.Generator


def sensor_streams(rng: np.random.Generator) -> SensorStreams:
    """Independent streams from one generator (spawned: what one draws does not move the others)."""
    return SensorStreams(*rng.spawn(3))


class Cameras:
    """Motion capture: true marker positions to measured ones.

    Does not simulate: occlusion (a marker source may leave markers out), calibration waves, marker swaps, latency.
    """

    def __init__(self, world: World, noise: float, rng: np.random.Generator, since: float = 0.0) -> None:
        """since: s of the session at which stamps are 0."""
        self._noise, self._since = noise, since
        self._rng, self._fault_rng = rng.spawn(2)
        self._rotation, self._shift = np.eye(3), np.zeros(3)
        self._scale = float(np.prod([1.0 + effect["scale"] for effect in world.effects("capture-scale")]))
        for effect in world.effects("frame-misalignment"):
            self._rotation = rotation(effect.vector("rx", "ry", "rz")) @ self._rotation
            self._shift += effect.vector("dx", "dy", "dz")
        self._drift = sum(
            (effect.vector("x", "y", "z") / 3600 for effect in world.effects("camera-drift")), np.zeros(3)
        )
        self._rate = float(np.prod([1.0 + effect["rate"] for effect in world.effects("clock-rate")]))
        self._offset = float(sum(effect["offset"] for effect in world.effects("time-offset")))
        self._faults = [_Fault(effect, rng) for effect, rng in self._fault_streams(world)]

    def exposure(self, stamp: float) -> float:
        """True time (s) at which a frame with this stamp (s since the clocks were set) is taken."""
        return stamp / self._rate + self._offset

    def place(self, markers: np.ndarray) -> np.ndarray:
        """True positions (…, 3) as ideal cameras would report them: in the frame of the motion capture."""
        return markers @ self._rotation.T * self._scale + self._shift

    def see(self, stamp: float, markers: np.ndarray) -> np.ndarray:
        """One frame: true positions (M, 3) → measured (M, 3), m, with noise and whatever is wrong with the sensor."""
        seen = self.place(markers) + self._rng.normal(0.0, 1.0, markers.shape) * self._noise
        seen += self._drift * (self._since + stamp)
        for fault in self._faults:
            seen = fault.spoil(stamp, seen)
        return seen

    def _fault_streams(self, world: World) -> list[tuple[HiddenEffect, np.random.Generator]]:
        effects = world.effects("sensor-fault")
        return list(zip(effects, self._fault_rng.spawn(len(effects)), strict=True)) if effects else []


class _Fault:
    """Outliers, a run of repeated samples, and a step, by the stamp of each frame."""

    def __init__(self, effect: HiddenEffect, rng: np.random.Generator) -> None:
        self._effect, self._rng = effect, rng
        self._stretch = -1
        self._freeze = 0.0
        self._last: np.ndarray | None = None

    def spoil(self, stamp: float, seen: np.ndarray) -> np.ndarray:
        """The frame as the faulty sensor gives it."""
        stretch, within = divmod(stamp, FAULT_PERIOD)
        if stretch != self._stretch:
            self._stretch, self._freeze = stretch, self._rng.uniform(0.1, 0.8) * FAULT_PERIOD
        frozen = self._freeze <= within < self._freeze + self._effect["frozen"]
        seen = seen.copy()
        if self._rng.random() < self._effect["outliers"]:
            seen[0] += self._rng.normal(0.0, self._effect["size"], 3)
        if within >= FAULT_PERIOD / 2:
            seen[0, 0] += self._effect["jump"]
        if frozen and self._last is not None:
            return self._last
        self._last = seen
        return seen


class Encoders:
    """Drum encoders: cable lengths in whole counts. The zero is a hidden effect of the plant, not of the encoder."""

    def __init__(self, resolution: float) -> None:
        self._resolution = resolution

    def counts(self, lengths: PerCable) -> np.ndarray:
        """Counts (n,) of these lengths (m), as integers."""
        return np.rint(lengths / self._resolution).astype(np.int64)

    def read(self, lengths: PerCable) -> PerCable:
        """Lengths (m) as the encoders report them; exact where the resolution is 0."""
        return lengths.copy() if self._resolution == 0 else self.counts(lengths) * self._resolution


class CurrentSensors:
    """Motor currents of held winches, A: tension over the winch's N/A, with white noise.

    Does not simulate: friction of gear and drum (a held winch can carry part of its tension), drift, torque ripple.
    """

    def __init__(self, winches: tuple[WinchTorque, ...], noise: float, rng: np.random.Generator) -> None:
        self._ampere_per_newton = np.array([1.0 / winch.newton_per_ampere for winch in winches])
        self._noise, self._rng = noise, rng

    def read(self, tensions: PerCable) -> PerCable:
        """Currents (n,), A, positive where the cable pulls."""
        return tensions * self._ampere_per_newton + self._rng.normal(0.0, 1.0, tensions.shape) * self._noise
