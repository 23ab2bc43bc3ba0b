"""The remaining work of a run that has ended in any way, read from its folder.

campaign.toml says which windows are kept (it is written before the journal says so), the journal which others have
their verdict, how often each was recorded, and where the robot should be. The open window is recorded again.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fidim_lab.data.campaign import FORMAT as CAMPAIGN_FORMAT
from fidim_lab.data.campaign import INDEX, ROBOT, CampaignTable, IndexEntry
from fidim_lab.data.files.toml_file import read_toml
from fidim_lab.data.records import Plan, Role
from fidim_lab.errors import RefusedError, SetupError
from procedures.outcomes import Outcome
from procedures.recording.journal import NAME as JOURNAL
from procedures.recording.journal import Entry, LineKind, read_journal
from procedures.report import WindowRow
from procedures.steps import Ask, GiveUp, Lengths, MoveTo, Record, Settle, longest_way

Position = tuple[float, float, float]

NEAR = 5e-3
"""m from where the journal left a robot at rest"""
NEAR_MARKER = 50e-3
"""m beyond its swing"""
NEAR_WAY = 25e-3
"""m from the way on which it was moving: winches that lost their host stop each on its own ramp"""


@dataclass(frozen=True)
class LastPlace:
    """Where the robot should be: at rest at `end`, or anywhere on its way from `start` to it. Cable lengths, m."""

    start: Lengths
    end: Lengths
    marker: Position | None = None
    """m, where the main marker came to rest there; None where that was not waited for"""

    @property
    def moving(self) -> bool:
        """Whether it was on its way."""
        return self.start != self.end

    def wrong(self, lengths: Lengths) -> str:
        """The contradiction, as a sentence without its full stop; empty where the robot is where it should be."""
        ways = [b - a for a, b in zip(self.start, self.end, strict=True)]
        gone = [now - a for a, now in zip(self.start, lengths, strict=True)]
        square = sum(way * way for way in ways)
        part = min(max(sum(w * g for w, g in zip(ways, gone, strict=True)) / square, 0.0), 1.0) if square else 0.0
        off = [g - part * w for w, g in zip(ways, gone, strict=True)]
        worst = max(range(len(off)), key=lambda cable: abs(off[cable]))
        allowed = NEAR_WAY if self.moving else NEAR
        if abs(off[worst]) <= allowed:
            return ""
        where = "the move during which the journal" if self.moving else "where the journal"
        return (
            f"cable {worst + 1} is {lengths[worst]:.4f} m long, {off[worst] * 1e3:+.1f} mm from {where} left it; "
            f"{allowed * 1e3:g} mm is allowed"
        )

    def marker_wrong(self, marker: Position | None, swing: float) -> str:
        """Likewise for the main marker (m; None: not seen), which may swing (m).

        Encoders cannot tell that a cable has slipped on its drum, or that a drum was turned while its drive was off.
        """
        if marker is None or self.marker is None or self.moving:
            return ""
        off, allowed = math.dist(marker, self.marker), swing + NEAR_MARKER
        if off <= allowed:
            return ""
        places = ["({:.3f}, {:.3f}, {:.3f}) m".format(*place) for place in (marker, self.marker)]
        return (
            f"the main marker is at {places[0]}, {off * 1e3:.0f} mm from {places[1]}, where it came to rest at these "
            f"lengths; {allowed * 1e3:.0f} mm is allowed"
        )


@dataclass(frozen=True, eq=False)
class Resumption:
    """The work of an earlier process."""

    entries: tuple[IndexEntry, ...]
    """of campaign.toml"""
    rows: Mapping[str, WindowRow]
    """windows with their verdict"""
    attempts: Mapping[str, int]
    """recordings begun, by window"""
    place: LastPlace | None
    """None where no winch was ever seen"""
    swings: bool
    """a person was asked to move or calm the platform, and it was not seen at rest since"""
    part: int
    """of the run that begins now; the first one was 0"""
    goes_on: bool = False
    """the procedure may have more to do than the plan's windows"""

    @property
    def recorded(self) -> int:
        """How many windows to identify from are kept."""
        return sum(entry.role is Role.IDENTIFY for entry in self.entries)

    def left_of(self, plan: Plan) -> Plan:
        """The windows without verdict. Raises RefusedError where there are none."""
        windows = tuple(window for window in plan.windows if window.id not in self.rows)
        if not windows and not self.goes_on:
            raise RefusedError("Every window has its verdict: there is nothing to resume.")
        return replace(plan, windows=windows)


