"""Chains of strokes by the nonlinear model: the swing they leave, sizes for a wanted swing, tensions."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import Positions, Series
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.excitation.candidates import SPARE, begins_of
from fidim_lab.identification.excitation.place import ExcitationPlace
from fidim_lab.identification.excitation.strokes import COARSE, FINEST, Chain, Timeline, timeline
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.motion import driven_derivative, driven_motions

LOOK = 10.0
"""s of free motion after the last stroke whose tensions are looked at: modes near 1 : 2 pass their energy to and fro"""
STEPS = (300, 600, 900, 1800)
"""of integration: few numbers, so that compiled loops are used again"""
NEWTON = 6
CLOSED = 0.01
"""part of the wanted amplitudes"""
MOST = 0.99
"""of what the winches may do"""
SLOWER = (1.0, 0.98, 0.96, 0.94, 0.92)
"""parts of a mode's frequency at small swings: pendulums that swing by half a radian are at 0.98"""
SMALLEST = 0.02
"""part of the chains at which making them smaller ends"""
ALMOST, AIM = 0.95, 0.98
"""parts of what tensions allow: with so much used chains are not made larger, and so much is aimed at"""
LATE = 0.08
"""part by which tensions may leave their rest farther than planned: set-points that come late, bodies in between. Of
797 second tries whose swing was as planned, the farthest came out 9 % beyond once the mass was allowed for"""
LOOKS = 6
"""at ever better factors"""
POWERS = (0.3, 4.0)
"""of the factor, by which what is used may grow"""

T = TypeVar("T")


def swings_after(
    place: ExcitationPlace,
    chains: tuple[Chain, ...],
    modes: tuple[int, ...],
    ratio: Float[np.ndarray, " modes"] | None = None,
) -> Float[np.ndarray, " modes"]:
    """How far the model's marker swings in each mode (m) after these chains; `place.swing` has the damping.

    ratio: of the true frequencies to the model's, for chains that were timed for the true ones.
    """
    if ratio is not None:
        chains = retimed(chains, modes, 1 / ratio)
    line, swing = line_of(chains, 0.0), place.swing
    accelerations = line.accelerations(np.array([chain.direction for chain in chains]))
    by = np.zeros((*accelerations.shape, len(chains)))
    pose = place.equilibrium.pose
    end = driven_derivative(place.mechanism, place.body, pose, accelerations, by, line.steps, swing.damping_matrix())
    return swing.amplitudes(swing.states(end.pose, end.twist)[0])


def marker_after(
    place: ExcitationPlace,
    chains: tuple[Chain, ...],
    modes: tuple[int, ...],
    ratio: Float[np.ndarray, " modes"],
    seconds: float,
) -> tuple[Series, Positions]:
    """The model's marker (m) during the free motion after these chains, as `swings_after`; t is 0 at the hold."""
    chains = retimed(chains, modes, 1 / ratio)
    line = line_of(chains, seconds)
    accelerations = line.accelerations(np.array([chain.direction for chain in chains]))[np.newaxis]
    pose, damping = place.equilibrium.pose, place.swing.damping_matrix()
    found = driven_motions(place.mechanism, place.body, pose, accelerations, line.steps, damping)
    t = line.t - (begins_of(chains)[-1] + chains[-1].pattern.seconds)
    after = (t >= -1e-9) & np.concatenate([[True], np.diff(t) > 0])
    return t[after], (found.positions[0] + found.rotations[0] @ place.robot.marker)[after]


def retimed(
    chains: tuple[Chain, ...], modes: tuple[int, ...], faster: Float[np.ndarray, " modes"]
) -> tuple[Chain, ...]:
    """The same strokes, each chain so much faster as its mode."""
    return tuple(
        replace(chain, pattern=replace(chain.pattern, half=float(chain.pattern.half / faster[mode])))
        for chain, mode in zip(chains, modes, strict=True)
    )


def in_step(place: ExcitationPlace, chains: tuple[Chain, ...], modes: tuple[int, ...]) -> tuple[Chain, ...]:
    """Each chain as slow as makes its mode swing farthest: large swings take longer than small ones."""
    found = chains
    for mode in modes:
        tried: list[tuple[float, tuple[Chain, ...]]] = []
        for slower in SLOWER:
            faster = np.ones(len(place.swing.frequencies))
            faster[mode] = slower
            trial = retimed(found, modes, faster)
            tried.append((float(swings_after(place, trial, modes)[mode]), trial))
        found = max(tried, key=lambda one: one[0])[1]
    return found


def solved(
    place: ExcitationPlace, chains: tuple[Chain, ...], modes: tuple[int, ...], wanted: Float[np.ndarray, " modes"]
) -> tuple[Chain, ...]:
    """Sizes by Newton's method on the nonlinear model: as many amplitudes as chains."""
    line, swing, index = line_of(chains, 0.0), place.swing, list(modes)
    directions = np.array([chain.direction for chain in chains])
    by = np.einsum("kc,cn->knc", line.patterns, directions)
    sizes = np.ones(len(chains))
    best = (np.inf, sizes)
    for _ in range(NEWTON):
        end = driven_derivative(
            place.mechanism, place.body, place.equilibrium.pose, by @ sizes, by, line.steps, swing.damping_matrix()
        )
        states, slopes = swing.states(end.pose, end.twist, (end.pose_by, end.twist_by))
        found = swing.amplitudes(states)
        miss = (found - wanted)[index]
        if not np.isfinite(miss).all():
            break
        error = float(np.linalg.norm(miss) / np.linalg.norm(wanted))
        if error < best[0]:
            best = (error, sizes)
        if error < CLOSED:
            break
        jacobian = ((np.conj(states) / np.abs(states))[:, np.newaxis] * slopes).real
        jacobian *= (swing.lever / np.abs(np.imag(swing.rates)))[:, np.newaxis]
        step = np.linalg.lstsq(jacobian[index], -miss, rcond=1e-3)[0]
        sizes = np.clip(sizes + np.clip(step, -0.3, 0.3), 0.2, MOST / SPARE)
    return tuple(chain.scaled(float(size)) for chain, size in zip(chains, best[1], strict=True))


