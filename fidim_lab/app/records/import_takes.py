"""`fidim import` of many takes of one robot: takes + robot (+ logs) → a campaign folder.

    read → poses (`import_poses`) → free stretches → lengths and currents (`import_logs`) → campaign

What was decided for each take is in import.json ("fidim-takes/1") and on screen; a take that cannot be used is named
there with the reason and never stops the others.
"""

import itertools
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median_low

import numpy as np

from fidim_lab.app.formats.answer_file import write_answer
from fidim_lab.app.records.import_cables import LogLengths, cable_order, miscounted
from fidim_lab.app.records.import_logs import compared, logged, without_log
from fidim_lab.app.records.import_poses import pose_take
from fidim_lab.app.terminal import console
from fidim_lab.data.campaign import OFF_RATE, write_campaign
from fidim_lab.data.files.json_file import write_json
from fidim_lab.data.importers.takes import Asked, Take, Takes
from fidim_lab.data.records import Campaign, Robot, Role, Window
from fidim_lab.errors import FidimError, RefusedError
from fidim_lab.identification.cleaning.gravity_clock import gravity_clock
from fidim_lab.identification.motion.free_stretches import StretchRule, find_free_motion
from fidim_lab.identification.motion.hand_free import FreeStretch
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.say import counted

JOURNAL = "import.json"
FORMAT = "fidim-takes/1"
HELD_OUT_EVERY = 3
"""every third window validates where the source does not say"""
SEEN = 0.8
"""share of a free stretch in which a marker is to be seen; less is told"""
TWICE = 0.5
"""share of a take's samples that are those of others: noise makes no two of them alike"""
JUMP = 3e-4
"""m, by which the misfit of the rigid markers changes from one sample to the next where a marker is mislabelled"""
MOST_NAMED = 8
"""takes named with a decision on screen, about half a line; import.json has all"""
MOST_WINDOWS = 12
"""lines of windows on screen, half of a terminal; more are merged to ranges"""
PIECE = re.compile(r"(--[\w-]+ \S+)|\d+(?:\.\d+)?(?:e[+-]?\d+)?")
"""an option to be typed, which stays as it is, or a number"""
OF_WINDOW = "window "
"""how a decision on one window begins"""


@dataclass(frozen=True, eq=False)
class TakeWindows:
    """What one take gave."""

    take: Take
    windows: tuple[Window, ...]
    decided: tuple[str, ...]
    warnings: tuple[str, ...]
    refused: str = ""
    lengths: LogLengths | None = None
    """by the log and by the poses, where there is a log that reaches over a window"""

    def short(self, warning: str) -> str:
        """A warning beside the take's name, without that name in it."""
        return re.sub(rf"^{OF_WINDOW}{re.escape(self.take.id)}(-\d+)?: ", "", warning)


def import_takes_command(groups: Sequence[Takes], out: Path, json_file: Path | None) -> int:
    """Import one campaign a group and print what was found. Returns the exit code; raises FidimError."""
    reports: list[dict[str, object]] = []
    for group in groups:
        folder = out if len(groups) == 1 else out / group.name
        found = tuple(find_windows(group))
        reports.append(_write(group, found, folder))
        _print(group, found, folder)
    write_answer(json_file, FORMAT, {"campaigns": reports})
    return 0 if all(report["windows"] for report in reports) else 1


def find_windows(group: Takes) -> Sequence[TakeWindows]:
    """Windows of all takes. A take that is refused says why."""
    mechanism = Mechanism(group.robot)
    found: list[TakeWindows] = []
    known: dict[bytes, str] = {}
    rate = median_low([take.markers.rate for take in group.takes])
    for take in group.takes:
        try:
            if not 1.0 / OFF_RATE <= take.markers.rate / rate <= OFF_RATE:
                what = f"{take.markers.rate:.5g} Hz, while most takes have {rate:.5g} Hz; a campaign has one rate."
                raise RefusedError(what, hint="Import it by itself, and name both campaigns in fidim identify.")
            one = _of_take(mechanism, take, group.asked)
            _refuse_twice(one, known)
            found.append(one)
        except FidimError as error:
            found.append(TakeWindows(take, (), take.markers.decided, (), str(error)))
    return _with_right_clock(group.robot, _without_wrong_logs(found), group.asked.rate or rate)


