"""Whether a gyroscope's axes are the body's: do its first seconds look like small oscillations of the robot file's?

For each of the 24 ways to lay a phone along the axes, the modes of the nominal body at the tape's lengths are fitted to
the rates. The inertia is not known yet, so modes are faster or slower by up to a third, each by the share of its energy
that turns; a mode that hardly turns explains little, since no swing is that large.
"""

from itertools import permutations, product

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import PerCable
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.modes import modes, swing_rates

OPENING = 2.5
"""s that are looked at: a swing, over which a wrong frequency matters little"""
FASTER = tuple(np.geomspace(0.7, 1.4, 21))
LEFT, FAR_LESS = 0.3, 0.6
"""of the rates' own rms with the stated axes, and of that with others: right axes leave up to 0.21 and 1.0 of it, wrong
ones 0.38 and more and 0.46 (16 bodies 10 to 20 % off, two and three cords)"""
OFF, SWING = 0.02, 0.3
"""rad/s by which rates may differ from those modes throughout, and m/s of a usual swing"""
ALIKE = 1.2
"""times what the best way leaves: as good"""

Axes = tuple[str, str, str]
"""which signed axis of the phone points along x, y, z of the body, such as ("y", "-x", "z")"""


def turn_of(axes: Axes) -> Float[np.ndarray, "3 3"]:
    """The matrix that takes rates from the phone's axes to the body's."""
    matrix = np.zeros((3, 3))
    for row, axis in enumerate(axes):
        matrix[row, "xyz".index(axis[-1])] = -1.0 if axis.startswith("-") else 1.0
    return matrix


def all_axes() -> tuple[Axes, ...]:
    """The 24 right-handed ways, the plain one first."""
    ways = [
        tuple(f"{sign}{axis}" for sign, axis in zip(signs, order, strict=True))
        for order in permutations("xyz")
        for signs in product(("", "-"), repeat=3)
    ]
    return tuple((a, b, c) for a, b, c in ways if np.linalg.det(turn_of((a, b, c))) > 0)


Swings = list[tuple[Float[np.ndarray, " T"], Float[np.ndarray, "T 3"]]]
"""times, s, and rates in the phone's axes, rad/s"""


def better_axes(mechanism: Mechanism, lengths: PerCable, swings: Swings, said: Axes) -> tuple[Axes, ...]:
    """Ways that explain the swings far better than those said, the best first; empty where these do.

    lengths: of the cables, m. Raises InfeasibleError where the robot file has no rest there.
    """
    left, size = left_by_axes(mechanism, lengths, swings, said)
    best = min(left.values())
    if left[said] < LEFT * size or best > FAR_LESS * left[said]:
        return ()
    return tuple(axes for axes in sorted(left, key=lambda one: left[one]) if left[axes] < ALIKE * best)


def left_by_axes(
    mechanism: Mechanism, lengths: PerCable, swings: Swings, said: Axes
) -> tuple[dict[Axes, float], float]:
    """What each way leaves of the rates, and what there is, both rad/s (root of the sum of squares)."""
    nominal = mechanism.robot.nominal
    rest = pose_from_lengths(mechanism, nominal, lengths)
    found = modes(mechanism, nominal, rest)
    turns = rest.pose.rotation.T @ found.shapes[3:]
    shares = np.einsum("ij,ik,kj->j", turns, nominal.inertia_about_com, turns)
    begins = [(t[t - t[0] <= OPENING] - t[0], rates[t - t[0] <= OPENING]) for t, rates in swings]
    left = {axes: np.inf for axes in (said, *all_axes())}
    for faster in FASTER:
        pulsations = found.pulsations(faster**shares)
        bases = [_basis(turns, pulsations, t) for t, _ in begins]
        for axes in left:
            turned = [(rates @ turn_of(axes).T).ravel() for _, rates in begins]
            missed = sum(r @ r - ((basis.T @ r) ** 2).sum() for r, basis in zip(turned, bases, strict=True))
            left[axes] = min(left[axes], float(np.sqrt(missed)))
    return left, float(np.sqrt(sum(((rates - rates.mean(axis=0)) ** 2).sum() for _, rates in begins)))


def _basis(turns: np.ndarray, pulsations: np.ndarray, t: np.ndarray) -> Float[np.ndarray, "3T K"]:
    """Orthonormal, of the modes' rates and a bias; shorter where they ask for a large swing to turn a little."""
    vectors, sizes, _ = np.linalg.svd(swing_rates(turns, pulsations, t), full_matrices=False)
    return vectors * (sizes / np.hypot(sizes, np.sqrt(len(t)) * OFF / SWING))
