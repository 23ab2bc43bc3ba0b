"""What a drive says of itself besides its PDOs: following error (60F4), temperature, safe torque off (60FD).

Asked by SDO twice a second; a drive that has none of them tells its statusword. One that sends samples and answers no
question does not hear: the next stop may not reach it, and nobody would know before it is needed.

By SDO, for a fifth PDO would cost bus time in every cycle, and not every drive lets these objects be mapped. An object
that the drive refuses is not asked for again; what has not been answered lately is unknown.
"""

from dataclasses import dataclass, replace

from drivers.cia402.dictionary.config import TemperatureObject
from drivers.cia402.profile.signals import INPUTS, Signal
from drivers.cia402.watch.node import NodeLink
from drivers.cia402.wire.sdo import SdoRefusedError
from drivers.ports import Clock
from fidim_lab.errors import DeviceError

FOLLOWING_ERROR = 0x60F4
PERIOD = 0.5
"""s between two rounds"""
STATUSWORD = 0x6041
DEAF_SAYS = "it sends samples and answers no question (SDO): a stop may not reach it"
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
        self, link: NodeLink, clock: Clock, temperature: TemperatureObject | None, sto: Signal | None = None
    ) -> None:
        self._sto = sto if sto is not None and link.sdo.knows(INPUTS) else None
        self._link = link
        self._clock = clock
        self._temperature = temperature if temperature and link.sdo.knows(temperature.index, temperature.sub) else None
        self._follows = link.sdo.knows(FOLLOWING_ERROR)
        self._newest = NOTHING_TOLD
        self._deaf = False

    @property
    def deaf(self) -> bool:
        """Whether it has answered neither the newest question nor its repetition (`SdoChannel.read`)."""
        return self._deaf and self._link.brought_up

    def believed(self) -> Health:
        """The newest answers, or an empty value where they are too old."""
        fresh = self._clock.now() - self._newest.t <= BELIEVED * PERIOD
        return self._newest if fresh else NOTHING_TOLD

    async def run(self) -> None:
        """Ask for ever, also a drive that does not answer: it is believed again once it does."""
        while True:
            await self._clock.sleep(PERIOD)
            if not self._link.brought_up:
                self._deaf = False
                continue
            try:
                await self._round()
            except DeviceError:
                self._deaf = True
            else:
                self._deaf = False

    async def _round(self) -> None:
        found = Health(t=self._clock.now())
        if not (self._follows or self._temperature or self._sto):
            await self._number(STATUSWORD, 0)
        if self._follows:
            lag = await self._number(FOLLOWING_ERROR, 0)
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
