"""One axis: the CiA 402 machine with its stop and fault reactions, on top of the positioner.

The node gives it the time (`feedback.sample`), its 5 ms cycle (`tick`), controlword and mode; it gives the statusword.
"""

from sim_backends.drive.axis.defects import Defects
from sim_backends.drive.axis.feedback import Feedback
from sim_backends.drive.axis.machine import State, commanded
from sim_backends.drive.axis.make import PROFILE, Make
from sim_backends.drive.axis.other_modes import (
    CYCLIC_POSITION,
    HOMING,
    PROFILE_TORQUE,
    PROFILE_VELOCITY,
    CyclicPosition,
    Homing,
    MotionMode,
    ProfileTorque,
    ProfileVelocity,
)
from sim_backends.drive.axis.positioner import Positioner
from sim_backends.drive.axis.set_points import SetPoints
from sim_backends.drive.axis.shaft import Shaft
from sim_backends.drive.objects.abort import AbortCode
from sim_backends.drive.objects.dictionary import Dictionary
from sim_backends.drive.objects.emergency import FOLLOWING_ERROR, HEARTBEAT_LOST, ErrorLog

PROFILE_POSITION = 1
MODES = (PROFILE_POSITION, PROFILE_VELOCITY, PROFILE_TORQUE, HOMING, CYCLIC_POSITION)
"""that this drive has; bit mode − 1 of 6502 for each"""
_HALT = 1 << 8
_VOLTAGE_AND_REMOTE, _TARGET_REACHED, _LIMIT, _ACKNOWLEDGE, _FOLLOWING = 0x210, 0x400, 0x800, 0x1000, 0x2000
_POWERED = frozenset({State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT_REACTION})
_RAMPS = {1: 0x6084, 2: 0x6085, 5: 0x6084, 6: 0x6085}
"""object that holds the deceleration of a stop, by option code; the others brake"""
_STAYS = 5
"""quick stop options from here on stay in QUICK STOP ACTIVE"""
_COMES_BACK = 0.3
"""s after a stop at which a drive that enables itself does so"""


