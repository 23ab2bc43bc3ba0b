"""A drive's own mechanics settings (polarity, gear, feed, encoder) compared with the rig file; read only.

A drive counts feed / gear (6092, 6091) in one turn of its motor, or encoder resolution / position factor (608F, 6093).
Ratios of 1 are a factory's defaults and tell nothing. Source: CiA 402-2, factor group.
"""

from collections.abc import Mapping

from drivers.cia402.dictionary.config import WinchConfig
from drivers.cia402.dictionary.family import speed_unit
from drivers.cia402.dictionary.settings import SettingCheck
from drivers.cia402.profile.scale import wrap32
from drivers.cia402.wire.sdo import SdoChannel, SdoRefusedError

POLARITY, ENCODER, GEAR, FEED, POSITION_FACTOR, UNIT = 0x607E, 0x608F, 0x6091, 0x6092, 0x6093, 0x60A8
SPEED_UNIT, RANGE = 0x60A9, 0x607B
RATIOS = (ENCODER, GEAR, FEED, POSITION_FACTOR)
REVERSED = 0xC0
"""607E: position (bit 7) and velocity (bit 6)"""
INCREMENTS = 0xB5
"""60A8, second byte from the top: positions are in encoder increments; CiA 303-2"""
ALIKE = 1e-4
"""of a ratio: 0.2 mm on 2 m of cable, less than the place of a rig's marker tells"""

Told = Mapping[tuple[int, int], int]
"""(index, sub) → what the drive says"""


def factor_checks(told: Told, config: WinchConfig) -> list[SettingCheck]:
    """One check for each fact that the drive tells. Pure."""
    checks: list[SettingCheck] = []
    if (polarity := told.get((POLARITY, 0))) is not None:
        wanted, found = REVERSED if config.reversed else 0, polarity & REVERSED
        meaning = "polarity (bits 7 and 6; reversed in the rig file)"
        checks.append(SettingCheck("607E:0", meaning, f"0x{wanted:02X}", f"0x{found:02X}", ok=found == wanted))
    turn = config.counts_per_turn if config.motor_counts is None else config.motor_counts
    gear = _ratio(told, GEAR)
    if gear != 1.0:
        checks.append(_alike("6091:1", "gear, motor turns for one of the drum", config.counts_per_turn / turn, gear))
    meaning = "counts for one turn of the motor (counts_per_turn)"
    if (feed := _ratio(told, FEED)) != 1.0:
        checks.append(_alike("6092:1", meaning, turn, feed / gear))
    factor, unit = _ratio(told, POSITION_FACTOR), told.get((UNIT, 0), 0) >> 16 & 0xFF
    if factor != 1.0 or (feed == 1.0 and unit in (0, INCREMENTS)):
        encoder = _ratio(told, ENCODER)
        if encoder != 1.0:
            checks.append(_alike("608F:1", meaning, turn, encoder / factor))
    return [*checks, *_speed_unit(told, config), *_range(told, config)]


def _speed_unit(told: Told, config: WinchConfig) -> list[SettingCheck]:
    """The unit of speeds (60A9), where a drive tells one of those that a family has, against the family's."""
    unit, family = speed_unit(told.get((SPEED_UNIT, 0), 0)), config.family
    if not unit:
        return []
    meaning = f"unit of speeds (family {family.name})"
    return [SettingCheck("60A9:0", meaning, family.speed, unit, ok=family.speaks(unit))]


def _range(told: Told, config: WinchConfig) -> list[SettingCheck]:
    """607B: beyond such a range the position begins anew, and the drive takes no target there."""
    low, high = (wrap32(told.get((RANGE, sub), 0)) for sub in (1, 2))
    if low >= high:  # zeros: no range
        return []
    first, last = sorted(config.scale.count(length) for length in config.length_limits)
    meaning = "range of positions, beyond which it begins again"
    return [
        SettingCheck("607B:1", meaning, f"{first} to {last} in it", f"{low} to {high}", ok=low <= first <= last <= high)
    ]


async def check_factors(sdo: SdoChannel, config: WinchConfig) -> list[SettingCheck]:
    """Read what this drive has of them, and compare. Raises DeviceError where it does not answer."""
    wanted = [(index, 0) for index in (POLARITY, UNIT, SPEED_UNIT)]
    wanted += [(index, sub) for index in (*RATIOS, RANGE) for sub in (1, 2)]
    told: dict[tuple[int, int], int] = {}
    for index, sub in wanted:
        if f"{index:04X}:{sub:X}" in config.family.absent or not sdo.knows(index, sub):
            continue
        try:
            told[index, sub] = await sdo.read(index, sub)
        except SdoRefusedError:  # the EDS file has more than this firmware
            continue
    return factor_checks(told, config)


def _ratio(told: Told, index: int) -> float:
    """1 where it is not told."""
    above, below = told.get((index, 1), 0), told.get((index, 2), 1)
    return above / below if above > 0 and below > 0 else 1.0


def _alike(name: str, meaning: str, wanted: float, found: float) -> SettingCheck:
    return SettingCheck(name, meaning, f"{wanted:g}", f"{found:g}", ok=abs(found - wanted) <= ALIKE * wanted)
