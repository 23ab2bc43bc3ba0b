"""The model's prediction of a recording that has just begun, from a process of its own: the screen never waits.

`Foresight` asks `foresee` (a worker, started at the first recording) twice in a recording.
"""

import asyncio
import json
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fidim_lab.app.terminal.worker_pipe import LineWorker
from fidim_lab.app.tui.view import Position, Trace

FIRST = 2.0
"""s of recording with which a prediction is tried first"""
MOST = 4.0
"""s that are fitted at most: with a body that is not quite right (CAD) longer stretches lose the phase"""
ENDS_WITHIN = 1.0
"""s"""
LINE = 1 << 24
"""bytes of an answer at most"""


@dataclass(frozen=True, eq=False)
class Foreseen:
    """A predicted path of the main marker."""

    of: tuple[str, int]
    """window and attempt"""
    fitted: float
    """s of the recording that gave the initial state; all after is foretold"""
    body: str
    """whose parameters: CAD, or a result"""
    t: Sequence[float]
    """s, the service's clock, increasing"""
    positions: Sequence[Position]

    def at(self, t: float) -> Position | None:
        """Between two predicted places; None where nothing was predicted."""
        if not self.t or not self.t[0] <= t <= self.t[-1]:
            return None
        k = min(max(bisect_left(self.t, t), 1), len(self.t) - 1)
        share = (t - self.t[k - 1]) / (self.t[k] - self.t[k - 1])
        a, b = self.positions[k - 1], self.positions[k]
        x, y, z = (p + share * (q - p) for p, q in zip(a, b, strict=True))
        return x, y, z


class Foresight:
    """Asks the worker. `look` at any rate; it asks when there is enough that is new."""

    def __init__(self) -> None:
        self.found: Foreseen | None = None
        self.doubt = "the model's prediction starts after some seconds"
        self._worker = LineWorker("-m", "fidim_lab.app.tui.foresee", longest=LINE)
        self._asking: asyncio.Task[None] | None = None
        self._asked: tuple[tuple[str, int], float] = (("", 0), 0.0)

    def look(self, trace: Trace, folder: Path | None) -> None:
        """Ask for a prediction where the recording is new, and once more when enough of it is there."""
        if folder is None or (self._asking is not None and not self._asking.done()):
            return
        if len(trace.t) < 2:
            if not self._worker.begun:
                self._asking = asyncio.create_task(self.warm(folder))
            return
        of, long = (trace.window, trace.attempt), trace.t[-1] - trace.t[0]
        before = self._asked[1] if self._asked[0] == of else 0.0
        if before >= MOST or long < (MOST if before else FIRST):
            return
        self._asked = of, long
        request = {
            "folder": str(folder),
            "window": trace.window,
            "t": trace.t,
            "positions": trace.positions,
            "lengths": trace.lengths,
        }
        self._asking = asyncio.create_task(self._ask(of, json.dumps(request)))

    async def close(self) -> None:
        """End the worker."""
        if self._asking is not None:
            self._asking.cancel()
            await asyncio.gather(self._asking, return_exceptions=True)
        await self._worker.end(ENDS_WITHIN)

    async def warm(self, folder: Path) -> None:
        """Start the worker, and have it make the model's functions, before they are needed: that takes seconds."""
        await self._told(json.dumps({"folder": str(folder)}))

    async def _told(self, request: str) -> dict[str, Any]:
        """The worker's answer, or why there is none."""
        try:
            return await self._worker.answer(request)
        except (OSError, ValueError):
            return {"doubt": "its process has ended"}

    async def _ask(self, of: tuple[str, int], request: str) -> None:
        self.doubt = "the model's prediction is being computed"
        answer = await self._told(request)
        if "doubt" in answer:
            self.doubt = f"no prediction: {answer['doubt']}"
            return
        self.found = Foreseen(
            of, answer["fitted"], answer["body"], answer["t"], [tuple(p) for p in answer["positions"]]
        )
