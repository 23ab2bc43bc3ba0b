"""The bodies used for planning: the likely one and those near CAD, tuned to the measured frequencies.

A centre of mass 5 % off CAD shifts frequencies by a tenth: then a chain of strokes is out of step with its mode, and
a body at a frequency of its own is no warning. Tuned, all of them agree with the recording.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from jaxtyping import Float
from scipy.linalg import hadamard

from fidim_lab.data.records import Body
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.excitation.place import ExcitationPlace

OFF = 0.05
"""part (of the lever, for the centre of mass) by which CAD may be off"""
FLAT, CROSSED = 0.3, 0.3
"""parts of that for the centre of mass's x and y, and for products of inertia"""
KNOWN = 5e-3
"""part to which frequencies are seen"""
INSIDE = 32
"""bodies beside those at the corners: chains of many turns answer a narrow band of frequencies, and one in between may
meet it. With the corners alone 6 of 100 undamped bodies broke a limit at the worst places, with these 1 of 1000"""
SURE = 0.01
"""part to which every parameter is known where a body is taken for known"""
ROUNDS = 3
STEP = 1e-3
"""part of OFF, for difference quotients of frequencies"""


@dataclass(frozen=True, eq=False)
class Bodies:
    """What may hang there."""

    likely: Body
    others: tuple[Body, ...]
    """whose tensions are looked at too"""
    off: Float[np.ndarray, "9 9"]
    """m, m²: ways in which the parameters may be off, each in a column, independent of each other"""

    @classmethod
    def around(cls, body: Body, off: float = OFF) -> Self:
        """A body, eight whose parameters are off by so much, and others less, always the same.

        Any two parameters of the eight are off in all four ways: higher and lower centres of mass with more and with
        less inertia swing at frequencies far apart. The others fill what is between, more of them near the sides.
        """
        return cls.within(body, np.diag(off * sizes(body)))

    @classmethod
    def within(cls, body: Body, off: Float[np.ndarray, "9 9"]) -> Self:
        """The same, with ways (m, m²; a column each) in which the parameters may be off; the last three go together."""
        corners = hadamard(8)[:, [1, 2, 3, 4, 5, 6, 7, 7, 7]]
        parts = np.vstack([corners, _between(INSIDE)]) @ off.T
        found = [Body.from_vector(body.vector + part) for part in parts]
        return cls(body, tuple(one for one in found if _possible(one)), off)

    @property
    def spread(self) -> Float[np.ndarray, "9"]:
        """By how much each parameter may be off, m and m²."""
        return np.sqrt(np.sum(self.off**2, axis=1))

    @property
    def sure(self) -> bool:
        """Whether it is known so well that further recordings would not change a plan."""
        return bool(np.all(self.spread <= SURE * sizes(self.likely)))

    def tuned(self, place: ExcitationPlace, frequencies: Float[np.ndarray, " modes"], seen: Sequence[int]) -> "Bodies":
        """Each changed as little as makes it swing at these frequencies (Hz), at this place.

        seen: the modes whose frequencies are known. A body that cannot be tuned is left out; where not even the likely
        one can, all stay as they are.
        """
        modes = list(seen)
        try:
            slopes = _slopes(place, self.likely, self.off, modes)
            likely = _tuned(place, self.likely, frequencies, modes, slopes, self.off)
        except (InfeasibleError, np.linalg.LinAlgError):
            return self
        others: list[Body] = []
        for other in self.others:
            try:
                others.append(_tuned(place, other, frequencies, modes, slopes, self.off))
            except (InfeasibleError, np.linalg.LinAlgError):
                continue
        return replace(self, likely=likely, others=tuple(others))


def _between(count: int) -> Float[np.ndarray, "count 9"]:
    """From −1 to 1, evenly spread: multiples of the powers of φ, where φ¹⁰ = φ + 1, without their whole parts."""
    phi = 1.0
    for _ in range(60):
        phi = (1 + phi) ** 0.1
    even = 2 * ((0.5 + np.outer(np.arange(1, count + 1), phi ** -np.arange(1.0, 10.0))) % 1) - 1
    return np.sign(even) * np.sqrt(np.abs(even))


def sizes(body: Body) -> Float[np.ndarray, "9"]:
    """What a part of each parameter is a part of, m and m²."""
    lever = float(np.linalg.norm(body.com))
    moments = np.concatenate([body.inertia[:3], np.full(3, CROSSED * body.inertia[:3].min())])
    return np.concatenate([lever * np.array([FLAT, FLAT, 1.0]), moments])


def _possible(body: Body) -> bool:
    return bool(np.linalg.eigvalsh(body.inertia_about_com)[0] > 0)


def _frequencies(place: ExcitationPlace, body: Body, modes: list[int]) -> Float[np.ndarray, " seen"]:
    if not _possible(body):
        raise InfeasibleError("There is no such body.")
    found = ExcitationPlace.at(place.mechanism, place.equilibrium.lengths, body).swing.frequencies
    if len(found) != len(place.swing.frequencies):
        raise InfeasibleError("This body has other modes.")
    return found[modes]


def _slopes(
    place: ExcitationPlace, body: Body, off: Float[np.ndarray, "9 9"], modes: list[int]
) -> Float[np.ndarray, "seen 9"]:
    """Of the frequencies, relative, by the ways in which the body may be off."""
    here = _frequencies(place, body, modes)
    moved = [_frequencies(place, Body.from_vector(body.vector + STEP * unit), modes) for unit in off.T]
    return (np.array(moved) / here - 1).T / STEP


def _tuned(
    place: ExcitationPlace, body: Body, wanted: np.ndarray, modes: list[int], slopes: np.ndarray, off: np.ndarray
) -> Body:
    """The nearest body with these frequencies, by the ways in which it may be off: as far as frequencies are known."""
    gain = slopes.T @ np.linalg.inv(slopes @ slopes.T + KNOWN**2 * np.eye(len(modes)))
    for _ in range(ROUNDS):
        miss = wanted[modes] / _frequencies(place, body, modes) - 1
        body = Body.from_vector(body.vector + off @ (gain @ miss))
    _frequencies(place, body, modes)
    return body
