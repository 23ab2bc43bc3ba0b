"""Markers that jump against the others, found by their distances alone, which no missing physics changes.

A marker that is displaced from one sample on shows in its distances to the others, which keep theirs: over a second on
either side in steps far smaller than any that stands out among neighbouring samples (`displaced`), however the body
moves. What cameras do to distances (distortion, from place to place) goes with the swing, and is as large elsewhere in
the window.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import chdtri

from fidim_lab.data.records import Window
from fidim_lab.identification.markers.clock_check import even_grid
from fidim_lab.identification.markers.finding import marker_jump
from fidim_lab.identification.markers.levels import displaced_rows
from fidim_lab.identification.markers.neighbours import noise_of
from fidim_lab.identification.markers.samples import Inspected
from fidim_lab.identification.markers.thresholds import MARKERS


@dataclass(frozen=True, eq=False)
class _Step:
    marker: int
    row: int
    """the first after it"""
    unsure: tuple[int, int]
    """the first and the last row that may be that"""
    by: Float[np.ndarray, "3"]
    """m, as far as distances show it"""


def without_rigid_steps(inspected: Inspected, noise: float, chance: float) -> Inspected:
    """A window without what a marker that has jumped against the others shows; the same object where none has.

    noise: of a marker coordinate, m. chance: of a step being found in this window where there is none.
    """
    window = inspected.window
    steps = _steps_of(window, chance)
    if not steps:
        return inspected
    bad = inspected.bad.copy()
    for marker in {step.marker for step in steps}:
        ours = [step for step in steps if step.marker == marker]
        seen = np.asarray(np.isfinite(window.markers[:, marker]).all(axis=1))
        bad[:, marker] |= displaced_rows(
            window.t, seen, {step.row: step.by for step in ours}, MARKERS.levels_same * noise
        )
        for step in ours:
            bad[step.unsure[0] : step.unsure[1] + 1, marker] = True
    markers = np.where(bad[..., np.newaxis], np.nan, window.markers)
    end = float(window.t[-1])
    sign = " against the other markers, which keep their distances."
    findings = (
        marker_jump(window.id, step.marker, step.by, (float(window.t[step.row]), end), digits=2, sign=sign)
        for step in steps
    )
    return Inspected(replace(window, markers=markers), (*inspected.findings, *findings), bad)


def _steps_of(window: Window, chance: float) -> list[_Step]:
    """The steps of a window, the plainest first."""
    count = window.markers.shape[1]
    if count < MARKERS.rigid_steps_others or len(window.t) < 2 * MARKERS.rigid_steps_fewest:
        return []
    grid = even_grid(window.t)
    half = max(MARKERS.rigid_steps_fewest, round(MARKERS.rigid_steps_reach / grid.step))
    pairs = np.array(list(combinations(range(count), 2)))
    between = window.markers[:, pairs[:, 1]] - window.markers[:, pairs[:, 0]]
    apart = grid.spread(np.linalg.norm(between, axis=2))
    found: list[_Step] = []
    while len(found) < MARKERS.rigid_steps_most:
        changes, sd = _changes(apart, half)
        place = _plainest(changes / sd, pairs, half, chance)
        if place is None:
            break
        at, marker, (first, last) = place
        ours = np.flatnonzero((pairs == marker).any(axis=1))
        towards = np.nanmean(between[max(0, at - half) : at + half, ours], axis=0)
        towards *= np.where(pairs[ours, 1] == marker, 1.0, -1.0)[:, np.newaxis]
        towards /= np.linalg.norm(towards, axis=1, keepdims=True)
        by = np.linalg.pinv(towards, rcond=MARKERS.rigid_steps_seen) @ changes[at, ours]
        row, first, last = (int(np.searchsorted(grid.slots, slot)) for slot in (at, first, last))
        found.append(_Step(marker, row, (first, last), by))
        apart[at:, ours] -= changes[at, ours]
    return found


def _plainest(
    steps: Float[np.ndarray, "G P"], pairs: np.ndarray, half: int, chance: float
) -> tuple[int, int, tuple[int, int]] | None:
    """Slot, marker, and between which slots it may be, of the plainest step; None where there is none."""
    ours = np.array([(pairs == marker).any(axis=1) for marker in range(int(pairs.max()) + 1)], dtype=float)
    gains = steps**2 @ ours.T
    if not np.isfinite(gains).any():
        return None
    at, marker = (int(k) for k in np.unravel_index(int(np.nanargmax(gains)), gains.shape))
    best = float(gains[at, marker])
    second = float(np.sort(gains[at])[-2])
    among_others = float(steps[at] ** 2 @ (1 - ours[marker]))
    elsewhere = np.abs(np.arange(len(gains)) - at) >= 2 * half
    usual = float(np.nanmax(gains[elsewhere], initial=0.0))
    certain = best > chdtri(len(ours) - 1, chance / gains.size) and best > second + MARKERS.rigid_steps_unsure
    if not certain or best < MARKERS.rigid_steps_still * max(usual, among_others):
        return None
    near = np.flatnonzero(gains[:, marker] > best - MARKERS.rigid_steps_unsure)
    return at, marker, (int(near[0]), int(near[-1]))


def _changes(apart: Float[np.ndarray, "G P"], half: int) -> tuple[Float[np.ndarray, "G P"], Float[np.ndarray, "G P"]]:
    """Mean of each distance from a slot on less that before it, and its sd (m); NaN where too little is seen."""
    seen: Bool[np.ndarray, "G P"] = np.isfinite(apart)
    sums = np.cumsum(np.vstack([np.zeros(apart.shape[1]), np.where(seen, apart, 0.0)]), axis=0)
    counts = np.cumsum(np.vstack([np.zeros(apart.shape[1]), seen]), axis=0)
    rows = np.arange(len(apart))
    low, high = np.maximum(rows - half, 0), np.minimum(rows + half, len(apart))
    before, after = (
        np.where(n < MARKERS.rigid_steps_fewest, np.nan, n)
        for n in (counts[rows] - counts[low], counts[high] - counts[rows])
    )
    change = (sums[high] - sums[rows]) / after - (sums[rows] - sums[low]) / before
    return change, noise_of(apart) * np.sqrt(1 / before + 1 / after)
