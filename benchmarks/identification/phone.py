"""A phone that rides on a simulated pendulum: what its gyroscope records, as an app exports it.

Jitter, samples that come twice or not at all, a bias that drifts, noise, a crooked seat and a scale; a hand that holds
the platform aside with a tremor before it lets go.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from fidim_lab.arrays import PerCable
from sim_backends.plant.plant import Plant
from sim_backends.plant.world import World


@dataclass(frozen=True)
class PhoneNoise:
    """What a phone adds; all 0 is ideal but for its rate."""

    rate: float = 200.0
    """Hz"""
    jitter: float = 2e-4
    """s, standard deviation of a stamp"""
    noise: float = 4e-3
    """rad/s, of a sample"""
    bias: float = 0.02
    """rad/s, standard deviation of each axis"""
    drift: float = 5e-5
    """rad/s², likewise"""
    seat: float = 0.03
    """rad, standard deviation of the turn about each axis"""
    scale: float = 0.01
    held: float = 3.0
    """s in the hand before it is let go"""
    tremor: float = 0.03
    """rad/s at 9 Hz while held"""
    twice: float = 0.002
    """share of samples that are written twice"""
    lost: float = 0.002
    """share of samples that are missing"""


IDEAL = PhoneNoise(jitter=0, noise=0, bias=0, drift=0, seat=0, scale=0, held=0, tremor=0, twice=0, lost=0)


@dataclass(frozen=True, eq=False)
class PhoneRecording:
    """What the app holds."""

    t: Float[np.ndarray, " N"]
    """s"""
    rates: Float[np.ndarray, "N 3"]
    """rad/s, in the phone's axes"""


def record_phone(
    world: World,
    lengths: PerCable,
    displacement: np.ndarray,
    duration: float,
    rng: np.random.Generator,
    noise: PhoneNoise | None = None,
    seat: np.ndarray | None = None,
) -> PhoneRecording:
    """One release from `displacement` (x, y; m) of the main marker, and the swing after it.

    seat: rotation vector (rad) and scale of the phone, the same in all recordings of a session; drawn unless given.
    """
    noise = noise or PhoneNoise()
    seat = draw_seat(rng, noise) if seat is None else seat
    plant = Plant(world)
    plant.place(plant.rest(lengths, near=plant.rest(lengths).pose, displacement=displacement), lengths)
    stamps = np.arange(round((noise.held + duration) * noise.rate)) / noise.rate
    rates = np.zeros((len(stamps), 3))
    for k in np.flatnonzero(stamps >= noise.held):
        plant.advance(float(stamps[k] - noise.held))
        rates[k] = plant.rate
    held = stamps < noise.held
    phase = rng.uniform(0, 2 * np.pi, 3)
    rates[held] = noise.tremor * np.sin(2 * np.pi * 9 * stamps[held, np.newaxis] + phase)
    turn = Rotation.from_rotvec(seat[:3]).as_matrix()
    bias, drift = noise.bias * rng.normal(size=3), noise.drift * rng.normal(size=3)
    read = (1 + seat[3]) * rates @ turn.T + bias + drift * stamps[:, np.newaxis]
    read += noise.noise * rng.normal(size=read.shape)
    jitter = np.clip(noise.jitter * rng.normal(size=len(stamps)), -0.4 / noise.rate, 0.4 / noise.rate)
    rows = np.flatnonzero(rng.uniform(size=len(stamps)) >= noise.lost)
    rows = np.sort(np.concatenate([rows, rows[rng.uniform(size=len(rows)) < noise.twice]]))
    return PhoneRecording((stamps + jitter)[rows], read[rows])


def draw_seat(rng: np.random.Generator, noise: PhoneNoise) -> np.ndarray:
    """Rotation vector (rad) and scale error of a phone (4)."""
    return np.array([noise.seat] * 3 + [noise.scale]) * rng.normal(size=4)


def as_phyphox(recording: PhoneRecording, *, comma: bool = False, degrees: bool = False) -> str:
    """As phyphox's experiment "Gyroscope" exports it; comma: with decimal commas and semicolons."""
    unit, scale = ("°/s", 180 / np.pi) if degrees else ("rad/s", 1.0)
    names = ["Time (s)", *(f"Gyroscope {axis} ({unit})" for axis in "xyz"), f"Absolute ({unit})"]
    rates = scale * recording.rates
    rows = np.column_stack([recording.t, rates, np.linalg.norm(rates, axis=1)])
    mark = ";" if comma else ","
    lines = [mark.join(f'"{name}"' for name in names), *(mark.join(f"{x:.9E}" for x in row) for row in rows)]
    text = "\n".join(lines) + "\n"
    return text.replace(".", ",") if comma else text


def as_sensor_logger(recording: PhoneRecording, began: int = 1_790_000_000_000_000_000) -> str:
    """As Sensor Logger writes Gyroscope.csv: nanoseconds since 1970, seconds since the begin, then z, y, x."""
    lines = ["time,seconds_elapsed,z,y,x"]
    for t, (x, y, z) in zip(recording.t, recording.rates, strict=True):
        lines.append(f"{began + round(t * 1e9)},{t:.9f},{z:.9f},{y:.9f},{x:.9f}")
    return "\n".join(lines) + "\n"