def read_resumption(folder: Path, roles: Mapping[str, Role]) -> Resumption:
    """Read what there is. Raises FileError for a damaged folder, SetupError for none."""
    if not (folder / JOURNAL).exists() or not (folder / ROBOT).exists():
        raise SetupError(f"{folder}: no run has begun here, so none can be resumed.")
    table = read_toml(folder / INDEX, CampaignTable, CAMPAIGN_FORMAT)
    journal = read_journal(folder / JOURNAL)
    entries = tuple(
        IndexEntry(w.id, w.role, None if w.equilibrium is None else np.array(w.equilibrium), Path(w.file).suffix)
        for w in table.window
    )
    attempts = _attempts(journal)
    verdicts = {
        e.window: e for e in journal if e.kind is LineKind.STEP_FINISHED and e.step in ("Accept", GiveUp.__name__)
    }
    rows: dict[str, WindowRow] = {}
    for entry in table.window:
        said = verdicts.get(entry.id)
        rows[entry.id] = WindowRow(
            id=entry.id,
            role=entry.role,
            outcome=said.outcome if said is not None and said.step == "Accept" else Outcome.MARGINAL,
            reason=said.reason if said is not None else "accepted at the moment the run was interrupted",
            attempts=attempts.get(entry.id, 1),
            file=folder / entry.file,
        )
    for window, said in verdicts.items():
        if window not in rows and window in roles and said.step == GiveUp.__name__:
            rows[window] = WindowRow(window, roles[window], said.outcome, said.reason, attempts.get(window, 0))
    part = 1 + sum(entry.kind is LineKind.CONTINUED for entry in journal)
    return Resumption(entries, rows, attempts, _place(journal), _swings(journal), part)


def _attempts(journal: Iterable[Entry]) -> dict[str, int]:
    found: dict[str, int] = {}
    for entry in journal:
        if entry.kind is LineKind.STEP_STARTED and entry.step == Record.__name__:
            found[entry.window] = found.get(entry.window, 0) + 1
    return found


def _swings(journal: Iterable[Entry]) -> bool:
    """So a question that was open when the run broke off is asked again, before the first move."""
    swings = False
    for entry in journal:
        if entry.step == Ask.__name__ and entry.kind is LineKind.STEP_STARTED:
            swings = True
        elif entry.step == Settle.__name__ and entry.kind is LineKind.STEP_FINISHED and entry.outcome.usable:
            swings = False
    return swings


def _place(journal: Iterable[Entry]) -> LastPlace | None:
    """The newest line that tells where the winches are; a move that has only begun ends somewhere on its way."""
    place: LastPlace | None = None
    for entry in journal:
        if place is not None and (rest := _rest(entry)) is not None:
            place = replace(place, marker=rest)
        lengths = _lengths(entry)
        if lengths is None:
            continue
        moving = entry.kind is LineKind.STEP_STARTED and entry.step == MoveTo.__name__ and place is not None
        stayed = place is not None and longest_way(place.end, lengths) <= NEAR
        marker = place.marker if place is not None and stayed and not moving else None
        place = LastPlace(place.end if moving and place is not None else lengths, lengths, marker)
    return place


def _rest(entry: Entry) -> Position | None:
    """Where the main marker came to rest, of a `Settle` that has seen it do so."""
    values: Sequence[float] = entry.data.get("values", ())
    settled = entry.kind is LineKind.STEP_FINISHED and entry.step == Settle.__name__ and entry.outcome.usable
    return (float(values[0]), float(values[1]), float(values[2])) if settled and len(values) == 3 else None


def _lengths(entry: Entry) -> Lengths | None:
    found: Sequence[float] | None = entry.data.get("lengths")
    if (
        found is None
        and entry.kind is LineKind.STEP_FINISHED
        and entry.step in ("Enable", "MoveTo", "Hold", "ReadEncoders")
    ):
        found = entry.data.get("values")
    return tuple(float(length) for length in found) if found else None
