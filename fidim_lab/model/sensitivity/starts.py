"""Initial states that obey the locked cables, Ξ v = l̇ (0 but for effects), and what they and the lengths depend on.

A window's own unknowns are [δp; δφ; δu; δτ; δξ]: a change of pose, rates along the free twists at that pose (λ with
rigid cables), the tensions of the cables that are springs, and how far astray the states are that effects have of their
own: they begin where their effect says, ξ = start(pose, twist, θ) + astray. Ξ is tied to the pose, so the twist follows
it: v(pose) is the projection of the old twist on the new free twists. A spring's unstretched length follows pose and
tension, l₀ = l − κ τ, so that a change of stiffness leaves a quiet start quiet.
"""

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial.transform import Rotation

from fidim_lab.model.batch import function, over_samples, rows
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion.contributions import extra_count, extra_start_at, seen_compliances_at
from fidim_lab.model.motion.equations import Symbols
from fidim_lab.model.sensitivity.equations import Sample, entries, sprung, turned
from fidim_lab.model.sensitivity.integrate import States

Begins = Float[np.ndarray, " W"]
"""s on each window's own clock"""

SLOW = 2 * np.pi * 3.0
"""rad/s: a direction in which the springs are no faster than this is not held by them but moves"""


@dataclass(frozen=True, eq=False)
class Starts:
    """Derivatives at the initial states of W windows."""

    lengths: Float[np.ndarray, "W n"]
    """m, as an encoder without error would read them"""
    lengths_by: Float[np.ndarray, "W n P"]
    """by [δp; δφ; δu; δτ; δξ; shared]"""
    states_by: Float[np.ndarray, "W 6+m P"]
    """[δp; δφ; δv; δω; δξ] by the same columns"""
    free_twists: Float[np.ndarray, "W 6 free"]
    """N: orthonormal, Ξ N = 0 for the cables that are held"""
    unstretched: Float[np.ndarray, "W springs"] | None = None
    """l₀ of the springs, m; None where there are none"""
    unstretched_by: Float[np.ndarray, "W springs P"] | None = None
    rates: Float[np.ndarray, "W springs"] | None = None
    """of the springs' stretch, m/s"""
    rates_by: Float[np.ndarray, "W springs P"] | None = None
    extra: Float[np.ndarray, "W extra"] | None = None
    """effects' own states; None where there are none"""

    def by_own(self, own: int) -> "Starts":
        """With derivatives by the windows' own unknowns alone."""
        parts = (self.unstretched_by, self.rates_by)
        unstretched_by, rates_by = (None if part is None else part[..., :own] for part in parts)
        lengths_by, states_by = self.lengths_by[..., :own], self.states_by[..., :own]
        return replace(
            self, lengths_by=lengths_by, states_by=states_by, unstretched_by=unstretched_by, rates_by=rates_by
        )


def own_count(mechanism: Mechanism) -> int:
    """Unknowns of each window: pose (6), free rates, tensions of springs, effects' own states."""
    return 6 + mechanism.freedoms + 2 * len(sprung(mechanism)) + extra_count(mechanism)


def spreads(mechanism: Mechanism) -> Float[np.ndarray, " extra"]:
    """How far astray effects' own states may well begin: standard deviations before any data."""
    return np.array([state.spread for effect in mechanism.effects for state in effect.extra_states])


def tied(mechanism: Mechanism, shared: np.ndarray, states: States, begins: Begins) -> States:
    """The same poses with the nearest twists at which the held cables do as they must: v − Ξ⁺ (Ξ v − l̇).

    Springs whose tension is not known yet get that of `quiet_springs`; states of effects that the mechanism did not
    have before begin where their effect says.
    """
    if sprung(mechanism) and states.tensions is None:
        states = replace(states, tensions=quiet_springs(mechanism, shared, states, begins).tensions)
    found = _quantities(mechanism, shared, states, begins)
    off = _pinv(found.structure) @ found.speeds[..., np.newaxis]
    return replace(states, twists=states.twists - off[..., 0], astray=_astray(mechanism, states))


