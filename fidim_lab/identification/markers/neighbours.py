"""Predictions of a sample from its neighbours: local polynomials with any samples missing, many columns at once.

Around every sample a polynomial of degree 6 is fitted to the ±`half` neighbours that are there. It gives a smoothed
value, and two matched filters: how much *this* sample alone, or *everything from here on*, is displaced. Noise passes
with a known norm, so that amplitude × norm / σ is a standard normal variable where nothing is wrong. Ends of a
recording are neighbours that are missing. Motions up to about 4 Hz bias this by less than 0.1 µm
per cm of amplitude (±0.08 s).
"""

from dataclasses import dataclass
from math import comb

import numpy as np
from jaxtyping import Bool, Float
from numpy.lib.stride_tricks import sliding_window_view

from fidim_lab.identification.markers.thresholds import MARKERS


@dataclass(frozen=True, eq=False)
class Local:
    """Of every sample (N) and column (K); NaN where it cannot be told."""

    value: Float[np.ndarray, "N K"]
    value_norm: Float[np.ndarray, "N K"]
    """standard deviation of `value` for noise of 1"""
    spike: Float[np.ndarray, "N K"]
    """displacement of this sample against its neighbours"""
    spike_norm: Float[np.ndarray, "N K"]
    """1 / its standard deviation for noise of 1"""
    step: Float[np.ndarray, "N K"]
    """displacement of this sample and all later ones against the earlier ones"""
    step_norm: Float[np.ndarray, "N K"]


def half_width(rate: float) -> int:
    """Neighbours on either side at a sample rate (Hz)."""
    return int(np.clip(round(MARKERS.neighbours_reach * rate), 5, 12))


def look(columns: Float[np.ndarray, "N K"], half: int) -> Local:
    """Compare every sample with its neighbours; NaN is a missing sample."""
    found = [np.full(columns.shape, np.nan) for _ in range(6)]
    seen = np.isfinite(columns)
    alike: dict[bytes, list[int]] = {}
    for column in range(columns.shape[1]):
        alike.setdefault(seen[:, column].tobytes(), []).append(column)
    for members in alike.values():
        for target, part in zip(found, _look(columns[:, members], seen[:, members[0]], half), strict=True):
            target[:, members] = part
    return Local(*found)


def _look(columns: np.ndarray, seen: Bool[np.ndarray, " N"], half: int) -> list[np.ndarray]:
    """Columns that miss the same samples."""
    width = 2 * half + 1
    masks = sliding_window_view(np.pad(seen, half), width)
    bits = masks @ (1 << np.arange(width, dtype=np.int64))
    _, first, which = np.unique(bits, return_index=True, return_inverse=True)
    taps, norms = _taps(masks[first].astype(float), half)
    padded = np.pad(np.where(seen[:, np.newaxis], columns, 0.0), ((half, half), (0, 0)))
    windows = sliding_window_view(padded, width, axis=0)
    results = np.empty((3, len(columns), columns.shape[1]))
    common = int(np.bincount(which).argmax())
    usual = which == common
    results[:, usual] = np.moveaxis(windows[usual] @ taps[common].T, 2, 0)
    results[:, ~usual] = np.einsum("npw,nkw->pnk", taps[which[~usual]], windows[~usual])
    shown = np.broadcast_to(norms[which].T[..., np.newaxis], results.shape)
    return [part for pair in zip(results, shown, strict=True) for part in pair]


def _taps(masks: Float[np.ndarray, "P width"], half: int) -> tuple[np.ndarray, np.ndarray]:
    """Filters (P, 3, width) for value, spike and step under each pattern of known samples, and their norms (P, 3)."""
    place = np.arange(-half, half + 1) / half
    basis = np.polynomial.legendre.legvander(place, MARKERS.neighbours_degree)
    known = masks[:, :, np.newaxis] * basis
    normal = np.swapaxes(known, 1, 2) @ known + 1e-10 * np.eye(MARKERS.neighbours_degree + 1)
    at_middle = np.linalg.solve(
        normal, np.broadcast_to(basis[half], (len(masks), MARKERS.neighbours_degree + 1))[..., np.newaxis]
    )
    value = (known @ at_middle)[..., 0]
    wanted = np.stack([place == 0, place >= 0], axis=1).astype(float)
    wanted = masks[:, :, np.newaxis] * wanted
    left = wanted - known @ np.linalg.solve(normal, np.swapaxes(known, 1, 2) @ wanted)
    left = np.swapaxes(left, 1, 2)
    norms = np.linalg.norm(left, axis=2)
    value_norm = np.linalg.norm(value, axis=1)
    enough = masks.sum(axis=1) >= MARKERS.neighbours_degree + 1 + MARKERS.fewest_spare
    here = masks[:, half] > 0
    norms = np.where((enough & here)[:, np.newaxis] & (norms > MARKERS.neighbours_smallest_norm), norms, np.nan)
    both = np.minimum(masks[:, :half].sum(axis=1), masks[:, half:].sum(axis=1)) >= MARKERS.fewest_beside_step
    norms[~both, 1] = np.nan
    value_norm = np.where(enough & (value_norm < 1), value_norm, np.nan)
    taps = np.concatenate([value[:, np.newaxis], left / norms[..., np.newaxis] ** 2], axis=1)
    return taps, np.column_stack([value_norm, norms])


def noise_of(columns: Float[np.ndarray, "N K"]) -> Float[np.ndarray, " K"]:
    """Standard deviation of white noise on smooth columns by their fourth differences, robust; NaN where too short.

    By eighth differences where these say much less: quick motion sampled slowly is not smooth enough for the fourth.
    """
    fourth, eighth = (_by_differences(columns, order) for order in (4, 8))
    return np.where(eighth < MARKERS.much_less * fourth, eighth, fourth)


def differences(columns: Float[np.ndarray, "N K"], order: int) -> Float[np.ndarray, "D K"]:
    """Differences of an order along the columns, as large as white noise on them."""
    return np.diff(columns, n=order, axis=0) / np.sqrt(comb(2 * order, order))


def robust_sd(values: Float[np.ndarray, "D K"]) -> Float[np.ndarray, " K"]:
    """Standard deviation of each column about 0, by the median: of at least one value each, NaN left out."""
    return np.nanmedian(np.abs(values), axis=0) / MARKERS.neighbours_mad


def _by_differences(columns: Float[np.ndarray, "N K"], order: int) -> Float[np.ndarray, " K"]:
    found = differences(columns, order)
    out = np.full(columns.shape[1], np.nan)
    usable = np.isfinite(found).sum(axis=0) >= 20
    if usable.any():
        out[usable] = robust_sd(found[:, usable])
    return out
