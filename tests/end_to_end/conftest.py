"""Rehearsals for fault tests (`benchmarks.rehearsal`), on the paper's robot in the test's own folder."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

from benchmarks.rehearsal import TWO, Ended, Rehearsal, places, short
from fidim_lab.data.records import Plan, Robot
from sim_backends.mocap.faults import Faults

STARVED = ("not answer for", "0x8130", "this computer did nothing for")
"""what a run stops for on a computer that has no time for it: hardware's limits, and the drives in the same process"""


@dataclass(frozen=True)
class Scene:
    """What tests take from here."""

    robot: Robot
    path: Path
    two: Plan = TWO
    short = staticmethod(short)
    places = staticmethod(places)

    def make(self, faults: Faults | None = None, folder: str = "run") -> Rehearsal:
        return Rehearsal(self.robot, self.path / folder, faults)

    def in_real_time(self, prepare: Callable[[Rehearsal], None], starved: Sequence[str] = STARVED) -> Ended:
        """Run on real bus threads and sockets; anew where a busy machine starved the host or the simulated drives.

        Such a run rightly stops: before anything was planted, or with one of the words of `starved`.
        """
        for attempt in range(5):
            rehearsal = self.make(folder=f"real{attempt}")
            rehearsal.real_time = True
            prepare(rehearsal)
            ended = rehearsal.run()
            if ended.planted and not any(says in ended.report.reason for says in starved):
                break
        return ended


@pytest.fixture
def scene(irma4: Robot, tmp_path: Path) -> Scene:
    return Scene(irma4, tmp_path)


@pytest.fixture
def rehearsal(scene: Scene) -> Rehearsal:
    return scene.make()
