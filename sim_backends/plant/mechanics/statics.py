"""Rest: the pose and tensions at which the platform hangs, alone or pulled aside by a hand.

First the potential energy is minimised with soft cables that only pull, which finds a *stable* rest from a rough guess;
then Newton's method on forces, moments and lengths makes it exact, with every hidden effect that acts at rest.
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import least_squares, minimize

from fidim_lab.arrays import PerCable, Vector3
from fidim_lab.data.records import Pose
from fidim_lab.errors import InfeasibleError
from sim_backends.plant.mechanics.dynamics import (
    generalised,
    gripped,
    inverse_of,
    mass_and_force,
    pulling,
    row_of,
    stretch_of,
)
from sim_backends.plant.mechanics.kinematics import HAND_SIZE, coordinates_of, platform, pose_of, size
from sim_backends.plant.mechanics.posts import on_bent_posts
from sim_backends.plant.mechanics.terms import hand_push
from sim_backends.plant.world import World

SOFT = (3e3, 3e4, 3e5)
"""N/m, stiffness of the soft cables, one after the other"""
HAND_STIFFNESS = 1e6
"""N/m, with which a hand holds the marker aside: some tens of µm of error at 20 N"""
MOST_NEWTON = 60
CLOSED = 1e-9
"""N, N m, m: residual of a pose at rest"""
LENGTH_WEIGHTS = (1.0, 1e4)
"""N/m: what a metre of cable counts against a newton when a Newton step is judged, tried one after the other. Near
singular poses the first refuses to correct a millimetre for the newton that it brings out of balance, and creeps"""
AHEAD = 0.02
"""m, by which a hand's target moves between two Newton solutions"""
SMALLEST_PART = 0.01
"""of a displacement: where even that much finds no rest, the cables do not allow it"""


@dataclass(frozen=True, eq=False)
class Rest:
    """The platform at rest."""

    coordinates: np.ndarray
    """(7,) position of G and quaternion"""
    tensions: PerCable
    """N, all positive"""
    marker: Vector3
    """the main marker, world frame, m"""
    pose: Pose
    """of P"""


