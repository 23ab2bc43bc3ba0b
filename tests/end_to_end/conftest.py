"""Rehearsals for fault tests (`benchmarks.rehearsal`), on the paper's robot in the test's own folder."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from benchmarks.rehearsal import TWO, Ended, Rehearsal, places, short
from fidim_lab.data.records import Plan, Robot
from sim_backends.mocap.faults import Faults

STARVED = ("not answered for", "0x8130", "this computer stood still for")
"""what a run stops for on a computer that has no time for it: hardware's limits, and the drives in the same process"""


TRIES = 5
"""runs in real time"""
LOOKS = 0.4
"""periods of the slowest swing, instead of two: the simulated robot rests before its winches are tried"""


def skip_if_busy() -> None:
    """Skip where others have more work than this computer has processors: then nothing runs here in real time."""
    load, processors = os.getloadavg()[0], os.cpu_count() or 1
    if load > processors:
        pytest.skip(f"{TRIES} runs in real time were starved: a load of {load:.1f} on {processors} processors")


@dataclass(frozen=True)
class Scene:
    """What tests take from here."""

    robot: Robot
    path: Path
    two: Plan = TWO
    short = staticmethod(short)
    places = staticmethod(places)
    tries: int = TRIES
    skip_if_busy = staticmethod(skip_if_busy)

    def make(self, faults: Faults | None = None, folder: str = "run") -> Rehearsal:
        made = Rehearsal(self.robot, self.path / folder, faults)
        made.periods = LOOKS
        return made

    def in_real_time(self, prepare: Callable[[Rehearsal], None], starved: Sequence[str] = STARVED) -> Ended:
        """Run on real bus threads and sockets; anew where a busy machine starved the host or the simulated drives.

        Such a run rightly stops: before anything was planted, or with one of the words of `starved`.
        """
        for attempt in range(TRIES):
            rehearsal = self.make(folder=f"real{attempt}")
            rehearsal.real_time = True
            prepare(rehearsal)
            ended = rehearsal.run()
            if ended.planted and not any(says in ended.report.reason for says in starved):
                return ended
        skip_if_busy()
        return ended


@pytest.fixture
def scene(irma4: Robot, tmp_path: Path) -> Scene:
    return Scene(irma4, tmp_path)


@pytest.fixture
def rehearsal(scene: Scene) -> Rehearsal:
    return scene.make()


@dataclass
class Truth:
    """What the plant did from the fault on; rows are times, columns cables."""

    lengths: list[np.ndarray] = field(default_factory=list)
    """m, by the shafts"""
    tensions: list[np.ndarray] = field(default_factory=list)
    """N"""

    def watch(self, stage):
        async def sample():
            laboratory = stage.rig.laboratory
            while True:
                now = stage.now()
                laboratory.refresh(now)
                motions = [shaft.motion(now) for shaft in laboratory.shafts]
                ways = [
                    d.direction * m.position * d.metres_per_count
                    for m, d in zip(motions, laboratory.drums, strict=True)
                ]
                self.lengths.append(np.array(ways))
                self.tensions.append(np.array(laboratory.plant.tensions))
                await stage.sleep(0.005)

        stage.spawn(sample())

    @property
    def moved(self):
        """m that each cable was paid out or wound since the fault."""
        return self.lengths[-1] - self.lengths[0]


@pytest.fixture
def truth():
    return Truth()
