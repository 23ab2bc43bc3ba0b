"""What differs from window to window, chosen by evidence: the most evident kind first, then others beside it.

Beforehand every size between a fraction of a count and centimetres is as likely (in its logarithm), and so is
every cable and window that can be picked: evidence is averaged over them. θ is normal and the fit is linearised.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float
from scipy.special import logsumexp

from fidim_lab.data.records import Body, Campaign, Window
from fidim_lab.identification.cleaning.free_motion import whole_id
from fidim_lab.identification.mle.evidence import ODDS
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.mismatch.session.influence import AXES, Influence, influence
from fidim_lab.mismatch.session.kinds import CONSTANT, SessionKind, not_told_apart, session_kinds
from fidim_lab.mismatch.session.load import PointLoad, changed, load_of
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.model.sensitivity.equations import BODY

SMALLEST = 0.5
"""of an encoder's resolution: the smallest difference that is asked for"""
LARGEST = 0.02
"""m: larger differences are mistakes of the robot file or of the recording, which other checks name"""
SETTLED = 0.1
"""standard deviations by which a θ still moves when the body is not worth another fit"""
SIZES = 25
"""between them, over which evidence is averaged: steps of a third where they span three decades"""


@dataclass(frozen=True, eq=False)
class SessionChange:
    """One kind of difference with its size."""

    kind: SessionKind
    nats: float
    """over the readings without it"""
    size: float
    """m, standard deviation of θ: of a scatter what there is to tell"""
    rivals: tuple[SessionKind, ...] = ()
    """others that odds of 20 do not exclude, the most evident first"""
    theta: Float[np.ndarray, " p"] = field(default_factory=lambda: np.zeros(0))
    """m; not of a scatter"""
    covariance: Float[np.ndarray, "p p"] = field(default_factory=lambda: np.zeros((0, 0)))
    """m²"""

    @property
    def sd(self) -> Float[np.ndarray, " p"]:
        """m"""
        return np.sqrt(np.diag(self.covariance))

    @property
    def is_evident(self) -> bool:
        """Whether θ, as it was estimated beside all others, still says enough."""
        precision = np.linalg.inv(self.covariance)
        nats = self.theta @ precision @ self.theta - np.linalg.slogdet(self.size**2 * precision)[1]
        return bool(0.5 * nats >= SHARED.enough)


