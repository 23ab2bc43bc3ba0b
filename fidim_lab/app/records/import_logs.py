"""Which robot log belongs to which take, and the lengths and currents of a window by it."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, permutations

import numpy as np

from fidim_lab.app.records.import_cables import LogLengths
from fidim_lab.app.records.import_poses import PosedTake
from fidim_lab.app.records.import_readings import FEW
from fidim_lab.data.alignment import align_clocks
from fidim_lab.data.importers.reading import EPOCH
from fidim_lab.data.importers.takes import EncoderLog, Take
from fidim_lab.data.own_sensors import swivel_names
from fidim_lab.data.records import Window
from fidim_lab.errors import RefusedError, SetupError
from fidim_lab.model.mechanism import Mechanism

NOT_ALIGNED = "clocks not aligned: the log begins with the take"
TRUSTED_CLOCK = 0.9
"""correlation of swivel angles above which log and markers are brought to one clock: of two cables at least, for a
swivel may stick; of two that are exchanged hardly any reaches it, never two"""

ALL_ORDERS = 4
"""cables, of which all 24 orders are tried; 120 of five took too long where none fits"""
ZONES = ((3600.0, 14), (900.0, 56))
"""s by which clocks of zones differ, most of them or all, and how many of these on either side"""
COVERED = 0.5
"""share of a window that its log has to cover to tell the lengths"""


def match(takes: Sequence[Take], logs: Sequence[EncoderLog]) -> tuple[tuple[Take, ...], dict[str, str]]:
    """Takes with their logs, by name (the same stem, or the same words or numbers in it), else by clock.

    And the logs of no take, with the reason. A log by clock may serve several takes. Words that all takes, or all logs,
    have in their names do not count. Raises SetupError where two logs fit one take by name.
    """
    matched: list[Take] = []
    used: set[int] = set()
    own_of_takes = _own_words([take.markers.source.stem for take in takes])
    own_of_logs = _own_words([log.source.stem for log in logs])
    for take, own in zip(takes, own_of_takes, strict=True):
        stem = take.markers.source.stem
        fitting = [k for k, log in enumerate(logs) if log.source.stem == stem]
        fitting = fitting or [k for k, words in enumerate(own_of_logs) if own and words == own]
        fitting = fitting or [
            k for k, log in enumerate(logs) if _numbers(stem) and _numbers(log.source.stem) == _numbers(stem)
        ]
        fitting = fitting or [k for k, log in enumerate(logs) if _spans(log, take)]
        if not fitting and len(takes) == len(logs) == 1:
            fitting = [0]
        if len(fitting) > 1:
            named = " and ".join(str(logs[k].source.name) for k in fitting[:2])
            raise SetupError(f"{named} both belong to {take.markers.source.name} by their names.")
        used.update(fitting)
        matched.append(replace(take, log=logs[fitting[0]]) if fitting else take)
    return tuple(matched), {log.source.name: _no_take(log, takes) for k, log in enumerate(logs) if k not in used}


def _no_take(log: EncoderLog, takes: Sequence[Take]) -> str:
    """Why a log is left over; with the hours by which its clock is off, if takes then lie within it."""
    says = "a log of no take, by name or clock"
    if log.t[0] <= EPOCH:
        return says
    for zone, most in ZONES:
        shifts = zone * np.arange(-most, most + 1)
        during = [[take for take in takes if _spans(replace(log, t=log.t + shift), take)] for shift in shifts]
        best = max(during, key=len)
        if best and sum(len(some) == len(best) for some in during) == 1:
            shift = float(shifts[during.index(best)])
            hours = f"{abs(shift) / 3600:g} h {'later' if shift > 0 else 'earlier'}"
            names = ", ".join(take.markers.source.name for take in best[:3])
            return (
                f"{says}: with times {hours} it would cover {names}. If they are local ones, state the zone in "
                "them (+02:00), or give log and take the same name"
            )
    return says


def _own_words(stems: Sequence[str]) -> list[tuple[str, ...]]:
    """Of each name, the words that not all of them have."""
    split = [re.findall(r"[a-z0-9]+", stem.lower()) for stem in stems]
    common = set(split[0]).intersection(*split[1:]) if split else set[str]()
    return [tuple(word for word in words if word not in common) for words in split]


def _numbers(stem: str) -> tuple[int, ...]:
    return tuple(int(digits) for digits in re.findall(r"\d{1,15}", stem))


def _spans(log: EncoderLog, take: Take) -> bool:
    """Whether both clocks count from 1970 and the log goes on during the whole take."""
    began = take.markers.began
    return began is not None and log.t[0] > EPOCH and log.t[0] <= began and began + take.markers.t[-1] <= log.t[-1]


@dataclass(frozen=True, eq=False)
class FromLog:
    """What a window has by its log."""

    lengths: np.ndarray
    """(N, n) m"""
    currents: np.ndarray | None
    """(N, n) A"""
    words: str
    doubt: str = ""
    """why the log cannot be meant; empty where nothing speaks against it"""
    zeros: np.ndarray | None = None
    """(n,) m, what was added to the log's lengths; None without a log, or with one in doubt"""
    swivels: np.ndarray | None = None
    """(N, n) rad; None without any, or where the log's clock is not known"""

    @property
    def further(self) -> dict[str, np.ndarray]:
        """Columns of the window."""
        return (
            {} if self.swivels is None else dict(zip(swivel_names(self.swivels.shape[1]), self.swivels.T, strict=True))
        )


def without_log(window: Window, *, currents: bool) -> Window:
    """An imported window without the lengths of its log: as the poses have them at the median.

    currents: with these, and with the angles of the swivels.
    """
    held = window.lengths
    if held is not None:  # the log's zeros are such that their median is what the poses say
        held = np.tile(np.nanmedian(held, axis=0), (len(window.t), 1))
    kept = window if currents else replace(window, currents=None, further={})
    return replace(kept, lengths=held, encoder_zeros=None)


