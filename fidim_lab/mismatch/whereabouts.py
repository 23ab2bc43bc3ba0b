"""Where the residual of a fit is not noise: windows, channels, times and frequencies, in sentences."""

import numpy as np

from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.judge import Remainder
from fidim_lab.mismatch.explanation import Place

MOST = 5
"""places that are said"""
NOTABLE = 1.2
"""χ²/dof of a channel below which it is not worth a sentence"""
PART = 0.1
"""of a window, over which the mismatch is averaged in time"""


def whereabouts(found: Fit) -> tuple[Place, ...]:
    """The channels with the largest share of the excess χ², the worst first."""
    noise = found.likelihood.noise * max(1.0, found.noise_ratio)
    excesses: list[tuple[float, int, int, int]] = []
    for w, left in enumerate(found.remainders):
        squares = np.nansum((left.residuals / noise) ** 2, axis=0)
        counts = np.isfinite(left.residuals).sum(axis=0)
        for m, axis in np.ndindex(squares.shape):
            if counts[m, axis] and squares[m, axis] > NOTABLE * counts[m, axis]:
                excesses.append((float(squares[m, axis] - counts[m, axis]), w, int(m), int(axis)))
    total = sum(excess for excess, *_ in excesses)
    worst = sorted(excesses, reverse=True)[:MOST]
    return tuple(_place(found, w, m, axis, excess / total) for excess, w, m, axis in worst)


def _place(found: Fit, w: int, marker: int, axis: int, share: float) -> Place:
    left, recording = found.remainders[w], found.likelihood.recordings[w]
    values = left.residuals[:, marker, axis]
    channel = "xyz"[axis] if marker == 0 else f"{'xyz'[axis]} of marker {marker + 1}"
    start, end = _loudest(left, values)
    frequency = _frequency(left, values)
    rms = 1e3 * float(np.sqrt(np.nanmean(values**2)))
    tone = "" if frequency is None else f", mostly at {frequency:.2f} Hz"
    says = (
        f"Window {recording.window.id}: {channel} is missed by {rms:.3g} mm rms, most between {start:.1f} and "
        f"{end:.1f} s{tone}; {100 * share:.0f} % of all that noise does not explain."
    )
    return Place(recording.window.id, (start, end), channel, frequency, share, says)


def _loudest(left: Remainder, values: np.ndarray) -> tuple[float, float]:
    """The tenth of the window with the largest residual."""
    edges = np.linspace(left.t[0], left.t[-1], round(1 / PART) + 1)
    inside = np.clip(np.searchsorted(edges, left.t, side="right") - 1, 0, len(edges) - 2)
    sums = np.bincount(inside, weights=np.nan_to_num(values) ** 2, minlength=len(edges) - 1)
    k = int(np.argmax(sums))
    return float(edges[k]), float(edges[k + 1])


def _frequency(left: Remainder, values: np.ndarray) -> float | None:
    """Of the largest peak of the spectrum, Hz; None where the window is too short to tell."""
    good = np.isfinite(values)
    if good.sum() < 50:
        return None
    even = np.linspace(left.t[0], left.t[-1], int(good.sum()))
    sampled = np.interp(even, left.t[good], values[good])
    spectrum = np.abs(np.fft.rfft((sampled - sampled.mean()) * np.hanning(len(sampled))))
    k = int(np.argmax(spectrum[1:])) + 1
    return float(k / (even[-1] - even[0]))