def _with_right_clock(robot: Robot, found: Sequence[TakeWindows], rate: float) -> Sequence[TakeWindows]:
    """The same, or all takes refused where gravity says another rate, Hz, than file or option."""
    windows = tuple(window for one in found for window in one.windows)
    clock = gravity_clock(Campaign("", robot, rate, windows))
    if clock is None:
        return found
    refused = str(RefusedError(f"{clock.says(rate)}.", hint="Give the right rate with --rate."))
    return [replace(one, windows=(), lengths=None, refused=refused) if one.windows else one for one in found]


def _without_wrong_logs(found: Sequence[TakeWindows]) -> Sequence[TakeWindows]:
    """Takes whose logs have their cables in another order, or count otherwise than said, without these; it is told."""
    told = [one for one in found if one.lengths is not None]
    lengths = [one.lengths for one in told if one.lengths is not None]
    other = cable_order(lengths)
    counts = "" if other else miscounted(lengths)
    if other is None and not counts:
        return found
    says = other.says if other else f"{counts}. The lengths of the log are not used"
    return [
        one
        if one.lengths is None
        else replace(
            one,
            windows=tuple(without_log(window, currents=other is None) for window in one.windows),
            warnings=(*one.warnings, says) if one is told[0] else one.warnings,
        )
        for one in found
    ]


def _of_take(mechanism: Mechanism, take: Take, asked: Asked) -> TakeWindows:
    posed = pose_take(mechanism, take.markers, asked)
    free = find_free_motion(mechanism, posed.t, posed.positions, posed.rotations)
    free = [part for stretch in free for part in _without_breaks(stretch, take.markers.breaks)]
    if not free:
        raise RefusedError("no free motion of 3 s or more was found", hint="Let go of the platform while recording.")
    said = (*take.markers.decided, *(take.log.decided if take.log else ()), *posed.decided)
    warnings = list(posed.warnings)
    windows: list[Window] = []
    shown: list[np.ndarray] = []
    for number, stretch in enumerate(free, start=1):
        rows = (posed.t >= stretch.begin - 1e-9) & (posed.t <= stretch.end + 1e-9)
        name = take.id if len(free) == 1 else f"{take.id}-{number}"
        warnings += _doubts(name, posed.names, posed.markers[rows], posed.rms[rows])
        by_log = logged(mechanism, take, posed, rows)
        shown.append(rows)
        said = (*said, f"{OF_WINDOW}{name}: {stretch.begin:.2f} to {stretch.end:.2f} s, {by_log.words}")
        warnings += [f"window {name}: {by_log.doubt}"] if by_log.doubt else []
        role = take.role or Role.IDENTIFY
        windows.append(
            Window(
                name,
                role,
                posed.t[rows],
                posed.markers[rows],
                by_log.lengths,
                by_log.currents,
                further=by_log.further,
                lengths_by_poses=True,
                encoder_zeros=by_log.zeros,
            )
        )
    lengths = compared(mechanism, take, posed, shown)
    return TakeWindows(take, tuple(windows), said, tuple(warnings), lengths=lengths)


def _without_breaks(stretch: FreeStretch, breaks: Sequence[float]) -> Sequence[FreeStretch]:
    """What is free between the times (s) at which the clock was set, as far as it is long enough."""
    edges = [stretch.begin, *(at for at in breaks if stretch.begin < at < stretch.end), stretch.end]
    parts = (FreeStretch(begin, end) for begin, end in itertools.pairwise(edges))
    return [part for part in parts if part.duration >= StretchRule.shortest]


def _refuse_twice(one: TakeWindows, known: dict[bytes, str]) -> None:
    """Raises RefusedError where most samples stand in takes before, to the last digit; adds its own.

    known: takes by what was seen in a sample.
    """
    mine = [row for window in one.windows for row in _rows_of(window)]
    shared = [known[row] for row in mine if row in known]
    if len(shared) > TWICE * len(mine):
        what = f"{len(shared)} samples are those of take {shared[0]}: they would count twice"
        raise RefusedError(what, hint="Leave out one of the two files.")
    known |= dict.fromkeys(mine, one.take.id)


def _rows_of(window: Window) -> set[bytes]:
    """What was seen in each sample, of three coordinates at least."""
    flat = window.markers.reshape(len(window.t), -1)
    return {row.tobytes() for row in flat[np.isfinite(flat).sum(axis=1) >= 3]}


def _doubts(window: str, names: Sequence[str], markers: np.ndarray, rms: np.ndarray) -> Sequence[str]:
    seen = np.isfinite(markers).all(axis=2).mean(axis=0)
    seen[seen == 0.0] = np.nan  # of poses, three markers are computed
    doubts = [
        f"window {window}: marker {name} is seen in {share:.0%} of it"
        for name, share in zip(names, seen, strict=True)
        if share < SEEN
    ]
    jumps = int((np.abs(np.diff(rms)) > JUMP).sum())
    if jumps:
        doubts.append(f"window {window}: the rigid shape of the markers jumps {jumps} times")
    return doubts


