"""What the drivers are told of each winch of a rig file: its entry, the proofs of its stops, what its drive lacks."""

import math
from dataclasses import replace
from pathlib import Path

from drivers.cia402.dictionary import (
    GENERIC_EDS,
    DriveFamily,
    Load,
    TemperatureObject,
    WinchConfig,
    family_path,
    read_family,
)
from drivers.cia402.dictionary.config import StopReactions, StoredZero
from drivers.cia402.dictionary.fitted import fitted
from drivers.cia402.profile import Mode, Signal
from fidim_lab.app.compose.proofs import held_proofs
from fidim_lab.data.rigs.rig import RigFile, WinchEntry
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
        return replace(fitted(config), proofs=proofs, on_trial=True)
    return fitted(replace(config, proofs=proofs))


def _winch_config(
    entry: WinchEntry, newton_per_ampere: float, sample_age: float, homing: bool, folder: Path
) -> WinchConfig:
    family = read_family(family_path(entry.family, folder))
    return WinchConfig(
        name=entry.name,
        node_id=entry.node_id,
        counts_per_turn=entry.counts_per_turn * entry.gear_ratio,
        drum_radius=entry.drum_radius,
        rated_current=entry.rated_current,
        current_limit=entry.current_limit,
        max_speed=entry.max_speed,
        max_acceleration=entry.max_acceleration,
        length_limits=entry.length_limits,
        direction=entry.direction,
        reversed=entry.reversed,
        home_count=entry.home_count,
        home_length=entry.home_length,
        quick_stop_deceleration=entry.quick_stop_deceleration,
        following_error=entry.following_error,
        following_error_time=entry.following_error_time,
        heartbeat=entry.heartbeat,
        host_timeout=entry.host_timeout,
        sdo_timeout=entry.sdo_timeout,
        step_timeout=STEP_TIMEOUT + entry.brake_time,
        stop=StopReactions(**vars(entry.stop)),
        eds=entry.eds_file or GENERIC_EDS,
        vendor_id=entry.vendor_id,
        product_code=entry.product_code,
        serial_number=entry.serial_number,
        rated_torque=entry.rated_torque,
        sample_age=sample_age,
        current_offset=entry.tension.offset / newton_per_ampere,
        temperature=_temperature(entry),
        sto=None if entry.sto is None else Signal(**vars(entry.sto)),
        brake_output=None if entry.brake_output is None else Signal(**vars(entry.brake_output)),
        family=family,
        motor_counts=entry.counts_per_turn,
        load=_load(entry, family),
        torque_constant=entry.torque_constant,
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


def _temperature(entry: WinchEntry) -> TemperatureObject | None:
    asked = entry.temperature
    return None if asked is None else TemperatureObject(asked.index, asked.sub, asked.scale)
