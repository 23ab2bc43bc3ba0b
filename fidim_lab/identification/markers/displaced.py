"""Displaced samples of one marker: spikes, and steps that no acceleration of the mechanism makes.

Matching pursuit: where one sample, or everything from one sample on, sits off the polynomial through its neighbours by
more than noise can, the larger of the two is taken out of a working copy, and the search goes on. Steps that cancel
make a displaced stretch. Frames that were lost while the time stamps went on look like a step of all coordinates
(`lost_frames`).
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.ndimage import maximum_filter1d
from scipy.special import chdtri, ndtri

from fidim_lab.arrays import runs
from fidim_lab.identification.markers.lost_frames import LostFrames, lost_frames
from fidim_lab.identification.markers.neighbours import look
from fidim_lab.identification.markers.rivals import JudgedDefect, What, judge
from fidim_lab.identification.markers.thresholds import MARKERS


@dataclass(frozen=True)
class ScoreLimits:
    """The required size of a score."""

    single: float
    joint: float

    @staticmethod
    def for_tests(samples: int) -> "ScoreLimits":
        """For so many samples of markers in the campaign: `false_alarm` over all of them."""
        tests = 2 * max(1, samples)
        return ScoreLimits(
            MARKERS.displaced_margin * float(-ndtri(MARKERS.false_alarm / (6 * tests))),
            MARKERS.displaced_margin * float(np.sqrt(chdtri(3, MARKERS.false_alarm / tests))),
        )


@dataclass(frozen=True, eq=False)
class Displacement:
    """A stretch of samples of one marker that sits off the motion."""

    marker: int
    begin: int
    end: int
    """exclusive"""
    offset: Float[np.ndarray, "3"]
    """m"""
    to_the_end: bool
    """a step without return"""
    by_steps: bool = False
    """longer than `displaced_short`: which side of the steps is the true one is not said"""


@dataclass(frozen=True, eq=False)
class DisplacedSearch:
    """The findings in one window."""

    displaced: tuple[Displacement, ...]
    lost: tuple[LostFrames, ...]
    steps: tuple[dict[int, Float[np.ndarray, "3"]], ...]
    """of each marker: first rows of steps, and by how much everything from there on is displaced, m"""
    same: Float[np.ndarray, "M 3"]
    """m, within which displacements are nothing"""


@dataclass(frozen=True, eq=False)
class _Peak:
    row: int
    marker: int
    is_step: bool
    score: float
    amplitude: np.ndarray


@dataclass(frozen=True, eq=False)
class _Work:
    """The grid as far as it is explained; rows of frames that turned out to be lost are inserted as missing."""

    columns: np.ndarray
    rows: np.ndarray
    """(G,) row of the window's grid; −1 where inserted"""


def search(
    markers: Float[np.ndarray, "G M 3"], sigma: Float[np.ndarray, "M 3"], half: int, limits: ScoreLimits
) -> DisplacedSearch:
    """Displaced samples on an even grid (NaN: missing) whose noise (m) is known for every coordinate."""
    count = markers.shape[1]
    work = _Work(markers.reshape(len(markers), -1).copy(), np.arange(len(markers)))
    lost: list[LostFrames] = []
    found = _Events({}, {}, set())
    for _ in range(MARKERS.displaced_rounds):
        peaks = [peak for peak in _peaks(work.columns, sigma, half, limits) if not found.is_innocent(work, peak)]
        if not peaks:
            break
        skip = None
        columns = work.columns.copy()
        for peak in sorted(peaks, key=lambda peak: -peak.score):
            mine = slice(3 * peak.marker, 3 * peak.marker + 3)
            what = judge(columns[:, mine], sigma[peak.marker], peak.row)
            if what is not None and not (what.what is What.BAD and len(what.rows) == 1):
                skip = lost_frames(columns, sigma.ravel(), peak.row)
                if skip is not None:
                    break
            found.take(columns, work.rows, peak, what)
        work = replace(work, columns=columns)
        if skip is not None:
            lost.append(LostFrames(int(work.rows[skip.at]), skip.frames))
            work = _inserted(work, skip)
    least = MARKERS.displaced_nothing * limits.single * sigma
    displaced = _stretches(found.spikes, found.steps, least, len(markers), count)
    return DisplacedSearch(
        tuple(sorted(displaced, key=lambda one: one.begin)),
        tuple(sorted(lost, key=lambda one: one.at)),
        tuple({row: by for (marker, row), by in found.steps.items() if marker == m} for m in range(count)),
        least,
    )


