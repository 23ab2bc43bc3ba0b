"""A row of docs/faults.md, and how each of its columns is asserted.

The mark of a test is its row (`docs/faults.py` reads it); `fault.strikes` plants the fault, runs, and asserts the row
and what holds whatever happens.
"""

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import pytest

from procedures.recording.journal import LineKind
from sim_backends.drive.axis.machine import State

QUICK_STOP, HALTED = 0x02, 0x10F
NODES = {1, 2, 3, 4}
LOOK = 0.005
"""s between two looks at the drives from outside"""
AGAIN = "the window is recorded again"
NONE_OPEN, FLUSHED = "none was open", "but for at most 0.1 s"
BY_THEMSELVES = "the drives stop by themselves"


@dataclass(frozen=True, kw_only=True)
class Expected:
    """A row of the table, and how each of its columns is asserted."""

    reaction: str
    says: str
    window: str
    within: float | None = None
    held: bool = True
    """whether the host can see that the robot is held"""
    journal: LineKind = LineKind.TRIPPED
    """which line says it"""

    def strikes(
        self,
        rehearsal: Any,
        plant: Callable[[Any], Any],
        *,
        step: str = "Record",
        after: float = 0.5,
        **run: Any,
    ) -> Any:
        """Plant it so long after a step begins, run to the end, assert everything; returns what was seen."""
        stopped: list[float] = []

        def strike(stage: Any) -> None:
            stage.tasks.append(asyncio.ensure_future(_watch(stage, stopped)))
            plant(stage)

        rehearsal.at(step, strike, after=after)
        ended = rehearsal.run(**run)
        ended.check(held=self.held, opened=self.window != NONE_OPEN)
        asserts = {
            "quick stop": lambda: self._stopped(ended, {QUICK_STOP}),
            "hold": lambda: self._stopped(ended, {HALTED}),
            BY_THEMSELVES: lambda: self._stopped_by_themselves(ended, stopped),
            AGAIN: lambda: self._again(ended),
            "warning": lambda: self._goes_on(ended),
            "none": lambda: self._goes_on(ended),
        }
        asserts[self.reaction]()
        self._said(ended)
        return ended

    def _stopped(self, ended: Any, first: set[int]) -> None:
        """All drives were told within the time, and nothing that moves one was said afterwards."""
        since = ended.planted[-1]
        words = [(t, node, word) for t, node, word in ended.controlwords(since) if word in first]
        assert {node for _, node, _ in words} == NODES
        told = max(min(t for t, node, _ in words if node == wanted) for wanted in NODES)
        assert self.within is None or told - since <= self.within, told - since
        after = {word for t, _, word in ended.controlwords(since) if t >= min(t for t, _, _ in words)}
        assert after <= {QUICK_STOP, HALTED}, "latched: nothing but stops"
        assert ended.report.exit_code == (130 if ended.report.interrupted else 3)
        self._kept(ended)

    def _stopped_by_themselves(self, ended: Any, stopped: Sequence[float]) -> None:
        assert stopped, "the drives never stopped"
        assert self.within is None or stopped[0] - ended.planted[-1] <= self.within, stopped[0] - ended.planted[-1]
        assert {drive.state for drive in ended.drives} == {State.QUICK_STOP_ACTIVE}
        assert ended.report.exit_code == 3
        self._kept(ended)

    def _kept(self, ended: Any) -> None:
        """The open window is no window of the campaign; what came of it until the fault is there."""
        if self.window == NONE_OPEN:
            return
        assert not ended.report.accepted
        rows = (ended.folder / "rejected" / "i01-attempt1.csv").read_text().count("\n") - 1
        unwritten = 11 if FLUSHED in self.window else 3
        assert rows >= 100 * (ended.planted[-1] - ended.begun["Record"][0]) - unwritten

    def _again(self, ended: Any) -> None:
        assert ended.report.exit_code == 0
        assert [row.attempts for row in ended.report.accepted] == [2]
        assert (ended.folder / "rejected" / "i01-attempt1.csv").read_text().count("\n") == ended.rows + 1
        assert ended.trip is None

    def _goes_on(self, ended: Any) -> None:
        assert ended.report.exit_code == 0, ended.report.reason
        assert [row.attempts for row in ended.report.accepted] == [1]
        assert ended.trip is None

    def _said(self, ended: Any) -> None:
        lines = [f"{e.window} {e.text} {e.reason}" for e in ended.journal if e.kind is self.journal]
        assert any(self.says in line for line in lines), (self.says, lines)


async def _watch(stage: Any, stopped: list[float]) -> None:
    """When all drives are in their own quick stop, seen from outside."""
    while {drive.state for drive in stage.rig.drives} != {State.QUICK_STOP_ACTIVE}:
        await stage.rig.rig.clock.sleep(LOOK)
    stopped.append(stage.now())


@pytest.fixture
def fault(request) -> Expected:
    """The row of this test."""
    told = dict(request.node.get_closest_marker("fault").kwargs)
    return Expected(**{**told, "journal": LineKind[told.pop("journal", "TRIPPED")]})
