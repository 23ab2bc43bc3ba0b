"""Digital signals of a drive: safe torque off, seen as an input (60FD), and a holding brake, as an output (60FE). Pure.

Which bit is which is the drive's wiring, and so the rig file's word. Without that nothing is read or written.
"""

from dataclasses import dataclass

INPUTS, OUTPUTS = 0x60FD, 0x60FE
"""digital inputs; digital outputs with their levels in sub 1 and, in sub 2, the mask of those that are commanded"""
STO_SAYS = "its safe torque off (STO) is active: the motor cannot have power"
STO_HINT = "Is the emergency stop pulled out again, and the safety chain closed?"


@dataclass(frozen=True)
class Signal:
    """One bit, and the level at which it means what its name says."""

    bit: int
    active: int = 1

    def is_active(self, word: int) -> bool:
        """Whether it is, in a word of all inputs or outputs."""
        return (word >> self.bit & 1) == self.active

    def put(self, word: int, active: bool) -> int:
        """The word with this bit as it must be."""
        level = self.active if active else 1 - self.active
        return word & ~(1 << self.bit) | level << self.bit