def moved(
    mechanism: Mechanism,
    shared: np.ndarray,
    states: States,
    starts: Starts,
    steps: Float[np.ndarray, "W own"],
    begins: Begins,
) -> States:
    """States after a step [δp; δφ; δu; δτ; δξ] of each window's own unknowns, for the (new) shared parameters."""
    last = 6 + starts.free_twists.shape[2]
    springs = last + len(sprung(mechanism))
    rates = (starts.free_twists @ steps[:, 6:last, np.newaxis])[..., 0]
    changed = States(
        positions=states.positions + steps[:, :3],
        rotations=states.rotations @ Rotation.from_rotvec(steps[:, 3:6]).as_matrix(),
        twists=states.twists + rates,
        tensions=None if states.tensions is None else states.tensions + steps[:, last:springs],
        astray=_astray(mechanism, states) + steps[:, springs:],
        body_changes=states.body_changes,
    )
    return tied(mechanism, shared, changed, begins)


def yielding_encoders(mechanism: Mechanism) -> tuple[int, ...]:
    """Indices (0-based) of the cables whose encoders turn with their tension."""

    def build(made: Mechanism) -> tuple[int, ...]:
        symbols = Symbols.of(made)
        cables = made.cables_at(symbols.position, symbols.rotation, symbols.theta)
        seen = seen_compliances_at(made, cables, symbols.theta)
        return tuple(k for k in range(made.n) if not seen[k].is_zero())

    return mechanism.compiled("sensitivity: yielding encoders", build)


def linearised_starts(mechanism: Mechanism, shared: np.ndarray, states: States, begins: Begins) -> Starts:
    """Lengths, free twists and derivatives at tied states."""
    found = _quantities(mechanism, shared, states, begins)
    count, springs, extra = len(found.lengths), found.unstretched.shape[1], found.extra.shape[1]
    free, back = _free_twists(found.structure), _pinv(found.structure)
    own = 6 + free.shape[2]
    last = own + springs + extra
    by = np.zeros((count, 12 + extra, last + len(shared)))
    by[:, :6, :6] = np.eye(6)
    by[:, 6:12, :6] = -back @ found.speeds_by[..., :6]
    by[:, 6:12, 6:own] = free
    by[:, 6:12, last:] = -back @ found.speeds_by[..., 6:]
    by[:, 12:] = found.extra_by[..., 6:12] @ by[:, 6:12]
    by[:, 12:, :6] += found.extra_by[..., :6]
    by[:, 12:, own + springs : last] += np.eye(extra)
    by[:, 12:, last:] += found.extra_by[..., 12:]
    plain = Starts(
        lengths=found.lengths,
        lengths_by=_among(found.lengths_by, own - 6, springs, extra),
        states_by=by,
        free_twists=free,
        extra=found.extra if extra else None,
    )
    if not springs:
        return plain
    rates_by = found.rates_by_twist @ by[:, 6:12]
    rates_by[..., :6] += found.rates_by[..., :6]
    rates_by[..., last:] += found.rates_by[..., 6:]
    return replace(
        plain,
        unstretched=found.unstretched,
        unstretched_by=_among(found.unstretched_by, own - 6, springs, extra),
        rates=found.rates,
        rates_by=rates_by,
    )


@dataclass(frozen=True, eq=False)
class QuietSprings:
    """What springs do where no fast oscillation of theirs is excited, and how large such ones may well be."""

    tensions: Float[np.ndarray, "W springs"]
    """N/kg: those of rigid cables in the same state"""
    rate_per_tension: Float[np.ndarray, "W springs"]
    """rate of stretch, m/s, that goes with an oscillating tension of 1 N/kg"""
    fastest: float
    """rad/s, of all oscillations of the platform on its springs"""


def quiet_springs(mechanism: Mechanism, shared: np.ndarray, states: States, begins: Begins) -> QuietSprings:
    """Tensions that rigid cables would have, directions that are as soft as the motion itself (`SLOW`) left slack."""
    chosen = list(sprung(mechanism))
    compiled = mechanism.compiled("sensitivity: quiet springs", _compile_quiet)
    count, n = len(states.positions), mechanism.n
    given = (begins[:, np.newaxis], states.positions, states.rotations.reshape(count, 9), states.twists)
    pull, spread, compliance = over_samples(compiled, count, *given, states.shared(shared))
    spread = spread.reshape(count, n, n)
    compliance[:, [k for k in range(n) if k not in chosen]] = 0.0
    soft = SLOW**2 * compliance[:, np.newaxis] * np.eye(n)
    tensions = np.linalg.solve(spread + soft, pull[..., np.newaxis])[..., 0]
    kappa = compliance[:, chosen]
    inner = spread[:, chosen][:, :, chosen]
    with np.errstate(invalid="ignore", divide="ignore"):
        squares = inner / np.sqrt(kappa[:, np.newaxis] * kappa[..., np.newaxis])
    fastest = float(np.sqrt(np.linalg.eigvalsh(squares).max())) if np.isfinite(squares).all() else np.inf
    rate = np.sqrt(np.maximum(kappa * np.diagonal(inner, axis1=1, axis2=2), 0.0))
    return QuietSprings(tensions[:, chosen], rate, fastest)


