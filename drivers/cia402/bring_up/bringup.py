"""Bring-up of one drive: identify it, write limits and stop reactions, map PDOs; everything read back.

The result is a list of checks (a table for a person); the drive stays without power, and one that fails a check is left
in PRE-OPERATIONAL, where it takes no controlword by PDO.
"""

import contextlib
from collections.abc import Iterable
from dataclasses import dataclass

from drivers.cia402.bring_up.factors import check_factors
from drivers.cia402.bring_up.zero import check_zero
from drivers.cia402.dictionary.config import WinchConfig
from drivers.cia402.dictionary.grading import grade, refusals
from drivers.cia402.dictionary.requirements import Graded
from drivers.cia402.dictionary.settings import STOPS, Setting, SettingCheck, identity, interpolation, limits
from drivers.cia402.profile.words import Mode, mode_name
from drivers.cia402.watch.master import CanopenMaster
from drivers.cia402.watch.node import NodeLink
from drivers.cia402.watch.without_power import read_state
from drivers.cia402.wire.emcy import emergency_words, register_words
from drivers.cia402.wire.nmt import NmtCommand, NmtState
from drivers.cia402.wire.pdo import COB_MASK, COB_OFF, Mappable, ObjectValue, PdoMap, mapping_expected, mapping_writes
from drivers.cia402.wire.sdo import SdoRefusedError
from drivers.clock import wait_until
from drivers.ports import DriveState
from fidim_lab.errors import DeviceError

_POWERED = (
    DriveState.SWITCHED_ON,
    DriveState.OPERATION_ENABLED,
    DriveState.QUICK_STOP_ACTIVE,
    DriveState.FAULT_REACTION,
)
HAS_POWER = "the drive has power already"
CLEARED = (
    "Some drives do not start while an error is active. Find its cause; secure the load, then: fidim power-off RIG "
    "--acknowledge NAME. If the error stays, switch the drive's supply off and on."
)
"""No NMT reset is sent by itself: with the error a drive may lose what it counted, and only a person knows the load"""
UNSAMPLED = "Is SYNC running (CanopenMaster.run), and does the drive send its TPDOs on SYNC?"
OF_A_MOVE = ("6083:0", "6084:0")
"""ramps that each move sets anew"""
_ON = COB_OFF | COB_MASK
"""what counts of an identifier"""
_COMMUNICATION = tuple(range(0x1400, 0x1404)) + tuple(range(0x1800, 0x1804))


@dataclass(frozen=True)
class BroughtUp:
    """The result of a bring-up."""

    checks: tuple[SettingCheck, ...]
    grades: tuple[Graded, ...]


async def bring_up(master: CanopenMaster, link: NodeLink, config: WinchConfig) -> BroughtUp:
    """All checks and grades, once all of them hold. `master.run()` must be running.

    Raises DeviceError naming every object that does not hold, every requirement that is not met, a drive that has
    power, or one that does not answer.
    """
    link.forget()
    compared = identity(config, link.eds_identity, keeps_mode=link.able.keeps_mode)
    checks = [await _apply(link, setting) for setting in link.able.fitting(compared)]
    checks += await check_factors(link.sdo, config)
    checks += await check_zero(link.sdo, config)
    _refuse(config, checks)
    grades = await graded(link, config)
    refuse_grades(config, grades)
    await _refuse_power(link, config)
    asked = master.clock.now()
    link.send_nmt(NmtCommand.PRE_OPERATIONAL)
    written = (*limits(config, master.host_id, guarded=link.able.guarded), *interpolation(config, master.period))
    checks += [await _apply(link, setting) for setting in link.able.fitting(written)]
    _refuse(config, checks)
    await _await_nmt(master, link, config, NmtState.PRE_OPERATIONAL, asked)
    checks += await _map_pdos(link, link.layout.pdos)
    checks.append(await _choose_mode(master, link, config))
    _refuse(config, checks)
    await start_sampling(master, link, config)
    return BroughtUp(tuple(checks), grades)


async def graded(link: NodeLink, config: WinchConfig) -> tuple[Graded, ...]:
    """The grade table of a drive: only read, so that it can be asked for at any time. Raises DeviceError."""
    told: dict[str, int] = {}
    for setting in link.able.kept(limits(config, 0, guarded=link.able.guarded)):
        with contextlib.suppress(SdoRefusedError):
            told[setting.object] = await link.sdo.read(setting.index, setting.sub)
    serial_number = 0
    if link.able.has(0x1018, 4):
        with contextlib.suppress(SdoRefusedError):
            serial_number = await link.sdo.read(0x1018, 4)
    return grade(link.able, config, told, serial_number)


