"""The table of requirements of one drive: how it meets each, by abilities, values and trials. Pure."""

from collections.abc import Mapping
from dataclasses import replace

from drivers.cia402.dictionary.abilities import Abilities
from drivers.cia402.dictionary.config import Load, WinchConfig
from drivers.cia402.dictionary.registers import Access
from drivers.cia402.dictionary.requirements import REQUIREMENTS, Graded, Met, Requirement, Trial, met_by_trial
from drivers.cia402.dictionary.settings import Setting, limits
from drivers.cia402.profile.words import Mode, mode_name
from drivers.cia402.wire.pdo import Mappable

_STOPS = {"605D:0": range(1, 5), "605E:0": range(1, 5)}
"""values that stop: any of them will do where the drive does not let it be written"""
_HOST = 127
"""stands in for the host's node; only whether 1016 can be written counts here"""


_MODE = "6060:0"
_COMMANDED = ("6040:0", _MODE, "607A:0", "6081:0", "6083:0", "60C2:1", "60C2:2")
"""what a move writes: one that keeps such an object to itself moves otherwise than it is told"""


def grade(able: Abilities, config: WinchConfig, told: Mapping[str, int], serial_number: int) -> tuple[Graded, ...]:
    """The whole table. told: values of objects that the drive shows and does not let be written (`Abilities.kept`)."""
    wanted = {setting.object: setting for setting in limits(config, _HOST, guarded=able.guarded)}
    return tuple(
        _grade(_as_configured(requirement, able, config), able, config, wanted, told, serial_number)
        for requirement in REQUIREMENTS
    )


def refusals(table: tuple[Graded, ...], *, on_trial: bool) -> list[str]:
    """Why no winch may be entrusted to it, in sentences; on trial, what is to be proven is not asked for."""
    refused = [line for line in table if line.refused]
    lacks = [f"{line.requirement.key}: {line.found}" for line in refused if not line.requirement.trials]
    unproven = [f"{line.requirement.key} ({line.found})" for line in refused if line.requirement.trials]
    if unproven and not on_trial:
        lacks.append(f"neither configured nor proven by trial (fidim commission RIG): {', '.join(unproven)}")
    return lacks


def narrowed(config: WinchConfig, table: tuple[Graded, ...]) -> WinchConfig:
    """The winch with what takes the place of what its drive lacks: a smaller area, a lower speed.

    Without limits in the drive a runaway ends where a stop ends that begins at the limit: the area is smaller by the
    way of a quick stop from the highest speed. A stop that was proven by trial may be weaker than the one that could
    not be configured: the speed is lowered until its way is no longer than that one's.
    """
    stops = [p for line in table if (p := line.proof) is not None and p.trial is Trial.QUICK_STOP and p.distance > 0.0]
    deceleration = min((0.5 * p.speed**2 / p.distance for p in stops), default=config.quick_stop_deceleration)
    weaker = min(1.0, deceleration / config.quick_stop_deceleration)
    changed = config.changed(max_speed=config.max_speed * weaker**0.5)
    if any(line.requirement.key == "position limits" and line.met is Met.HOST for line in table):
        low, high = config.length_limits
        way = min(0.5 * changed.max_speed**2 / deceleration, 0.4 * (high - low))
        changed = changed.changed(length_limits=(low + way, high - way))
    return changed


_RAMPS = {Mode.PROFILE_POSITION: ("6081:0", "6083:0"), Mode.CYCLIC_POSITION: ("60C2:1", "60C2:2")}
"""what a move needs beside its target, in the modes in which a winch is driven"""
_IN_RIG_FILE = {Mode.PROFILE_POSITION: "profile-position", Mode.CYCLIC_POSITION: "cyclic-position"}
_OF_THE_NETWORK = ("reaction to a lost host", "heartbeat of the drive")
"""what heartbeats or node guarding give, never both: heartbeats first"""


def _as_configured(requirement: Requirement, able: Abilities, config: WinchConfig) -> Requirement:
    """Where the winch's mode, the drive or the family puts an object in the place of another."""
    if requirement.key in _OF_THE_NETWORK:
        return replace(requirement, objects=(requirement.objects[able.guarded],))
    own = {"current limit": config.family.current_limit, "rated current": config.family.rated_current}
    vendor = own.get(requirement.key)
    if vendor is not None:
        return replace(requirement, objects=((f"{vendor.index:04X}:{vendor.sub:X}",), *requirement.objects))
    if requirement.key == "position command":
        return replace(requirement, objects=((*requirement.objects[0], *_RAMPS[config.mode]),))
    return requirement


