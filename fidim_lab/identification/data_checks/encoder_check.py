"""Encoders of locked winches: a step of a length within a window is a slip, not a motion of the platform."""

import numpy as np

from fidim_lab.data.records import Window
from fidim_lab.identification.data_checks.thresholds import DATA_CHECKS
from fidim_lab.identification.markers.finding import DefectKind, Finding


def check_encoders(window: Window, resolution: float) -> tuple[tuple[Finding, ...], np.ndarray]:
    """Slips, and which lengths (N, n) come after one (before it, where that is the longer part)."""
    if window.lengths is None:
        return (), np.zeros((len(window.t), 0), dtype=bool)
    bad = np.zeros(window.lengths.shape, dtype=bool)
    found: list[Finding] = []
    for cable, column in enumerate(window.lengths.T):
        rows = np.flatnonzero(np.isfinite(column))
        step = _best_step(column[rows], resolution)
        if step is None:
            continue
        row, size = int(rows[step[0]]), step[1]
        bad[row:, cable] = True
        t = (float(window.t[row]), float(window.t[rows[-1]]))
        says = (
            f"Window {window.id}: the encoder of cable {cable + 1} slips by {size * 1e3:+.3g} mm at {t[0]:.3f} s, with "
            "its motor locked."
        )
        found.append(Finding(DefectKind.JUMP, window.id, f"l{cable + 1}", t, abs(size), "m", says))
    return tuple(found), bad


def _best_step(column: np.ndarray, resolution: float) -> tuple[int, float] | None:
    """First sample after the step, and its size (m); None where no single step explains the column."""
    count = len(column)
    if count < 3 * DATA_CHECKS.encoder_check_fewest or np.ptp(column) < DATA_CHECKS.encoder_check_steps * resolution:
        return None
    x = column - column.mean()
    before = np.cumsum(x)[DATA_CHECKS.encoder_check_fewest - 1 : count - DATA_CHECKS.encoder_check_fewest]
    k = np.arange(DATA_CHECKS.encoder_check_fewest, count - DATA_CHECKS.encoder_check_fewest + 1)
    gain = before**2 * count / (k * (count - k))
    best = int(np.argmax(gain))
    total, at = float(x @ x), int(k[best])
    size = float(column[at:].mean() - column[:at].mean())
    left = np.sqrt(max(total - float(gain[best]), 0.0) / count)
    sharp = abs(float(column[at : at + 3].mean() - column[at - 3 : at].mean())) > 0.7 * abs(size)
    certain = abs(size) > DATA_CHECKS.encoder_check_certain * left / np.sqrt(min(at, count - at))
    enough = (
        gain[best] > DATA_CHECKS.encoder_check_share * total
        and abs(size) > DATA_CHECKS.encoder_check_steps * resolution
    )
    return (at, size) if enough and certain and sharp else None
