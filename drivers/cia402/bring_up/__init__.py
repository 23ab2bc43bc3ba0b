"""From a silent bus to drives that may have power: identify, write and read back, take over, zero.

In: a master and configs. Out: drives as they were found, or a DeviceError.
"""

from drivers.cia402.bring_up.bringup import HAS_POWER, graded
from drivers.cia402.bring_up.inspection import InspectedObject, Standing, inspect
from drivers.cia402.bring_up.takeover import NOT_TAKEN_OVER, refuse_other_master
from drivers.cia402.bring_up.zero import MEANING, Zeroed

__all__ = [
    "HAS_POWER",
    "MEANING",
    "NOT_TAKEN_OVER",
    "InspectedObject",
    "Standing",
    "Zeroed",
    "graded",
    "inspect",
    "refuse_other_master",
]
