"""What a drive says of itself besides its PDOs: following error (60F4), temperature, safe torque off (60FD).

And its mode (6061) where no PDO carries it. Asked by SDO twice a second, its encoder (6064) ten times. A drive that
sends samples and answers no question does not hear: the next stop may not reach it, and nobody would know before it is
needed. One whose samples stay where they are while its encoder, asked here, tells another place sends old ones: every
guard would look at the past. One that twice refuses to tell its encoder leaves that unknown, and an unknown place is no
place that holds.

By SDO, for a fifth PDO would cost bus time in every cycle, and not every drive lets these objects be mapped. Any other
object that the drive refuses is not asked for again; what has not been answered lately is unknown.
"""

import math
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from drivers.cia402.dictionary.settings import Setting
from drivers.cia402.profile.scale import LengthScale, wrap32
from drivers.cia402.profile.signals import INPUTS
from drivers.cia402.watch.node import NodeLink
from drivers.cia402.wire.pdo import Mappable
from drivers.cia402.wire.sdo import SdoRefusedError
from drivers.ports import Clock
from drivers.trajectory import Trajectory
from fidim_lab.data.rigs.rig_winch_tables import Signal, TemperatureObject
from fidim_lab.errors import DeviceError

PERIOD = 0.5
"""s between two rounds"""
COMPARED_EVERY = 0.1
"""s between two comparisons of encoder and samples: with old samples an uncommanded 0.05 m/s runs `OLD`, then at most
this time and `BETWEEN`, 7.5 mm together. Ten questions a second and drive are 2 % of the frames of a 100 Hz cycle"""
DEAF_SAYS = "it sends samples and answers no question (SDO): a stop may not reach it"
REFUSES_SAYS = "it refuses to give its encoder by SDO ({}): its samples (TPDO) may be old"
OLD_SAYS = "its samples (TPDO) stay where they are, its encoder, asked by SDO, is {:+.1f} mm elsewhere: they are old"
CHANGED_SAYS = (
    "what its stops rest on is no longer as it was written (somebody has changed it, or the drive has restarted): "
    "{} {}: {} found, {} was written"
)
SAME_SAYS = (
    "its samples (TPDO) have been exactly the same for {:.1f} s, its load, asked by SDO, is another: they are old"
)
CHANCE = 1e-9
"""that a load which seldom changes by a digit did so in that many answers, and in none of the samples meanwhile: the
samples are old then. It is the same object both ways, so that one that never changes is the same both ways. A drive
that flickers in the worst possible rhythm is stopped in vain once in 2400 h (docs/benchmarks/sensitivity.md)"""
OLD = 1e-3
"""m of cable within which samples before and after the question stay where they are (a frozen one may flicker), and
beyond which the encoder is elsewhere than both: 0 at rest; up to 0.03 m/s such samples are passed on the way"""
MOVED_SAYS = (
    "its own set-point ({:04X}) has moved by {:+.1f} mm while it should stand: another program commands it, and its "
    "encoder does not show it"
)
DEMANDS = (0x6062, Mappable.TARGET_POSITION.index)
"""where a drive wants to be by now; of drives without the first, where it was told to go"""
BETWEEN = 0.03
"""s from the answer to the sample that it is compared with: several SYNCs later"""
BELIEVED = 5.0
"""periods for which an answer counts"""


@dataclass(frozen=True)
class Health:
    """The newest answers; None: not told."""

    t: float = float("-inf")
    """monotonic s"""
    following_error: int | None = None
    """counts"""
    temperature: float | None = None
    """°C"""
    sto: bool = False
    """safe torque off is active"""


NOTHING_TOLD = Health()


