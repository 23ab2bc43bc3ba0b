"""Which errors the readings have, chosen by evidence: the most evident first, then others beside it.

Beforehand every size between a fraction of a count and centimetres is as likely (in its logarithm), and so is
every cable and window that can be picked: evidence is averaged over them. θ is normal and the fit is linearised.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float
from scipy.special import logsumexp

from fidim_lab.data.records import Campaign, Window
from fidim_lab.identification.cleaning.free_motion import whole_id
from fidim_lab.identification.mle.evidence import ODDS
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.mismatch.readings.influence import AXES, Influence, influence
from fidim_lab.mismatch.readings.kinds import CONSTANT, ReadingKind, reading_kinds
from fidim_lab.mismatch.thresholds import SHARED

SMALLEST = 0.5
"""of an encoder's resolution: the smallest error of readings that is asked for"""
LARGEST = 0.02
"""m: larger errors are mistakes of the robot file or of the recording, which other checks name"""
SIZES = 25
"""between them, over which evidence is averaged: steps of a third where they span three decades"""


@dataclass(frozen=True, eq=False)
class ReadingError:
    """One kind of error with its size."""

    kind: ReadingKind
    nats: float
    """over the readings without it"""
    size: float
    """m, standard deviation of θ: of a scatter what there is to tell"""
    rivals: tuple[ReadingKind, ...] = ()
    """others that odds of 20 do not exclude, the most evident first"""
    theta: Float[np.ndarray, " p"] = field(default_factory=lambda: np.zeros(0))
    """m; not of a scatter"""
    sd: Float[np.ndarray, " p"] = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True, eq=False)
class ReadingErrors:
    """All errors found in one campaign."""

    found: tuple[ReadingError, ...]
    order: tuple[str, ...]
    """ids of all windows as they were recorded"""
    temper: float
    """χ²/dof that the errors leave, at least 1"""

    @property
    def nats(self) -> float:
        """Of all together."""
        return sum(one.nats for one in self.found)

    @property
    def kinds(self) -> frozenset[str]:
        """Ids of all kinds."""
        return frozenset(one.kind.id for one in self.found)

    def put_right(self, campaign: Campaign) -> Campaign:
        """The campaign as its sensors should have read it, and with the noise that they have.

        A cable whose own encoder scatters counts as one without an encoder.
        """
        robot, windows = campaign.robot, campaign.windows
        for one in self.found:
            if not one.kind.is_scatter:
                windows = tuple(_without(window, one, self.order) for window in windows)
            elif one.kind.cable is not None:
                windows = tuple(_without_encoder(window, one.kind.cable) for window in windows)
            else:
                resolution = float(np.hypot(robot.sensors.encoder_resolution, one.size))
                robot = replace(robot, sensors=replace(robot.sensors, encoder_resolution=resolution))
        return replace(campaign, robot=robot, windows=windows)


def reading_errors(found: Fit, campaign: Campaign, enough: float) -> ReadingErrors | None:
    """The errors of a campaign's readings, estimated after a fit; None without any.

    enough: nats of evidence that each kind needs. Noise counts as large as what the errors themselves leave.
    """
    order = tuple(dict.fromkeys(whole_id(window.id) for window in campaign.windows))
    seen = influence(found)
    smallest = SMALLEST * found.likelihood.resolution
    sizes = np.geomspace(smallest, max(LARGEST, 2 * smallest), SIZES)
    search = _Search(seen, order, reading_kinds(seen.cables, order), sizes)
    temper = seen.temper(np.zeros(len(seen.gradient)))
    chosen: tuple[ReadingError, ...] = ()
    for _ in range(SHARED.rounds):
        chosen = search.chosen(temper, enough)
        temper = seen.temper(search.likeliest(chosen, temper))
    errors = tuple(one for one in search.sized(chosen, temper) if one.kind.id != CONSTANT)
    return ReadingErrors(errors, order, temper) if errors else None


