"""A winch adapted to its drive before the drive is asked: by dictionary and family alone."""

import canopen

from drivers.cia402.dictionary.abilities import Abilities, abilities, dictionary_of
from drivers.cia402.dictionary.config import GENERIC_EDS, WinchConfig
from drivers.cia402.dictionary.family import GENERIC_FAMILY, speed_unit
from drivers.cia402.dictionary.grading import grade, narrowed
from drivers.cia402.dictionary.requirements import Graded
from drivers.cia402.wire.sdo import told_by_file
from drivers.ports import Trial


def fitted(config: WinchConfig) -> WinchConfig:
    """With the smaller area and the lower speed that take the place of what the drive lacks (`grading.narrowed`).

    Raises SetupError naming the winch where its EDS file cannot be read.
    """
    if config.eds == GENERIC_EDS and config.family == GENERIC_FAMILY:
        return config
    return narrowed(config, by_file(dictionary_of(config), config)[1])


def by_file(known: canopen.ObjectDictionary, config: WinchConfig) -> tuple[Abilities, tuple[Graded, ...]]:
    """Abilities and grade table by a dictionary; a value that cannot be written is believed to be the file's."""
    able = abilities(known, config)
    told = {f"{i:04X}:{s:X}": r.default for (i, s), r in able.registers.items() if r.default is not None}
    return able, grade(able, config, told, config.serial_number or _tried(config))


def speed_unit_by_file(known: canopen.ObjectDictionary) -> str:
    """The unit of speeds that the file itself tells (60A9); empty where it tells none that a family has."""
    said = known.get_variable(0x60A9)
    return "" if said is None else speed_unit(told_by_file(said) or 0)


def _tried(config: WinchConfig) -> int:
    """The serial number of the drive that is believed to be there where the rig file names none.

    That of the quick stop first: its proof alone makes the winch slower.
    """
    proofs = sorted(config.proofs, key=lambda proof: (proof.trial is Trial.QUICK_STOP, proof.at))
    return proofs[-1].serial_number if proofs else 0
