"""Whether recordings lose energy that the model keeps.

Free motion on rigid cables keeps its energy; a fit without anything that dissipates is too slow at the beginning of
each window and too fast at its end. The squares of the markers' velocities, recorded over predicted, then fall from
part to part of every window. What else a model may lack (geometry, forces, a clock) moves them to and fro, not down in
all.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fidim_lab.identification.mle.judge import Remainder
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
SEEN = 2.0
"""times what noise adds to the squares that there must be in every part"""


@dataclass(frozen=True)
class Loss:
    """The rate of energy loss."""

    rate: float
    """1/s, of the energy, beyond what the model loses"""
    windows: int

    @property
    def says(self) -> str:
        """A sentence for a person."""
        return (
            f"The recorded motion decays, that of the model does not: half of its energy is lost in "
            f"{plain(float(np.log(2.0)) / self.rate, 2)} s, in all {self.windows} windows. What is missing dissipates: "
            "drag, friction in cables, pulleys or attachments, something loose, or a hand that brakes it."
        )


def lost_energy(remainders: Sequence[Remainder], noise: float) -> Loss | None:
    """The energy that windows lose beyond the model; None where not all lose some.

    noise: standard deviation of a marker coordinate where the residuals do not tell it, m.
    """
    rates = np.array([rate for left in remainders if (rate := _rate(left, noise)) is not None])
    if len(rates) < FEWEST or (rates >= 0).any():
        return None
    mean, error = float(rates.mean()), float(rates.std(ddof=1) / np.sqrt(len(rates)))
    return Loss(-mean, len(rates)) if mean < -max(LEAST, CERTAIN * error) else None


def _rate(left: Remainder, noise: float) -> float | None:
    """1/s at which ln of the squares, recorded over predicted, grows; None where noise hides the motion."""
    if len(left.t) < FEWEST_SAMPLES:
        return None
    apart = max(1, round(OVER / float(np.median(np.diff(left.t)))))
    steps = left.t[apart:] - left.t[:-apart]
    if len(steps) < FEWEST_SAMPLES:
        return None
    known = noise if left.noise is None else left.noise
    recorded, predicted = (
        (places[apart:] - places[:-apart]) / steps[:, np.newaxis, np.newaxis]
        for places in (left.predicted + left.residuals, left.predicted)
    )
    seen = np.isfinite(recorded)
    added = np.broadcast_to(2 * known**2 / steps[:, np.newaxis, np.newaxis] ** 2, seen.shape)
    times, ratios = np.zeros(PARTS), np.zeros(PARTS)
    for k, rows in enumerate(np.array_split(np.arange(len(steps)), PARTS)):
        here = seen[rows]
        by_noise = float(added[rows][here].sum())
        total = float((recorded[rows][here] ** 2).sum())
        kept = float((predicted[rows][here] ** 2).sum())
        if total < SEEN * by_noise or kept <= 0:
            return None
        times[k], ratios[k] = left.t[rows].mean(), np.log((total - by_noise) / kept)
    return float(np.polyfit(times, ratios, 1)[0])
