"""What a service tells all its clients ten times a second: the state of everything, and live samples."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime

from drivers.ports import Clock, MarkerSource
from fidim_lab.app.service.messages import Status
from fidim_lab.app.service.process.board import PromptBoard
from fidim_lab.app.service.process.command_handler import CommandHandler
from fidim_lab.app.service.process.hub import Hub
from fidim_lab.app.service.process.status import Gauges, Watcher
from fidim_lab.errors import FidimError
from procedures.guards.guard import Guard

TELL_PERIOD = 0.1
"""s between two states"""


def wall_time() -> str:
    """The time of day, UTC."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


@dataclass(frozen=True, eq=False)
class StateSources:
    """From what a state is made."""

    clock: Clock
    markers: MarkerSource
    gauges: Gauges
    watcher: Watcher
    command_handler: CommandHandler
    board: PromptBoard
    hub: Hub


class StateBroadcast:
    """Makes states, and tells them. `tell` and `follow_markers` are tasks beside the run."""

    def __init__(self, sources: StateSources, guards: Sequence[Guard]) -> None:
        self._from = sources
        self._guards = tuple(guards)
        self._late = 0.0

    def more_guards(self, guards: Sequence[Guard]) -> None:
        """Show these among the guards, too."""
        self._guards = (*self._guards, *guards)

    async def tell(self) -> None:
        """States and live samples, for ever."""
        clock, sources = self._from.clock, self._from
        due = clock.now()
        while True:
            due += TELL_PERIOD
            await clock.sleep(due - clock.now())
            late = clock.now() - due
            self._late = max(late, 0.9 * self._late)
            if late > TELL_PERIOD:
                due = clock.now()
            sources.hub.tell(self.status())
            samples = sources.gauges.samples(sources.watcher.recording)
            if samples is not None:
                sources.hub.tell(samples)

    async def follow_markers(self) -> None:
        """Take every marker frame, beside the recorder, for ever."""
        while True:
            with suppress(FidimError):  # a silent stream says so; it may come back
                async for frame in self._from.markers.frames():
                    self._from.gauges.frame(frame)
            await self._from.clock.sleep(TELL_PERIOD)

    def status(self) -> Status:
        """As everything is now."""
        of = self._from
        latch = of.command_handler.latch
        return Status(
            t=round(of.clock.now(), 4),
            wall=wall_time(),
            phase=of.watcher.phase,
            latched=latch.latched,
            latched_why=latch.why,
            commanding=of.command_handler.lease.holder,
            commander=of.command_handler.lease.name,
            watching=of.hub.clients,
            step=of.watcher.step,
            winches=of.gauges.winches(),
            mocap=of.gauges.mocap(),
            bus=of.gauges.bus(),
            guards=of.watcher.guards(self._guards),
            equilibria=of.watcher.equilibria(),
            loop_late=round(max(self._late, 0.0), 4),
            prompt=None if of.board.question is None else of.board.question.number,
        )
