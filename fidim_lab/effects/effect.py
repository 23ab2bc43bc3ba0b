"""What an effect of the catalogue says about itself, beside what it does in the model's slots.

`NamedEffect` is the base of every effect in this folder: a frozen value with an id (spec/model.md §5), the cable it
concerns, its parameters with bounds, its formula and source, and what is physically possible for a given robot.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import ClassVar

import numpy as np

from fidim_lab.data.records import Robot
from fidim_lab.effects.plausibility import Context, Limit
from fidim_lab.model.slots import Effect


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect, SI."""

    name: str
    unit: str
    says: str
    scale: float
    """a size that matters physically: 1 unit of a score"""
    low: float
    """hard bounds: no fit goes beyond"""
    high: float
    start: float
    """where a refit starts when no score says better"""
    scan: tuple[float, ...] = ()
    """values to try one after the other: a parameter that has no score at amplitude 0 (a frequency, a place)"""

    @property
    def absent(self) -> float:
        """Its value where the effect is absent: 0, or any value that is scanned."""
        return self.scan[0] if self.scan else 0.0


@dataclass(frozen=True)
class NamedEffect(Effect):
    """One effect of the catalogue; θ are the values of `parameters`, in order."""

    id: ClassVar[str]
    says: ClassVar[str]
    """what it is, with the formula: one line"""
    source: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    variant: ClassVar[str] = ""
    """tells several effects with the same id apart"""
    of_each_window: ClassVar[bool] = False
    """its score has θ of its own in every window (a phase that each window starts anew)"""

    cable: int | None = None
    """1-based; None where it concerns all cables, or none"""

    def wider(self, values: np.ndarray, robot: Robot) -> "tuple[tuple[NamedEffect, np.ndarray], ...]":
        """More general forms of this effect, with θ from which to fit them, once it was fitted with these values.

        For what has no score of its own and is too much to scan: it is looked for where the simple form has led.
        """
        return ()

    def narrower(self, values: np.ndarray) -> "tuple[NamedEffect, np.ndarray] | None":
        """The simple form that this is a wider form of, where others beside it may have made its freedom needless."""
        return None

    def parts(self, values: np.ndarray, sd: np.ndarray) -> "tuple[tuple[NamedEffect, np.ndarray], ...]":
        """Simpler effects that do the same together, with θ, where these values leave nothing that is surely its own.

        sd: of the values; NaN where one is held at a bound.
        """
        return ()

    def other_forms(self, values: np.ndarray, context: Context) -> "tuple[tuple[NamedEffect, np.ndarray], ...]":
        """Forms of this effect that are as free, with θ at which they do nearly what this does with these values."""
        return ()

    @property
    def label(self) -> str:
        """For people: id, variant, cable."""
        cable = "" if self.cable is None else f"cable {self.cable}"
        details = ", ".join(part for part in (self.variant, cable) if part)
        return f"{self.id} ({details})" if details else self.id

    @property
    def absent(self) -> np.ndarray:
        """A θ at which it does nothing: amplitudes 0, scanned parameters at their first value."""
        return np.array([parameter.absent for parameter in self.parameters])

    @property
    def scanned(self) -> tuple[bool, ...]:
        """Which parameters have no score of their own, and are tried value by value."""
        return tuple(bool(parameter.scan) for parameter in self.parameters)

    @property
    def scan_points(self) -> tuple[np.ndarray, ...]:
        """Every absent θ at which to score: one, or the grid of all scanned parameters."""
        values = (parameter.scan or (0.0,) for parameter in self.parameters)
        return tuple(np.array(point) for point in product(*values))

    @property
    def start(self) -> np.ndarray:
        """Where a refit starts when no score says better."""
        return np.array([parameter.start for parameter in self.parameters])

    def concerns(self, number: int) -> bool:
        """Whether it acts on this cable (1-based)."""
        return self.cable is None or self.cable == number

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """Largest possible size of some parameters for this robot and motion; the others have hard bounds alone."""
        return {}

    def bounds(self, context: Context | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds of θ for a fit: the hard ones, and what the context makes possible."""
        low = np.array([parameter.low for parameter in self.parameters])
        high = np.array([parameter.high for parameter in self.parameters])
        limits = {} if context is None else self.limits(context)
        sizes = np.array([limits[p.name].size if p.name in limits else np.inf for p in self.parameters])
        return np.maximum(low, -sizes), np.minimum(high, sizes)

    def plausible(self, values: np.ndarray, context: Context) -> str | None:
        """Why these values are physically impossible, as a sentence; None where they are possible."""
        limits = self.limits(context)
        for parameter, value in zip(self.parameters, values, strict=True):
            found = f"{self.label}: {parameter.name} = {value:.3g} {parameter.unit}"
            if value < parameter.low or value > parameter.high:
                return f"{found} is outside {parameter.low:g}…{parameter.high:g} {parameter.unit} ({parameter.says})."
            limit = limits.get(parameter.name)
            if limit is not None and abs(value) > limit.size:
                return f"{found}, but {limit.why}: at most {limit.size:.3g} {parameter.unit}."
        return None


def vector(prefix: str, unit: str, says: str, *, scale: float, most: float) -> tuple[Parameter, Parameter, Parameter]:
    """Three parameters of one vector, `prefix` + x, y, z, that may have either sign."""
    x, y, z = (
        Parameter(f"{prefix}{axis}", unit, f"{says}, {axis}", scale=scale, low=-most, high=most, start=0.0)
        for axis in "xyz"
    )
    return x, y, z


@dataclass(frozen=True)
class HandContact(NamedEffect):
    """A hand during part of a window: found by its work (`identification.motion.hand_free`), and cut out."""

    id: ClassVar[str] = "hand-contact"
    says: ClassVar[str] = "an intermittent unknown wrench during part of a window; these times are left out of the fit"
    source: ClassVar[str] = "spec/irma4u.md §2; spec/model.md §5"


@dataclass(frozen=True)
class SensorFault(NamedEffect):
    """Outliers, frozen or jumped samples: found in the samples themselves, before any model."""

    id: ClassVar[str] = "sensor-fault"
    says: ClassVar[str] = "outliers, frozen samples or jumps of a marker: the sensor, not the physics"
    source: ClassVar[str] = "spec/model.md §5"


@dataclass(frozen=True)
class UnknownEffect(NamedEffect):
    """Something real that no effect here explains: typed by generic functions of position, velocity and time."""

    id: ClassVar[str] = "unknown"
    says: ClassVar[str] = "a real effect that none of the others explains"
    source: ClassVar[str] = "spec/model.md §5"
