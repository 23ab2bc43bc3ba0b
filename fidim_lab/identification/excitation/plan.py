"""Planning an excitation: which strokes leave the platform swinging as wanted when the winches hold.

For each mode one chain of strokes near its frequency, the slowest mode first, along the directions that swing the
platform farthest within all limits (`candidates`). How slow and how large each is, is found with the nonlinear model
and its exact derivatives; then the whole motion is looked at with bodies that CAD may have meant, and made smaller
where a tension would leave its limits. Sizes are for the damping that is likely, tensions are looked at with the least
there may be.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Body
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.excitation.candidates import (
    SPARE,
    ChainCandidate,
    Hanging,
    begins_of,
    candidates,
    half_periods,
)
from fidim_lab.identification.excitation.knowledge import Knowledge
from fidim_lab.identification.excitation.motion import (
    LATE,
    at_rest,
    in_step,
    retimed,
    solved,
    swings_after,
    within_tensions,
)
from fidim_lab.identification.excitation.place import ExcitationPlace, WinchLimits, inside
from fidim_lab.identification.excitation.strokes import Chain

BESIDE = 8
"""of the other bodies, with which directions are chosen; the others are looked at when they are"""
TINY = 1e-3
"""N/kg: so much may tensions change even where the rest is beyond its limit; it is refused later"""
LEAST = 0.1
"""part of the wanted swing under which a place is refused"""
ENOUGH = 0.97
"""part of the wanted swing that is said to be all of it"""
NEARLY = 0.9
"""part of what others reach, or of the wanted swing, at which strokes like those before are not given up for others"""
ALIKE = 0.75
"""power of a gain learnt of strokes in one direction, applied to others: of 120 windows 92 % swing as planned or
wanted after two tries, 91 % with 0.5, 83 % with 0"""
SMALL = 1e-6
"""m"""


@dataclass(frozen=True, eq=False)
class Excitation:
    """Chains of strokes, and what is to be expected of them."""

    chains: tuple[Chain, ...]
    """one for each mode that is excited, in order"""
    begins: tuple[float, ...]
    """s since the begin of the first"""
    wanted: Float[np.ndarray, " modes"]
    """m: how far the main marker is to swing in each mode when the winches hold"""
    reached: Float[np.ndarray, " modes"]
    """m: by the plan; less where limits did not allow it"""
    tension: tuple[float, float]
    """N, smallest and largest of all bodies looked at"""
    modes: tuple[int, ...] = field(default=())
    """the mode (from 0) of each chain"""
    why_less: str = ""
    """what limits the swing; empty where nothing does"""

    @property
    def seconds(self) -> float:
        """From the first stroke's begin to the hold."""
        return self.begins[-1] + self.chains[-1].pattern.seconds


def planned(
    place: ExcitationPlace,
    wanted: Float[np.ndarray, " modes"],
    knowledge: Knowledge | None = None,
    limits: WinchLimits | None = None,
    bodies: Sequence[Body] = (),
    tension: tuple[float, float] | None = None,
    before: Excitation | None = None,
) -> Excitation:
    """The excitation after which the marker swings `wanted` (m) in each mode.

    knowledge: what earlier recordings taught. bodies: others than the place's that CAD may have meant
    (`Bodies.others`). tension: N at all times; the robot's limits unless given. before: what was carried out
    here last; what knowledge says of its strokes need not hold for others. Where limits allow less, all modes get
    less alike; raises InfeasibleError where nothing is left (a tenth), or nothing is wanted.
    """
    if not np.linalg.norm(wanted) > 0:
        raise InfeasibleError(
            "Its displacement is zero: it is not to swing at all.", hint="Give the window a displacement in the plan."
        )
    limits, knowledge = limits or WinchLimits(), knowledge or Knowledge.none(len(wanted))
    known = replace(place, swing=place.swing.damped(knowledge.damping))
    others = tuple(known.beside(body) for body in bodies)
    trial = _Trial(known, wanted, knowledge, others, inside(tension or place.robot.limits.tension))
    best = trial.best(limits, before)
    chains, modes = best.chains, best.modes
    why = (
        "" if best.why is Less.NOTHING else f"{100 * best.part:.0f} % of the wanted swing: {best.words(trial.tension)}"
    )
    if best.part < LEAST:
        raise InfeasibleError(
            f"The winches cannot make the platform swing {_mm(wanted)} mm here: {why}.",
            hint="Choose another equilibrium or a smaller displacement, or allow the winches more.",
        )
    stretched = retimed(chains, modes, knowledge.ratio)
    return Excitation(stretched, begins_of(stretched), wanted, best.reached, best.extremes, modes, why)


class Less(Enum):
    """Why a swing is less than wanted."""

    NOTHING = "it is not"
    WINCHES = "what the winches' speed, acceleration, lengths and time reach"
    TENSION = "what tensions allow"


