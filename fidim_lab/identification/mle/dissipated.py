"""Whether recordings lose energy that the model keeps.

Free motion on rigid cables keeps its energy; a fit without anything that dissipates is too slow at the beginning of
each window and too fast at its end. The squares of the markers' velocities, recorded over predicted, then fall from
part to part of every window. What else a model may lack (geometry, forces, a clock) moves them to and fro, not down in
all.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from fidim_lab.arrays import Series
from fidim_lab.identification.mle.judge import Remainder
from fidim_lab.identification.mle.trajectories.recordings import FollowedSamples
from fidim_lab.units import plain

PARTS = 4
"""of a window over which the squares are averaged: of ten seconds each holds two swings or more"""
OVER = 0.1
"""s over which velocities are taken: a swing of 1 Hz hardly turns meanwhile, and noise counts for little"""
FEWEST_SAMPLES = 32
FEWEST = 2
"""windows; a single one may swing up in what is seen of it"""
LEAST = 0.004
"""1/s: a twenty-fifth of the energy in ten seconds. Mean rates of recordings that lose none were at most 0.002 (three
windows of faint swings at 30 Hz), mostly below 0.0003; swivel friction had 0.008, drag 0.06 and more"""
CERTAIN = 3.0
"""standard errors of the mean rate over windows"""
DISSIPATES = (
    "What is missing dissipates: drag, friction in cables, pulleys or attachments, something loose, or a hand that "
    "brakes it."
)
SEEN = 2.0
"""times what noise adds to the squares that there must be in a part to show the motion"""


@dataclass(frozen=True)
class Loss:
    """The rate at which the squares of the markers' velocities fall."""

    rate: float
    """1/s; of energy"""
    windows: int
    beyond_model: bool
    """whether what the model itself loses is taken off; else there was no motion of the model to compare with"""

    @property
    def says(self) -> str:
        """A sentence for a person."""
        half, windows = plain(float(np.log(2.0)) / self.rate, 2), f"in all {self.windows} windows"
        if self.beyond_model:
            begin = "The recorded motion decays, that of the model does not: half of its energy is lost in "
            return f"{begin}{half} s, {windows}. {DISSIPATES}"
        return (
            f"The recorded motion dies down {windows} (the squares of its speeds halve in {half} s), and the model "
            f"keeps its energy. {DISSIPATES}"
        )


def decays(recordings: Sequence[FollowedSamples], noise: float) -> Loss | None:
    """Motion that dies down from part to part of every window; None where one does otherwise.

    For a search that found no motion to compare with. One window in ten whose motion only beats falls so (of 120 of
    6 s), all of a campaign in none of 24. noise: standard deviation of a marker coordinate, m.
    """
    rates = [_fall(recording.t, recording.markers, noise) for recording in recordings]
    known = [rate for rate in rates if rate is not None]
    if len(known) < max(FEWEST, len(rates)) or min(known) < LEAST:
        return None
    return Loss(float(np.median(known)), len(known), beyond_model=False)


def lost_energy(remainders: Sequence[Remainder], noise: float) -> Loss | None:
    """The energy that windows lose beyond the model; None where not all lose some.

    noise: standard deviation of a marker coordinate where the residuals do not tell it, m.
    """
    rates = np.array([rate for left in remainders if (rate := _rate(left, noise)) is not None])
    if len(rates) < FEWEST or (rates >= 0).any():
        return None
    mean, error = float(rates.mean()), float(rates.std(ddof=1) / np.sqrt(len(rates)))
    return Loss(-mean, len(rates), beyond_model=True) if mean < -max(LEAST, CERTAIN * error) else None


def _rate(left: Remainder, noise: float) -> float | None:
    """1/s at which ln of the squares, recorded over predicted, grows; None where noise hides the motion."""
    recorded = _squares(left.t, left.predicted + left.residuals, noise if left.noise is None else left.noise)
    shown = np.where(np.isfinite(left.residuals), left.predicted, np.nan)
    predicted = _squares(left.t, shown, 0.0)
    if recorded is None or predicted is None:
        return None
    return float(np.polyfit(recorded.times, np.log(recorded.sums / predicted.sums), 1)[0])


def _fall(t: Series, markers: Float[np.ndarray, "T M 3"], noise: float) -> float | None:
    """1/s at which the squares fall; None where they rise from a part to the next, or noise hides them at once."""
    squares = _squares(t, markers, noise)
    if squares is None or (squares.seen[1:] & (np.diff(squares.sums / squares.counts) > 0)).any():
        return None
    return float(-np.polyfit(squares.times, np.log(squares.sums / squares.counts), 1)[0])


class _Squares(NamedTuple):
    """Of the markers' velocities, in each part of a window."""

    times: Float[np.ndarray, " parts"]
    sums: Float[np.ndarray, " parts"]
    """m²/s², less what noise adds; where that hides the motion, as much as noise may hide"""
    counts: Float[np.ndarray, " parts"]
    seen: Bool[np.ndarray, " parts"]


def _squares(t: Series, places: Float[np.ndarray, "T M 3"], noise: float) -> _Squares | None:
    """None where noise hides the motion at once: a motion that it hides later has died down at least so far."""
    if len(t) < FEWEST_SAMPLES:
        return None
    apart = max(1, round(OVER / float(np.median(np.diff(t)))))
    steps = (t[apart:] - t[:-apart])[:, np.newaxis, np.newaxis]
    if len(steps) < FEWEST_SAMPLES:
        return None
    velocities = (places[apart:] - places[:-apart]) / steps
    seen = np.isfinite(velocities)
    added = np.broadcast_to(2 * noise**2 / steps**2, seen.shape)
    times, sums, counts = (np.zeros(PARTS) for _ in range(3))
    shown = np.zeros(PARTS, dtype=bool)
    for k, rows in enumerate(np.array_split(np.arange(len(steps)), PARTS)):
        here = seen[rows]
        by_noise, total = float(added[rows][here].sum()), float((velocities[rows][here] ** 2).sum())
        shown[k] = total >= SEEN * by_noise
        sums[k] = max(total - by_noise, (SEEN - 1) * by_noise)
        times[k], counts[k] = t[rows].mean(), here.sum()
    return _Squares(times, sums, counts, shown) if shown[0] and (sums > 0).all() else None
