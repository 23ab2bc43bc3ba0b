"""Frozen samples: the same values repeated more often than rounding alone could give."""

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import runs
from fidim_lab.data.records import Window
from fidim_lab.identification.markers.finding import DefectKind, Finding, marker_channel, marker_name
from fidim_lab.identification.markers.thresholds import MARKERS


def frozen_runs(markers: Float[np.ndarray, "N M 3"], noise: float) -> list[tuple[int, int | None, int, int]]:
    """(marker, axis or None for all three, begin, end): samples begin … end − 1 are identical."""
    found: list[tuple[int, int | None, int, int]] = []
    same = np.zeros(markers.shape, dtype=bool)
    same[1:] = markers[1:] == markers[:-1]
    for m in range(markers.shape[1]):
        chance = _chance_of_equal(markers[:, m], noise)
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
    return float(np.clip(quantum / (2 * np.sqrt(np.pi) * noise), 1e-9, 0.5))


def check_frozen(window: Window, noise: float) -> tuple[tuple[Finding, ...], np.ndarray]:
    """Findings, and which samples (N, M) are frozen; the first of a run too: it may be off, as when a sensor fails."""
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