@dataclass(frozen=True, eq=False)
class _Search:
    """All kinds of errors of one campaign, weighed against each other."""

    seen: Influence
    order: tuple[str, ...]
    """ids of all windows as they were recorded"""
    groups: tuple[tuple[ReadingKind, ...], ...]
    sizes: Float[np.ndarray, " sizes"]

    def chosen(self, temper: float, enough: float) -> tuple[ReadingError, ...]:
        """One kind after the other, as long as each is evident enough beside those before."""
        chosen: tuple[ReadingError, ...] = ()
        while len(chosen) < SHARED.most_terms:
            weighed = self._weighed(chosen, temper)
            best = weighed[0]
            if best.nats < enough:
                break
            near = tuple(one.kind for one in weighed[1:] if best.nats - one.nats < ODDS)
            chosen = (*chosen, replace(best, rivals=near))
        return chosen

    def likeliest(self, chosen: Sequence[ReadingError], temper: float) -> Float[np.ndarray, " z"]:
        """The errors z of all readings, by these kinds."""
        if not chosen:
            return np.zeros(len(self.seen.gradient))
        designs = [one.size * one.kind.design(self.seen, self.order) for one in chosen]
        design = np.hstack(designs)
        inner = temper * np.eye(design.shape[1]) + design.T @ self.seen.information @ design
        return design @ np.linalg.solve(inner, design.T @ self.seen.gradient)

    def sized(self, chosen: Sequence[ReadingError], temper: float) -> tuple[ReadingError, ...]:
        """With the θ of each beside the others."""
        told: list[ReadingError] = []
        for one in chosen:
            if one.kind.is_scatter:
                told.append(one)
                continue
            information, gradient = self._given([other for other in chosen if other is not one], temper)
            design = one.kind.design(self.seen, self.order)
            inner = np.eye(design.shape[1]) / one.size**2 + design.T @ information @ design
            theta = np.linalg.solve(inner, design.T @ gradient)
            told.append(replace(one, theta=theta, sd=np.sqrt(np.diag(np.linalg.inv(inner)))))
        return tuple(told)

    def _weighed(self, chosen: Sequence[ReadingError], temper: float) -> list[ReadingError]:
        """The best of each group beside what was chosen, with the group's evidence, the most evident first."""
        information, gradient = self._given(chosen, temper)
        found: list[ReadingError] = []
        for group in self.groups:
            designs = (one.design(self.seen, self.order) for one in group)
            nats = np.array([_nats(design, information, gradient, self.sizes) for design in designs])
            k, at = np.unravel_index(int(np.argmax(nats)), nats.shape)
            whole = float(logsumexp(nats)) - float(np.log(nats.size))
            found.append(ReadingError(group[int(k)], whole, float(self.sizes[at])))
        return sorted(found, key=lambda one: -one.nats)

    def _given(
        self, chosen: Sequence[ReadingError], temper: float
    ) -> tuple[Float[np.ndarray, "z z"], Float[np.ndarray, " z"]]:
        """Information and gradient by z, over the noise, what was chosen being free under its own prior."""
        information, gradient = self.seen.information / temper, self.seen.gradient / temper
        for one in chosen:
            design = one.kind.design(self.seen, self.order)
            across = information @ design
            inner = np.eye(design.shape[1]) / one.size**2 + design.T @ across
            information = information - across @ np.linalg.solve(inner, across.T)
            gradient = gradient - across @ np.linalg.solve(inner, design.T @ gradient)
        return information, gradient


def _nats(design: np.ndarray, information: np.ndarray, gradient: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Evidence at each size, over that of none."""
    values, vectors = np.linalg.eigh(design.T @ information @ design)
    along = vectors.T @ (design.T @ gradient)
    wide = sizes[:, np.newaxis] ** 2
    growth = 1.0 + wide * np.maximum(values, 0.0)
    return 0.5 * (wide * along**2 / growth - np.log(growth)).sum(axis=1)


def _without(window: Window, error: ReadingError, order: Sequence[str]) -> Window:
    """A window less the error that its readings have."""
    off = error.kind.of_window[order.index(whole_id(window.id))] @ error.theta
    lengths, shift = off[:-AXES], off[-AXES:]
    read = None if window.lengths is None else window.lengths - lengths
    return replace(window, markers=window.markers - shift, lengths=read)


def _without_encoder(window: Window, cable: int) -> Window:
    if window.lengths is None:
        return window
    lengths = window.lengths.copy()
    lengths[:, cable - 1] = np.nan
    return replace(window, lengths=lengths)