@dataclass(frozen=True, eq=False)
class _Planned:
    """What came of one trial."""

    chains: tuple[Chain, ...]
    modes: tuple[int, ...]
    reached: Float[np.ndarray, " modes"]
    part: float
    extremes: tuple[float, float]
    why: Less

    def words(self, tension: tuple[float, float]) -> str:
        """Why, with the tensions (N) that are allowed."""
        if self.why is not Less.TENSION:
            return self.why.value
        low, high = self.extremes
        return f"{self.why.value}, then {low:.0f} to {high:.0f} N within {tension[0]:.0f} to {tension[1]:.0f} N"


@dataclass(frozen=True, eq=False)
class _Trial:
    """What a plan is made for; the place's swing has the damping that is known."""

    place: ExcitationPlace
    wanted: Float[np.ndarray, " modes"]
    knowledge: Knowledge
    others: tuple[ExcitationPlace, ...]
    """the same lengths with other bodies"""
    tension: tuple[float, float]

    def best(self, limits: WinchLimits, before: Excitation | None) -> _Planned:
        """Of all candidates within these limits, the one that reaches most by the nonlinear model.

        Strokes as those before are taken if they reach nearly all, or nearly what others do: what they did tells what
        they do, and less of what others do (`ALIKE`).
        """
        knowledge, gain, known = self.knowledge, self.knowledge.gain, None
        if before is not None:
            known = self._carried_out(self._as_before(before, limits), gain)
            if known.part >= NEARLY:
                return known
            gain = gain**ALIKE
        aims, tried = self.wanted / gain, list[_Planned]()
        for candidate in candidates(self.place, aims, knowledge.ratio, self._at_most, limits, self._hanging()):
            tried.append(self._carried_out(candidate, gain))
            if tried[-1].why is not Less.TENSION:
                break
        most = max(tried, key=lambda one: one.part)
        return most if known is None or known.part < NEARLY * most.part else known

    @property
    def _at_most(self) -> Float[np.ndarray, " modes"]:
        """Gains with which tensions are looked at."""
        return np.maximum(self.knowledge.gain, 1.0)

    def _as_before(self, before: Excitation, limits: WinchLimits) -> ChainCandidate:
        """The same directions and turns, timed anew and as large as is wanted: it is known what they do."""
        halves, ratio, aims = half_periods(self.place.swing), self.knowledge.ratio, self.wanted / self.knowledge.gain
        chains = tuple(
            replace(chain, pattern=replace(chain.pattern, half=float(halves[mode])))
            for chain, mode in zip(before.chains, before.modes, strict=True)
        )
        reached = swings_after(self.place, chains, before.modes)
        factors = [float(aims[mode] / max(reached[mode], SMALL)) for mode in before.modes]
        chains = tuple(chain.scaled(factor) for chain, factor in zip(chains, factors, strict=True))
        held = self.place.equilibrium.lengths
        used = max(
            limits.used(held, chain, float(ratio[mode])) for chain, mode in zip(chains, before.modes, strict=True)
        )
        share = min(1.0, SPARE / used)
        return ChainCandidate(share, tuple(chain.scaled(share) for chain in chains), before.modes, share)

    def _carried_out(self, candidate: ChainCandidate, gain: np.ndarray) -> _Planned:
        """By the nonlinear model times a gain, as large as tensions allow."""
        chains, modes, aims = candidate.chains, candidate.modes, candidate.share * self.wanted / gain
        if not candidate.share > 0:
            return _Planned(chains, modes, np.zeros(len(aims)), 0.0, at_rest(self.place, chains), Less.WINCHES)
        chains = solved(self.place, in_step(self.place, chains, modes), modes, aims)
        loose = replace(self.place, swing=self.place.swing.damped(self.knowledge.least))
        factor, extremes = within_tensions(loose, chains, self._at_most[list(modes)], self.others, self.tension)
        chains = tuple(chain.scaled(factor) for chain in chains)
        reached = gain * swings_after(self.place, chains, modes)
        part = float(np.linalg.norm(reached) / np.linalg.norm(self.wanted))
        tense = factor < 1.0 or candidate.share < ENOUGH * candidate.by_winches
        less = Less.NOTHING if part > ENOUGH else Less.TENSION if tense else Less.WINCHES
        return _Planned(chains, modes, reached, part, extremes, less)

    def _hanging(self) -> list[Hanging]:
        """The likely body and the first of the others, at the least damping."""
        mass = self.place.robot.mass
        found: list[Hanging] = []
        for place in (self.place, *self.others[:BESIDE]):
            rest = place.equilibrium.tensions
            room = np.array([rest - self.tension[0] / mass, self.tension[1] / mass - rest]) / (1 + LATE)
            swing = place.swing.damped(np.resize(self.knowledge.least, len(place.swing.frequencies)))
            found.append(Hanging(swing, np.maximum(room, TINY)))
        return found


def _mm(values: np.ndarray) -> str:
    return " and ".join(f"{1e3 * value:.0f}" for value in values)
