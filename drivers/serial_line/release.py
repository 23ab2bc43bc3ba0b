"""`SerialRelease`: a device that holds the displaced platform and lets it go on command (an electromagnet, a gripper).

Command, then the state read back: a command is done when the device says so. The host asks several times a second; a
device with a watchdog lets go when nobody asks, and so does this program when it ends. What is lost while it holds, or
lets go by itself, latches: the platform may be swinging, or in somebody's hands, and nothing is taken hold of again
before somebody has said that he has looked.
"""

from drivers.ports import Clock, ReleaseState
from drivers.serial_line.lines import LineSplitter
from drivers.serial_line.port import SerialPort
from fidim_lab.data.rigs.rig_serial import ReleaseEntry
from fidim_lab.errors import DeviceError, RefusedError

POLL = 0.02
"""s between two looks for an answer"""


def state_in(line: str, config: ReleaseEntry) -> ReleaseState | None:
    """The state that a line tells; None for any other line (an echo, a greeting). Pure."""
    if line == config.holds:
        return ReleaseState.HOLDS
    return ReleaseState.RELEASED if line == config.released else None


class SerialRelease:
    """`Release` port on a serial line. `run` keeps it connected and asks for its state."""

    def __init__(self, config: ReleaseEntry, clock: Clock) -> None:
        self.config = config
        self.ignored = 0
        """lines that told no state"""
        self._clock = clock
        self._splitter = LineSplitter(skip_first=False)
        self._port = SerialPort(config.port, config.baud, clock, config.name, self._received, self._changed)
        self._told: tuple[float, ReleaseState] | None = None
        self._holding = False
        """a hold was asked for and confirmed, and not ended by us"""
        self._fault = ""

    @property
    def name(self) -> str:
        """For messages."""
        return self.config.name

    @property
    def problem(self) -> str:
        """Why it is not connected; empty where it is."""
        return self._port.problem

    @property
    def state(self) -> ReleaseState:
        """As the device said last; UNKNOWN where that is too old or it is not connected."""
        if self._told is None or self._clock.now() - self._told[0] > self.config.timeout:
            return ReleaseState.UNKNOWN
        return self._told[1]

    @property
    def fault(self) -> str:
        """The fault while it held, in words; it stays until `acknowledge`."""
        if self._holding and not self._fault and self.state is ReleaseState.UNKNOWN:
            self._latch(f"has not reported its state for over {self.config.timeout:g} s")
        return self._fault

    def acknowledge(self, by: str) -> None:
        """Somebody has looked at the platform. Raises RefusedError without a name."""
        if not by.strip():
            raise RefusedError(f"{self.name}: a fault while it held the platform must be acknowledged by name.")
        self._fault, self._holding = "", False

    async def hold(self) -> None:
        """Take hold, confirmed. Raises DeviceError while a fault is latched, or where it is not confirmed in time."""
        if self.fault:
            raise DeviceError(self.name, f"{self._fault}; this was not acknowledged yet.", hint="Look at the platform.")
        await self._command(self.config.hold, ReleaseState.HOLDS)
        self._holding = True

    async def release(self) -> None:
        """Let go, confirmed. Allowed in every state. Raises DeviceError where it is not confirmed in time."""
        self._holding = False
        await self._command(self.config.release, ReleaseState.RELEASED)

    async def run(self, *, lets_go: bool = True) -> None:
        """Keep it connected and ask for its state; never returns. Lets go when it is ended, unless only looked at."""
        try:
            while True:
                await self._port.keep_open()
                self._send(self.config.ask)
                await self._clock.sleep(self.config.period)
        finally:
            if lets_go:
                self._send(self.config.release)
            self._port.close()

    async def _command(self, command: bytes, wanted: ReleaseState) -> None:
        """Send it, once more after half the time: the same command twice does no harm, a lost one does."""
        begin = self._clock.now()
        self._told = None  # only what is told from now on counts
        self._port.write(command)
        self._port.write(self.config.ask)
        again = begin + self.config.timeout / 2.0
        while (now := self._clock.now()) - begin < self.config.timeout:
            if self.state is wanted:
                return
            if now >= again:
                again = float("inf")
                self._port.write(command)
            await self._clock.sleep(POLL)
        found = f"it says “{self.state}”" if self._told else "it does not answer"
        raise DeviceError(
            self.name,
            f"“{wanted}” was not confirmed within {self.config.timeout:g} s: {found}.",
            hint="Check its power and plug, and the texts of its answers in the rig file.",
        )

    def _send(self, data: bytes) -> None:
        if self._port.connected:
            try:
                self._port.write(data)
            except DeviceError:
                return  # the port knows why, and is opened again

    def _latch(self, problem: str) -> None:
        if self._holding and not self._fault:
            self._fault = f"while it held the platform, it {problem}"

    def _changed(self, connected: bool) -> None:
        self._splitter.restart()
        self._told = None
        if not connected:
            self._latch(f"was unplugged ({self._port.problem})")

    def _received(self, data: bytes, t: float) -> None:
        for line in self._splitter.feed(data):
            state = state_in(line, self.config)
            if state is None:
                self.ignored += 1
                continue
            self._told = (t, state)
            if state is ReleaseState.RELEASED:
                self._latch("let go by itself")