class Axis:
    """State machine and motion of one drive.

    Ready one cycle after power-on. Obeys a controlword when it is written, not between; a stop on its way to a lower
    state (605B, 605C) can be hastened but not taken back. Without power the brake holds the shaft.
    Not simulated: torque and velocity loops of their own, DC link, temperatures, limit switches.
    """

    def __init__(
        self,
        dictionary: Dictionary,
        shaft: Shaft,
        errors: ErrorLog,
        position: float,
        make: Make = PROFILE,
        defects: Defects | None = None,
    ) -> None:
        self._number = dictionary.number
        self._errors = errors
        self._defects = defects or Defects()
        self._comes_back: float | None = None
        self._without_torque = False
        self._positioner = Positioner(dictionary, shaft, position, make, self._defects)
        self.feedback = Feedback(dictionary, shaft, self._positioner, make, self._defects)
        self._set_points = SetPoints(dictionary, self._positioner, self.feedback, self._defects)
        parts = (dictionary, self._positioner, self.feedback, make)
        self._modes: dict[int, MotionMode] = {
            PROFILE_VELOCITY: ProfileVelocity(*parts),
            PROFILE_TORQUE: ProfileTorque(*parts),
            HOMING: Homing(*parts),
            CYCLIC_POSITION: CyclicPosition(*parts),
        }
        self.state = State.NOT_READY
        self.mode = self._number(0x6060)
        self.rejected_modes: set[int] = set()
        self._word = 0
        self._after_stop: State | None = None

    @property
    def busy(self) -> bool:
        """Whether something may change by itself, so that `tick` is wanted."""
        return (
            self._after_stop is not None
            or self._comes_back is not None
            or self.state is State.NOT_READY
            or not self._positioner.at_rest(self.feedback.now)
            or self.feedback.strayed()
        )

    def tick(self) -> None:
        """The drive's own cycle, at the time last sampled."""
        now = self.feedback.now
        if self.state is State.NOT_READY:
            self.state = State.SWITCH_ON_DISABLED
        if self._comes_back is not None and now >= self._comes_back:
            self._comes_back = None
            self._settle(State.OPERATION_ENABLED)
        if self._after_stop is not None:
            if self._positioner.at_rest(now):
                self._settle(self._after_stop)
        elif self.state is State.OPERATION_ENABLED:
            if self.mode == PROFILE_TORQUE:
                self._modes[PROFILE_TORQUE].target()
            self._positioner.tick(now, self.feedback.lacking())
            self._set_points.settle()
        if self.feedback.lost():
            self.fail(FOLLOWING_ERROR)

    def cut_torque(self, on: bool) -> None:
        """Safe torque off: the power stage is blocked, the brake holds; the drive is in SWITCH ON DISABLED."""
        self._without_torque = on
        if on:
            self._settle(State.SWITCH_ON_DISABLED)

    def reset(self) -> None:
        """NMT reset node: power off, everything forgotten but where the shaft is."""
        self._settle(State.NOT_READY)
        self._errors.acknowledge()
        self.mode = self._number(0x6060)
        self._word = 0

    def control(self, word: int) -> None:
        """Obey a controlword."""
        previous, self._word = self._word, word
        for _ in range(2):  # "enable operation" leads through SWITCHED ON
            target = commanded(self.state, word, previous)
            if target is None or not self._go(target):
                break
        if self._moves and self.mode == PROFILE_POSITION:
            self._set_points.control(word, previous)
        elif (mode := self._mode) is not None:
            mode.control(word, previous)

    def select(self, mode: int) -> None:
        """Obey 6060; a change of mode in motion stops on the ramp."""
        if mode in self.rejected_modes or mode == self.mode:
            return
        self.mode = mode
        if self._moves:
            self._positioner.ramp_down(self.feedback.now, 0x6084)
            self._set_points.reset()
            if (chosen := self._mode) is not None:
                chosen.enter()

    def new_target(self) -> None:
        """607A or 60FF was written; profile position mode waits for the controlword."""
        if (mode := self._mode) is not None:
            mode.target()

    @property
    def _moves(self) -> bool:
        return self.state is State.OPERATION_ENABLED and self._after_stop is None

    @property
    def _mode(self) -> MotionMode | None:
        """Of the modes beside profile position, the one that moves the shaft now."""
        return self._modes.get(self.mode) if self._moves else None

    def allows_mode(self, mode: int) -> AbortCode | None:
        """Whether 6060 may be written with `mode`, by 6502; a drive without has all of ours."""
        told = self._number(0x6502, default=sum(1 << mode - 1 for mode in MODES))
        supported = mode == 0 or (mode > 0 and told >> (mode - 1) & 1)
        return None if supported else AbortCode.VALUE

    def fail(self, code: int, *, register: int | None = None, lasting: bool = False) -> None:
        """A fault: report it and react as 605E says."""
        self._errors.report(code, register=register, lasting=lasting)
        if self.state not in (State.FAULT, State.FAULT_REACTION):
            self._stop_towards(State.FAULT, self._number(0x605E, default=2), meanwhile=State.FAULT_REACTION)

    def abort_connection(self) -> None:
        """The host is gone: do what 6007 says. That is no controlword: a halt stays one."""
        option = self._number(0x6007, default=1)
        if option == 1:
            self.fail(HEARTBEAT_LOST)
        elif option in (2, 3):
            self.control(self._word & _HALT | (0x00 if option == 2 else 0x02))

    def statusword(self) -> int:
        """6041."""
        word = self.state.value | _VOLTAGE_AND_REMOTE
        if not self.feedback.powered:
            return word
        if (mode := self._mode) is not None:
            word |= mode.bits()
        elif self._set_points.arrived():
            word |= _TARGET_REACHED
        if self._set_points.limited or self.feedback.lacking():
            word |= _LIMIT
        if self._set_points.acknowledged:
            word |= _ACKNOWLEDGE
        return word | _FOLLOWING if self.feedback.strayed() else word

    def _go(self, target: State) -> bool:
        """Take a transition that was commanded; False where this drive refuses it."""
        if self._without_torque and target in (State.SWITCHED_ON, State.OPERATION_ENABLED):
            return False
        if self.state is State.FAULT:
            if self._errors.lasting:
                return False
            self._errors.acknowledge()
        if self.state is State.OPERATION_ENABLED and target is State.QUICK_STOP_ACTIVE:
            if self._defects.quick_stop_ignored:
                return False
            option = self._number(0x605A, default=2)
            final = State.QUICK_STOP_ACTIVE if option >= _STAYS else State.SWITCH_ON_DISABLED
            self._stop_towards(final, option, meanwhile=State.QUICK_STOP_ACTIVE)
        elif self.state is State.OPERATION_ENABLED and target is not State.SWITCH_ON_DISABLED:
            option = self._number(0x605B if target is State.READY else 0x605C, default=1)
            self._stop_towards(target, option, meanwhile=State.OPERATION_ENABLED)
        elif self.state is State.QUICK_STOP_ACTIVE and target is State.OPERATION_ENABLED:
            if self._after_stop is State.SWITCH_ON_DISABLED:
                return False
            self._settle(target)
        else:
            self._settle(target)
        return True

    def _stop_towards(self, final: State, option: int, *, meanwhile: State) -> None:
        """Stop as an option code says, in the state `meanwhile`, then enter `final`; without power, at once."""
        if self._defects.enables_itself:
            self._comes_back = self.feedback.now + _COMES_BACK
        if not self.feedback.powered or option not in _RAMPS:
            self._settle(final)
            return
        if self._defects.stops_in_words:
            self.state = final if final in _POWERED else meanwhile
            return
        self.state, self._after_stop = meanwhile, final
        self._set_points.reset()
        self._positioner.ramp_down(self.feedback.now, _RAMPS[option])

    def _settle(self, state: State) -> None:
        """Be in `state`, with power or the brake as it has them."""
        self.state, self._after_stop = state, None
        on = state in _POWERED
        if not on or not self.feedback.powered:
            self._positioner.brake(self.feedback.now)
            self._set_points.reset()
        self.feedback.power(on)
        if (mode := self._mode) is not None:
            mode.enter()
