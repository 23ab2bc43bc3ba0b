"""How things end: outcomes, and measurements that are judged against limits.

A value that was never measured is UNSET, and UNSET is not PASS.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

from fidim_lab.units import plain


class Outcome(StrEnum):
    """How a measurement, a step, a window or a run ended."""

    PASS = "pass"
    MARGINAL = "marginal"
    """within limits, but near the edge"""
    SKIPPED = "skipped"
    """skipped by the operator"""
    UNSET = "unset"
    """never measured"""
    FAIL = "fail"
    """measured, and outside its limits; or refused"""
    ABORTED = "aborted"
    """stopped by a person"""
    ERROR = "error"
    """a device, a guard or the disk stopped it"""

    @property
    def usable(self) -> bool:
        """Whether what ended like this may be built on."""
        return self in (Outcome.PASS, Outcome.MARGINAL)


_SEVERITY = tuple(Outcome)
"""from best to worst, as declared"""


def worst(outcomes: Iterable[Outcome]) -> Outcome:
    """The worst of some outcomes; UNSET when there are none, for nothing was shown."""
    return max(outcomes, key=_SEVERITY.index, default=Outcome.UNSET)


@dataclass(frozen=True)
class Measurement:
    """One named value with what is allowed for it."""

    name: str
    value: float | None
    """None: not measured"""
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    """allowed range, ends included"""
    margin: float = 0.0
    """width of the band inside each finite limit that is MARGINAL, in the unit of the value"""

    @property
    def outcome(self) -> Outcome:
        """UNSET, FAIL, MARGINAL or PASS."""
        if self.value is None or math.isnan(self.value):
            return Outcome.UNSET
        if not self.low <= self.value <= self.high:
            return Outcome.FAIL
        near = self.value < self.low + self.margin or self.value > self.high - self.margin
        return Outcome.MARGINAL if near else Outcome.PASS

    @property
    def sentence(self) -> str:
        """Found and allowed value in words."""
        if self.outcome is Outcome.UNSET:
            return f"{self.name} was not measured ({self._allowed})"
        return f"{self.name} is {self._shown(self.value)}{self._unit} ({self._allowed})"

    @property
    def _small(self) -> bool:
        """Whether all of it is less than a metre: then it is told in mm."""
        told = [value for value in (self.value, self.low, self.high) if value is not None and math.isfinite(value)]
        return self.unit == "m" and all(abs(value) < 1.0 for value in told)

    @property
    def _unit(self) -> str:
        return " mm" if self._small else f" {self.unit}" if self.unit else ""

    def _shown(self, value: float | None) -> str:
        """With three figures, or with as many as tell a value from the limit that it misses."""
        scale = 1e3 if self._small else 1.0
        limits = [limit for limit in (self.low, self.high) if math.isfinite(limit) and limit != self.value]
        found = math.nan if self.value is None else self.value
        few = (n for n in range(3, 9) if all(plain(scale * found, n) != plain(scale * one, n) for one in limits))
        return "" if value is None else plain(scale * value, next(few, 9))

    @property
    def _allowed(self) -> str:
        if self.outcome is Outcome.MARGINAL:
            return f"{self._range}, marginal {self._band}"
        return self._range

    @property
    def _band(self) -> str:
        """Where it is marginal: from the limit that it is near to."""
        low, high = self.low + self.margin, self.high - self.margin
        below = self.value is not None and self.value < low
        return f"below {self._shown(low)}{self._unit}" if below else f"above {self._shown(high)}{self._unit}"

    @property
    def _range(self) -> str:
        low, high = self._shown(self.low), self._shown(self.high)
        if math.isinf(self.low) and math.isinf(self.high):
            return "no limits"
        if math.isinf(self.low):
            return f"at most {high}{self._unit} is allowed"
        if math.isinf(self.high):
            return f"at least {low}{self._unit} is allowed"
        return f"{low} to {high}{self._unit} is allowed"


def judge(measurements: Iterable[Measurement]) -> tuple[Outcome, str]:
    """The worst outcome of some measurements, and the sentences of those that did not pass."""
    taken = tuple(measurements)
    outcome = worst(m.outcome for m in taken)
    return outcome, "; ".join(m.sentence for m in taken if m.outcome is not Outcome.PASS)