@dataclass(frozen=True, eq=False)
class _Quantities:
    lengths: Float[np.ndarray, "W n"]
    """less what the cables have grown by since the window's start"""
    lengths_by: Float[np.ndarray, "W n 6+springs+shared"]
    """by [δp; δφ], tensions of springs, shared"""
    structure: Float[np.ndarray, "W held 6"]
    speeds: Float[np.ndarray, "W held"]
    """Ξ v − l̇, which must vanish"""
    speeds_by: Float[np.ndarray, "W held 6+shared"]
    """by [δp; δφ], shared"""
    unstretched: Float[np.ndarray, "W springs"]
    unstretched_by: Float[np.ndarray, "W springs 6+springs+shared"]
    rates: Float[np.ndarray, "W springs"]
    rates_by: Float[np.ndarray, "W springs 6+shared"]
    rates_by_twist: Float[np.ndarray, "W springs 6"]
    extra: Float[np.ndarray, "W extra"]
    extra_by: Float[np.ndarray, "W extra 12+shared"]
    """by [δp; δφ], twist, shared"""


def _quantities(mechanism: Mechanism, shared: np.ndarray, states: States, begins: Begins) -> _Quantities:
    count, springs = len(states.positions), len(sprung(mechanism))
    held, n = mechanism.n - springs, mechanism.n
    compiled = compiled_starts(mechanism)
    found = over_samples(
        compiled,
        count,
        begins[:, np.newaxis],
        states.positions,
        states.rotations,
        states.twists,
        states.shared(shared),
        np.zeros((count, 0)) if states.tensions is None else states.tensions,
        _astray(mechanism, states),
    )
    wide, narrow, extra = 6 + springs + len(shared), 6 + len(shared), extra_count(mechanism)
    shapes = [(n,), (n, wide), (held, 6), (held,), (held, narrow), (springs,), (springs, wide)]
    shapes += [(springs,), (springs, narrow), (springs, 6), (extra,), (extra, 6 + narrow)]
    return _Quantities(*(x.reshape(count, *shape) for x, shape in zip(found, shapes, strict=True)))


def compiled_starts(mechanism: Mechanism) -> ca.Function:
    """(time, position, rotation row by row, twist, shared, tensions of springs, astray) → what `_Quantities` holds."""
    return mechanism.compiled("sensitivity: starts", _compile_starts)


def _astray(mechanism: Mechanism, states: States) -> Float[np.ndarray, "W extra"]:
    """None, or those of another mechanism: nowhere."""
    shape = (len(states.positions), extra_count(mechanism))
    return np.zeros(shape) if states.astray is None or states.astray.shape != shape else states.astray


def _among(by: np.ndarray, rates: int, springs: int, extra: int) -> np.ndarray:
    """Columns [δp; δφ; δτ; shared] made into [δp; δφ; δu; δτ; δξ; shared]."""
    pose, tensions, shared = np.split(by, [6, 6 + springs], axis=-1)
    none = np.zeros((*by.shape[:-1], rates + extra))
    return np.concatenate([pose, none[..., :rates], tensions, none[..., rates:], shared], axis=-1)


def _free_twists(structure: Float[np.ndarray, "W held 6"]) -> Float[np.ndarray, "W 6 free"]:
    count, held = structure.shape[:2]
    if held == 0:
        return np.broadcast_to(np.eye(6), (count, 6, 6))
    known = _known(structure)
    free = np.full((count, 6, max(0, 6 - held)), np.nan)
    free[known] = np.swapaxes(np.linalg.svd(structure[known])[2][:, held:], 1, 2)
    return free


def _pinv(structure: Float[np.ndarray, "W held 6"]) -> Float[np.ndarray, "W 6 held"]:
    if not structure.shape[1]:
        return np.swapaxes(structure, 1, 2)
    known = _known(structure)
    found = np.full((len(structure), 6, structure.shape[1]), np.nan)
    found[known] = np.linalg.pinv(structure[known])
    return found


