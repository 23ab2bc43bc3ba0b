"""One window's samples by themselves: defects, and the window without the bad samples.

Nothing is repaired and nothing is spliced: a bad sample becomes missing. After a step without return, or lost frames,
only one side is kept, the earlier one unless that is shorter than `levels_enough`.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from fidim_lab.arrays import runs
from fidim_lab.data.records import Window
from fidim_lab.identification.markers.clock_check import check_clock, even_grid
from fidim_lab.identification.markers.displaced import Displacement, ScoreLimits, search
from fidim_lab.identification.markers.finding import DefectKind, Finding, marker_channel, marker_name
from fidim_lab.identification.markers.levels import displaced_rows
from fidim_lab.identification.markers.lost_frames import LostFrames
from fidim_lab.identification.markers.neighbours import half_width, noise_of
from fidim_lab.identification.markers.thresholds import MARKERS


@dataclass(frozen=True, eq=False)
class Inspected:
    """A window with what was found in it."""

    window: Window
    """bad samples missing"""
    findings: tuple[Finding, ...]
    bad: Bool[np.ndarray, "N M"]
    """samples that were taken out"""


def inspect(
    window: Window, rate: float, noise: float, sigma: Float[np.ndarray, "M 3"], limits: ScoreLimits
) -> Inspected:
    """Look at one window; `noise` is the declared standard deviation (m), `sigma` the one seen in the campaign."""
    bad = np.zeros(window.markers.shape[:2], dtype=bool)
    if len(window.t) < MARKERS.samples_fewest:
        return Inspected(window, (), bad)
    found = [*check_clock(window, rate), *_gaps(window)]
    frozen, bad = check_frozen(window, np.minimum(noise, sigma.mean(axis=1)))
    grid = even_grid(window.t)
    kept = np.where(bad[..., np.newaxis], np.nan, window.markers)
    columns = grid.spread(_timed(window.t, kept.reshape(len(kept), -1), grid.slots * grid.step + window.t[0]))
    own = np.nan_to_num(noise_of(columns), nan=noise).reshape(sigma.shape)
    judged = np.maximum(np.maximum(sigma, own), MARKERS.finest * noise)
    result = search(columns.reshape(-1, *sigma.shape), judged, half_width(1 / grid.step), limits)
    row_of = np.searchsorted(grid.slots, np.arange(len(columns) + 1))
    found += frozen
    for one in result.displaced:
        begin, end = int(row_of[one.begin]), int(row_of[one.end])
        found.append(_displaced(window, one, begin, end))
        if not one.by_steps:
            bad[begin:end, one.marker] = True
    for m, steps in enumerate(result.steps):
        seen = np.asarray(np.isfinite(window.markers[:, m]).all(axis=1)) & ~bad[:, m]
        rows = {int(row_of[row]): by for row, by in steps.items()}
        bad[:, m] |= displaced_rows(window.t, seen, rows, result.same[m])
    for skip in result.lost:
        row = int(row_of[skip.at])
        found.append(_lost(window, skip, row, grid.step))
        bad[slice(row, None) if _enough(window, row) else slice(None, row)] = True
    cleaned = np.where(bad[..., np.newaxis], np.nan, window.markers)
    return Inspected(replace(window, markers=cleaned), tuple(found), bad)


def _enough(window: Window, row: int) -> bool:
    return float(window.t[row - 1] - window.t[0]) >= min(MARKERS.levels_enough, window.duration / 2)


def _timed(t: np.ndarray, columns: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Columns as if sampled on the even grid, to first order, where that makes them smoother: true uneven stamps do."""
    late = (t - grid)[:, np.newaxis]
    if np.abs(late).max() < 1e-9:
        return columns
    moved = columns - np.gradient(columns, t, axis=0) * late
    before, after = noise_of(columns), noise_of(moved)
    return moved if np.nansum(after) < np.nansum(before) else columns


def _gaps(window: Window) -> list[Finding]:
    """Blank cells, one finding for each marker."""
    found: list[Finding] = []
    for m in range(window.markers.shape[1]):
        blanks = runs(np.asarray(np.isnan(window.markers[:, m]).any(axis=1)))
        if not blanks:
            continue
        total = sum(end - begin for begin, end in blanks)
        begin, end = max(blanks, key=lambda run: run[1] - run[0])
        t = (float(window.t[begin]), float(window.t[end - 1]))
        says = (
            f"Window {window.id}: {marker_name(m)} is missing in {total} samples, {len(blanks)} gaps; the longest is "
            f"{end - begin} samples at {t[0]:.3f} s."
        )
        found.append(Finding(DefectKind.GAP, window.id, marker_channel(m, 0), t, float(total), "samples", says))
    return found


