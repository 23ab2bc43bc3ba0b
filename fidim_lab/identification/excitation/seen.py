"""The swing of the platform, from its main marker: a sum of decaying oscillations, fitted to some seconds.

No body enters but a first guess of the frequencies, so that a plan can be judged by it. `seen_swing` for amplitudes,
`learnt` for what the next plan should know, `SwingOscillations.states` for the modes' phases.
"""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from jaxtyping import Complex, Float
from scipy import optimize

from fidim_lab.arrays import Positions, Series, Vector3
from fidim_lab.identification.excitation.bodies import Bodies
from fidim_lab.identification.excitation.knowledge import GAINS, MOST_DAMPING, RATIOS, SURE, Knowledge
from fidim_lab.identification.excitation.motion import marker_after, swings_after
from fidim_lab.identification.excitation.place import ExcitationPlace
from fidim_lab.identification.excitation.plan import Excitation
from fidim_lab.model.swing import Swing

PERIODS = 6.0
"""of the slowest mode, that are looked at: large swings change their frequency as they fade"""


CORRECTIONS = 2


@dataclass(frozen=True, eq=False)
class SwingOscillations:
    """What the marker did, as decaying oscillations about its rest."""

    t: float
    """s: the time at which the amplitudes are meant"""
    rates: Complex[np.ndarray, " modes"]
    """s = −ζω + iω_d, 1/s"""
    oscillations: Complex[np.ndarray, "modes 3"]
    """c: the marker is at rest + Re Σ c e^{s (t − t₀)}, m"""
    left: float
    """m, root mean square of what they do not describe"""

    @property
    def amplitudes(self) -> Float[np.ndarray, " modes"]:
        """How far the marker swings in each mode, m."""
        return np.linalg.norm(self.oscillations, axis=1)

    @property
    def damping(self) -> Float[np.ndarray, " modes"]:
        """ζ"""
        return -np.real(self.rates) / np.abs(self.rates)

    @property
    def frequencies(self) -> Float[np.ndarray, " modes"]:
        """Undamped, Hz."""
        return np.abs(self.rates) / (2 * np.pi)

    def states(self, swing: Swing, t: float) -> Complex[np.ndarray, " modes"]:
        """The modes' states y at another time (s), by the shapes of the model."""
        shapes = swing.markers / swing.lever**2
        found = np.einsum("kj,jk->j", shapes, self.oscillations)
        return 1j * np.imag(self.rates) * found * np.exp(self.rates * (t - self.t))


def seen_swing(
    swing: Swing, t: Series, marker: Positions, *, rest: Vector3 | None = None, at_end: bool = False
) -> SwingOscillations | None:
    """The oscillations of a marker (NaN where it was not seen); None where too little was.

    rest: where it would rest, m; fitted unless given. at_end: amplitudes at the last sample, not at the first.
    """
    there = np.isfinite(marker).all(axis=1)
    t, marker = t[there], marker[there]
    if len(t) < 8 * (1 + len(swing.frequencies)):
        return None
    longest = PERIODS / float(swing.frequencies.min())
    keep = t >= t[-1] - longest if at_end else t <= t[0] + longest
    t, marker = t[keep], marker[keep]
    origin = float(t[-1] if at_end else t[0])
    s = swing.rates
    guess = np.concatenate([np.imag(s), np.full(len(s), 0.03) * np.imag(s)])
    low = np.concatenate([RATIOS[0] * np.imag(s), np.full(len(s), -0.01) * np.imag(s)])
    high = np.concatenate([RATIOS[1] * np.imag(s), np.full(len(s), 2 * MOST_DAMPING) * np.imag(s)])
    away = marker if rest is None else marker - rest

    def fitted(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        rates = -x[len(s) :] + 1j * x[: len(s)]
        waves = np.exp(rates * (t - origin)[:, np.newaxis])
        table = np.hstack([np.real(waves), -np.imag(waves), *([np.ones((len(t), 1))] if rest is None else [])])
        weights = np.linalg.lstsq(table, away, rcond=1e-9)[0]
        return rates, weights, table @ weights - away

    found = optimize.least_squares(lambda x: fitted(x)[2].ravel(), guess, bounds=(low, high), x_scale=guess)
    rates, weights, residual = fitted(found.x)
    count = len(s)
    return SwingOscillations(
        t=origin,
        rates=rates,
        oscillations=weights[:count] + 1j * weights[count : 2 * count],
        left=float(np.sqrt(np.mean(np.sum(residual**2, axis=1)))),
    )


class LearntMotion(Protocol):
    """What there is to learn from: per mode, slowest first."""

    @property
    def damping(self) -> Float[np.ndarray, " modes"]:
        """ζ"""
        ...

    @property
    def frequencies(self) -> Float[np.ndarray, " modes"]:
        """Undamped, Hz."""
        ...

    @property
    def amplitudes(self) -> Float[np.ndarray, " modes"]:
        """m, of the marker."""
        ...


def learnt(place: ExcitationPlace, excitation: Excitation, seen: LearntMotion, before: Knowledge) -> Knowledge:
    """What a recording after an excitation taught about this place; a mode that was not excited keeps what was known.

    The model's own motion goes through the same fit: frequencies and damping of large swings differ from those of small
    ones alike in both. The gain is what then remains between seen and modelled swing.
    """
    excited = list(excitation.modes)
    chains, modes = excitation.chains, excitation.modes
    damping, ratio = before.damping.copy(), before.ratio.copy()
    damping[excited] = np.clip(seen.damping, 0.0, MOST_DAMPING)[excited]
    ratio[excited] = np.clip(seen.frequencies / place.swing.frequencies, *RATIOS)[excited]
    longest = PERIODS / float(place.swing.frequencies.min())
    for _ in range(CORRECTIONS):
        known = replace(place, swing=place.swing.damped(damping))
        own = seen_swing(place.swing, *marker_after(known, chains, modes, ratio, longest))
        if own is None:
            break
        damping[excited] = np.clip(damping + seen.damping - own.damping, 0.0, MOST_DAMPING)[excited]
        ratio[excited] = np.clip(seen.frequencies / own.frequencies, *RATIOS)[excited]
    known = replace(place, swing=place.swing.damped(damping))
    gain, least = before.gain.copy(), before.least.copy()
    gain[excited] = np.clip(seen.amplitudes / swings_after(known, chains, modes, ratio), *GAINS)[excited]
    least[excited] = SURE * damping[excited]
    return Knowledge(damping, ratio, gain, least)


@dataclass(frozen=True, eq=False)
class Lesson:
    """What a recording taught."""

    place: ExcitationPlace
    """with the body that is likely now"""
    bodies: Bodies
    knowledge: Knowledge


def taught(
    place: ExcitationPlace, bodies: Bodies, excitation: Excitation, seen: LearntMotion, before: Knowledge
) -> Lesson:
    """As `learnt`, with bodies tuned to the frequencies that were seen; knowledge is what these do not explain."""
    first = learnt(place, excitation, seen, before)
    tuned = bodies.tuned(place, first.ratio * place.swing.frequencies, excitation.modes)
    there = ExcitationPlace.at(place.mechanism, place.equilibrium.lengths, tuned.likely)
    return Lesson(there, tuned, learnt(there, excitation, seen, before))