def _write(group: Takes, found: Sequence[TakeWindows], folder: Path) -> dict[str, object]:
    windows = [window for one in found for window in one.windows]
    if all(one.take.role is None for one in found):
        windows = [
            replace(window, role=Role.VALIDATE if k % HELD_OUT_EVERY == 0 else Role.IDENTIFY)
            for k, window in enumerate(windows, start=1)
        ]
    table = _table(group, found, windows)
    folder.mkdir(parents=True, exist_ok=True)
    if windows:
        rate = group.asked.rate or median_low([one.take.markers.rate for one in found if one.windows])
        campaign = Campaign(group.name, group.robot, rate, tuple(windows))
        write_campaign(folder, campaign, robot_comment=f"Written by fidim import {group.kind} from its own geometry.")
    write_json(folder / JOURNAL, table)
    return table


def _table(group: Takes, found: Sequence[TakeWindows], windows: Sequence[Window]) -> dict[str, object]:
    return {
        "format": FORMAT,
        "kind": group.kind,
        "name": group.name,
        "geometry": str(group.geometry_source),
        "takes": [
            {
                "id": one.take.id,
                "file": str(one.take.markers.source),
                "log": None if one.take.log is None else str(one.take.log.source),
                "decided": list(one.decided),
                "warnings": list(one.warnings),
                "refused": one.refused or None,
            }
            for one in found
        ],
        "unread": dict(group.unread),
        "windows": [{"id": w.id, "role": w.role.value, "t": [float(w.t[0]), float(w.t[-1])]} for w in windows],
    }


def _merged(said: Iterable[tuple[str, str]]) -> list[tuple[str, tuple[str, ...]]]:
    """Sentences that differ in their numbers alone as one, with ranges; and the takes of which they were said."""
    alike: dict[str, tuple[list[str], list[str]]] = {}
    for id, words in said:
        sentences, ids = alike.setdefault(PIECE.sub(lambda piece: piece[1] or "#", words), ([], []))
        sentences.append(words)
        ids.append(id)
    return [(_with_ranges(sentences), tuple(dict.fromkeys(ids))) for sentences, ids in alike.values()]


def _with_ranges(sentences: Sequence[str]) -> str:
    """The first of sentences that differ in their numbers alone, each number as the range that it has in all."""
    numbers = zip(*([n[0] for n in PIECE.finditer(words) if not n[1]] for words in sentences), strict=True)
    ends = (sorted(set(texts), key=float) for texts in numbers)
    ranges = iter(["…".join(dict.fromkeys((texts[0], texts[-1]))) for texts in ends])
    return PIECE.sub(lambda piece: piece[1] or next(ranges), sentences[0])


def _print(group: Takes, found: Sequence[TakeWindows], folder: Path) -> None:
    windows = sum(len(one.windows) for one in found)
    lines = [
        f"{group.name}: {counted(len(found), 'take')} of {group.robot.n} cables, {counted(windows, 'window')} of free "
        "motion"
    ]
    decided = [(one.take.id, words) for one in found for words in one.decided]
    for words, ids in _merged(said for said in decided if not said[1].startswith(OF_WINDOW)):
        few = f"{', '.join(ids[:MOST_NAMED])}{' …' if len(ids) > MOST_NAMED else ''}"
        lines.append(f"  {words}" if len(ids) == len(found) else f"  {words}  ({few})")
    of_windows = [(id, words.removeprefix(OF_WINDOW)) for id, words in decided if words.startswith(OF_WINDOW)]
    many = len(of_windows) > MOST_WINDOWS
    lines += [] if many else [f"  {words}" for _, words in of_windows]
    told = (
        ("", [(id, words.partition(": ")[2]) for id, words in of_windows if many]),
        ("check ", [(one.take.id, one.short(words)) for one in found for words in one.warnings]),
        ("left out: ", [(one.take.id, one.refused) for one in found if one.refused]),
        ("not read: ", group.unread.items()),
    )
    for head, said in told:
        lines += [f"  {head}{', '.join(ids)}: {words}" for words, ids in _merged(said)]
    end = f"Written to {folder} (import.json lists the decisions); next: fidim identify {folder}"
    if not windows:
        end = f"No window was found, so there is no campaign. {folder / JOURNAL} lists the reasons."
    for line in (*lines, end):
        console.out.print(line, highlight=False, markup=False)
