"""Planning an excitation: which strokes leave the platform swinging as wanted when the winches hold.

For each mode one chain of strokes near its frequency, along a direction that moves it most and the others little; they
follow one another, the slowest mode first. How large each is, is solved for with the nonlinear model and its exact
derivatives; then the whole motion is looked at with bodies that CAD may have meant, and made smaller where a tension
would leave its limits. Sizes are for the damping that is likely, tensions are looked at with the least there may be.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Body
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.excitation.candidates import begins_of, within_winches
from fidim_lab.identification.excitation.knowledge import Knowledge
from fidim_lab.identification.excitation.motion import at_rest, retimed, solved, swings_after, within_tensions
from fidim_lab.identification.excitation.place import Place, WinchLimits, inside
from fidim_lab.identification.excitation.strokes import Chain

SLOWER = (0.5, 0.25)
"""parts of the acceleration that are tried where tensions are the limit"""
LEAST = 0.1
"""part of the wanted swing under which a place is refused"""
ENOUGH = 0.97
"""part of the wanted swing that is said to be all of it"""


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
    place: Place,
    wanted: Float[np.ndarray, " modes"],
    knowledge: Knowledge | None = None,
    limits: WinchLimits | None = None,
    bodies: Sequence[Body] = (),
    tension: tuple[float, float] | None = None,
) -> Excitation:
    """The excitation after which the marker swings `wanted` (m) in each mode.

    knowledge: what earlier recordings taught. bodies: others than the place's that CAD may have meant
    (`Bodies.others`). tension: N at all times; the robot's limits unless given. Where limits allow less, all modes get
    less alike; raises InfeasibleError where nothing is left (a tenth), or nothing is wanted.
    """
    if not np.linalg.norm(wanted) > 0:
        raise InfeasibleError(
            "Its displacement is zero: it is not to swing at all.", hint="Give the window a displacement in the plan."
        )
    limits, knowledge = limits or WinchLimits(), knowledge or Knowledge.none(len(wanted))
    known = replace(place, swing=place.swing.damped(knowledge.damping))
    trial = _Trial(known, wanted, knowledge, tuple(bodies), inside(tension or place.robot.limits.tension))
    best = trial.best(limits)
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


def missed(seen: Float[np.ndarray, " modes"], plan: Excitation, close: float) -> str:
    """What is amiss with a swing, as a sentence without its full stop; empty where it is as wanted, or as planned.

    seen: how far the marker swung in each mode, m. close: part of a swing by which it may be off.
    """
    found, aim, wanted = (float(np.linalg.norm(values)) for values in (seen, plan.reached, plan.wanted))
    if min(abs(found / wanted - 1), abs(found / aim - 1)) <= close:
        return ""
    return f"it swung {1e3 * found:.1f} mm, {1e3 * aim:.1f} mm were planned"


def falls_short(seen: Float[np.ndarray, " modes"], plan: Excitation, close: float) -> bool:
    """Whether less was planned than was wanted, and it swung less: what it taught may allow more."""
    return bool(plan.why_less) and float(np.linalg.norm(seen) / np.linalg.norm(plan.wanted)) < 1 - close


def more_in_reach(seen: Float[np.ndarray, " modes"], again: Excitation, close: float) -> str:
    """Why a swing that was as planned is done again, by the plan that knows of it; empty where that gains little."""
    found, more = float(np.linalg.norm(seen)), float(np.linalg.norm(again.reached))
    if more <= (1 + 2 * close) * found:
        return ""
    return f"it swung {1e3 * found:.1f} mm as planned; with what it taught {1e3 * more:.1f} mm can be reached"


@dataclass(frozen=True, eq=False)
class _Trial:
    """What a plan is made for; the place's swing has the damping that is known."""

    place: Place
    wanted: Float[np.ndarray, " modes"]
    knowledge: Knowledge
    bodies: tuple[Body, ...]
    tension: tuple[float, float]

    def best(self, limits: WinchLimits) -> _Planned:
        """With the acceleration that reaches most: gentler strokes take longer, and pull less at the cables."""
        tried = [(1.0, self.planned(limits))]
        if tried[0][1].why is not Less.TENSION:
            return tried[0][1]
        for slower in SLOWER:
            tried.append((slower, self._slowly(limits, slower)))
            if tried[-1][1].why is not Less.TENSION:
                break
        else:
            return max((found for _, found in tried), key=lambda one: one.part)
        if tried[-1][1].part <= ENOUGH:
            # there winches are the limit, and tensions with twice the acceleration: the best is in between
            between = float(np.sqrt(tried[-1][0] * tried[-2][0]))
            tried.append((between, self._slowly(limits, between)))
        found = max((found for _, found in tried), key=lambda one: one.part)
        return found if found.part > ENOUGH else replace(found, why=Less.TENSION)

    def _slowly(self, limits: WinchLimits, part: float) -> _Planned:
        """With a part of the acceleration."""
        return self.planned(replace(limits, acceleration=part * limits.acceleration))

    def planned(self, limits: WinchLimits) -> _Planned:
        """Chains within these limits."""
        aims = self.wanted / self.knowledge.gain
        share, chains, modes = within_winches(self.place, aims, self.knowledge.ratio, limits)
        if not share > 0:
            nothing = (np.zeros(len(aims)), 0.0, at_rest(self.place, chains), Less.WINCHES)
            return _Planned(chains, modes, *nothing)
        chains = solved(self.place, chains, modes, share * aims)
        gains = np.maximum(self.knowledge.gain[list(modes)], 1.0)
        loose = replace(self.place, swing=self.place.swing.damped(self.knowledge.least))
        factor, extremes = within_tensions(loose, chains, gains, self.bodies, self.tension)
        chains = tuple(chain.scaled(factor) for chain in chains)
        reached = self.knowledge.gain * swings_after(self.place, chains, modes)
        part = float(np.linalg.norm(reached) / np.linalg.norm(self.wanted))
        less = Less.NOTHING if part > ENOUGH else Less.TENSION if factor < 1.0 else Less.WINCHES
        return _Planned(chains, modes, reached, part, extremes, less)


def _mm(values: np.ndarray) -> str:
    return " and ".join(f"{1e3 * value:.0f}" for value in values)
