"""The mechanism: all cables of one robot with its effects, as expressions and as functions over many samples.

`Mechanism` is made once per robot (some milliseconds) and handed to every other function of this package. Its methods
take N poses at once. Whoever needs derivatives or an integrator builds on `cables_at` and keeps the compiled function
with `compiled`.
"""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import casadi as ca
import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import CableSeries, Positions, Rotations, Twists
from fidim_lab.data.records import Cable, Robot
from fidim_lab.errors import InfeasibleError, OurBugError
from fidim_lab.model.batch import from_rows, function, over_samples, rows
from fidim_lab.model.geometry import CableConstants, CableExpressions, cable_expressions, skew
from fidim_lab.model.making import MAKING, made_once
from fidim_lab.model.slots import Effect, PlatformState

T = TypeVar("T")

SINGULAR_DISTANCE = 1e-6
"""m: nearer than this to the swivel axis, or to the pulley's rim, the cable has no direction"""


class Mechanism:
    """Kinematics of a platform on n cables; SI units, world frame (spec/model.md §1, Eq. 1–4).

    `theta` are the parameters of all effects, in their order; absent unless given. `native`: simulate and
    solve with compiled C where a compiler is found, the same digits faster after a second of building (see `native`).
    `springs`: trajectories with derivatives treat the cables that an effect stretches as springs, which their θ must
    then make compliant (positive), instead of stretching them to first order (`equations`). `quiet`: springs so stiff
    that their own oscillations are not followed but die at once (`sensitivity.stiff`); any stiffness costs the same.
    """

    def __init__(
        self,
        robot: Robot,
        effects: Sequence[Effect] = (),
        theta: Sequence[float] | None = None,
        *,
        native: bool = False,
        springs: bool = False,
        quiet: bool = False,
    ) -> None:
        self.robot = robot
        self.native = native
        self.springs = springs
        self.quiet = springs and quiet
        self.effects = tuple(effects)
        count = sum(len(effect.parameters) for effect in self.effects)
        absent = np.concatenate([np.zeros(0), *(effect.absent for effect in self.effects)])
        self.theta = absent if theta is None else np.array(theta, dtype=float)
        if self.theta.shape != (count,):
            raise OurBugError(f"Mechanism: {count} effect parameters expected, {self.theta.size} given.")
        self._compiled: dict[str, Any] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        """Compiled functions stay here: another process compiles its own."""
        return (_remake, (self.robot, self.effects, tuple(self.theta), self.native, self.springs, self.quiet))

    @property
    def n(self) -> int:
        """Number of cables."""
        return self.robot.n

    @property
    def freedoms(self) -> int:
        """λ = 6 − n."""
        return self.robot.freedoms

    def compiled(self, name: str, build: Callable[["Mechanism"], T]) -> T:
        """`build(self)`, once for this mechanism; later calls with the same name return the same object."""
        return made_once(self._compiled, name, lambda: build(self))

    def cables_at(self, position: ca.SX, rotation: ca.SX, theta: ca.SX) -> tuple[CableExpressions, ...]:
        """All cables at a symbolic pose, effects on geometry applied."""
        return tuple(cable_expressions(_constants(self, index, theta), position, rotation) for index in range(self.n))

    def lengths_at(self, cables: Sequence[CableExpressions], theta: ca.SX) -> ca.SX:
        """Lengths (n) of `cables_at`, effects on cable length applied."""
        return ca.vertcat(
            *(
                cable.length + sum(effect.cable_length(number, part) for effect, part in parts(self, theta))
                for number, cable in enumerate(cables, start=1)
            )
        )

    def wrench_at(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """Sum of the effects' wrenches per unit mass (6), N/kg and N m/kg."""
        seen = states_of(self, state)
        wrenches = (effect.wrench(own, part) for own, (effect, part) in zip(seen, parts(self, theta), strict=True))
        return sum(wrenches, ca.SX.zeros(6)) / self.robot.mass

    def geometry(self) -> tuple[Cable, ...]:
        """The cables as its effects have them with its θ: anchors, attachments, radii and axes moved."""
        found: list[Cable] = []
        with MAKING:
            for index in range(self.n):
                constants = _constants(self, index, ca.SX(ca.DM(self.theta)))
                names = ("d", "a", "radius", "x", "y", "z")
                d, a, radius, x, y, z = (np.array(ca.evalf(getattr(constants, name))).ravel() for name in names)
                found.append(Cable(d, a, float(radius[0]), x, y, z, self.robot.cables[index].name))
        return tuple(found)

    def lengths(self, positions: Positions, rotations: Rotations) -> CableSeries:
        """Cable lengths l = r φ + ρ, m. Raises InfeasibleError at a singular pose, naming the cable."""
        return _evaluate(self, "lengths", positions, rotations)

    def structure_matrix(self, positions: Positions, rotations: Rotations) -> Float[np.ndarray, "N n 6"]:
        """Ξ with rows [tᵀ, (R a × t)ᵀ], so that Ξ [ṗ; ω] = l̇ (Eq. 3, 4). Raises InfeasibleError as `lengths`."""
        return _evaluate(self, "structure matrix", positions, rotations).reshape(-1, self.n, 6)

    def structure_matrix_rate(
        self, positions: Positions, rotations: Rotations, twists: Twists
    ) -> Float[np.ndarray, "N n 6"]:
        """Ξ̇ along the given twists, 1/s. Raises InfeasibleError as `lengths`."""
        return _evaluate(self, "structure matrix rate", positions, rotations, twists).reshape(-1, self.n, 6)

    def swivel_angles(self, positions: Positions, rotations: Rotations) -> CableSeries:
        """σ in (−π, π], rad. Raises InfeasibleError as `lengths`."""
        return _evaluate(self, "swivel angles", positions, rotations)

    def wrap_angles(self, positions: Positions, rotations: Rotations) -> CableSeries:
        """φ in [0, 2π), rad. Raises InfeasibleError as `lengths`."""
        return _evaluate(self, "wrap angles", positions, rotations)


def _evaluate(mechanism: Mechanism, name: str, *arguments: np.ndarray) -> np.ndarray:
    compiled = mechanism.compiled(f"kinematics: {name}", lambda made: _compile(made, name))
    result, distances, clearances = over_samples(compiled, len(arguments[0]), *arguments, mechanism.theta)
    _refuse_singular(distances, clearances)
    return result


def _constants(mechanism: Mechanism, index: int, theta: ca.SX) -> CableConstants:
    constants = CableConstants.of(mechanism.robot.cables[index])
    for effect, part in parts(mechanism, theta):
        constants = effect.geometry(index + 1, constants, part)
    return constants


def parts(mechanism: Mechanism, theta: ca.SX) -> list[tuple[Effect, ca.SX]]:
    """Each effect with its own parameters."""
    found: list[tuple[Effect, ca.SX]] = []
    first = 0
    for effect in mechanism.effects:
        last = first + len(effect.parameters)
        found.append((effect, theta[first:last]))
        first = last
    return found


def states_of(mechanism: Mechanism, state: PlatformState) -> list[PlatformState]:
    """The state as each effect's slots see it: with its own extra states, mass and gravity.

    Raises OurBugError where the state lacks extra states that an effect has.
    """
    count = sum(len(effect.extra_states) for effect in mechanism.effects)
    if state.extra.numel() != count:
        raise OurBugError(f"PlatformState: {count} extra states expected, {state.extra.numel()} given.")
    seen: list[PlatformState] = []
    first = 0
    for effect in mechanism.effects:
        last = first + len(effect.extra_states)
        seen.append(state.of_effect(state.extra[first:last], mechanism.robot.mass, mechanism.robot.gravity))
        first = last
    return seen


def _remake(
    robot: Robot, effects: tuple[Effect, ...], theta: tuple[float, ...], native: bool, springs: bool, quiet: bool
) -> Mechanism:
    return Mechanism(robot, effects, theta, native=native, springs=springs, quiet=quiet)


def structure_expression(cables: Sequence[CableExpressions]) -> ca.SX:
    """Ξ (n × 6) as an expression (Eq. 3)."""
    return ca.horzcat(*(cable.screw for cable in cables)).T


def structure_rate_expression(structure: ca.SX, position: ca.SX, rotation: ca.SX, twist: ca.SX) -> ca.SX:
    """Ξ̇ (n × 6) as an expression; position and rotation must be the symbols that `structure` is made of."""
    at = ca.vertcat(position, ca.vec(rotation))
    rate = ca.vertcat(twist[:3], ca.vec(skew(twist[3:]) @ rotation))
    return ca.reshape(ca.jtimes(ca.vec(structure), at, rate), structure.size1(), 6)


def _compile(mechanism: Mechanism, name: str) -> ca.Function:
    position, flat = ca.SX.sym("position", 3), ca.SX.sym("rotation", 9)
    theta = ca.SX.sym("theta", mechanism.theta.size)
    rotation = from_rows(flat, 3, 3)
    cables = mechanism.cables_at(position, rotation, theta)
    inputs = [position, flat]
    match name:
        case "lengths":
            output = mechanism.lengths_at(cables, theta)
        case "structure matrix":
            output = rows(structure_expression(cables))
        case "structure matrix rate":
            twist = ca.SX.sym("twist", 6)
            inputs.append(twist)
            output = rows(structure_rate_expression(structure_expression(cables), position, rotation, twist))
        case "swivel angles":
            output = ca.vertcat(*(cable.swivel_angle for cable in cables))
        case "wrap angles":
            output = ca.vertcat(*(cable.wrap_angle for cable in cables))
        case _:
            raise OurBugError(f"Mechanism: no quantity is called {name!r}.")
    distances = ca.vertcat(*(cable.axis_distance for cable in cables))
    clearances = ca.vertcat(*(cable.clearance for cable in cables))
    return function(name.replace(" ", "_"), [*inputs, theta], [output, distances, clearances])


def _refuse_singular(distances: np.ndarray, clearances: np.ndarray) -> None:
    on_axis = distances <= SINGULAR_DISTANCE
    inside = clearances <= SINGULAR_DISTANCE**2
    if not (on_axis.any() or inside.any()):
        return
    sample, cable = (int(index) for index in np.argwhere(on_axis | inside)[0])
    why = (
        "its attachment lies inside the pulley (L ≤ r)"
        if inside[sample, cable]
        else f"its attachment lies on the swivel axis (h = {distances[sample, cable]:.1e} m)"
    )
    raise InfeasibleError(
        f"Cable {cable + 1} is singular at sample {sample + 1} of {len(distances)}: {why}.",
        hint="Choose a pose farther from that pulley, or check d, a and radius in the robot file.",
    )