class Statics:
    """Finds poses at rest in one world (compiled once).

    t: of the session, s, settable: when it is that the platform rests.
    """

    def __init__(self, world: World) -> None:
        self.t = 0.0
        self._world = world
        z, tension, lengths = ca.SX.sym("z", 7), ca.SX.sym("tension", world.n), ca.SX.sym("lengths", world.n)
        hand, stiffness, t = ca.SX.sym("hand", HAND_SIZE), ca.SX.sym("stiffness"), ca.SX.sym("t")
        residual = _residual(world, z, tension, lengths, hand, t)
        unknown = ca.vertcat(z, tension)
        self._newton = ca.Function(
            "newton", [unknown, lengths, hand, t], [residual, ca.densify(ca.jacobian(residual, unknown))]
        )
        soft = _soft_energy(world, z, lengths, stiffness)
        self._soft = ca.Function("soft", [z, lengths, stiffness], [soft, ca.gradient(soft, z), ca.hessian(soft, z)[0]])

    def rest(self, lengths: PerCable, near: Pose | None = None) -> Rest:
        """Where the platform hangs with cables of these true lengths (m), near a pose (default: below the pulleys).

        Raises:
            InfeasibleError: no rest with all cables taut was found.
        """
        z = self._hang(lengths, near)
        guess = np.concatenate([z, self._soft_tensions(z, lengths)])
        solution = self._solve(guess, lengths, np.zeros(HAND_SIZE))
        return self._checked(solution, lengths)

    def held_aside(self, rest: Rest, lengths: PerCable, displacement: np.ndarray) -> Rest:
        """Where the platform rests when a hand holds its main marker `displacement` (x, y; m) away from `rest`.

        With fewer than two freedoms, as near as the cables allow. The tensions are those at which it is let go.

        Raises:
            InfeasibleError: no such pose with all cables taut was found.
        """
        unknown = np.concatenate([rest.coordinates, rest.tensions])
        hand = np.zeros(HAND_SIZE)
        hand[3:5] = HAND_STIFFNESS
        part, step = 0.0, 1.0 / max(1.0, np.ceil(np.linalg.norm(displacement) / AHEAD))
        while part < 1.0:
            hand[0:2] = rest.marker[:2] + min(part + step, 1.0) * displacement
            try:
                unknown, part = self._solve(unknown, lengths, hand), part + step
            except InfeasibleError:
                step /= 2
                if step < SMALLEST_PART:
                    raise
        return self._checked(unknown, lengths)

    def _hang(self, lengths: PerCable, near: Pose | None) -> np.ndarray:
        """Minimum of the energy with soft cables, stiffer and stiffer."""
        world = self._world
        if near is None:
            down = world.gravity / np.linalg.norm(world.gravity)
            below = world.middle - np.mean([cable.a for cable in world.cables], axis=0)
            near = Pose(position=below + down * 0.5 * float(np.min(lengths)), rotation=np.eye(3))
        z = coordinates_of(world, near)
        for stiffness in SOFT:
            z = self._softly(z, lengths, stiffness)
        return z

    def _softly(self, z: np.ndarray, lengths: PerCable, stiffness: float) -> np.ndarray:
        def energy(z: np.ndarray) -> float:
            return float(self._soft(z, lengths, stiffness)[0])

        def gradient(z: np.ndarray) -> np.ndarray:
            return self._soft(z, lengths, stiffness)[1].full().ravel()

        def curvature(z: np.ndarray) -> np.ndarray:
            return self._soft(z, lengths, stiffness)[2].full()

        options: Any = {"maxiter": 300, "gtol": 1e-3, "initial_trust_radius": 0.1, "max_trust_radius": 0.5}
        found = minimize(energy, z, jac=gradient, hess=curvature, method="trust-exact", options=options)
        found.x[3:7] /= np.linalg.norm(found.x[3:7])
        return found.x

    def _soft_tensions(self, z: np.ndarray, lengths: PerCable) -> PerCable:
        """What the stiffest of the soft cables pull with."""
        beyond = self._newton(np.concatenate([z, np.zeros_like(lengths)]), lengths, np.zeros(HAND_SIZE), self.t)[
            0
        ].full()
        return SOFT[-1] * np.maximum(beyond.ravel()[6 : 6 + len(lengths)], 0.0)

    def _solve(self, unknown: np.ndarray, lengths: PerCable, hand: np.ndarray) -> np.ndarray:
        """Newton's method with halved steps; least squares where a force at rest is not determined."""
        missed = np.inf
        for weight in LENGTH_WEIGHTS:
            found, missed = self._newtons(unknown, lengths, hand, weight)
            if missed < 1e3 * CLOSED:
                return found
        found, missed = self._damped(unknown, lengths, hand)
        if missed < 1e3 * CLOSED:
            return found
        raise InfeasibleError(
            f"The simulated platform finds no rest at cable lengths {_shown(lengths)} m (residual {missed:.2g} N)."
        )

    def _damped(self, unknown: np.ndarray, lengths: PerCable, hand: np.ndarray) -> tuple[np.ndarray, float]:
        """Levenberg–Marquardt from the same guess: on one cable yaw hardly matters, and Newton steps in it are huge.

        An answer that hangs on a pushing cable is none: it has jumped to another pose.
        """

        def residual(z: np.ndarray) -> np.ndarray:
            return self._newton(z, lengths, hand, self.t)[0].full().ravel()

        def jacobian(z: np.ndarray) -> np.ndarray:
            return self._newton(z, lengths, hand, self.t)[1].full()

        found = least_squares(residual, unknown, jacobian, method="lm", xtol=1e-14, ftol=1e-14, gtol=1e-14)
        return found.x, float(np.linalg.norm(found.fun)) if found.x[7:].min() > 0 else np.inf

    def _newtons(
        self, unknown: np.ndarray, lengths: PerCable, hand: np.ndarray, length_weight: float
    ) -> tuple[np.ndarray, float]:
        """The last point that Newton's method reaches, and the size of the residual tried last."""
        residual, jacobian = (part.full() for part in self._newton(unknown, lengths, hand, self.t))
        weights = np.ones_like(residual)
        weights[6 : 6 + len(lengths)] = length_weight
        for _ in range(MOST_NEWTON):
            if np.linalg.norm(residual) < CLOSED:
                break
            before = np.linalg.norm(weights * residual)
            step = np.linalg.lstsq(jacobian, -residual.ravel(), rcond=1e-13)[0]
            for shorter in (1.0, 0.5, 0.25, 0.1, 0.02):
                trial = unknown + shorter * step
                residual, jacobian = (part.full() for part in self._newton(trial, lengths, hand, self.t))
                if np.linalg.norm(weights * residual) < before:
                    break
            else:
                break
            unknown = trial
        return unknown, float(np.linalg.norm(residual))

    def _checked(self, unknown: np.ndarray, lengths: PerCable) -> Rest:
        tensions = unknown[7:]
        if np.min(tensions) <= 0:
            i = int(np.argmin(tensions))
            raise InfeasibleError(
                f"At cable lengths {_shown(lengths)} m the simulated platform does not hang on all its cables: "
                f"cable {i + 1} would have to push with {-tensions[i]:.1f} N.",
                hint="Choose lengths whose rest has every cable taut.",
            )
        x = np.zeros(size(self._world))
        x[:7] = unknown[:7]
        pose = pose_of(self._world, x)
        marker = pose.position + pose.rotation @ self._world.markers[0]
        return Rest(coordinates=unknown[:7].copy(), tensions=tensions.copy(), marker=marker, pose=pose)


def _residual(world: World, z: ca.SX, tension: ca.SX, lengths: ca.SX, hand: ca.SX, t: ca.SX) -> ca.SX:
    """Force (N) and moment (N m) about G, lengths (m) with stretch, and the quaternion's length."""
    body = platform(world, _still(world, z), ca.vertcat(t, ca.SX.zeros(2)), still=True)
    mass, force = mass_and_force(body)
    jacobian = ca.vertcat(*(row_of(body, i) for i in range(world.n)))
    push = generalised(body, hand_push(body, hand))
    balance = force + gripped(inverse_of(world, mass), jacobian, push) - pulling(on_bent_posts(body, tension)) @ tension
    gaps: list[ca.SX] = []
    for i, end in enumerate(body.cables):
        stretch = stretch_of(world, i, end.tangent)
        given_way = ca.SX(0) if stretch.stiffness is None else tension[i] / stretch.stiffness
        gaps.append(end.tangent.length - lengths[i] - given_way)
    return ca.vertcat(balance, *gaps, ca.dot(z[3:7], z[3:7]) - 1)


def _soft_energy(world: World, z: ca.SX, lengths: ca.SX, stiffness: ca.SX) -> ca.SX:
    body = platform(world, _still(world, z), ca.SX.zeros(3), still=True)
    total = -world.mass * ca.dot(ca.DM(world.gravity), body.centre)
    for i, end in enumerate(body.cables):
        total += stiffness * ca.fmax(end.tangent.length - lengths[i], 0) ** 2 / 2
    return total + 10.0 * (ca.dot(z[3:7], z[3:7]) - 1) ** 2


def _still(world: World, z: ca.SX) -> ca.SX:
    return ca.vertcat(z, ca.SX.zeros(size(world) - 7))


def _shown(lengths: PerCable) -> str:
    return ", ".join(f"{length:.4f}" for length in lengths)
