"""What chains of strokes do by the nonlinear model: the swing they leave, their sizes for a wanted one, tensions."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import Positions, Series
from fidim_lab.data.records import Body
from fidim_lab.identification.excitation.candidates import SPARE, begins_of
from fidim_lab.identification.excitation.place import Place
from fidim_lab.identification.excitation.strokes import COARSE, FINEST, Chain, Timeline, timeline
from fidim_lab.model.driven import driven_derivative, driven_motions
from fidim_lab.model.equilibria import pose_from_lengths

LOOK = 10.0
"""s of free motion after the last stroke whose tensions are looked at: modes near 1 : 2 pass their energy to and fro"""
STEPS = (300, 600, 900, 1800)
"""of integration: few numbers, so that compiled loops are used again"""
NEWTON = 6
CLOSED = 0.01
"""part of the wanted amplitudes"""
MOST = 0.99
"""of what the winches may do"""
SMALLEST = 0.02
"""part of the chains at which making them smaller ends"""


def swings_after(
    place: Place, chains: tuple[Chain, ...], modes: tuple[int, ...], ratio: Float[np.ndarray, " modes"] | None = None
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
    place: Place, chains: tuple[Chain, ...], modes: tuple[int, ...], ratio: Float[np.ndarray, " modes"], seconds: float
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


def solved(
    place: Place, chains: tuple[Chain, ...], modes: tuple[int, ...], wanted: Float[np.ndarray, " modes"]
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
    place: Place, chains: tuple[Chain, ...], gains: np.ndarray, bodies: Sequence[Body], tension: tuple[float, float]
) -> tuple[float, tuple[float, float]]:
    """How large the chains may be for all bodies' tensions to keep their limits, and the extremes then (N)."""
    line, factor = line_of(chains, LOOK), 1.0
    # chains that were found to do less have been made larger for it: that they then do all of it is allowed for
    directions = np.array([gain * chain.direction for gain, chain in zip(gains, chains, strict=True)])
    trials = [(place.body, place.equilibrium.pose)]
    for body in bodies:
        rest = pose_from_lengths(place.mechanism, body, place.equilibrium.lengths, place.equilibrium.pose)
        trials.append((body, rest.pose))
    rest, damping = place.equilibrium.tensions_in_newton(place.robot.mass), place.swing.damping_matrix()
    while True:
        accelerations = line.accelerations(factor * directions)[np.newaxis]
        low, high = np.inf, -np.inf
        for body, pose in trials:  # one by one: a thread that plans lets others have their turn
            found = driven_motions(place.mechanism, body, pose, accelerations, line.steps, damping).tensions
            newton = found * place.robot.mass
            low, high = min(low, _least(newton)), max(high, -_least(-newton))
        room = min(_room(rest.min(), low, tension[0]), _room(-rest.max(), -high, -tension[1]))
        if room >= 1.0 or factor < SMALLEST:
            return factor, (low, high)
        factor *= min(max(0.5, 0.97 * room), 0.97)


def line_of(chains: tuple[Chain, ...], after: float) -> Timeline:
    """The steps in which chains are integrated, with so many seconds of free motion after them."""
    begins = begins_of(chains)
    moving = begins[-1] + chains[-1].pattern.seconds
    pieces = sum(2 * (chain.pattern.turns + 1) + 2 for chain in chains)
    needed = moving / FINEST + after / COARSE + pieces + 4
    count = next((steps for steps in STEPS if steps >= needed), int(needed) + 1)
    return timeline(tuple(chain.pattern for chain in chains), begins, moving + after, count)


def _least(tensions: np.ndarray) -> float:
    """−∞ where a motion broke down."""
    return float(tensions.min()) if np.isfinite(tensions).all() else -np.inf


def _room(rest: float, found: float, limit: float) -> float:
    """How much larger the way from the tension at rest to the extreme may be."""
    if found >= limit:
        return 1.0
    return (rest - limit) / (rest - found) if rest > limit and np.isfinite(found) else 0.0