def _known(structure: Float[np.ndarray, "W held 6"]) -> Bool[np.ndarray, " W"]:
    """Windows whose pose has a Ξ: a cable that would have to lie inside its pulley has none."""
    return np.asarray(np.isfinite(structure).all(axis=(1, 2)))


def _compile_starts(mechanism: Mechanism) -> ca.Function:
    sample = Sample.of(mechanism)
    equations, symbols = sample.equations, sample.equations.symbols
    held, springs = list(sample.held), list(sample.sprung)
    tensions = ca.SX.sym("tensions", len(springs))
    drift, rate = _constraint(sample)
    lengths, speeds = equations.lengths - drift, equations.structure @ symbols.twist - rate
    unstretched = entries(lengths, springs) - entries(equations.compliance, springs) * tensions
    lengths[springs] = unstretched
    if not equations.compliance.is_zero():
        seen = seen_compliances_at(mechanism, equations.state.cables, symbols.theta)
        pulled = ca.SX.zeros(mechanism.n)
        pulled[springs] = tensions
        lengths += seen * (pulled if springs else sample.solver(equations.wrench, equations.pull)[6:])
    by_pose = ca.horzcat(equations.structure[:, :3], equations.structure[:, 3:] @ symbols.rotation)
    by_pose = _by_pose(symbols, lengths) if springs else by_pose
    lengths_by = ca.horzcat(by_pose, ca.jacobian(lengths, ca.vertcat(tensions, sample.shared)))
    unstretched_by = ca.horzcat(
        _by_pose(symbols, unstretched), ca.jacobian(unstretched, ca.vertcat(tensions, sample.shared))
    )
    speeds_by = ca.horzcat(_by_pose(symbols, speeds), ca.jacobian(speeds, sample.shared))
    outputs = [lengths, lengths_by, equations.structure[held, :], entries(speeds, held), speeds_by[held, :]]
    outputs += [unstretched, unstretched_by]
    outputs += [entries(speeds, springs), speeds_by[springs, :], equations.structure[springs, :]]
    astray = ca.SX.sym("astray", symbols.extra.numel())
    extra = extra_start_at(mechanism, equations.state, symbols.theta) + astray
    by_rest = ca.jacobian(extra, ca.vertcat(symbols.twist, sample.shared))
    outputs += [extra, ca.horzcat(_by_pose(symbols, extra), by_rest)]
    # what else depends on effects' own states (stretch) does so hardly: no derivative of it is carried
    outputs = ca.substitute([rows(output) for output in outputs], [symbols.extra], [extra])
    inputs = [*sample.inputs[:3], symbols.twist, sample.shared, tensions, astray]
    return function("starts", inputs, outputs)


def _constraint(sample: Sample) -> tuple[ca.SX, ca.SX]:
    """What the cables have grown by, stretch of springs left out, and its rate."""
    if not sample.sprung:
        return sample.equations.length_constraint(sample.solver)
    drifts = sample.equations.drifts
    return drifts, ca.jtimes(drifts, sample.equations.symbols.time, ca.SX(1))


def _by_pose(symbols: Symbols, expression: ca.SX) -> ca.SX:
    """By [δp; δφ]."""
    by_rotation = ca.jacobian(expression, symbols.flat) @ turned(symbols.flat)
    return ca.horzcat(ca.jacobian(expression, symbols.position), by_rotation)


def _compile_quiet(mechanism: Mechanism) -> ca.Function:
    """(time, position, rotation, twist, shared) → Ξ M⁻¹ f − c, Ξ M⁻¹ Ξᵀ row by row, κ."""
    sample = Sample.of(mechanism, springs=False)
    equations, symbols = sample.equations, sample.equations.symbols
    free = ca.solve(equations.mass, ca.horzcat(equations.wrench, equations.pulling))
    spread = equations.structure @ free[:, 1:]
    pull = equations.structure @ free[:, 0] - equations.pull
    extra = extra_start_at(mechanism, equations.state, symbols.theta)
    pull, spread, compliance = ca.substitute([pull, spread, equations.compliance], [symbols.extra], [extra])
    inputs = [*sample.inputs[:3], symbols.twist, sample.constants]
    return function("quiet_springs", inputs, [pull, rows(spread), compliance])