def _displaced(window: Window, one: Displacement, begin: int, end: int) -> Finding:
    t = (float(window.t[begin]), float(window.t[end - 1]))
    size = float(np.linalg.norm(one.offset))
    axis = int(np.argmax(np.abs(one.offset)))
    who, much = marker_name(one.marker), f"{size * 1e3:.3g} mm (mostly {'xyz'[axis]})"
    if end - begin <= MARKERS.displaced_short and not (one.to_the_end and end - begin > 1):
        kind, what = DefectKind.SPIKE, f"{who} is {much} off its neighbours at {t[0]:.3f} s"
        what += "." if end - begin == 1 else f", {end - begin} samples."
    else:
        step = float(window.t[begin] - window.t[begin - 1]) if begin else float(window.t[1] - window.t[0])
        kind, what = DefectKind.JUMP, f"{who} jumps by {much} within one sample at {t[0]:.3f} s"
        what += " and stays there" if one.to_the_end else f", and back after {t[1]:.3f} s"
        what += f"; a body would need {size / step**2:.0f} m/s² for that."
    return Finding(kind, window.id, marker_channel(one.marker, axis), t, size, "m", f"Window {window.id}: {what}")


def _lost(window: Window, skip: LostFrames, row: int, step: float) -> Finding:
    t = (float(window.t[row - 1]), float(window.t[row]))
    says = (
        f"Window {window.id}: {skip.frames} frames ({skip.frames * step * 1e3:.0f} ms) are lost between {t[0]:.3f} and "
        f"{t[1]:.3f} s, though the time stamps are continuous: the motion is smooth only with these frames inserted."
    )
    return Finding(DefectKind.SKIP, window.id, "t", t, float(skip.frames), "samples", says)


def frozen_runs(
    markers: Float[np.ndarray, "N M 3"], noise: Float[np.ndarray, " M"]
) -> list[tuple[int, int | None, int, int]]:
    """(marker, axis or None for all three, begin, end): samples begin … end − 1 are identical."""
    found: list[tuple[int, int | None, int, int]] = []
    same = np.zeros(markers.shape, dtype=bool)
    same[1:] = markers[1:] == markers[:-1]
    for m in range(markers.shape[1]):
        chance = _chance_of_equal(markers[:, m], float(noise[m]))
        whole = _long(np.asarray(same[:, m].all(axis=1)), chance, 3)
        found += [(m, None, begin, end) for begin, end in whole]
        covered = np.zeros(len(markers), dtype=bool)
        for begin, end in whole:
            covered[begin:end] = True
        for axis in range(3):
            single = _long(same[:, m, axis], chance, 1)
            found += [(m, axis, begin, end) for begin, end in single if not covered[begin:end].all()]
    return found


def _long(same: np.ndarray, chance: float, axes: int) -> list[tuple[int, int]]:
    """Runs with their first sample, those only that are too long for chance."""
    repeats = np.log(MARKERS.frozen_chance / max(1, len(same))) / (axes * np.log(max(chance, 1e-12)))
    needed = max(MARKERS.frozen_shortest, 1 + int(np.ceil(repeats)))
    return [(begin - 1, end) for begin, end in runs(same) if end - begin + 1 >= needed]


def _chance_of_equal(marker: Float[np.ndarray, "N 3"], noise: float) -> float:
    """How often neighbours agree in one coordinate by rounding: quantum / (2 √π σ), at most one half."""
    apart = np.abs(np.diff(marker, axis=0))
    apart = apart[np.isfinite(apart) & (apart > 1e-12)]
    quantum = float(apart.min()) if len(apart) else noise
    return float(np.clip(quantum / max(2 * np.sqrt(np.pi) * noise, quantum), 1e-9, 0.5))


def check_frozen(window: Window, noise: Float[np.ndarray, " M"]) -> tuple[tuple[Finding, ...], np.ndarray]:
    """Findings, and which samples (N, M) are frozen; the first of a run too: it may be off, as when a sensor fails.

    noise: m, of each marker, as far as it is surely there: without any, rounded values stand still at a reversal.
    """
    bad = np.zeros(window.markers.shape[:2], dtype=bool)
    found: list[Finding] = []
    for m, axis, begin, end in frozen_runs(window.markers, noise):
        bad[begin:end, m] = True
        t = (float(window.t[begin]), float(window.t[end - 1]))
        what = marker_name(m) if axis is None else marker_channel(m, axis)
        says = (
            f"Window {window.id}: {what} is the same bit for bit in {end - begin} samples, {t[0]:.3f} to {t[1]:.3f} s"
        )
        says += ", and noise forbids that."
        channel = marker_channel(m, 0 if axis is None else axis)
        found.append(Finding(DefectKind.FROZEN, window.id, channel, t, float(end - begin), "samples", says))
    return tuple(found), bad
