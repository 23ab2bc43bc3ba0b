"""What the catalogue names without a term in the equations: found by other means, not by a score."""

from dataclasses import dataclass
from typing import ClassVar

from fidim_lab.effects.effect import NamedEffect


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
