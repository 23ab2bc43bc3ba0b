"""What a test or a rehearsal can break in a simulated drive."""

from collections.abc import Callable

from sim_backends.drive.axis.axis import Axis
from sim_backends.drive.objects.dictionary import Dictionary
from sim_backends.drive.objects.emergency import HEARTBEAT_LOST, ErrorLog


class DriveFaults:
    """Switches that make one drive misbehave; each says which defect of a real drive it stands for."""

    def __init__(self, dictionary: Dictionary, errors: ErrorLog, axis: Axis, changed: Callable[[], None]) -> None:
        self._dictionary = dictionary
        self._errors = errors
        self._axis = axis
        self._changed = changed
        self.silent = False
        """the communication processor hangs: nothing is heard or said; the servo goes on with what it had"""
        self.sdo_silent = False
        """only SDO requests stay without answer"""
        self.sdo_delay = 0.0
        """s by which SDO answers come late"""

    def raise_fault(self, code: int, *, register: int | None = None, lasting: bool = False) -> None:
        """The drive detects a fault: EMCY with `code`, reaction 605E, state FAULT; `lasting` defies fault reset."""
        self._axis.fail(code, register=register, lasting=lasting)
        self._changed()

    def end_fault(self, code: int) -> None:
        """The cause of a lasting fault has gone; the drive stays in FAULT until it is reset."""
        self._errors.withdraw(code)
        self._changed()

    def safe_torque_off(self, on: bool, bit: int = 3) -> None:
        """The safety chain opens: no power, at once, and none as long as it is open; input `bit` of 60FD says so."""
        inputs = self._dictionary.number(0x60FD)
        self._dictionary.put(0x60FD, 0, inputs | 1 << bit if on else inputs & ~(1 << bit))
        self._axis.cut_torque(on)
        self._changed()

    def jump_encoder(self, counts: int) -> None:
        """The encoder loses counts: 6064 jumps, the shaft (held by the motor's own commutation) does not move."""
        self._axis.feedback.slipped += counts
        self._changed()

    def offset_current(self, ampere: float) -> None:
        """The ammeter reads `ampere` too much."""
        self._axis.feedback.current_offset = ampere

    def stick_current(self, shown: int | None = None) -> None:
        """The ammeter shows what it shows now, or `shown` (per mille of 6075), for ever."""
        self._axis.feedback.stuck_current = self._axis.feedback.current() if shown is None else shown

    def miss_host(self) -> None:
        """The host's heartbeat has been missed while nobody could hear the drive say so: its computer was asleep."""
        self._errors.report(HEARTBEAT_LOST)
        self._axis.abort_connection()
        self._changed()

    def reject_mode(self, mode: int) -> None:
        """6060 accepts `mode`, but 6061 never shows it."""
        self._axis.rejected_modes.add(mode)

    def claim_identity(self, *, vendor: int | None = None, product: int | None = None) -> None:
        """Another make of drive has been put in: 1018 says so, also after a reset."""
        if vendor is not None:
            self._dictionary.fix(0x1018, 1, vendor)
        if product is not None:
            self._dictionary.fix(0x1018, 2, product)
