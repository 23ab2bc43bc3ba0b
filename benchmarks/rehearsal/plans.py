"""What is rehearsed: a robot that stands, two windows, and a protocol of nine seconds a window."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from fidim_lab.app import compose
from fidim_lab.data.records import Plan, PlannedWindow, Role
from procedures.settings import HandSettings, MotionSettings, PlaceSettings, RecordSettings, Settings, TensionSettings

RATE = compose.MARKER_RATE


def planned(id_: str, lengths: Sequence[float], position: tuple[float, float, float]) -> PlannedWindow:
    return PlannedWindow(id_, Role.IDENTIFY, np.array(lengths), np.array([-0.012, 0.018]), np.array(position))


START = planned("s", (1.34283, 1.43119, 1.56772, 1.45231), (1.109, -0.273, -0.405))
FIRST = planned("i01", (1.30283, 1.39119, 1.52772, 1.41231), (1.111, -0.271, -0.315))
SECOND = planned("i02", (1.36283, 1.37119, 1.49772, 1.46231), (1.175, -0.260, -0.352))
ONE, TWO = Plan("one window", (FIRST,)), Plan("two windows", (FIRST, SECOND))
STANDS = Plan("where the robot stands", (START, FIRST, SECOND))
"""the simulated robot rests at the first one's lengths, so that the first step is a move"""


def short(**recording: Any) -> Settings:
    """A protocol of nine seconds a window."""
    return Settings(
        motion=MotionSettings(settle_over=0.3, length_limits=compose.length_limits(STANDS)),
        tension=TensionSettings(over=0.2),
        hand=HandSettings(over=0.3, timeout=2.0),
        place=PlaceSettings(over=0.3, speed=0.05, acceleration=0.3),
        record=RecordSettings(**{"seconds": 1.5, **recording}),
    )
