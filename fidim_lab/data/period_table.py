"""Periods as `[[period]]` of campaign.toml has them, and what is wrong with one, wherever it stands."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from fidim_lab.data.files.toml_file import NotNegative, Positive, Table
from fidim_lab.data.records import Period
from fidim_lab.units import HALL

WORTH = 0.1
"""of a time: what is known to no better says nothing of a body"""
TURNED = 1.5
"""rad: no pendulum swings or leans farther; degrees are 57 times as many"""


class PeriodTable(Table):
    """`[[period]]`."""

    lengths: list[Positive]
    motion: Literal["yaw", "along", "across", "rock"] | None = None
    time: Positive
    swings: Annotated[int, Field(ge=1)] = 1
    sd: Positive
    amplitude: NotNegative | None = None
    tilt: tuple[float, float] | None = None
    tilt_sd: Positive | None = None


@dataclass(frozen=True)
class PeriodMistake:
    """What is wrong with a period."""

    key: str
    """of `[[period]]`"""
    what: str
    """found, and allowed"""
    hint: str = ""


def period_of(table: PeriodTable, cables: int) -> Period | PeriodMistake:
    """The period of a robot with so many cables, or its mistake."""
    if len(table.lengths) != cables:
        return PeriodMistake("lengths", f"{len(table.lengths)} lengths for a robot file of {cables} cables")
    if max(table.lengths) > HALL:
        return PeriodMistake("lengths", f"{max(table.lengths):g} m; up to {HALL:g} m is allowed", "Are they mm?")
    if table.sd > WORTH * table.time:
        what = f"{table.sd:g} s of {table.time:g} s; up to a tenth is allowed"
        return PeriodMistake("sd", what, "It is the standard deviation of the time of all swings, s.")
    if (table.tilt is None) != (table.tilt_sd is None):
        key, other = ("tilt_sd", "tilt") if table.tilt_sd is None else ("tilt", "tilt_sd")
        return PeriodMistake(key, f"is missing beside {other}", "A tilt is two angles at rest and their sd, rad.")
    angles = (table.amplitude or 0.0, *(table.tilt or ()))
    worst = int(np.argmax(np.abs(angles)))
    if abs(angles[worst]) > TURNED:
        key = "tilt" if worst else "amplitude"
        return PeriodMistake(key, f"{angles[worst]:g} rad; up to {TURNED:g} is allowed", "Are they degrees?")
    tilt = None if table.tilt is None or table.tilt_sd is None else (*table.tilt, table.tilt_sd)
    lengths = np.array(table.lengths)
    return Period(lengths, table.motion or "", table.time, table.swings, table.sd, table.amplitude, tilt)


def as_tables(periods: tuple[Period, ...]) -> list[dict[str, object]]:
    """As campaign.toml has them."""
    return [
        {
            **({"motion": one.motion} if one.motion else {}),
            "lengths": one.lengths.tolist(),
            "swings": one.swings,
            "time": one.time,
            "sd": one.sd,
            **({} if one.amplitude is None else {"amplitude": one.amplitude}),
            **({} if one.tilt is None else {"tilt": list(one.tilt[:2]), "tilt_sd": one.tilt[2]}),
        }
        for one in periods
    ]