class HealthPoll:
    """Asks one drive. `run` is a task beside the control loop; without it nothing is ever told."""

    def __init__(
        self,
        link: NodeLink,
        clock: Clock,
        scale: LengthScale,
        temperature: TemperatureObject | None,
        sto: Signal | None = None,
        kept: Callable[[], Sequence[Setting]] = tuple,
        standing: Callable[[], Trajectory | None] = lambda: None,
    ) -> None:
        """kept: what it must hold as it was written, as long as it works; looked at in turn.

        standing: the command by which it has long been at rest, with power.
        """
        self._scale = scale
        self._sto = sto if sto is not None and link.sdo.knows(INPUTS) else None
        self._link = link
        self._clock = clock
        self._temperature = temperature if temperature and link.sdo.knows(temperature.index, temperature.sub) else None
        self._follows = link.sdo.knows(Mappable.FOLLOWING_ERROR.index)
        self._newest = NOTHING_TOLD
        self._doubt = self._changed = self._moved = ""
        self._kept, self._turn = kept, 0
        self._standing = standing
        self._demand = next((index for index in DEMANDS if link.sdo.knows(index)), None)
        self._wanted: tuple[Trajectory, int, int] | None = None
        """its set-point and its encoder (counts) when they were first asked for under a command to stand"""
        self._stretch = float("-inf")
        """since when all samples tell the same (monotonic s)"""
        self._answers = self._others = 0
        """since then: answers that told the load, and those that told another than the samples"""
        self.blind = False
        """whether its encoder was contradicted: what it shows since proves nothing"""

    @property
    def doubt(self) -> str:
        """Why its samples are no sign that it can be stopped, in words; empty where nothing is wrong.

        It has answered neither the newest question nor its repetition (`SdoChannel.read`), its samples are old, its
        set-point is somebody else's, or what its stops rest on has been changed.
        """
        return (self._doubt or self._moved or self._changed) if self._link.brought_up else ""

    def believed(self) -> Health:
        """The newest answers, or an empty value where they are too old."""
        fresh = self._clock.now() - self._newest.t <= BELIEVED * PERIOD
        return self._newest if fresh else NOTHING_TOLD

    async def run(self) -> None:
        """Ask for ever, also a drive that does not answer: it is believed again once it does."""
        due = self._clock.now() + PERIOD
        while True:
            await self._clock.sleep(COMPARED_EVERY - BETWEEN)
            if not self._link.brought_up:
                self._doubt = self._changed = self._moved = ""
                self.blind = False
                continue
            try:
                self._doubt = await self._compare()
                self._moved = self._moved or await self._look_at_demand()
                self._doubt = self._doubt or await self._look_at_load()
                if self._clock.now() >= due:
                    due = self._clock.now() + PERIOD
                    await self._round()
                    self._changed = await self._look_at_one()
            except DeviceError:
                self._doubt = DEAF_SAYS

    async def _compare(self) -> str:
        """Whether samples and encoder agree; what is wrong where they do not."""
        before = self._link.values
        try:
            told = await self._link.sdo.read(Mappable.POSITION.index)
        except SdoRefusedError:
            await self._clock.sleep(BETWEEN)
            try:
                told = await self._link.sdo.read(Mappable.POSITION.index)
            except SdoRefusedError as error:
                return REFUSES_SAYS.format(error.reason)
        if before is None:
            return ""
        await self._clock.sleep(BETWEEN)
        after, allowed = self._link.values, self._scale.magnitude(OLD)
        if after is None or after.t <= before.t or abs(wrap32(after.position - before.position)) > allowed:
            return ""
        if any(abs(wrap32(told - sample.position)) <= allowed for sample in (before, after)):
            return ""
        self.blind = True
        return OLD_SAYS.format(1e3 * (self._scale.length(told) - self._scale.length(after.position)))

    async def _look_at_demand(self) -> str:
        """How far its set-point has moved since it was told to stand; empty where it has not, or its encoder follows.

        Then the guards see that. A following error is caught up within `BETWEEN`.
        """
        command, sample = self._standing(), self._link.values
        if command is None or sample is None or self._demand is None:
            return ""
        told = await self._number(self._demand, 0)
        if told is None:
            self._demand = None
            return ""
        if self._standing() is not command:
            return ""
        if self._wanted is None or self._wanted[0] is not command:
            self._wanted = command, told, sample.position
        moved = wrap32(told - self._wanted[1])
        if abs(moved) <= self._scale.magnitude(OLD):
            return ""
        await self._clock.sleep(BETWEEN)
        sample = self._link.values or sample
        if 2.0 * wrap32(sample.position - self._wanted[2]) / moved >= 1.0:
            return ""
        self.blind = True
        return MOVED_SAYS.format(self._demand, 1e3 * self._scale.velocity(moved))

    async def _look_at_load(self) -> str:
        """Whether samples that tell the same all the time are old."""
        load, link = self._link.decoder.load, self._link
        sample, since = link.values, link.unchanged_since
        if since != self._stretch:
            self._stretch, self._answers, self._others = since, 0, 0
        if load is None or sample is None or sample.t - since < COMPARED_EVERY:
            return ""
        told = await self._number(load.index, load.value[1])
        if told is None or link.unchanged_since != since:
            return ""
        self._answers += 1
        self._others += (told - int(sample.current)) % (1 << 8 * struct.calcsize(load.code)) != 0
        if _by_chance(self._others, self._answers, link.unchanged) > CHANCE:
            return ""
        self.blind = True
        return SAME_SAYS.format(sample.t - since)

    async def _look_at_one(self) -> str:
        """What one of its settings is by now; empty where it is as it was written: then the next has its turn."""
        kept = self._kept()
        if not kept:
            return ""
        setting = kept[self._turn % len(kept)]
        value = await self._number(setting.index, setting.sub)
        if value is None or setting.holds(value) or setting not in self._kept():
            self._turn += 1
            return ""
        return CHANGED_SAYS.format(setting.object, setting.meaning, setting.told(value), setting.words)

    async def _round(self) -> None:
        found = Health(t=self._clock.now())
        if not self._link.layout.tells(Mappable.MODE_DISPLAY.name):
            mode = await self._number(Mappable.MODE_DISPLAY.index, 0)
            if mode is not None:
                self._link.decoder.displayed = mode
        if self._follows:
            lag = await self._number(Mappable.FOLLOWING_ERROR.index, 0)
            self._follows = lag is not None
            found = replace(found, following_error=lag)
        if (where := self._temperature) is not None:
            digits = await self._number(where.index, where.sub)
            self._temperature = where if digits is not None else None
            found = replace(found, temperature=None if digits is None else where.scale * digits)
        if self._sto is not None:
            inputs = await self._number(INPUTS, 0)
            found = replace(found, sto=inputs is not None and self._sto.is_active(inputs))
        self._newest = found

    async def _number(self, index: int, sub: int) -> int | None:
        try:
            return await self._link.sdo.read(index, sub)
        except SdoRefusedError:
            return None


def _by_chance(others: int, answers: int, samples: int) -> float:
    """The greatest probability that so many of the answers differ and none of the samples, if each did as often."""
    every = samples + answers
    part = others / every
    return math.comb(answers, others) * part**others * (1.0 - part) ** (every - others)