def refuse_grades(config: WinchConfig, grades: tuple[Graded, ...]) -> None:
    """Raise DeviceError naming what this drive must have and has not, unless it is on trial for it."""
    if wrong := refusals(grades, on_trial=config.on_trial):
        raise DeviceError(
            config.device,
            "refused, it must not be switched on: " + "; ".join(wrong) + ".",
            hint="Use the EDS file of this drive and its firmware; docs/rig.md, Bring your drive, says what each is.",
        )


async def forgotten(link: NodeLink, config: WinchConfig, host_id: int) -> list[str]:
    """What bring-up has written and the drive no longer holds, in sentences: it has restarted unheard.

    Ramps are left out, which each move sets anew. Raises DeviceError where the drive does not answer.
    """
    written = (s for s in _written(link, config, host_id) if s.object not in OF_A_MOVE)
    found = [(setting, await link.sdo.read(setting.index, setting.sub)) for setting in written]
    return [f"{s.object} {s.meaning}: {value} found, {s.words} written" for s, value in found if not s.holds(value)]


def stops_rest_on(link: NodeLink, config: WinchConfig, host_id: int) -> tuple[Setting, ...]:
    """What a working drive must keep as it was written: else its next stop is another, or does not reach it."""
    heard = (
        Setting(pdo.communication_index, 1, pdo.cob_id(link.node_id), f"identifier of RPDO {pdo.number}", mask=_ON)
        for pdo in link.layout.pdos
        if not pdo.transmit
    )
    return (*(s for s in _written(link, config, host_id) if s.object in STOPS), *heard)


def _written(link: NodeLink, config: WinchConfig, host_id: int) -> tuple[Setting, ...]:
    return tuple(s for s in link.able.fitting(limits(config, host_id, guarded=link.able.guarded)) if s.write)


def _refuse(config: WinchConfig, checks: Iterable[SettingCheck]) -> None:
    wrong = [str(check) for check in checks if not check.ok]
    if wrong:
        raise DeviceError(
            config.device,
            "refused, it must not be switched on: " + "; ".join(wrong) + ".",
            hint="Correct the rig file, or choose what this drive supports.",
        )


async def _apply(link: NodeLink, setting: Setting) -> SettingCheck:
    """Write where asked, read back, compare. A refusal by the drive is a failed check, no answer is an error."""
    try:
        if setting.write:
            await link.sdo.write(setting.index, setting.sub, setting.wanted)
        found = await link.sdo.read(setting.index, setting.sub)
    except SdoRefusedError as error:
        return SettingCheck(setting.object, setting.meaning, setting.words, error.reason, ok=False)
    return setting.check(found)


async def _refuse_power(link: NodeLink, config: WinchConfig) -> None:
    state = await read_state(link)
    if state in _POWERED:
        raise DeviceError(
            config.device,
            f"{HAS_POWER} ({state}).",
            hint="Left by a run? fidim resume DIR keeps the load held. Otherwise secure it, then: fidim power-off RIG.",
        )


async def _await_nmt(master: CanopenMaster, link: NodeLink, config: WinchConfig, state: NmtState, asked: float) -> None:
    """By its heartbeat or its answers to node guarding; one without has its samples to show that it is operational."""
    if not link.able.tells_its_state:
        return

    def there() -> bool:
        heartbeat = link.heartbeat
        return heartbeat is not None and heartbeat.t >= asked and heartbeat.state is state

    timeout = config.step_timeout + 2.0 * config.heartbeat
    if not await wait_until(master.clock, there, timeout=timeout, period=master.period):
        last = link.heartbeat
        found = (
            "no heartbeat"
            if last is None
            else f"{last.state.words} by its last heartbeat, {master.clock.now() - last.t:.2f} s ago"
        )
        error = await _standing_error(link) if state is NmtState.OPERATIONAL else ""
        hint = CLEARED if error else ""
        raise DeviceError(config.device, f"{state.words} expected within {timeout:g} s, {found}{error}.", hint=hint)


async def _standing_error(link: NodeLink) -> str:
    """Why a node may not start: CANopenNode takes no NMT start while its error register is not 0.

    Its version 1 keeps a heartbeat that it once missed there until it is restarted.
    """
    register = last = 0
    with contextlib.suppress(DeviceError):
        register = await link.sdo.read(0x1001)
        last = await link.sdo.read(0x1003, 1) & 0xFFFF
    if not register:
        return ""
    newest = f"; its last error (1003:1) is 0x{last:04X}, {emergency_words(last)}" if last else ""
    return f"; its error register (1001) is {register_words(register)}{newest}"


