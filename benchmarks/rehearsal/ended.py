"""What was seen of a run from outside, and what must hold whatever was planted (`Ended.check`).

Shafts at rest and staying there, journal and campaign readable, every frame that came during a recording in a file, a
whole CAN log.
"""

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.rehearsal.plans import RATE
from drivers.canbus.candump import read_candump
from drivers.canbus.transport import CanFrame
from drivers.ports import MarkerFrame
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.files.mcap_file import read_mcap
from procedures.events import Event, RunFinished, Tripped
from procedures.guards.guard import Trip
from procedures.outcomes import Outcome
from procedures.recording.journal import Entry, LineKind, read_journal
from procedures.report import RunReport
from sim_backends.drive.axis.machine import State
from sim_backends.drive.node import SimulatedDrive

ROUNDING = 1e-5
"""m in a window file"""
SAFE = {State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT, State.SWITCH_ON_DISABLED, State.READY}
"""powered and standing, or braked"""


@dataclass(frozen=True, eq=False)
class Ended:
    """A run that has ended, and all that was seen from outside."""

    folder: Path
    rows: int
    """of a whole window"""
    events: list[Event] = field(default_factory=list)
    frames: list[CanFrame] = field(default_factory=list)
    """as they passed the master's adapter"""
    markers: dict[int, MarkerFrame] = field(default_factory=dict)
    """every marker frame that the source handed out, by number"""
    truth: dict[int, np.ndarray] = field(default_factory=dict)
    """where the main marker truly was in each frame"""
    planted: list[float] = field(default_factory=list)
    """when each fault came"""
    begun: dict[str, list[float]] = field(default_factory=dict)
    """when steps began, by type"""
    drives: tuple[SimulatedDrive, ...] = ()
    rest: tuple[float, ...] = ()
    """position of each shaft when the run ended, counts"""
    shafts: tuple[tuple[float, float], ...] = ()
    """position and speed a while later"""
    error: BaseException | None = None

    @property
    def report(self) -> RunReport:
        last = self.events[-1]
        assert isinstance(last, RunFinished)
        return last.report

    @property
    def trip(self) -> Trip | None:
        return next((e.trip for e in self.events if isinstance(e, Tripped)), None)

    @property
    def journal(self) -> tuple[Entry, ...]:
        return read_journal(self.folder / "journal.jsonl")

    def controlwords(self, since: float = -math.inf) -> list[tuple[float, int, int]]:
        """(time, node, word) of every controlword since a time, by RPDO or by SDO."""
        found: list[tuple[float, int, int]] = []
        for frame in (f for f in self.frames if f.t >= since):
            function, node, data = frame.id & 0x780, frame.id & 0x7F, frame.data
            if function == 0x200 or (function == 0x600 and data[:4] == b"\x2b\x40\x60\x00"):
                word = data[:2] if function == 0x200 else data[4:6]
                found.append((frame.t, node, int.from_bytes(word, "little")))
        return found

    def check(
        self, *, held: bool = True, journal: bool = True, log: bool = True, part: bool = False, opened: bool = True
    ) -> RunReport:
        """What holds whatever the fault was.

        held: every winch was seen to stand still; journal, log: the disk took them; part: a full disk left one behind;
        opened: each recording that began has a file.
        """
        report = self.report
        assert self.planted, "the fault was never planted"
        for drive, (place, speed), rest in zip(self.drives, self.shafts, self.rest, strict=True):
            assert drive.state in SAFE, drive.state
            assert speed == 0.0, f"drive {drive.node_id} still turns"
            assert abs(place - rest) <= 1.0, f"drive {drive.node_id} turned after the run"
        assert report.held is held, report.held_says
        assert report.reason.strip()
        if journal:
            self._check_journal(report)
        self._check_folder(report, part=part, opened=opened)
        if log:
            logged = list(read_candump(self.folder / "can.log"))
            assert [(f.id, f.data) for f in logged] == [(f.id, f.data) for f in self.frames]
        return report

    def _check_journal(self, report: RunReport) -> None:
        held, finished = self.journal[-2:]
        assert (held.kind, finished.kind) == (LineKind.HELD, LineKind.RUN_FINISHED)
        assert (finished.outcome, finished.reason) == (report.outcome, report.reason)
        assert (held.outcome, held.reason) == (Outcome.PASS if report.held else Outcome.ERROR, report.held_says)
        assert (self.trip is None) == (not [e for e in self.journal if e.kind is LineKind.TRIPPED])

    def _check_folder(self, report: RunReport, *, part: bool, opened: bool) -> None:
        """Accepted windows are whole and listed, the others are kept, nothing is spliced, nothing is missing."""
        left = [path for path in self.folder.rglob("*.part") if part is False]
        assert [path for path in left if path.parent.name != "rejected" or ".mcap" not in path.suffixes] == []
        if report.accepted:
            campaign = read_campaign(self.folder)
            assert [w.id for w in campaign.windows] == [row.id for row in report.accepted]
            assert {len(w.t) for w in campaign.windows} == {self.rows}
        files = [path for path in self.folder.glob("[wr]*/*") if ".csv" in path.suffixes]
        assert len(files) == len(self.begun.get("Record", ())) or not opened
        for file in files:
            self.check_rows(file)
            if "cannot be written" not in report.reason:
                self.check_log(file)

    def first_number(self, file: Path) -> int | None:
        """The frame number of a window's first row; None for a file without a marker."""
        at, place = next(iter(places(file).items()), (0, None))
        return None if place is None else next(n for n, f in self.markers.items() if _is(f, place)) - at

    def check_rows(self, file: Path) -> None:
        """Each row is the frame of its number, or blank where there was none."""
        text = file.read_text()
        assert text.endswith("\n") or not text
        first, found = self.first_number(file), places(file)
        for k, line in enumerate(text.splitlines()[1:] if first is not None else ()):
            assert abs(float(line.partition(",")[0]) - k / RATE) <= 1e-6
            frame = self.markers.get(first + k)
            if k in found:
                assert frame is not None
                assert _is(frame, found[k]), f"{file.name}, row {k}"
            else:
                assert frame is None or frame.positions[0] is None, f"{file.name}: frame {first + k} is missing"

    def check_log(self, file: Path) -> None:
        """The MCAP file beside a window has the same rows; it is whole unless the window was broken off."""
        log = file.with_suffix(".mcap")
        log = log if log.exists() else log.with_name(log.name + ".part")
        contents = read_mcap(log)
        assert contents.complete == (log.suffix == ".mcap")
        rows = [message.value for message in contents.of("/window")]
        assert len(rows) == file.read_text().count("\n") - 1
        found = places(file)
        for k, row in enumerate(rows):
            assert (k in found) == (not math.isnan(row.markers[0]))
            assert k not in found or np.allclose(row.markers[:3], found[k], rtol=0, atol=ROUNDING)


def places(file: Path) -> dict[int, np.ndarray]:
    """The main marker by row, where it is not blank; also of a file that a full disk has cut short."""
    rows = [line.split(",") for line in file.read_text().splitlines()[1:]]
    return {k: np.array([float(value) for value in row[1:4]]) for k, row in enumerate(rows) if row[1]}


def _is(frame: MarkerFrame, place: np.ndarray) -> bool:
    return frame.positions[0] is not None and bool(np.allclose(frame.positions[0], place, rtol=0, atol=ROUNDING))
