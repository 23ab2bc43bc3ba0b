"""Judging a recorded window: samples complete, tensions positive, motors still, amplitude useful. Pure functions."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from fidim_lab.arrays import CableSeries, Mask, Positions, Series, runs
from procedures.outcomes import Measurement
from procedures.recording.recorder import WindowRecording
from procedures.steps import WindowLimits

SMALLEST = "smallest tension"
JUMP = "largest jump of"
FROZEN = 5
"""samples: a position repeated so often, exactly, is no measurement (a noisy sensor does not repeat itself)"""

ON_TIME = 0.5
"""s in which at least one frame comes without delay: a busy host and the network delay single ones"""


def window_measurements(
    recording: WindowRecording,
    limits: WindowLimits,
    lengths: Sequence[float],
    equilibrium: Sequence[float],
    newton_per_ampere: Sequence[float],
) -> tuple[Measurement, ...]:
    """What decides about a window. A quantity for which there is no data is UNSET, which does not pass."""
    place = recording.markers[:, 0, :]
    seen = seen_samples(place)
    smooth = max(1, round(limits.tension_over * recording.rate))
    tensions = np.column_stack(
        [moving_average(c, smooth) * k for c, k in zip(recording.currents.T, newton_per_ampere, strict=True)]
    )
    winches = ~np.isnan(recording.lengths + recording.currents).any(axis=1)
    arrived = winches | ~np.isnan(recording.markers).all(axis=(1, 2))  # a frame that never came says nothing of winches
    return (
        Measurement("part of marker samples that are there", float(seen.mean()), "", low=limits.complete),
        Measurement("longest gap of the marker", _longest_gap(seen) / recording.rate, "s", high=limits.longest_gap),
        Measurement(
            "longest repetition of earlier places of the marker",
            _longest_repetition(place, seen) / recording.rate,
            "s",
            high=limits.longest_gap,
        ),
        Measurement(
            "shift of the frame numbers against this computer's clock",
            _shift(recording.arrivals, recording.rate),
            "s",
            high=limits.longest_gap,
        ),
        Measurement(
            "part of winch samples that are there",
            float(winches.sum() / max(arrived.sum(), 1)),
            "",
            low=limits.complete,
        ),
        _largest_jump(recording.markers, seen, limits.jump),
        Measurement("amplitude (peak to peak)", _amplitude(place[seen]), "m", low=limits.amplitude),
        *_displacements(place[seen], equilibrium, limits),
        _stillness(recording.lengths, limits.motors_still),
        _encoder_error(recording.lengths, lengths, limits.encoder_error),
        *_tensions(tensions, limits),
    )


def seen_samples(place: Positions) -> Mask:
    """Which samples (N, 3) are measurements: neither blank nor one of FROZEN equal ones in a row."""
    seen = np.array(~np.isnan(place).any(axis=1))
    repeats = np.concatenate([[False], (place[1:] == place[:-1]).all(axis=1)])
    for begin, end in runs(repeats):
        if end - begin + 1 >= FROZEN:
            seen[begin:end] = False
    return seen


def moving_average(values: Series, count: int) -> Series:
    """Mean of each `count` samples in a row, (N − count + 1,); blank samples are left out of it."""
    there = ~np.isnan(values)
    kernel = np.ones(min(count, max(len(values), 1)))
    numbers = np.convolve(there, kernel, mode="valid")
    sums = np.convolve(np.where(there, values, 0.0), kernel, mode="valid")
    return np.divide(sums, numbers, out=np.full(len(sums), np.nan), where=numbers > 0)


def _longest_gap(seen: Mask) -> int:
    return max((end - begin for begin, end in runs(~seen)), default=0)


def _longest_repetition(place: Positions, seen: Mask) -> int:
    """Samples (N, 3) in a row that are exactly those of an earlier stretch: a stream that sends old places as new ones.

    Single ones may be equal by chance, where a stream has few digits.
    """
    lags = np.zeros(len(place), dtype=np.int64)
    _, first, which = np.unique(place[seen], axis=0, return_index=True, return_inverse=True)
    at = np.flatnonzero(seen)
    lags[at] = at - at[first[which.ravel()]]
    bounds = np.flatnonzero(np.diff(lags, prepend=-1, append=-1))
    stretches = [end - begin for begin, end in pairwise(bounds.tolist()) if lags[begin]]
    return max((count for count in stretches if count >= FROZEN), default=0)


def _shift(arrivals: Series, rate: float) -> float | None:
    """By how much frames (N,) of later numbers come earlier or later (s) than those before: rows tell no time then.

    A stream that begins to replay, or whose count goes on elsewhere, has rows of two times. A frame may be delayed, so
    the least delay on each side counts.
    """
    delays = (arrivals - np.arange(len(arrivals)) / rate)[~np.isnan(arrivals)]
    least = min(round(ON_TIME * rate), len(delays) // 2)
    if not least:
        return None
    before = np.minimum.accumulate(delays)[least - 1 : len(delays) - least]
    after = np.minimum.accumulate(delays[::-1])[::-1][least : len(delays) - least + 1]
    return float(np.abs(after - before).max())


def _largest_jump(markers: np.ndarray, seen: Mask, allowed: float) -> Measurement:
    """Largest second difference of the markers (N, M, 3), m: small for a swinging platform, large at a wrong sample."""
    places = markers.copy()
    places[~seen, 0] = np.nan
    jumps = np.linalg.norm(places[2:] - 2.0 * places[1:-1] + places[:-2], axis=2)
    if np.isnan(jumps).all():
        return Measurement(f"{JUMP} a marker", None, "m", high=allowed)
    marker = int(np.nanargmax(jumps)) % markers.shape[1]
    return Measurement(f"{JUMP} marker {marker + 1}", float(np.nanmax(jumps)), "m", high=allowed)


def _amplitude(place: Positions) -> float | None:
    return float(np.ptp(place, axis=0).max()) if len(place) else None


def _displacements(place: Positions, equilibrium: Sequence[float], limits: WindowLimits) -> list[Measurement]:
    """Largest displacement of x and y from rest: marginal beyond the planned one, rejected beyond its tolerance."""
    found: list[Measurement] = []
    for axis, planned in enumerate(limits.displacement):
        high = planned * limits.displacement_tolerance
        known = len(place) and len(equilibrium) > axis
        value = float(np.abs(place[:, axis] - equilibrium[axis]).max()) if known else None
        found.append(Measurement(f"displacement {'xy'[axis]}", value, "m", high=high, margin=high - planned))
    return found


def _stillness(lengths: CableSeries, allowed: float) -> Measurement:
    moved = [float(np.ptp(column[~np.isnan(column)])) for column in lengths.T if not np.isnan(column).all()]
    if len(moved) < lengths.shape[1]:
        return Measurement("movement of the motors", None, "m", high=allowed)
    cable = int(np.argmax(moved))
    name = f"movement of the motor of cable {cable + 1}"
    return Measurement(name, moved[cable], "m", high=allowed, margin=allowed / 2)


def _encoder_error(found: CableSeries, planned: Sequence[float], allowed: float) -> Measurement:
    """Where the motors stood: a drive that gave way, or an encoder that slipped, in an earlier attempt shows here."""
    if np.isnan(found).all(axis=0).any():
        return Measurement("encoder error", None, "m", high=allowed)
    errors = np.abs(np.nanmean(found, axis=0) - planned)
    cable = int(np.argmax(errors))
    return Measurement(f"encoder error of cable {cable + 1}", float(errors[cable]), "m", high=allowed)


def _tensions(tensions: CableSeries, limits: WindowLimits) -> list[Measurement]:
    """The extremes: marginal beyond the robot's limits, for a motor current is no ground to reject a taut window."""
    least, most = limits.tension
    if np.isnan(tensions).all(axis=0).any():
        return [Measurement(SMALLEST, None, "N", low=0.0)]
    low, high = np.nanmin(tensions, axis=0), np.nanmax(tensions, axis=0)
    slack, tight = int(np.argmin(low)), int(np.argmax(high))
    smallest = f"{SMALLEST} of cable {slack + 1} (limit {least:g} N)"
    largest = f"largest tension of cable {tight + 1} (limit {most:g} N)"
    return [
        Measurement(smallest, float(low[slack]), "N", low=0.0, margin=least),
        Measurement(largest, float(high[tight]), "N", high=limits.overload, margin=limits.overload - most),
    ]
