"""The simulated release: takes commands, tells its state, and lets go when nobody asks any more."""

import asyncio
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from drivers.ports import Clock
from sim_backends.serial_devices.pty_line import PtyLine

LOOK = 0.01
"""s between two looks at its watchdog"""


class Magnet(Protocol):
    """What the device switches."""

    energised: bool

    def switch(self, on: bool) -> None:
        """Power on or off; off, it lets go of what it holds."""
        ...


@dataclass(frozen=True)
class ReleaseTalk:
    """Its commands and answers."""

    hold: bytes
    release: bytes
    ask: bytes
    holds: str
    released: str


class SimulatedRelease:
    """Answers on a pseudo terminal. `run` lets it live.

    Not simulated: the time that a magnet's field needs to fade beyond the hand-over to the plant, bouncing relays.
    """

    def __init__(self, link: Path, baud: int, clock: Clock, magnet: Magnet, talk: ReleaseTalk, watchdog: float) -> None:
        """watchdog: s without a question until it lets go."""
        self.line = PtyLine(link, baud, clock, self._heard)
        self.deaf = False
        """from now on commands have no effect (a blown fuse): the state read back tells"""
        self._clock = clock
        self._magnet = magnet
        self._talk = talk
        self._watchdog = watchdog
        self._asked_at = float("-inf")
        self._rest = b""
        self._answers: asyncio.Queue[str] = asyncio.Queue()

    async def run(self) -> None:
        """Plug in and live; never returns, lets go and unplugs in the end."""
        try:
            self.line.plug()
            while True:
                while not self._answers.empty():
                    await self.line.send(f"{self._answers.get_nowait()}\r\n".encode("ascii"))
                if self._clock.now() - self._asked_at > self._watchdog:
                    self._switch(False)
                await self._clock.sleep(LOOK)
        finally:
            self._switch(False)
            self.line.unplug()

    def _switch(self, on: bool) -> None:
        if self._magnet.energised != on and not (on and self.deaf):
            self._magnet.switch(on)

    def _heard(self, data: bytes) -> None:
        """Commands in the order in which they came, however their bytes were torn."""
        self._rest += data
        commands = (self._talk.hold, self._talk.release, self._talk.ask)
        while found := [(at, what) for what in commands if (at := self._rest.find(what)) >= 0]:
            at, command = min(found, key=lambda one: (one[0], -len(one[1])))
            self._rest = self._rest[at + len(command) :]
            self._asked_at = self._clock.now()
            if command == self._talk.ask:
                self._answers.put_nowait(self._talk.holds if self._magnet.energised else self._talk.released)
            else:
                self._switch(command == self._talk.hold)
        self._rest = self._rest[-max(map(len, commands)) :]