@dataclass(frozen=True, eq=False)
class SessionChanges:
    """All that was found in one campaign."""

    found: tuple[SessionChange, ...]
    order: tuple[str, ...]
    """ids of all windows as they were recorded"""
    temper: float
    """χ²/dof that these leave, at least 1"""
    body: Body
    """without the changes, where it is not the same in all windows"""
    are_placed: bool = False
    """whether windows that were not fitted were asked where steps are"""

    def placed(self, fitted: Sequence[str]) -> Iterator["SessionChanges"]:
        """The same with one of its steps elsewhere, where windows that were fitted do not tell these apart."""
        for k, one in enumerate(self.found):
            for kind in not_told_apart(one.kind, self.order, fitted):
                yield replace(self, found=(*self.found[:k], replace(one, kind=kind), *self.found[k + 1 :]))

    @property
    def nats(self) -> float:
        """Of all together."""
        return sum(one.nats for one in self.found)

    @property
    def kinds(self) -> frozenset[str]:
        """Ids of all kinds."""
        return frozenset(one.kind.id for one in self.found)

    def load(self, one: SessionChange) -> PointLoad | None:
        """What changes the body so where it does in full; None where no load at one place does."""
        by = one.kind.chosen[-BODY:]
        return load_of(self.body, by @ one.theta, by @ one.covariance @ by.T)

    @property
    def moves_body(self) -> bool:
        """Whether the body is not the same in all windows."""
        return any(one.kind.is_body for one in self.found)

    def sharpened(self, found: Fit) -> tuple["SessionChanges", float]:
        """Estimated again at a fit of the campaign that these have put right, and by how many sd they moved at most.

        A body acts on a motion of many swings by more than to first order. What is not evident any more is left out,
        unless that is all.
        """
        steady = [one for one in self.found if not one.kind.is_scatter]
        if not steady:
            return self, 0.0
        seen = influence(found)
        temper = seen.temper(np.zeros(len(seen.gradient)))
        designs = [one.kind.design(seen, self.order) for one in steady]
        again = _estimated(steady, designs, seen.information / temper, seen.gradient / temper)
        told = _in_place_of(steady, again, self.found)
        evident = tuple(one for one in told if one.kind.is_scatter or one.is_evident) or told
        moved = max(float((abs(new.theta - old.theta) / new.sd).max()) for old, new in zip(steady, again, strict=True))
        return replace(self, found=evident, temper=temper, body=Body.from_vector(found.values[:BODY])), moved

    def put_right(self, campaign: Campaign) -> Campaign:
        """The campaign as its sensors should have read it, with the noise that they have and the body of each window.

        A cable whose own encoder scatters counts as one without an encoder.
        """
        robot, windows = campaign.robot, campaign.windows
        for one in self.found:
            if not one.kind.is_scatter:
                load = self.load(one) if one.kind.is_body else None
                windows = tuple(self._put_right(window, one, load) for window in windows)
            elif one.kind.cable is not None:
                windows = tuple(_without_encoder(window, one.kind.cable) for window in windows)
            else:
                resolution = float(np.hypot(robot.sensors.encoder_resolution, one.size))
                robot = replace(robot, sensors=replace(robot.sensors, encoder_resolution=resolution))
        return replace(campaign, robot=robot, windows=windows)

    def _put_right(self, window: Window, one: SessionChange, load: PointLoad | None) -> Window:
        """A window less the error that its readings have, or with the body that it has: a load's, where it is one."""
        share = one.kind.share(window.id, self.order)
        lengths, shift, body = np.split(share * one.kind.chosen @ one.theta, [-AXES - BODY, -BODY])
        if not one.kind.is_body:
            read = None if window.lengths is None else window.lengths - lengths
            return replace(window, markers=window.markers - shift, lengths=read)
        if load is not None:  # less of a load does not change the body in proportion
            part, whole = (changed(self.body, of * load.share, load.at) for of in (share, 1.0))
            body += part - share * whole
        by = share * one.size * one.kind.chosen[-BODY:]
        if window.body_change is not None and window.body_change_by is not None:  # of another kind
            body, by = window.body_change + body, np.hstack([window.body_change_by, by])
        return replace(window, body_change=body, body_change_by=by)


def session_changes(found: Fit, campaign: Campaign, enough: float) -> SessionChanges | None:
    """What differs between a campaign's windows, estimated after a fit; None where nothing does.

    enough: nats of evidence that each kind needs. Noise counts as large as what the differences themselves leave.
    """
    order = tuple(dict.fromkeys(whole_id(window.id) for window in campaign.windows))
    seen = influence(found)
    smallest = SMALLEST * found.likelihood.resolution
    sizes = np.geomspace(smallest, max(LARGEST, 2 * smallest), SIZES)
    arm = float(np.sqrt(found.values[AXES : 2 * AXES].sum() / 2))  # I/m about P: the sum of all r² counts twice
    search = _Search(seen, order, session_kinds(seen.cables, order, arm), sizes)
    temper = seen.temper(np.zeros(len(seen.gradient)))
    chosen: tuple[SessionChange, ...] = ()
    for _ in range(SHARED.rounds):
        chosen = search.chosen(temper, enough)
        temper = seen.temper(search.likeliest(chosen, temper))
    differences = tuple(one for one in search.sized(chosen, temper) if one.kind.id != CONSTANT)
    return SessionChanges(differences, order, temper, Body.from_vector(found.values[:BODY])) if differences else None