def compared(mechanism: Mechanism, take: Take, posed: PosedTake, windows: Sequence[np.ndarray]) -> LogLengths | None:
    """Lengths of a take by its log and by its poses, also where its cables are exchanged; None without a log.

    windows: (N,) bool, the samples of each.
    """
    if take.log is None:
        return None
    offset = _offset(mechanism, take, take.log, posed, _orders(mechanism.robot.n))[0]
    known = np.isfinite(posed.positions).all(axis=1)

    def both(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        some = np.flatnonzero(rows & known)
        some = some[:: max(1, len(some) // FEW)]
        counted = _at(take.log, take.log.lengths, posed.t[some] + offset) if take.log else np.zeros((0, 0))
        seen = mechanism.lengths(posed.positions[some], posed.rotations[some])
        covered = np.isfinite(counted).all(axis=1)
        return counted[covered], seen[covered]

    rest = [pair for rows in windows if len((pair := both(rows))[0])]
    if not rest:
        return None
    at_rest = tuple(np.array([np.median(pair[k], axis=0) for pair in rest]) for k in (0, 1))
    return LogLengths((at_rest[0], at_rest[1]), both(np.asarray(known)))


def _orders(cables: int) -> Sequence[tuple[int, ...]]:
    """In which swivels are tried: as they are, then all others of few cables, or two exchanged."""
    itself = tuple(range(cables))
    if cables <= ALL_ORDERS:
        return list(permutations(itself))
    pairs = [dict(((i, j), (j, i))) for i, j in combinations(itself, 2)]
    return [itself, *(tuple(pair.get(k, k) for k in itself) for pair in pairs)]


def logged(mechanism: Mechanism, take: Take, posed: PosedTake, rows: np.ndarray) -> FromLog:
    """Lengths by the log where there is one, its unknown zeros from the poses; without one, those of the poses."""
    known = rows & np.isfinite(posed.positions).all(axis=1)
    held = np.median(mechanism.lengths(posed.positions[known], posed.rotations[known]), axis=0)
    if take.log is None:
        constant = np.tile(held, (int(rows.sum()), 1))
        return FromLog(constant, None, "lengths: the median of those computed from the poses, since there is no log")
    offset, clock = _offset(mechanism, take, take.log, posed)
    at = posed.t[rows] + offset
    counted = _at(take.log, take.log.lengths, at)
    if np.isfinite(counted).all(axis=1).mean() < COVERED:
        what = f"{take.log.source.name} does not reach over this window: lengths are the median of what the poses say"
        return FromLog(np.tile(held, (int(rows.sum()), 1)), None, what)
    currents, swivels = (
        None if columns is None else _at(take.log, columns, at) for columns in (take.log.currents, take.log.swivels)
    )
    zeros = held - np.nanmedian(counted, axis=0)
    seen = mechanism.lengths(posed.positions[known], posed.rotations[known])
    doubt = too_much_motion(counted, seen)
    words = f"lengths by {take.log.source.name}, zeros by the poses, {clock}"
    doubted = f"{take.log.source.name}: {doubt}" if doubt else ""
    if clock == NOT_ALIGNED:
        swivels = None
    return FromLog(counted + zeros, currents, words, doubted, None if doubt else zeros, swivels)


def too_much_motion(counted: np.ndarray, seen: np.ndarray) -> str:
    """Where a log's cables (N, n) m move more than twice as far as those of the poses (M, n) m: which, and how far.

    Twice: a log on another clock, or of a motor that yields against a stretching cable, moves about as far.
    """
    by_log, by_poses = (np.nanmedian(np.abs(one - np.nanmedian(one, axis=0)), axis=0) for one in (counted, seen))
    worst = int(np.argmax(by_log - by_poses))
    if by_log[worst] <= 2.0 * by_poses[worst]:
        return ""
    apart = f"{1e3 * by_log[worst]:.3g} mm by it, {1e3 * by_poses[worst]:.2g} mm by the markers"
    says = (
        f"cable {worst + 1} moves by {apart} (median): are its lengths in m? Another unit is length_unit of --log-map"
    )
    return f"{says}, and counts need metres_per_count"


def _at(log: EncoderLog, columns: np.ndarray, at: np.ndarray) -> np.ndarray:
    """NaN where the log does not reach."""
    return np.column_stack([np.interp(at, log.t, column, left=np.nan, right=np.nan) for column in columns.T])


def _offset(
    mechanism: Mechanism, take: Take, log: EncoderLog, posed: PosedTake, orders: Sequence[Sequence[int]] = ()
) -> tuple[float, str]:
    """What to add to the markers' time for the log's, s, and how it is known.

    orders: of the log's cables, in which swivel angles are compared; as they are where none is given.
    """
    if log.swivels is not None:
        known = np.isfinite(posed.positions).all(axis=1)
        angles = np.full((len(posed.t), mechanism.robot.n), np.nan)
        angles[known] = mechanism.swivel_angles(posed.positions[known], posed.rotations[known])
        for order in orders or [range(mechanism.robot.n)]:
            read = log.swivels[:, list(order)]
            try:
                clock = align_clocks(posed.t, angles, log.t, read)
            except RefusedError:
                break
            alike = clock.correlations > TRUSTED_CLOCK
            if alike.sum() >= min(2, len(alike)):
                told = align_clocks(posed.t, angles[:, alike], log.t, read[:, alike])
                return told.offset, "clocks aligned by swivel angles"
    if _spans(log, take) and take.markers.began is not None:
        return take.markers.began, "clocks by the time of day in both files"
    return float(log.t[0] - posed.t[0]), NOT_ALIGNED
