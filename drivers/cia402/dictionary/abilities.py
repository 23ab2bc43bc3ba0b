"""What one drive can do: dictionary and family as one frozen value, for bring-up, moves and modes. Pure.

No part of this program asks for a maker: it asks whether an object is there, may be written, may be mapped.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from canopen.objectdictionary import ObjectDictionary

from drivers.cia402.dictionary.config import WinchConfig
from drivers.cia402.dictionary.layout import PdoLayout, Registers, lay_out
from drivers.cia402.dictionary.registers import Access, registers_of
from drivers.cia402.dictionary.settings import Setting
from fidim_lab.data.eds import read_dictionary
from fidim_lab.errors import FileError, SetupError

_LIMITS = ((0x607D, 1), (0x607D, 2))
"""lowest and highest position"""


@dataclass(frozen=True)
class Abilities:
    """All that is known of a drive before it is asked."""

    registers: Registers
    layout: PdoLayout

    @property
    def guarded(self) -> bool:
        """Whether it misses its host by life guarding (100C, 100D): it watches no heartbeat (1016)."""
        return not self.can_write(0x1016, 1) and self.can_write(0x100C) and self.can_write(0x100D)

    @property
    def without_axis(self) -> str:
        """Why there is nothing to command, in words; empty where there is."""
        if self.has(0x6040):
            return ""
        other = next((n for n in range(0x6840, 0xA000, 0x800) if self.has(n)), None)
        return "no 6040:0 (controlword)" + (
            f", but {other:04X}: only the first axis of a node is driven" if other else ""
        )

    @property
    def keeps_mode(self) -> bool:
        """Whether its mode cannot be chosen (6060): its own configuration has done that."""
        return self.access(0x6060) is Access.READ

    @property
    def tells_its_state(self) -> bool:
        """Whether its network state is heard: by its heartbeat (1017), or by its answers to node guarding."""
        return self.guarded or self.can_write(0x1017)

    def access(self, index: int, sub: int = 0) -> Access:
        """What may be done with an object."""
        register = self.registers.get((index, sub))
        return Access.ABSENT if register is None else register.access

    def has(self, index: int, sub: int = 0) -> bool:
        """Whether the object is there."""
        return (index, sub) in self.registers

    def can_write(self, index: int, sub: int = 0) -> bool:
        """Whether the object is there and may be written."""
        return self.access(index, sub) is Access.WRITE

    def fitting(self, wanted: Iterable[Setting]) -> tuple[Setting, ...]:
        """Those that this drive can be told, or compared with: what it lacks or keeps to itself is left out.

        A limit without its other end is none: it is not written either.
        """
        whole = all(self.can_write(index, sub) for index, sub in _LIMITS)
        ours = (s for s in wanted if whole or (s.index, s.sub) not in _LIMITS)
        return tuple(s for s in ours if (self.can_write if s.write else self.has)(s.index, s.sub))

    def kept(self, wanted: Iterable[Setting]) -> tuple[Setting, ...]:
        """Those that it shows and does not let be written."""
        return tuple(s for s in wanted if s.write and self.access(s.index, s.sub) is Access.READ)


def dictionary_of(config: WinchConfig) -> ObjectDictionary:
    """Of the winch's EDS file. Raises SetupError naming the winch where that cannot be read."""
    try:
        return read_dictionary(config.eds, config.node_id).dictionary
    except FileError as error:
        raise SetupError(f"winch {config.name!r}: the EDS file {error.message}", hint=error.hint) from error


def abilities(dictionary: ObjectDictionary, config: WinchConfig) -> Abilities:
    """Of a drive with this dictionary, for a winch of this mode and load."""
    registers = registers_of(dictionary, config.family)
    return Abilities(registers, lay_out(registers, config))