def _grade(
    requirement: Requirement,
    able: Abilities,
    config: WinchConfig,
    wanted: Mapping[str, Setting],
    told: Mapping[str, int],
    serial_number: int,
) -> Graded:
    if requirement.key == "samples at each SYNC":
        if able.layout.problem:
            return Graded(requirement, Met.ABSENT, able.layout.problem)
        carried = able.layout.tells(Mappable.VELOCITY.name)
        return Graded(requirement, Met.CONFIGURED, "PDOs" if carried else "PDOs; no 606C: speed by the positions")
    if requirement.key == "load reported":
        return _load(requirement, able, config)
    lacks: list[str] = []
    other = _other_mode(able, config.mode, told) if requirement.key == "position command" else ""
    if requirement.key == "position command" and (says := _without_mode(config.mode, told)):
        return Graded(requirement, Met.ABSENT, says + other)
    for alternative in requirement.objects:
        problems = [says for name in alternative if (says := _problem(name, able, wanted.get(name), told, config.mode))]
        if not problems:
            return Graded(requirement, Met.CONFIGURED, " + ".join(alternative))
        lacks.append(" and ".join(problems))
    found = "; ".join(lacks) + other
    if (proof := met_by_trial(requirement, config.proofs, serial_number)) is not None:
        shown = f"{proof.trial}: {1e3 * proof.distance:.1f} mm in {proof.time:.2f} s from {proof.speed:g} m/s"
        return Graded(requirement, Met.TRIAL, f"{found}; {shown}", proof)
    if requirement.instead:
        return Graded(requirement, Met.HOST, found)
    return Graded(requirement, Met.ABSENT, found)


def _problem(name: str, able: Abilities, wanted: Setting | None, told: Mapping[str, int], mode: Mode) -> str:
    """Why this object does not meet what is required of it; empty where it does."""
    index, sub = (int(part, 16) for part in name.split(":"))
    access = able.access(index, sub)
    if access is Access.ABSENT:
        return (able.without_axis if name == "6040:0" else "") or f"no {name}"
    if access is Access.WRITE or (wanted is None and name not in _COMMANDED):
        return ""
    value = told.get(name)
    if name == _MODE:
        value = value or told.get("6061:0") or mode  # not told: bring-up sees what its own configuration is
        if value == mode:
            return ""
    if value is not None and wanted is not None and (wanted.holds(value) or value in _STOPS.get(name, ())):
        return ""
    return f"{name} is read only{'' if value is None else f' and {value}'}"


def _without_mode(mode: Mode, told: Mapping[str, int]) -> str:
    """Whether a drive says that it does not have the mode (6502)."""
    modes = told.get("6502:0")
    return f"6502:0 is 0x{modes:X}: no {mode_name(mode)}" if modes and not modes >> (mode - 1) & 1 else ""


def _other_mode(able: Abilities, mode: Mode, told: Mapping[str, int]) -> str:
    """Which mode of the rig file this drive does have instead; empty where it has none."""
    for other, needs in _RAMPS.items():
        there = all(able.can_write(int(name[:4], 16), int(name[5:], 16)) for name in needs)
        if other is not mode and there and able.can_write(0x6060) and not _without_mode(other, told):
            return f'; it has {mode_name(other)}: set mode = "{_IN_RIG_FILE[other]}"'
    return ""


def _load(requirement: Requirement, able: Abilities, config: WinchConfig) -> Graded:
    tells = next((e for pdo in able.layout.tpdos for e in pdo.entries if e.name not in _NO_LOAD), None)
    if tells is None:
        own = config.family.load_object
        asked = {Load.CURRENT: "6078:0", Load.TORQUE: "6077:0"}.get(config.load, "")
        name = asked or (f"{own.index:04X}:{own.sub:X}" if own else "")
        other = able.registers.get((0x6077, 0))
        could = config.load is Load.CURRENT and other is not None and other.mappable and other.code
        says = '; it has 6077: set load = "torque"' if could and not able.has(0x6078) else ""
        if not says and not own and other is None and not able.has(0x6078):
            says = "; name the object that holds its current in a family file (load)"
        return Graded(requirement, Met.HOST, f"no TPDO carries {name}{says}")
    index, sub, _ = tells.value
    return Graded(requirement, Met.CONFIGURED, f"{index:04X}:{sub:X}")


_NO_LOAD = ("", "STATUSWORD", "POSITION", "MODE_DISPLAY", "VELOCITY")
