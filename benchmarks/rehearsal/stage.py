"""What a fault may break while a run goes on."""

import asyncio
import math
import os
import struct
from collections.abc import Callable, Coroutine
from dataclasses import dataclass, field, replace
from typing import Any

from benchmarks.rehearsal.plans import RATE
from drivers.canbus.transport import CanFrame
from fidim_lab.app import compose
from fidim_lab.data.records import Robot
from procedures.control import Control
from sim_backends.drive.node import SimulatedDrive
from sim_backends.mocap.faults import During, Faults, Freeze, Jump, Occlusion, Replay


def _itself(during: During) -> During:
    return during


_MAKES: dict[str, Callable[..., Any]] = {
    "occlusions": Occlusion,
    "freezes": Freeze,
    "silences": _itself,
    "strays": _itself,
    "jumps": Jump,
    "replays": Replay,
}


class MocapFaults:
    """Adds faults to a stream while it runs."""

    def __init__(self, faults: Faults | None) -> None:
        self._added: dict[str, list[Any]] = {kind: [] for kind in _MAKES}
        self.faults = replace(faults or Faults(), **self._added)
        self.now: Callable[[], float] = lambda: 0.0
        self.begin = 0.0

    def add(self, kind: str, seconds: float, *more: Any) -> None:
        """From now on: "occlusions", "freezes", "silences", "strays"; "jumps" with an offset; "replays"."""
        since = self.now() - self.begin - 1.0 / RATE  # a stream begins one period after its server
        during = During(since, since + seconds)
        self._added[kind].append(_MAKES[kind](during, *more))


FAR = 1.0
"""m of cable: farther than a drum turns until it is stopped"""


@dataclass
class Disk:
    """Where recordings are written; it may refuse from some time on."""

    refuses: int | None = None
    """errno"""

    def write(self, descriptor: int, data: bytes) -> int:
        if self.refuses is not None:
            raise OSError(self.refuses, os.strerror(self.refuses))
        return os.write(descriptor, data)


@dataclass(frozen=True, eq=False)
class Stage:
    """What a fault may break."""

    rig: compose.SimulatedRig
    robot: Robot
    now: Callable[[], float]
    mocap: MocapFaults
    control: Control
    """what people may say to the run"""
    disk: Disk = field(default_factory=Disk)
    tasks: "list[asyncio.Future[Any]]" = field(default_factory=list)
    """of faults that take their time; ended with the run"""

    @property
    def bus(self) -> Any:
        return self.rig.transport

    def drive(self, cable: int) -> SimulatedDrive:
        return self.rig.drives[cable - 1]

    def add_tension(self, cable: int, newton: float) -> None:
        """As the ammeter of a drive tells it."""
        winches = self.robot.winches
        assert winches is not None
        pull = -self.rig.laboratory.drums[cable - 1].direction
        self.drive(cable).faults.offset_current(pull * newton / winches[cable - 1].newton_per_ampere)

    def counts(self, cable: int, metres: float) -> int:
        """So much more cable, in counts of the drive."""
        drum = self.rig.laboratory.drums[cable - 1]
        return round(drum.direction * metres / drum.metres_per_count)

    def place(self, cable: int) -> int:
        """Where the shaft is now, counts."""
        return round(self.rig.laboratory.shafts[cable - 1].motion(self.now()).position)

    def write_pdo(self, cable: int, *, unseen: bool = False, **values: int) -> None:
        """Somebody else's RPDO to a drive, in whatever order the drive has its objects mapped; 0 where not given.

        values: controlword, mode, target. unseen: by the drive's own port, so that nothing passes on the bus.
        """
        names, codes = {0x6040: "controlword", 0x6060: "mode", 0x607A: "target"}, {8: "b", 16: "H", 32: "i"}
        od = self.drive(cable).od
        mapped = [od.number(0x1600, k) for k in range(1, od.number(0x1600, 0) + 1)]
        data = b"".join(
            struct.pack("<" + codes[entry & 0xFF], values.get(names.get(entry >> 16, ""), 0)) for entry in mapped
        )
        self._arrives(0x200 + cable, data, unseen=unseen)

    def write_sdo(self, cable: int, index: int, value: int, subindex: int = 0, *, unseen: bool = False) -> None:
        """Somebody else's SDO download of four bytes; unseen: as in `write_pdo`."""
        self._arrives(0x600 + cable, struct.pack("<BHBi", 0x23, index, subindex, value), unseen=unseen)

    def write_word(self, cable: int, index: int, value: int) -> None:
        """A download of two bytes by the drive's own port, unseen."""
        self._arrives(0x600 + cable, struct.pack("<BHBHxx", 0x2B, index, 0, value), unseen=True)

    def write_byte(self, cable: int, index: int, value: int) -> None:
        """One of a byte, likewise."""
        self._arrives(0x600 + cable, struct.pack("<BHBbxxx", 0x2F, index, 0, value), unseen=True)

    def spin(self, cable: int, speed: float, *, unseen: bool = False) -> None:
        """Another program turns a drum as far as it goes, m/s of cable, in the mode that the drive has."""
        self.write_sdo(cable, 0x6081, abs(self.counts(cable, speed)), unseen=unseen)
        self.send_to(cable, math.copysign(FAR, speed), unseen=unseen)

    def spin_in_velocity_mode(self, cable: int, speed: float, *, unseen: bool = False) -> None:
        """As `spin`, in profile velocity mode, as a vendor's tool does it."""
        self.write_sdo(cable, 0x60FF, self.counts(cable, speed), unseen=unseen)
        self.write_pdo(cable, unseen=unseen, controlword=0x0F, mode=3)

    def send_to(self, cable: int, metres: float, *, unseen: bool = False) -> None:
        """A second master's set-point, so many metres of cable from here: bit 4 rises."""
        target = self.place(cable) + self.counts(cable, metres)
        for word in (0x2F, 0x3F, 0x2F):
            self.write_pdo(cable, unseen=unseen, controlword=word, mode=1, target=target)

    def _arrives(self, frame_id: int, data: bytes, *, unseen: bool) -> None:
        if unseen:
            self.drive(frame_id & 0x7F).receive(CanFrame(frame_id, data, self.now()))
        else:
            self.bus.inject(frame_id, data)

    def spawn(self, work: Coroutine[Any, Any, Any]) -> None:
        """Let a fault take its time; it ends with the run."""
        self.tasks.append(asyncio.ensure_future(work))

    async def sleep(self, seconds: float) -> None:
        await self.rig.rig.clock.sleep(seconds)

    def end_task(self, name: str) -> None:
        """End a background task of the host by the name of its coroutine."""
        (task,) = [t for t in asyncio.all_tasks() if getattr(t.get_coro(), "__qualname__", "") == name]
        task.cancel()
