"""A measuring device that sends lines of text: load cells with their amplifier, an inclinometer."""

from collections.abc import Callable
from pathlib import Path

from drivers.ports import Clock
from sim_backends.serial_devices.pty_line import PtyLine


class SimulatedGauge:
    """Sends a line at its rate, or one whenever it is asked. `run` lets it live.

    Not simulated: warming up, filters of the amplifier, its own commands besides the question.
    """

    def __init__(self, link: Path, baud: int, clock: Clock, rate: float, line: Callable[[], str], ask: bytes) -> None:
        """rate: lines a second; line: what it says now, without its end; ask: empty where it sends by itself."""
        self.line = PtyLine(link, baud, clock, self._heard)
        self.garbled = False
        """from now on it sends what is no reading ("OVERLOAD"), as an amplifier beyond its range does"""
        self._clock = clock
        self._period = 1.0 / rate
        self._says = line
        self._ask = ask
        self._rest = b""
        self._asked = 0

    async def run(self) -> None:
        """Plug in and live; never returns, unplugs in the end. Raises SetupError where it cannot be plugged in."""
        try:
            self.line.plug()
            due = self._clock.now()
            while True:
                due = max(due + self._period, self._clock.now())
                await self._clock.sleep(due - self._clock.now())
                if self.line.plugged and (self._asked or not self._ask):
                    self._asked = max(self._asked - 1, 0)
                    text = "OVERLOAD" if self.garbled else self._says()
                    await self.line.send(f"{text}\r\n".encode("ascii"))
        finally:
            self.line.unplug()

    def _heard(self, data: bytes) -> None:
        if self._ask:
            *asked, rest = (self._rest + data).split(self._ask)
            self._asked += len(asked)
            self._rest = rest[-len(self._ask) :]
