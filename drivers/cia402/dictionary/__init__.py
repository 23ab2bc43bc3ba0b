"""One winch of the rig file and its drive: what is compared and written, what the drive can do, with grades.

In: a rig entry, an EDS, a family of drives. Out: a WinchConfig, Abilities, a table of grades.
"""

from drivers.cia402.dictionary.config import GENERIC_EDS, Load, WinchConfig
from drivers.cia402.dictionary.family import AmpereObject, DriveFamily, family_path, read_family
from drivers.cia402.dictionary.requirements import Graded, Met, TrialPassed
from drivers.cia402.dictionary.settings import stop_settings

__all__ = [
    "GENERIC_EDS",
    "AmpereObject",
    "DriveFamily",
    "Graded",
    "Load",
    "Met",
    "TrialPassed",
    "WinchConfig",
    "family_path",
    "read_family",
    "stop_settings",
]