@dataclass(frozen=True, eq=False)
class _Search:
    """All kinds of differences of one campaign, weighed against each other."""

    seen: Influence
    order: tuple[str, ...]
    """ids of all windows as they were recorded"""
    groups: tuple[tuple[SessionKind, ...], ...]
    sizes: Float[np.ndarray, " sizes"]

    def chosen(self, temper: float, enough: float) -> tuple[SessionChange, ...]:
        """One kind after the other, as long as each is evident enough beside those before."""
        chosen: tuple[SessionChange, ...] = ()
        while len(chosen) < SHARED.most_terms:
            weighed = self._weighed(chosen, temper)
            best = weighed[0]
            if best.nats < enough:
                break
            near = tuple(one.kind for one in weighed[1:] if best.nats - one.nats < ODDS)
            chosen = (*chosen, replace(best, rivals=near))
        return chosen

    def likeliest(self, chosen: Sequence[SessionChange], temper: float) -> Float[np.ndarray, " z"]:
        """z of all windows, by these kinds."""
        if not chosen:
            return np.zeros(len(self.seen.gradient))
        designs = [one.size * one.kind.design(self.seen, self.order) for one in chosen]
        design = np.hstack(designs)
        inner = temper * np.eye(design.shape[1]) + design.T @ self.seen.information @ design
        return design @ np.linalg.solve(inner, design.T @ self.seen.gradient)

    def sized(self, chosen: Sequence[SessionChange], temper: float) -> tuple[SessionChange, ...]:
        """With the θ of each beside the others."""
        steady = [one for one in chosen if not one.kind.is_scatter]
        if not steady:
            return tuple(chosen)
        information, gradient = self._given([one for one in chosen if one.kind.is_scatter], temper)
        begun = [replace(one, theta=np.zeros(one.kind.chosen.shape[1])) for one in steady]
        designs = [one.kind.design(self.seen, self.order) for one in steady]
        return _in_place_of(steady, _estimated(begun, designs, information, gradient), chosen)

    def _weighed(self, chosen: Sequence[SessionChange], temper: float) -> list[SessionChange]:
        """The best of each group beside what was chosen, with the group's evidence, the most evident first."""
        information, gradient = self._given(chosen, temper)
        found: list[SessionChange] = []
        for group in self.groups:
            designs = (one.design(self.seen, self.order) for one in group)
            nats = np.array([_nats(design, information, gradient, self.sizes) for design in designs])
            k, at = np.unravel_index(int(np.argmax(nats)), nats.shape)
            whole = float(logsumexp(nats)) - float(np.log(nats.size))
            found.append(SessionChange(group[int(k)], whole, float(self.sizes[at])))
        return sorted(found, key=lambda one: -one.nats)

    def _given(
        self, chosen: Sequence[SessionChange], temper: float
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


def _estimated(
    changes: Sequence[SessionChange], designs: Sequence[np.ndarray], information: np.ndarray, gradient: np.ndarray
) -> list[SessionChange]:
    """The likeliest θ of all together; information and gradient (over the noise) by z, at the θ that they have."""
    design, before = np.hstack(designs), np.concatenate([one.theta for one in changes])
    prior = np.concatenate([np.full(len(one.theta), 1 / one.size**2) for one in changes])
    inner = np.diag(prior) + design.T @ information @ design
    theta = before + np.linalg.solve(inner, design.T @ gradient - prior * before)
    covariance = np.linalg.inv(inner)
    ends = np.cumsum([len(one.theta) for one in changes])
    places = [slice(end - len(one.theta), end) for one, end in zip(changes, ends, strict=True)]
    return [
        replace(one, theta=theta[at], covariance=covariance[at, at]) for one, at in zip(changes, places, strict=True)
    ]


def _in_place_of(
    before: Sequence[SessionChange], after: Sequence[SessionChange], among: Sequence[SessionChange]
) -> tuple[SessionChange, ...]:
    """All of these, some of them exchanged."""
    exchanged = {id(old): new for old, new in zip(before, after, strict=True)}
    return tuple(exchanged.get(id(one), one) for one in among)


def _nats(design: np.ndarray, information: np.ndarray, gradient: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Evidence at each size, over that of none."""
    values, vectors = np.linalg.eigh(design.T @ information @ design)
    along = vectors.T @ (design.T @ gradient)
    wide = sizes[:, np.newaxis] ** 2
    growth = 1.0 + wide * np.maximum(values, 0.0)
    return 0.5 * (wide * along**2 / growth - np.log(growth)).sum(axis=1)


def _without_encoder(window: Window, cable: int) -> Window:
    if window.lengths is None:
        return window
    lengths = window.lengths.copy()
    lengths[:, cable - 1] = np.nan
    return replace(window, lengths=lengths)
