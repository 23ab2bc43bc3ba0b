"""Chains of strokes by linear theory: for each mode one near its frequency, and how many turns it takes."""

import itertools

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import PerCable
from fidim_lab.identification.excitation.place import Place, WinchLimits
from fidim_lab.identification.excitation.strokes import Chain, Pattern
from fidim_lab.model.swing import Swing

SPARE = 0.9
"""part of the winches' speed and acceleration that a plan uses: a second try may want more"""
GAP = 0.15
"""s between two chains: the drives are told their next speeds"""
DUTY = 0.9
SELECTIVE = 30.0
"""how much a direction minds moving other modes"""
TURNS = (1, 2, 3, 4, 5, 6, 7, 8, 10, 12)
NEARLY = 0.95
SEEN = 0.08
"""part of the whole swing under which a mode is left alone"""


def within_winches(
    place: Place, wanted: Float[np.ndarray, " modes"], ratio: Float[np.ndarray, " modes"], limits: WinchLimits
) -> tuple[float, tuple[Chain, ...], tuple[int, ...]]:
    """The part of the wanted swing that the winches can reach, chains for it by linear theory, and their modes.

    Of all numbers of turns, those that reach most; of those that reach nearly as much, the shortest.
    """
    modes = tuple(int(j) for j in np.flatnonzero(wanted > SEEN * np.linalg.norm(wanted)))
    choices = [_chains(place, j, float(wanted[j]), float(ratio[j]), limits) for j in modes]
    found: list[tuple[float, float, tuple[Chain, ...]]] = []
    for picked in itertools.product(*choices):
        later, share, larger = 0.0, np.inf, []
        for j, (part, chain) in zip(reversed(modes), reversed(picked), strict=True):
            # what an earlier chain leaves fades while the later ones go on
            fading = float(np.exp(np.real(place.swing.rates[j]) * later))
            share = min(share, part * fading)
            larger.insert(0, chain.scaled(1 / fading))
            later += chain.pattern.seconds + GAP
        if later <= limits.seconds or not found:
            share = min(1.0, share)
            found.append((share, later, tuple(chain.scaled(share) for chain in larger)))
    most = min(1.0, NEARLY * max(part for part, _, _ in found))
    share, _, chains = min((one for one in found if one[0] >= most), key=lambda one: one[1])
    return share, chains, modes


def _chains(place: Place, mode: int, wanted: float, ratio: float, limits: WinchLimits) -> list[tuple[float, Chain]]:
    """Chains for one mode, of ever more turns, and the part of the wanted swing for which the winches suffice."""
    swing = place.swing
    half = 0.5 / (swing.frequencies[mode] * float(np.sqrt(1 - swing.damping[mode] ** 2)))
    found: list[tuple[float, Chain]] = []
    for turns in TURNS:
        pattern = Pattern(half, turns, DUTY)
        if found and pattern.seconds > limits.seconds:
            break
        response = pattern.response(swing.rates) * swing.dragged
        direction = direction_of(swing, mode, np.abs(response))
        gained = abs(response[mode] * (swing.gain[mode] @ direction) / np.imag(swing.rates[mode])) * swing.lever[mode]
        allowed = SPARE * min(
            limits.reach(place.equilibrium.lengths, direction),
            limits.speed / (pattern.speed * ratio),
            limits.acceleration / (pattern.acceleration * ratio**2),
        )
        found.append((allowed * gained / wanted, Chain(pattern, wanted / gained * direction)))
    return found


def direction_of(swing: Swing, mode: int, response: Float[np.ndarray, " modes"]) -> PerCable:
    """Of largest entry 1: moves this mode, and the others little where the pattern does not spare them already."""
    own = swing.gain[mode]
    selective = np.eye(len(own))
    for j, gain in enumerate(swing.gain):
        if j != mode:
            weight = SELECTIVE * (response[j] / response[mode]) ** 2 * (swing.lever[j] / swing.lever[mode]) ** 2
            selective += weight * np.outer(gain, gain) / (own @ own)
    found = np.linalg.solve(selective, own)
    return found / np.abs(found).max()


def begins_of(chains: tuple[Chain, ...]) -> tuple[float, ...]:
    """When each chain begins, s since the first does."""
    begins = [0.0]
    for chain in chains[:-1]:
        begins.append(begins[-1] + chain.pattern.seconds + GAP)
    return tuple(begins)
