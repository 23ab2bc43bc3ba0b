"""What the drivers are told of each winch of a rig file: its entry, the proofs of its stops, what its drive lacks."""

import math
from pathlib import Path

from drivers.cia402.dictionary import (
    GENERIC_EDS,
    DriveFamily,
    Load,
    WinchConfig,
    family_path,
    read_family,
)
from drivers.cia402.dictionary.config import StoredZero
from drivers.cia402.dictionary.fitted import fitted
from drivers.cia402.profile import Mode
from fidim_lab.app.compose.proofs import held_proofs
from fidim_lab.data.rigs.rig import RigFile, WinchEntry
from fidim_lab.data.rigs.rig_winch_tables import WinchSettings
from fidim_lab.errors import SetupError

MODES = {"profile-position": Mode.PROFILE_POSITION, "cyclic-position": Mode.CYCLIC_POSITION}
STEP_TIMEOUT = 2.0
"""s for one step of a drive's machine, besides its brake"""


def winch_configs(file: RigFile, *, homing: bool = False, on_trial: bool = False) -> tuple[WinchConfig, ...]:
    """What the drivers are told of each winch. Raises SetupError naming file, winch and key.

    homing: stored zeros are about to be made anew, so that none is checked. on_trial: stops are about to be tried.
    """
    winches = file.robot.winches or ()
    age = file.guards.stale_winch.age
    try:
        configs = [
            _winch_config(entry, winch.newton_per_ampere, age, homing, file.path.parent)
            for entry, winch in zip(file.winches, winches, strict=True)
        ]
        return tuple(_fitted(file, one, on_trial=on_trial) for one in configs)
    except SetupError as error:
        raise SetupError(f"{file.path}: {error.message}", hint=error.hint) from error


def _fitted(file: RigFile, config: WinchConfig, *, on_trial: bool) -> WinchConfig:
    """With its proofs, and slower where one of them says so (`fitted`).

    On trial the proofs are not asked: the trial that is to take the place of a weak stop is made at its own speed.
    """
    proofs = held_proofs(file, config)
    if on_trial:
        return fitted(config).changed(proofs=proofs, on_trial=True)
    return fitted(config.changed(proofs=proofs))


def _winch_config(
    entry: WinchEntry, newton_per_ampere: float, sample_age: float, homing: bool, folder: Path
) -> WinchConfig:
    family = read_family(family_path(entry.family, folder))
    said = {key: getattr(entry, key) for key in WinchSettings.model_fields}
    return WinchConfig(
        **said,
        counts_per_turn=entry.counts_per_turn * entry.gear_ratio,
        motor_counts=entry.counts_per_turn,
        step_timeout=STEP_TIMEOUT + entry.brake_time,
        eds=entry.eds_file or GENERIC_EDS,
        sample_age=sample_age,
        current_offset=entry.tension.offset / newton_per_ampere,
        torque_constant=entry.torque_constant,
        family=family,
        load=_load(entry, family),
        mode=MODES[entry.mode],
        zero=None if homing else _stored_zero(entry),
    )


def _load(entry: WinchEntry, family: DriveFamily) -> Load:
    if entry.load is None and family.load_object is not None:
        return Load.VENDOR
    return Load(entry.load or family.load)


def _stored_zero(entry: WinchEntry) -> StoredZero | None:
    home = entry.home
    if home is None:
        return None
    per_metre = entry.counts_per_turn * entry.gear_ratio / (2.0 * math.pi * entry.drum_radius)
    return StoredZero(home.serial_number, entry.multi_turn, home.last_count, max(1, round(entry.turned * per_metre)))
