"""A drive's objects compared with the rig file; read only, so possible at any time.

The same table as bring-up (`settings`, `pdo`), but nothing is written: what bring-up would write is `TO_BE_WRITTEN`.
"""

from dataclasses import dataclass
from enum import Enum

from drivers.cia402.bring_up.factors import check_factors
from drivers.cia402.bring_up.zero import check_zero
from drivers.cia402.dictionary.config import WinchConfig
from drivers.cia402.dictionary.settings import Setting, SettingCheck, identity, limits
from drivers.cia402.profile.signals import INPUTS, STO_HINT
from drivers.cia402.watch.node import NodeLink
from drivers.cia402.watch.without_power import read_state
from drivers.cia402.wire.emcy import COMMUNICATION, GENERIC
from drivers.cia402.wire.pdo import COB_MASK, COB_OFF, PdoMap, mapping_expected
from drivers.cia402.wire.sdo import SdoChannel, SdoRefusedError
from drivers.ports import DriveState
from fidim_lab.data.rigs.rig_winch_tables import Signal

HOME = "fidim run PLAN --rig RIG --procedure home"
FACTORS = "correct the rig file or the drive; an object that it has but does not use: absent, in a family file"
_AT_REST = (DriveState.SWITCH_ON_DISABLED, DriveState.READY, DriveState.NOT_READY)
_HIGHEST_MAPPED = 8


class Standing(Enum):
    """The found value compared with the wanted one."""

    HOLDS = "holds"
    TO_BE_WRITTEN = "to be written"
    """another value, which bring-up writes and reads back"""
    WRONG = "wrong"


@dataclass(frozen=True)
class InspectedObject:
    """One object of one drive."""

    object: str
    meaning: str
    wanted: str
    found: str
    standing: Standing
    advice: str = ""


async def inspect(link: NodeLink, config: WinchConfig, host_id: int) -> tuple[InspectedObject, ...]:
    """All that bring-up would look at. Raises DeviceError where the drive does not answer."""
    sdo, able = link.sdo, link.able
    compared = identity(config, link.eds_identity, keeps_mode=able.keeps_mode)
    found = [await _setting(sdo, s) for s in able.fitting(compared)]
    found += [_checked(check, HOME) for check in await check_zero(sdo, config)]
    found += [_checked(check, FACTORS) for check in await check_factors(sdo, config)]
    found += [await _state(link), await _error_register(sdo)]
    if config.sto is not None:
        found.append(await _sto(link, config.sto))
    limited = limits(config, host_id, guarded=able.guarded)
    found += [await _setting(sdo, setting) for setting in able.fitting(limited)]
    found += [await _pdo(sdo, pdo, link.node_id) for pdo in link.layout.pdos]
    if sdo.knows(0x60C2, 1):
        found.append(await _interpolation(sdo))
    return tuple(found)


def _checked(check: SettingCheck, advice: str) -> InspectedObject:
    standing = Standing.HOLDS if check.ok else Standing.WRONG
    return InspectedObject(check.object, check.meaning, check.wanted, check.found, standing, "" if check.ok else advice)


async def _setting(sdo: SdoChannel, setting: Setting) -> InspectedObject:
    mend = "correct the rig file, or put the right drive there" if not setting.write else ""
    if not sdo.knows(setting.index, setting.sub):
        advice = "use the EDS file of this drive; bring-up needs this object"
        return InspectedObject(
            setting.object, setting.meaning, setting.words, "not in the EDS file", Standing.WRONG, advice
        )
    try:
        value = await sdo.read(setting.index, setting.sub)
    except SdoRefusedError as error:
        advice = "this drive lacks what it needs to stop without the host" if setting.write else mend
        return InspectedObject(setting.object, setting.meaning, setting.words, error.reason, Standing.WRONG, advice)
    found = setting.told(value)
    if setting.holds(value):
        return InspectedObject(setting.object, setting.meaning, setting.words, found, Standing.HOLDS)
    if not setting.write:
        return InspectedObject(setting.object, setting.meaning, setting.words, found, Standing.WRONG, mend)
    if not sdo.writable(setting.index, setting.sub):
        advice = "the EDS file has it as read only: set it with the vendor's tool"
        return InspectedObject(setting.object, setting.meaning, setting.words, found, Standing.WRONG, advice)
    return InspectedObject(setting.object, setting.meaning, setting.words, found, Standing.TO_BE_WRITTEN)


