"""The dialogue with one drive: send a controlword, wait for a statusword that confirms it.

A confirmation must be *fresh*: sampled by a SYNC after the command. Every command has a number; one that is waiting
gives up as soon as another was begun, so that a stop overtakes a move and is never undone by it.
"""

from collections.abc import Callable

from drivers.cia402.dictionary.config import WinchConfig
from drivers.cia402.profile.machine import Command, answer, next_command, state_of
from drivers.cia402.profile.words import (
    FOLLOWS,
    HALT,
    LOST,
    SET_POINT_ACKNOWLEDGED,
    Mode,
    controlword,
    mode_name,
    remarks,
    set_point,
)
from drivers.cia402.watch.master import CanopenMaster
from drivers.cia402.wire.pdo import DriveValues, Mappable
from drivers.clock import wait_until
from drivers.ports import DriveState
from fidim_lab.errors import DeviceError

_STALE_PERIODS = 10.0
_SHORTEST_STALE = 0.05
_STILL_SAMPLES = 3
_LONGEST_WALK = 8
_SHOWN = 0.05
"""s with power in which a mode must be displayed; a brake takes longer to let go"""
_TESTED = "the end of its self-test"
_WITH_POWER = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
_FAULTED = (DriveState.FAULT, DriveState.FAULT_REACTION)