@dataclass(frozen=True, eq=False)
class _Events:
    """What was taken out of the working copy so far: (marker, row of the window's grid) → offset, m."""

    spikes: dict[tuple[int, int], np.ndarray]
    steps: dict[tuple[int, int], np.ndarray]
    innocent: set[tuple[int, int]]
    """places that stand out and are nobody's fault: sharp motion, blows"""

    def is_innocent(self, work: _Work, peak: _Peak) -> bool:
        """Whether the place was looked at already."""
        row = int(work.rows[peak.row])
        return any((peak.marker, near) in self.innocent for near in range(row - 2, row + 3))

    def take(self, columns: np.ndarray, rows: np.ndarray, peak: _Peak, what: JudgedDefect | None) -> None:
        """Take a peak out of the columns as what it is; without a verdict it is taken for a spike."""
        mine = slice(3 * peak.marker, 3 * peak.marker + 3)
        if what is None:
            if peak.is_step:
                self.innocent.add((peak.marker, int(rows[peak.row])))
                return
            what = JudgedDefect(What.BAD, (peak.row,))
        edge = _edge(columns, what)
        if edge and what.amplitude is not None:
            for row in edge:
                self.spikes[(peak.marker, int(rows[row]))] = what.amplitude
                columns[row, mine] = np.nan
        elif what.what is What.STEP and what.amplitude is not None:
            key = (peak.marker, int(rows[what.rows[0]]))
            self.steps[key] = self.steps.get(key, np.zeros(3)) + what.amplitude
            columns[what.rows[0] :, mine] -= what.amplitude
        elif what.what is What.BAD:
            for row in what.rows:
                self.spikes[(peak.marker, int(rows[row]))] = peak.amplitude
                columns[row, mine] = np.nan
        else:
            self.innocent.add((peak.marker, int(rows[peak.row])))


def _edge(columns: np.ndarray, what: JudgedDefect) -> range:
    """Rows beyond a step so near to an end of the window that it is they that are off."""
    if what.what is not What.STEP:
        return range(0)
    first = what.rows[0]
    if first < MARKERS.fewest_beside_step:
        return range(first)
    return range(first, len(columns)) if len(columns) - first < MARKERS.fewest_beside_step else range(0)


def _peaks(columns: np.ndarray, sigma: np.ndarray, half: int, limits: ScoreLimits) -> list[_Peak]:
    """Samples that stand out most within their neighbourhood, each as a spike or a step."""
    local = look(columns, half)
    shape = (len(columns), -1, 3)
    noise = sigma.reshape(-1)
    scores = [
        np.nan_to_num((amplitude * passed / noise).reshape(shape))
        for amplitude, passed in ((local.spike, local.spike_norm), (local.step, local.step_norm))
    ]
    strength = [
        np.maximum(np.abs(z).max(axis=2) / limits.single, np.linalg.norm(z, axis=2) / limits.joint) for z in scores
    ]
    best = np.maximum(strength[0], strength[1])
    standing = (best > 1) & (best == maximum_filter1d(best, 2 * half + 1, axis=0))
    amplitudes = [np.nan_to_num(a.reshape(shape)) for a in (local.spike, local.step)]
    found: list[_Peak] = []
    for row, marker in np.argwhere(standing):
        is_step = bool(strength[1][row, marker] > MARKERS.displaced_clearer * strength[0][row, marker])
        amplitude = amplitudes[int(is_step)][row, marker]
        found.append(_Peak(int(row), int(marker), is_step, float(best[row, marker]), amplitude))
    return found


def _inserted(work: _Work, skip: LostFrames) -> _Work:
    empty = np.full((skip.frames, work.columns.shape[1]), np.nan)
    return _Work(
        np.insert(work.columns, skip.at, empty, axis=0), np.insert(work.rows, skip.at, np.full(skip.frames, -1))
    )


def _stretches(
    spikes: dict[tuple[int, int], np.ndarray],
    steps: dict[tuple[int, int], np.ndarray],
    least: Float[np.ndarray, "M 3"],
    length: int,
    markers: int,
) -> list[Displacement]:
    """Events as stretches: offsets summed up over time; samples off beside long ones stay by themselves."""
    found: list[Displacement] = []
    for m in range(markers):
        lasting, alone = np.zeros((length, 3)), np.zeros((length, 3))
        for (marker, row), amplitude in steps.items():
            if marker == m:
                lasting[row:] += amplitude
        for (marker, row), amplitude in spikes.items():
            if marker == m:
                alone[row] += amplitude
        moved, off = ((np.abs(offset) > least[m]).any(axis=1) for offset in (lasting, lasting + alone))
        for begin, end in runs(np.asarray(off)):
            if end - begin <= MARKERS.displaced_short:
                found.append(_stretch(m, begin, end, lasting + alone))
        for begin, end in runs(np.asarray(moved)):
            if end - begin > MARKERS.displaced_short:
                found.append(replace(_stretch(m, begin, end, lasting), by_steps=True))
        short = {row for one in found if one.marker == m and not one.by_steps for row in range(one.begin, one.end)}
        apart = np.asarray(np.abs(alone).any(axis=1))
        apart[list(short)] = False
        found += [_stretch(m, begin, end, alone) for begin, end in runs(np.asarray(apart))]
    return found


def _stretch(marker: int, begin: int, end: int, offset: np.ndarray) -> Displacement:
    largest = begin + int(np.argmax(np.linalg.norm(offset[begin:end], axis=1)))
    return Displacement(marker, begin, end, offset[largest], end == len(offset))
