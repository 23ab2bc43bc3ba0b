"""How often the search finds an effect in pure noise: simulated for the campaign at hand.

Without any effect the gradient of all scores is normal with the curvature as its covariance, times the variance of
what is left. Every draw is scored as the data were, all hypotheses at once, but without bounds, at the size that is
best for the evidence, and with periodic effects apart from all others; each of these can only raise the rate. Pairs are
looked at only where one hypothesis alone is believed, hence they add nothing to it.
"""

from dataclasses import dataclass

import numpy as np

from fidim_lab.mismatch.linearised.hypotheses import PERIODIC
from fidim_lab.mismatch.scores.score import Projected, freedom

DRAWS = 10_000
"""of noise alone: a rate of 1 in 3000 is told at 95 %"""


@dataclass(frozen=True)
class AlarmRate:
    """Alarms among draws without any effect."""

    alarms: int
    draws: int
    hypotheses: int
    threshold: float
    """log-evidence"""

    @property
    def at_most(self) -> float:
        """Upper end of the rate, 95 % (normal approximation of the count, 3/N where there was none)."""
        return (self.alarms + 3 + (2 * np.sqrt(self.alarms) if self.alarms else 0.0)) / self.draws

    @property
    def says(self) -> str:
        """For people."""
        return (
            f"Chance of a false alarm: {self.alarms} of {self.draws} draws without any effect reach a log-evidence of "
            f"{self.threshold:g} for one of {self.hypotheses} hypotheses, hence under {100 * self.at_most:.2g} %."
        )


def alarm_rate(found: Projected, threshold: float, draws: int = DRAWS) -> AlarmRate:
    """The rate at which noise alone brings some hypothesis over a log-evidence."""
    scale = np.sqrt(np.maximum(np.diag(found.curvature), 1e-300))  # units differ by many powers of ten
    curvature = found.curvature / np.outer(scale, scale)
    rng = np.random.default_rng(1)
    gradients = np.zeros((draws, len(curvature)))
    for together in _drawn_together(found):
        values, vectors = np.linalg.eigh(curvature[np.ix_(together, together)])
        root = vectors * np.sqrt(found.inflation * np.clip(values, 0.0, None))
        gradients[:, together] = rng.standard_normal((draws, len(together))) @ root.T
    best = np.full(draws, -np.inf)
    for k, place in enumerate(found.slices):
        part = gradients[:, place] / found.inflation
        cost, prior = freedom(found, (k,))
        known = curvature[place, place] / found.inflation + np.diag((scale[place] * prior) ** -2.0)
        gained = 0.5 * np.einsum("ni,ni->n", part, np.linalg.solve(known, part.T).T)
        best = np.maximum(best, gained - cost)
    return AlarmRate(int((best > threshold).sum()), draws, len(found.tried), threshold)


def _drawn_together(found: Projected) -> list[np.ndarray]:
    """Parameters whose common curvature is known: all steady hypotheses, and every periodic one by itself."""
    steady: list[np.ndarray] = []
    alone: list[np.ndarray] = []
    for tried, place in zip(found.tried, found.slices, strict=True):
        parameters = np.arange(place.start, place.stop)
        (alone if tried.effect.id in PERIODIC else steady).append(parameters)
    return [*([np.concatenate(steady)] if steady else []), *alone]
