"""One campaign within a joint fit, and which of the joint parameters are its own."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from fidim_lab.data.records import PARAMETER_NAMES, Campaign
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.effects.plausibility import Context
from fidim_lab.identification.joint.sharing import Common, Key, open_geometry
from fidim_lab.identification.mle.trajectories.likelihood import Likelihood
from fidim_lab.identification.mle.trajectories.normal import Prior
from fidim_lab.identification.survey import EXACT, Nuisance
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import BODY

POSSIBLE = 0.5
"""of the largest possible size of what dissipates: standard deviation about none (as `mle.soft`)"""


@dataclass(frozen=True)
class Piece:
    """One piece of geometry in the joint fit."""

    key: Key
    nuisance: Nuisance
    """as the first campaign that has it calls it"""
    member: int
    """that campaign"""
    place: slice
    """of its θ among the joint parameters"""
    guessed: bool
    """its standard deviation is that of a usual survey: no robot file states one"""


@dataclass(frozen=True, eq=False)
class Layout:
    """The joint parameters: the body, what dissipates, then each piece of geometry once."""

    effects: tuple[NamedEffect, ...]
    pieces: tuple[Piece, ...]
    places: tuple[Int[np.ndarray, " local"], ...]
    """for each campaign, where its own shared parameters are among the joint ones"""
    mechanisms: tuple[Mechanism, ...]

    @property
    def size(self) -> int:
        """Of the joint parameters."""
        return BODY + self.dissipating + sum(len(piece.nuisance.sd) for piece in self.pieces)

    @property
    def dissipating(self) -> int:
        """Parameters of what dissipates."""
        return sum(len(effect.parameters) for effect in self.effects)

    @property
    def of_effects(self) -> tuple[slice, ...]:
        """Where each effect's parameters are among the joint ones."""
        ends = BODY + np.cumsum([len(effect.parameters) for effect in self.effects], dtype=int)
        return tuple(slice(int(e) - len(one.parameters), int(e)) for one, e in zip(self.effects, ends, strict=True))

    @property
    def names(self) -> tuple[str, ...]:
        """Of the joint parameters."""
        of_effects = [f"{effect.id} {parameter.name}" for effect in self.effects for parameter in effect.parameters]
        of_pieces = [" ".join(str(part) for part in piece.key) for piece in self.pieces for _ in piece.nuisance.sd]
        return (*PARAMETER_NAMES, *of_effects, *of_pieces)

    def survey(self, factor: float = 1.0) -> Float[np.ndarray, " geometry"]:
        """Standard deviations of the geometry; those of no stated survey are multiplied."""
        sizes = [(factor if piece.guessed else 1.0) * np.array(piece.nuisance.sd) for piece in self.pieces]
        return np.maximum(np.concatenate([np.zeros(0), *sizes]), EXACT)

    def prior(self, mean: Float[np.ndarray, "9"], plausible: Float[np.ndarray, "9"], factor: float) -> Prior:
        """Of the joint parameters: wide about `mean` for the body, one-sided for what dissipates."""
        limits = self.limits()
        none = np.full(self.size, np.inf)
        low, high = -none, none.copy()
        dissipating = slice(BODY, BODY + self.dissipating)
        low[dissipating], high[dissipating] = 0.0, limits
        sd = np.concatenate([plausible, POSSIBLE * limits, self.survey(factor)])
        about = np.concatenate([mean, np.zeros(self.size - BODY)])
        return Prior(about, sd, low, high, firm=BODY)

    def limits(self) -> Float[np.ndarray, " dissipating"]:
        """The largest sizes that are possible with every robot."""
        highs = [
            np.concatenate([np.zeros(0), *(effect.bounds(Context.of(m.robot))[1] for effect in self.effects)])
            for m in self.mechanisms
        ]
        return np.min(highs, axis=0)

    def widened(self, member: int, local: Float[np.ndarray, " local"]) -> Float[np.ndarray, " shared"]:
        """Joint parameters that hold those of one campaign, zero elsewhere."""
        wide = np.zeros(self.size)
        wide[self.places[member]] = local
        return wide


@dataclass(frozen=True, eq=False)
class JointMember:
    """A campaign's recordings as the joint fit uses them."""

    campaign: Campaign
    likelihood: Likelihood
    ends: Float[np.ndarray, " W"]
    """how far each recording is used, s"""
    worth: Float[np.ndarray, " W"]
    """of each recording's squares: 1 over the χ²/dof that it leaves, at most 1"""
    astray: frozenset[int] = frozenset()
    """recordings whose phase got lost however the way there was taken: no further way is tried for them"""

    def up_to(self, horizon: float) -> Float[np.ndarray, " W"]:
        """The same, no farther than a horizon."""
        return np.minimum(self.ends, horizon)

    def by(self, mechanism: Mechanism) -> "JointMember":
        """With another model."""
        return replace(self, likelihood=replace(self.likelihood, mechanism=mechanism))


def lay_out(common: Common, chosen: Sequence[int], effects: Sequence[NamedEffect], *, native: bool) -> Layout:
    """The joint parameters of some of the campaigns, in their order."""
    pieces: dict[Key, Piece] = {}
    places: list[np.ndarray] = []
    mechanisms: list[Mechanism] = []
    dissipating = sum(len(effect.parameters) for effect in effects)
    size = BODY + dissipating
    for member in chosen:
        robot = common.campaigns[member].robot
        opened = open_geometry(robot, 1.0)
        place = list(range(BODY + dissipating))
        for nuisance in opened:
            key = common.key(member, nuisance)
            if key not in pieces:
                width = len(nuisance.sd)
                pieces[key] = Piece(key, nuisance, member, slice(size, size + width), robot.survey is None)
                size += width
            place += range(pieces[key].place.start, pieces[key].place.stop)
        places.append(np.array(place))
        mechanisms.append(Mechanism(robot, (*effects, *(one.effect for one in opened)), native=native))
    return Layout(tuple(effects), tuple(pieces.values()), tuple(places), tuple(mechanisms))