def within_tensions(
    place: ExcitationPlace,
    chains: tuple[Chain, ...],
    gains: np.ndarray,
    others: Sequence[ExcitationPlace],
    tension: tuple[float, float],
) -> tuple[float, tuple[float, float]]:
    """How large the chains may be for all bodies' tensions to keep their limits, and the extremes then (N).

    Those at rest at the strokes' ends count, too: an emergency stop may leave the platform there. others: the same
    lengths with other bodies, damped as `place` is.
    """
    line = line_of(chains, LOOK)
    # chains that were found to do less have been made larger for it: that they then do all of it is allowed for
    directions = np.array([gain * chain.direction for gain, chain in zip(gains, chains, strict=True)])
    rest, damping = place.equilibrium.tensions_in_newton(place.robot.mass), place.swing.damping_matrix()

    def look(factor: float) -> tuple[float, tuple[float, float]]:
        accelerations = line.accelerations(factor * directions)[np.newaxis]
        low, high = at_rest(place, tuple(chain.scaled(factor) for chain in chains))
        for one in (place, *others):  # one by one: a thread that plans lets others have their turn
            pose = one.equilibrium.pose
            found = driven_motions(place.mechanism, one.body, pose, accelerations, line.steps, damping).tensions
            low, high = wider((low, high), found * place.robot.mass)
        used = max(_used(rest.min(), low, tension[0]), _used(-rest.max(), -high, -tension[1]))
        return (1 + LATE) * used, (low, high)

    return _largest(look)


def at_rest(place: ExcitationPlace, chains: Sequence[Chain]) -> tuple[float, float]:
    """Smallest and largest tension (N) of resting at the strokes' ends; infinite where there is no rest."""
    found = (np.inf, -np.inf)
    for ends in (chain.direction * side for chain in chains for side in (1.0, -1.0)):
        try:
            rest = pose_from_lengths(
                place.mechanism, place.body, place.equilibrium.lengths + ends, place.equilibrium.pose
            )
        except InfeasibleError:
            return -np.inf, np.inf
        found = wider(found, rest.tensions_in_newton(place.robot.mass))
    return found


def wider(extremes: tuple[float, float], newton: np.ndarray) -> tuple[float, float]:
    """Smallest and largest tension (N) with these seen, too; infinite where a motion broke down."""
    if not np.isfinite(newton).all():
        return -np.inf, np.inf
    return min(extremes[0], float(newton.min())), max(extremes[1], float(newton.max()))


def _largest(look: Callable[[float], tuple[float, T]]) -> tuple[float, T]:
    """The largest factor (at most 1, to a few percent) that uses no more than all of what is allowed.

    look: the part of it that a factor uses, and what is to be told of it. What is used grows like a power of the
    factor, which is found on the way: with large swings tensions grow faster than the swing.
    """
    factor, power, looks = 1.0, 1.0, 0
    best: tuple[float, T] | None = None
    least, most = 0.0, 1.0
    before: tuple[float, float] | None = None
    while True:
        used, seen = look(factor)
        looks += 1
        if used <= 1.0:
            best = (factor, seen)
            if factor == 1.0 or used >= ALMOST:
                return best
            least = factor
        else:
            most = factor
        if best is not None and looks >= LOOKS:
            return best
        if best is None and factor < SMALLEST:
            return factor, seen
        if before is not None and np.isfinite(used) and used > 0:
            power = float(np.clip(np.log(used / before[1]) / np.log(factor / before[0]), *POWERS))
        before = (factor, used) if np.isfinite(used) and used > 0 else None
        wanted = factor * (AIM / used) ** (1 / power) if before else 0.5 * factor
        # well inside the bracket, and never so much smaller that a good factor is passed by far
        inside = 0.1 * (most - least)
        factor = float(np.clip(wanted, max(least + inside, 0.4 * factor), most - inside))


def line_of(chains: tuple[Chain, ...], after: float, finest: float = FINEST) -> Timeline:
    """The steps in which chains are integrated, with so many seconds of free motion after them."""
    begins = begins_of(chains)
    moving = begins[-1] + chains[-1].pattern.seconds
    pieces = sum(2 * (chain.pattern.turns + 1) + 2 for chain in chains)
    needed = moving / finest + after / COARSE + pieces + 4
    count = next((steps for steps in STEPS if steps >= needed), int(needed) + 1)
    return timeline(tuple(chain.pattern for chain in chains), begins, moving + after, count, finest)


def _used(rest: float, found: float, limit: float) -> float:
    """Part of the way from the tension at rest to its limit that the extreme takes; ∞ where there is none."""
    return (rest - found) / (rest - limit) if rest > limit else np.inf