async def _sto(link: NodeLink, sto: Signal) -> InspectedObject:
    name, meaning, wanted = f"{INPUTS:04X}:0", "safe torque off (STO)", f"not active (bit {sto.bit})"
    if not link.able.has(INPUTS):
        advice = "this drive does not report its inputs: remove sto from the rig file"
        return InspectedObject(name, meaning, wanted, "not in the EDS file", Standing.WRONG, advice)
    if sto.is_active(await link.sdo.read(INPUTS)):
        return InspectedObject(name, meaning, wanted, "active", Standing.WRONG, STO_HINT)
    return InspectedObject(name, meaning, wanted, "not active", Standing.HOLDS)


async def _state(link: NodeLink) -> InspectedObject:
    state = await read_state(link)
    advice = ""
    if state in (DriveState.FAULT, DriveState.FAULT_REACTION):
        advice = "find the cause, then reset the fault"
    elif state not in _AT_REST:
        advice = "another program uses it, or left it switched on: secure the load, then fidim power-off"
    standing = Standing.WRONG if advice else Standing.HOLDS
    return InspectedObject("6041:0", "state of the drive", "without power, no fault", str(state), standing, advice)


async def _error_register(sdo: SdoChannel) -> InspectedObject:
    """That it misses its host is no matter before there is one: the error goes with the first heartbeat.

    Some leave out the generic bit (CANopenNode). One that keeps the error refuses NMT start, and bring-up says why.
    """
    value = await sdo.read(0x1001)
    wrong = value & ~(COMMUNICATION | GENERIC) if value & COMMUNICATION else value
    advice = "look at the drive's error history (1003) and its display" if wrong else ""
    found = f"{value}{' (misses its host)' if value and not wrong else ''}"
    return InspectedObject("1001:0", "error register", "0", found, Standing.WRONG if wrong else Standing.HOLDS, advice)


async def _pdo(sdo: SdoChannel, pdo: PdoMap, node_id: int) -> InspectedObject:
    """One line for a PDO: its entries by name, or what cannot be mapped."""
    name, wanted = f"{pdo.mapping_index:04X}", " + ".join(f"{e.value[0]:04X}" for e in pdo.entries)
    meaning = f"mapping of {'TPDO' if pdo.transmit else 'RPDO'} {pdo.number}"
    unmappable = [f"{e.value[0]:04X}" for e in pdo.entries if not sdo.mappable(*e.value[:2])]
    try:
        count = await sdo.read(pdo.mapping_index, 0)
        entries = [await sdo.read(pdo.mapping_index, n) for n in range(1, min(count, _HIGHEST_MAPPED) + 1)]
        cob = await sdo.read(pdo.communication_index, 1)
        expected = mapping_expected(pdo, node_id)
        holds = not cob & COB_OFF
        for entry in expected if count == len(pdo.entries) else ():
            value = await sdo.read(entry.index, entry.sub)
            holds &= (value & COB_MASK if (entry.index, entry.sub) == (pdo.communication_index, 1) else value) == (
                entry.value
            )
    except SdoRefusedError as error:
        return InspectedObject(name, meaning, wanted, error.reason, Standing.WRONG, "this drive cannot map PDOs freely")
    found = " + ".join(f"{value >> 16:04X}" for value in entries) or "nothing"
    if cob & COB_OFF:
        found += " (off)"
    if holds and count == len(pdo.entries):
        return InspectedObject(name, meaning, wanted, found, Standing.HOLDS)
    if unmappable:
        advice = f"by its EDS file {', '.join(unmappable)} cannot be mapped"
        return InspectedObject(name, meaning, wanted, found, Standing.WRONG, advice)
    return InspectedObject(name, meaning, wanted, found, Standing.TO_BE_WRITTEN)


async def _interpolation(sdo: SdoChannel) -> InspectedObject:
    try:
        found = f"{await sdo.read(0x60C2, 1) * 10.0 ** await sdo.read(0x60C2, 2) * 1e3:g} ms"
    except SdoRefusedError as error:  # only for people to know
        found = error.reason
    return InspectedObject("60C2", "interpolation period", "any (profile position mode)", found, Standing.HOLDS)