async def _map_pdos(link: NodeLink, pdos: tuple[PdoMap, ...]) -> list[SettingCheck]:
    used = {pdo.communication_index for pdo in pdos}
    ids = {pdo.cob_id(link.node_id) for pdo in pdos}
    unused = (index for index in _COMMUNICATION if index not in used and link.able.has(index, 1))
    checks = [await _switch_off(link, index, ids) for index in unused]
    for pdo in pdos:
        try:
            for entry in mapping_writes(pdo, link.node_id):
                await link.sdo.write(entry.index, entry.sub, entry.value)
        except SdoRefusedError as error:
            wanted = " + ".join(e.name for e in pdo.entries)
            checks.append(SettingCheck(f"{pdo.mapping_index:04X}:0", "PDO mapping", wanted, error.reason, ok=False))
            continue
        checks += [await _compare(link, entry) for entry in mapping_expected(pdo, link.node_id)]
    return checks


async def _switch_off(link: NodeLink, index: int, ids: set[int]) -> SettingCheck:
    """A PDO that we do not use must not talk, nor take controlwords.

    One that the drive keeps on may stay where its identifier is none of ours: nobody sends to it or listens to it.
    """
    kept = not link.able.can_write(index, 1)
    try:
        cob = await link.sdo.read(index, 1)
        if not (kept or cob & COB_OFF):
            await link.sdo.write(index, 1, cob | COB_OFF)
            cob = await link.sdo.read(index, 1)
    except SdoRefusedError as error:
        return SettingCheck(f"{index:04X}:1", "unused PDO", "off", error.reason, ok=False)
    off = bool(cob & COB_OFF)
    found = "off" if off else f"on, identifier {cob & COB_MASK:X}{', read only' if kept else ''}"
    return SettingCheck(f"{index:04X}:1", "unused PDO", "off", found, ok=off or (kept and cob & COB_MASK not in ids))


async def _compare(link: NodeLink, entry: ObjectValue) -> SettingCheck:
    found = await link.sdo.read(entry.index, entry.sub)
    is_cob = entry.sub == 1 and entry.index in _COMMUNICATION
    compared = found & _ON if is_cob else found
    return SettingCheck(
        f"{entry.index:04X}:{entry.sub:X}",
        "PDO mapping",
        f"0x{entry.value:X}",
        f"0x{compared:X}",
        ok=compared == entry.value,
    )


async def _choose_mode(master: CanopenMaster, link: NodeLink, config: WinchConfig) -> SettingCheck:
    """Write 6060 and look at 6061: a drive may keep its old mode without a word, or for good (6060 read only).

    Some families display no mode (0) before they are enabled, and hold what they were told in 6060 until then:
    enabling looks again, and takes the power away at once where the mode is not displayed.
    """
    wanted = link.mode = config.mode
    try:
        if not link.able.keeps_mode:
            await link.sdo.write(Mappable.MODE.index, 0, wanted)
    except SdoRefusedError as error:
        return SettingCheck("6060:0", "mode of operation", mode_name(wanted), error.reason, ok=False)
    found = await link.ask_mode(master.clock, wanted, master.period, config.step_timeout)
    name, ok = mode_name(found), found == wanted
    if found == Mode.NONE and config.family.mode_shown == "enabled":
        ok = await link.sdo.read(Mappable.MODE.index) == wanted
        name += " until it is enabled"
    elif found == Mode.NONE:
        name += " until it is enabled, which its family file does not allow (mode_shown)"
    return SettingCheck("6061:0", "mode of operation", mode_name(wanted), name, ok=ok)


async def start_sampling(master: CanopenMaster, link: NodeLink, config: WinchConfig) -> None:
    """Have the node operational, and its first whole sample; power is not touched. Raises DeviceError."""
    asked = master.clock.now()
    link.answers.restart()  # what an earlier host had it send up to now answered other SYNCs
    link.send_nmt(NmtCommand.START)
    # A node that an earlier host has left operational has said so by its last heartbeat: its next is not waited for.
    await _await_nmt(master, link, config, NmtState.OPERATIONAL, asked - config.heartbeat)

    def sampled() -> bool:
        return link.values is not None and link.values.t >= asked

    if not await wait_until(master.clock, sampled, timeout=config.step_timeout, period=master.period):
        decoder, error = link.decoder, await _standing_error(link)
        raise DeviceError(
            config.device,
            f"no sample within {config.step_timeout:g} s of NMT start ({decoder.incomplete} incomplete, "
            f"{decoder.malformed} of a wrong length){error}.",
            hint=CLEARED if error else UNSAMPLED,
        )
    if link.twins.says:
        raise DeviceError(
            config.device,
            f"two nodes answer with id {config.node_id} ({link.twins.says}); neither may be switched on.",
            hint="Unplug one, or give it an id of its own (its DIP switches, LSS or the vendor's tool).",
        )
    link.brought_up = True
