"""Profile position mode on the wire: the set-point handshake (bits 4, 5, 6, 12), halt (bit 8), position limits 607D."""

from sim_backends.drive.axis.defects import Defects
from sim_backends.drive.axis.feedback import Feedback
from sim_backends.drive.axis.positioner import Positioner
from sim_backends.drive.objects.dictionary import Dictionary

_NEW_SET_POINT, _AT_ONCE, _RELATIVE, _HALT = 0x10, 0x20, 0x40, 0x100
_HALT_RAMPS = {1: 0x6084, 2: 0x6085}


class SetPoints:
    """Takes targets from 607A when the controlword says so, one under way and one waiting.

    A rising bit 4 is acknowledged by bit 12, which falls when bit 4 has fallen and there is room for another set-point.
    Halt stops on the ramp 605D; released, the shaft goes on to its target.
    """

    def __init__(self, dictionary: Dictionary, positioner: Positioner, feedback: Feedback, defects: Defects) -> None:
        self._defects = defects
        self._number = dictionary.number
        self._positioner = positioner
        self._feedback = feedback
        self._requested = False
        self._halted = False
        self.acknowledged = False
        """statusword bit 12"""
        self.limited = False
        """607D has shortened the last set-point"""

    def reset(self) -> None:
        """Power has gone: nothing is wanted any more."""
        self._requested = self._halted = self.acknowledged = self.limited = False

    def control(self, word: int, previous: int) -> None:
        """Obey a controlword in OPERATION ENABLED and profile position mode."""
        halt = bool(word & _HALT)
        self._requested = bool(word & _NEW_SET_POINT)
        if halt and not self._halted:
            ramp = _HALT_RAMPS.get(self._number(0x605D, default=1), 0x6084)
            self._positioner.ramp_down(self._feedback.now, ramp, keep_target=True)
        if self._requested and not previous & _NEW_SET_POINT and not self.acknowledged:
            self._accept(word, start=not (halt or self._halted))
        if self._halted and not halt:
            self._positioner.resume(self._feedback.now)
        self._halted = halt
        self.settle()

    def settle(self) -> None:
        """Take the acknowledgement back where there is room again."""
        if not self._requested and not self._positioner.full:
            self.acknowledged = False

    def arrived(self) -> bool:
        """Statusword bit 10: at rest within 6067 of the target, or at rest at all while halted."""
        positioner, feedback = self._positioner, self._feedback
        if self._halted:
            return feedback.motion.velocity == 0.0
        if not positioner.at_rest(feedback.now):
            return False
        off = positioner.target + feedback.reference - feedback.motion.position - feedback.slipped
        return abs(off) <= max(self._number(0x6067), 1)

    def _accept(self, word: int, *, start: bool) -> None:
        reference = self._feedback.reference
        wanted = self._number(0x607A)
        if word & _RELATIVE:
            wanted += round(self._positioner.target) + reference
        low, high = self._number(0x607D, 1, default=-(2**31)), self._number(0x607D, 2, default=2**31 - 1)
        limited = low < high and not self._defects.limit_ignored  # both 0: no limits
        target = min(max(wanted, low), high) if limited else wanted
        self.limited = target != wanted
        self.acknowledged = True
        self._positioner.aim(self._feedback.now, float(target - reference), at_once=bool(word & _AT_ONCE), start=start)
