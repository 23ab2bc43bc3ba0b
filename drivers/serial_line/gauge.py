"""`LineGauge`: a measuring device that sends lines of text, by itself or when asked (load cells, inclinometers)."""

from dataclasses import dataclass

from drivers.ports import Clock, GaugeReading
from drivers.serial_line.lines import LineSplitter
from drivers.serial_line.port import SerialPort
from drivers.serial_line.template import LineTemplate
from fidim_lab.data.rigs.rig_serial import GaugeEntry
from fidim_lab.errors import DeviceError, SetupError

LOOK = 0.1
"""s between two looks at the port of a device that sends by itself"""


@dataclass
class GaugeCounters:
    """Counters of received lines and of useless ones."""

    lines: int = 0
    malformed: int = 0
    """lines that do not look like the pattern, and pieces that are no line"""


class LineGauge:
    """`Gauge` port on a serial line. `run` keeps it connected and asks; make it on a running loop."""

    def __init__(self, config: GaugeEntry, clock: Clock) -> None:
        """Raises SetupError for a pattern that is none, or that does not name the columns' numbers."""
        self.config = config
        self.counters = GaugeCounters()
        self.columns = tuple(config.columns.values())
        self._template = LineTemplate(config.pattern)
        if set(self._template.names) != set(config.columns):
            wanted = ", ".join(f"{{{name}}}" for name in config.columns)
            raise SetupError(f"{config.name}: pattern {config.pattern!r} must name {wanted}, and no other number.")
        self._clock = clock
        self._splitter = LineSplitter(skip_first=not config.ask)
        self._latest: GaugeReading | None = None
        self._port = SerialPort(config.port, config.baud, clock, config.name, self._received, self._changed)

    @property
    def name(self) -> str:
        """For messages."""
        return self.config.name

    @property
    def age(self) -> float:
        """s after which a reading is unknown."""
        return self.config.age

    @property
    def uncertainty(self) -> float:
        """Standard deviation of one reading's error, SI."""
        return self.config.uncertainty

    @property
    def problem(self) -> str:
        """Why it is not connected; empty where it is."""
        return self._port.problem

    def latest(self) -> GaugeReading | None:
        """The newest reading, None before the first; look at its time before believing it."""
        return self._latest

    async def run(self) -> None:
        """Keep it connected, and ask where it wants to be asked; never returns. Raises SetupError for a bad URL."""
        try:
            while True:
                await self._port.keep_open()
                if self.config.ask and self._port.connected:
                    try:
                        self._port.write(self.config.ask)
                    except DeviceError:
                        continue  # the port knows why, and is opened again
                await self._clock.sleep(1.0 / self.config.rate if self.config.ask else LOOK)
        finally:
            self._port.close()

    def _changed(self, connected: bool) -> None:
        if connected:
            self._splitter.restart()

    def _received(self, data: bytes, t: float) -> None:
        before = self._splitter.malformed
        lines = self._splitter.feed(data)
        self.counters.malformed += self._splitter.malformed - before
        for line in lines:
            self.counters.lines += 1
            numbers = self._template.read(line)
            if numbers is None:
                self.counters.malformed += 1
                continue
            scale, offset = self.config.scale, self.config.offset
            self._latest = GaugeReading(t, tuple(scale * numbers[name] + offset for name in self.config.columns))