class Drive:
    """Commands to one drive, each confirmed or raised as a DeviceError."""

    def __init__(self, config: WinchConfig, master: CanopenMaster) -> None:
        """Registers the node with the master. Raises SetupError (see `CanopenMaster.add_node`)."""
        self.link = master.add_node(config)
        self._config = config
        self._clock = master.clock
        self._period = master.period
        self.target = 0
        """counts; every controlword carries it"""
        self.order = 0
        """the number of the newest command"""
        self._sent_at = float("-inf")
        self._halted = False
        self._displayed = False
        """whether it has displayed the mode that it was told last"""
        self._shown = 0
        """the statusword with which it was enabled: some drives never set a bit that others lose"""

    def begin(self) -> int:
        """The number of a new command; whatever was waiting is overtaken."""
        self.order += 1
        return self.order

    def send(self, order: int, word: int, *, both_ways: bool = False) -> None:
        """One controlword; both_ways: by SDO, too. Raises DeviceError where another order was begun since, BusError."""
        if order != self.order:
            raise _overtaken(self._config)
        self._sent_at = self._clock.now()
        self._halted = bool(word & HALT)
        self.link.send_controlword(word, self.target, both_ways=both_ways)

    # what is known --------------------------------------------------------------------------------------------------

    def stale(self, values: DriveValues) -> bool:
        """Whether values are too old to be believed."""
        age = self._config.sample_age
        limit = max(_STALE_PERIODS * self._period, _SHORTEST_STALE) if age is None else age
        return self._clock.now() - values.t > limit

    def fault(self) -> str:
        """The fault in words; empty without one."""
        found = self.link.fault(self._clock.now())
        values = self.link.values
        if found or values is None:
            return found
        state = state_of(values.statusword)
        if state in _FAULTED:
            last = next((e for e in reversed(self.link.emergencies) if not e.cleared), None)
            return f"the drive is in fault; its last message was {last}" if last else "the drive is in fault"
        lost = [says for bit, says in LOST.items() if self._shown & ~values.statusword & bit]
        if lost and state in _WITH_POWER:
            return "; ".join(lost)
        if state is DriveState.OPERATION_ENABLED and self._displayed and values.mode != self.link.mode:
            return f"it has changed to {mode_name(values.mode)}, {mode_name(self.link.mode)} was commanded"
        return ""

    def believed(self) -> DriveValues:
        """The newest values. Raises DeviceError where the drive is not configured or they are too old."""
        values = self.link.values
        if not self.link.brought_up:
            raise DeviceError(self._config.device, "is not configured.", hint="Configure the winch first.")
        if values is None or self.stale(values):
            raise DeviceError(
                self._config.device,
                f"its state is unknown: {_describe(values, self._clock.now())}.",
                hint=self.fault() or "Is the control loop running?",
            )
        return values

    def healthy(self) -> DriveValues:
        """The newest values of a drive without a fault. Raises DeviceError with the fault in words."""
        fault = self.fault()
        if self.link.brought_up and fault:
            hint = "Find the cause; then `fidim power-off RIG --acknowledge NAME` resets the fault."
            raise DeviceError(self._config.device, f"{fault}.", hint=hint)
        return self.believed()

    # confirmed commands ---------------------------------------------------------------------------------------------

    async def walk_to_operation(self, order: int) -> None:
        """Walk the table to OPERATION ENABLED, halted, every step confirmed; a fault is never reset.

        Raises DeviceError.
        """
        goal = DriveState.OPERATION_ENABLED
        self._displayed, self._shown = False, 0
        for _ in range(_LONGEST_WALK):
            state = state_of(self.healthy().statusword)
            if state is goal:
                return
            if state is DriveState.NOT_READY:  # it has just been switched on
                await self._expect(
                    order, lambda v: state_of(v.statusword) is not DriveState.NOT_READY, _TESTED, in_mode=False
                )
                continue
            command = next_command(state, goal, quick_stop_holds=self._config.stop.holds_in_quick_stop)
            wanted = None if command is None else answer(state, command)
            if command is None or wanted is None:
                raise DeviceError(self._config.device, f"cannot be enabled from state {state}.")
            self.target = self.healthy().position
            if state is DriveState.QUICK_STOP_ACTIVE and wanted is goal:
                # Where it has stopped by itself, its controlword still enables, and some act only on one that changes.
                self.send(order, controlword(Command.QUICK_STOP))
                await self.reach(order, state, after=Command.QUICK_STOP)
            self.send(order, controlword(command, halt=command is Command.ENABLE_OPERATION))
            await self.reach(order, wanted, after=command)
            if wanted is goal:
                await self._display_or_power_off(order)
        raise DeviceError(
            self._config.device,
            f"repeatedly falls back on the way to {goal}: {_describe(self.link.values, self._clock.now())}.",
        )

    async def reach(self, order: int, state: DriveState, *, after: Command) -> None:
        """Wait for a state. Raises DeviceError."""
        await self._expect(
            order,
            lambda v: state_of(v.statusword) is state and v.mode in (self.link.mode, Mode.NONE),
            f"{state} after {after}",
            leaves_fault=True,
            in_mode=False,
        )

    async def _display_or_power_off(self, order: int) -> None:
        """A drive with power in another mode may not hold its load: the brake does, before it has been released."""
        try:
            await self.display(order, self.link.mode, _SHOWN)
        except DeviceError:
            self.send(order, controlword(Command.DISABLE_VOLTAGE))
            raise
        self._shown = self.believed().statusword

    async def clear_acknowledgement(self, order: int) -> None:
        """Some drives show bit 12 from the moment they are enabled until their first handshake.

        One is made for the place where the drive stands, halted. Raises DeviceError.
        """
        values = self.healthy()
        if not _acknowledged(values):
            return
        self.target = values.position
        self.send(order, set_point(new=True, halt=True))
        await self._expect(order, _acknowledged, "the set-point acknowledged (statusword bit 12)")
        self.send(order, set_point(new=False, halt=True))
        await self._expect(order, lambda v: not _acknowledged(v), "the handshake finished (statusword bit 12 low)")

    async def take_set_point(self, order: int, target: int, begins: Callable[[], None] | None = None) -> None:
        """The handshake of profile position mode: bit 4 low, bit 4 high with the target, acknowledged, bit 4 low again.

        The target is there before bit 4 rises: a drive that takes the objects of a frame one by one, controlword first,
        would go to its old one. A drive that stands in halt is kept there until bit 4 rises: letting it go first would
        resume the old move. begins: called just before the frame that begins the move.
        """
        self.target = target
        self.send(order, set_point(new=False, halt=self._halted))
        await self._expect(order, lambda v: not _acknowledged(v), "readiness for a set-point (statusword bit 12 low)")
        if begins is not None:
            begins()
        self.send(order, set_point(new=True))
        await self._expect(order, _acknowledged, "the set-point acknowledged (statusword bit 12)")
        self.send(order, set_point(new=False))
        await self._expect(order, lambda v: not _acknowledged(v), "the handshake finished (statusword bit 12 low)")

    async def follow(self, order: int) -> None:
        """Wait until a drive in a cyclic mode follows its targets (statusword bit 12). Raises DeviceError."""
        await self._expect(order, lambda v: bool(v.statusword & FOLLOWS), "following (statusword bit 12)")

    async def choose(self, order: int, word: int, mode: Mode) -> None:
        """Ask for a mode, with a controlword, and wait until it is displayed. Raises DeviceError."""
        before, self.link.mode = self.link.mode, mode
        self._displayed = False
        try:
            if not self.link.layout.asks(Mappable.MODE.name):
                await self.link.sdo.write(Mappable.MODE.index, 0, mode)
            self.send(order, word)
            await self.display(order, mode)
        except DeviceError:
            self.link.mode = before
            raise

    async def display(self, order: int, mode: Mode, timeout: float | None = None) -> None:
        """Wait until the mode is displayed (6061), in a TPDO or asked by SDO. Raises DeviceError."""
        if not self.link.layout.tells(Mappable.MODE_DISPLAY.name):
            seconds = self._config.step_timeout if timeout is None else timeout
            await self.link.ask_mode(self._clock, mode, self._period, seconds)
        await self._expect(order, lambda v: v.mode == mode, f"{mode_name(mode)} displayed (6061)", timeout=timeout)
        self._displayed = True

    async def word(
        self, order: int, fulfilled: Callable[[int], bool], what: str, timeout: float | None = None
    ) -> DriveValues:
        """Wait for a statusword; returns the values with it. Raises DeviceError."""
        await self._expect(order, lambda v: fulfilled(v.statusword), what, timeout=timeout)
        return self.believed()

    async def stand_still(self, order: int, slowest: float, timeout: float) -> None:
        """Wait until the velocity (counts/s) stays at most `slowest` for some samples. Raises DeviceError."""
        still: list[float] = []

        def standing(values: DriveValues) -> bool:
            if abs(values.velocity) > slowest:
                still.clear()
            elif not still or values.t > still[-1]:
                still.append(values.t)
            return len(still) >= _STILL_SAMPLES

        await self._expect(order, standing, "standstill", timeout=timeout, in_mode=False)

    async def _expect(
        self,
        order: int,
        fulfilled: Callable[[DriveValues], bool],
        what: str,
        *,
        timeout: float | None = None,
        in_mode: bool = True,
        leaves_fault: bool = False,
    ) -> None:
        def confirmed() -> bool:
            if order != self.order:
                raise _overtaken(self._config)
            values = self.link.values
            if values is None or values.t <= self._sent_at:
                return False
            if state_of(values.statusword) in _FAULTED and not leaves_fault:
                raise DeviceError(self._config.device, f"went into fault while waiting for {what}: {self.fault()}.")
            return fulfilled(values) and (values.mode == self.link.mode or not in_mode)

        seconds = self._config.step_timeout if timeout is None else timeout
        if not await wait_until(self._clock, confirmed, timeout=seconds, period=self._period):
            found = "; ".join(filter(None, (_describe(self.link.values, self._clock.now()), self.fault())))
            raise DeviceError(self._config.device, f"{what} expected within {seconds:g} s, found: {found}.")


def _overtaken(config: WinchConfig) -> DeviceError:
    return DeviceError(config.device, "this command was replaced by a later one.")


def _describe(values: DriveValues | None, now: float) -> str:
    if values is None:
        return "no sample at all"
    words = [str(state_of(values.statusword)), f"statusword 0x{values.statusword:04X}", mode_name(values.mode)]
    words += remarks(values.statusword)
    return f"{', '.join(words)}, sampled {now - values.t:.3f} s ago"


def _acknowledged(values: DriveValues) -> bool:
    return bool(values.statusword & SET_POINT_ACKNOWLEDGED)
