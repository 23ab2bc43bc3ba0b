"""The zero of an encoder: from a known length; used in a later session only where something proves it.

A drive that lost its power may count from another zero. A multi-turn encoder keeps its own, so the same drive (serial
number) is proof. Any other encoder proves nothing by itself; its zero is believed while it stands where it was seen
last, to within a tolerance: after a power cut it counts from elsewhere.
"""

from dataclasses import dataclass

from drivers.cia402.dictionary.config import StoredZero, WinchConfig
from drivers.cia402.dictionary.settings import SettingCheck
from drivers.cia402.profile.scale import wrap32
from drivers.cia402.wire.pdo import DriveValues
from drivers.cia402.wire.sdo import SdoChannel
from fidim_lab.errors import DeviceError, RefusedError

OBJECT, MEANING = "6064:0", "encoder where its stored zero was left"


@dataclass(frozen=True)
class Zeroed:
    """A length that an encoder was told, and whose encoder it is."""

    vendor_id: int
    product_code: int
    serial_number: int
    count: int
    length: float
    """m"""


def zero_check(zero: StoredZero, serial_number: int, count: int) -> SettingCheck:
    """Whether a stored zero still counts for the drive with this serial number that shows this count. Pure."""
    if serial_number != zero.serial_number:
        wanted, found = f"drive {zero.serial_number}", f"drive {serial_number}: home it"
        return SettingCheck(OBJECT, MEANING, wanted, found, ok=False)
    if zero.multi_turn:
        if zero.serial_number:
            return SettingCheck(OBJECT, MEANING, "multi-turn", f"{count}, drive {serial_number}", ok=True)
        return SettingCheck(
            OBJECT, MEANING, "a serial number", "none, so the zero cannot be assigned to this drive: home it", ok=False
        )
    if zero.last_count is None:
        return SettingCheck(OBJECT, MEANING, "a last known position", "none: home it", ok=False)
    off = wrap32(count - zero.last_count)
    ok = abs(off) <= zero.tolerance
    found = str(count) if ok else f"{count}: its power was off, or the drum was turned; home it"
    return SettingCheck(OBJECT, MEANING, f"{zero.last_count} ± {zero.tolerance}", found, ok=ok)


async def check_zero(sdo: SdoChannel, config: WinchConfig) -> list[SettingCheck]:
    """The check of a winch that has a stored zero; empty for one whose rig file says its zero."""
    if config.zero is None:
        return []
    return [zero_check(config.zero, await sdo.read(0x1018, 4), await sdo.read(0x6064))]


async def read_zero(sdo: SdoChannel, config: WinchConfig, values: DriveValues, length: float) -> Zeroed:
    """The present count as the place of `length` (m).

    Raises RefusedError for a length outside the winch's limits, DeviceError for a drum that turns.
    """
    low, high = config.length_limits
    if not low <= length <= high:
        raise RefusedError(f"{config.device}: a length of {length:.4f} m, its length_limits are {low:g} to {high:g} m.")
    if values.velocity:
        raise DeviceError(config.device, f"turns ({values.velocity} counts/s) while its length is set.")
    identity = [await sdo.read(0x1018, sub) for sub in (1, 2, 4)]
    return Zeroed(*identity, count=values.position, length=length)
