"""The result of a step as a line of the journal: JSON, without infinities and NaN. Pure."""

from collections.abc import Mapping, Sequence
from typing import Any

from procedures.outcomes import Measurement, Outcome


def step_data(
    measurements: Sequence[Measurement],
    values: Sequence[float],
    answer: str,
    readings: Mapping[str, Sequence[float]] | None = None,
) -> dict[str, Any]:
    """Only what there is."""
    data: dict[str, Any] = {}
    if measurements:
        data["measurements"] = [_measurement_data(m) for m in measurements]
    if values:
        data["values"] = [round(value, 6) for value in values]
    for name, numbers in (readings or {}).items():
        data.setdefault("readings", {})[name] = [round(value, 6) for value in numbers]
    if answer:
        data["answer"] = answer
    return data


def _measurement_data(measurement: Measurement) -> dict[str, Any]:
    """As JSON has it: no infinities, no NaN."""
    data: dict[str, Any] = {"name": measurement.name, "outcome": measurement.outcome.value}
    if measurement.outcome is not Outcome.UNSET and measurement.value is not None:
        data["value"] = float(f"{measurement.value:.6g}")
    if measurement.unit:
        data["unit"] = measurement.unit
    limits = {"low": measurement.low, "high": measurement.high}
    return data | {name: value for name, value in limits.items() if abs(value) != float("inf")}
