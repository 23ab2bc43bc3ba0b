"""Registration of a marker cluster: cluster → body and motion-capture world → robot world, with locked motors.

With locked motors every cable keeps its length, whatever the platform does: the transforms that make the lengths of
all poses most nearly constant are the registration. Twelve numbers, no touching, no calibration wand; the encoders'
zeros stay unknown. `register` finds every arrangement that fits about equally well, for a robot that looks the same
from several sides fits from several sides: which is right must be judged by other signals (swivel angles, load cells).
`refine` repeats the fit of the right one together with the cables' stretch.

The twelve numbers: world translation and rotation vector, body translation and rotation vector. Their derivatives come
from l̇ = Ξ v (Eq. 3). Attachments and pulleys are held fixed: they are the gauge in which the transforms are expressed.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from fidim_lab.arrays import CableSeries, Matrix3, PerCable, Positions, Rotations, Vector3, skew
from fidim_lab.errors import InfeasibleError, RefusedError
from fidim_lab.model.mechanism import Mechanism

QUARTERS = (0.0, 0.5 * np.pi, np.pi, 1.5 * np.pi)
ALIKE = 1.25
"""times the best misfit: arrangements up to here are judged by more than their misfit"""
SAME_ROTATION = 0.05
"""rad; two fits closer than this are one"""
MOST_TILT = np.radians(15.0)
"""both worlds were levelled; lengths that are not constant are fitted best by cables that run away to infinity"""
HOPELESS = 0.005
"""m rms of length: geometry and markers do not belong together"""
FIT_POSES, START_POSES = 1200, 250
START_STEPS, FIT_STEPS = 60, 400
"""function evaluations of a fit; 10 to 30 do where the platform was moved well"""
FEWEST = 100
"""poses, 1 s at 100 Hz; fewer cannot hold twelve numbers"""


@dataclass(frozen=True, eq=False)
class Transform:
    """x ↦ rotation x + translation (m)."""

    rotation: Matrix3
    translation: Vector3

    def points(self, points: np.ndarray) -> np.ndarray:
        """Apply to (…, 3) points."""
        return points @ self.rotation.T + self.translation


@dataclass(frozen=True, eq=False)
class Registration:
    """The two transforms, and how well they make the lengths constant."""

    world: Transform
    """motion-capture world → robot world"""
    body: Transform
    """marker cluster → body frame"""
    lengths: PerCable
    """m, mean length of each cable by kinematics: what the encoders' zeros are set to"""
    rms: float
    """m, misfit of one length"""
    rms_per_cable: PerCable
    compliance: float = 0.0
    """m/N, stretch of a cable for tension, where load cells were part of the fit"""

    @property
    def tilt(self) -> float:
        """Angle between the two worlds' verticals, rad."""
        return float(np.arccos(np.clip(self.world.rotation[2, 2], -1.0, 1.0)))

    @property
    def yaw(self) -> float:
        """Rotation from motion-capture to robot world about the vertical, rad in (−π, π]."""
        return float(np.arctan2(self.world.rotation[1, 0], self.world.rotation[0, 0]))

    def poses(self, positions: Positions, rotations: Rotations) -> tuple[Positions, Rotations]:
        """Body poses in the robot world from cluster poses in the motion-capture world."""
        turned = rotations @ self.body.rotation.T
        return self.world.points(positions - turned @ self.body.translation), self.world.rotation @ turned


def register(mechanism: Mechanism, positions: Positions, rotations: Rotations) -> tuple[Registration, ...]:
    """All arrangements that keep the lengths about equally constant, the best first.

    Args:
        mechanism: the robot's geometry.
        positions: (N, 3) of the cluster's origin in the motion-capture world, m; rows of NaN are left out.
        rotations: (N, 3, 3) cluster → motion-capture world.

    Raises RefusedError where none fits: too little motion, wrong geometry, or motors that were not locked.
    """
    known = np.all(np.isfinite(positions), axis=1)
    positions, rotations = positions[known], rotations[known]
    few, many = _spread(len(positions), START_POSES), _spread(len(positions), FIT_POSES)
    starts = _starts(mechanism, positions)
    fits = (_fit(mechanism, positions[few], rotations[few], start, steps=START_STEPS) for start in starts)
    rough = [fit for fit in _distinct(fits) if fit.tilt < MOST_TILT]
    best = min((fit.rms for fit in rough), default=np.inf)
    if best > HOPELESS:
        raise RefusedError(
            "No placing of the markers with the two worlds' verticals within "
            f"{np.degrees(MOST_TILT):.0f}° keeps the cable lengths constant: {best * 1e3:.1f} mm rms at best.",
            hint="Check that the motors were locked and that the geometry file is this robot's.",
        )
    fits = (
        _fit(mechanism, positions[many], rotations[many], _parameters(fit)) for fit in rough if fit.rms <= ALIKE * best
    )
    return _distinct(fits)


def register_frame(
    mechanism: Mechanism, positions: Positions, rotations: Rotations, *, body: bool = False
) -> Registration | None:
    """The best arrangement of one frame alone: of the motion-capture world, or of the cluster on the body.

    Six numbers, which a single window determines where it leaves the twelve of `register` open; the other transform is
    none. Arguments as there. None where there are fewer than `FEWEST` poses, or no start leads anywhere.
    """
    known = np.flatnonzero(np.all(np.isfinite(positions), axis=1))
    if len(known) < FEWEST:
        return None
    rows = known[_spread(len(known), START_POSES)]
    problem = _LengthProblem(mechanism, positions[rows], rotations[rows], None)
    free = slice(6, 12) if body else slice(0, 6)

    def whole(numbers: np.ndarray) -> np.ndarray:
        return np.concatenate([np.zeros(6), numbers] if body else [numbers, np.zeros(6)])

    turned = [np.concatenate([np.zeros(11), [yaw]]) for yaw in QUARTERS]
    starts = turned if body else _starts(mechanism, positions[rows])[:: len(QUARTERS)]
    found: list[Registration] = []
    for start in starts:
        try:
            answer = least_squares(
                lambda numbers: problem.residual(whole(numbers)),
                start[free],
                jac=lambda numbers: problem.jacobian(whole(numbers))[:, free],
                method="lm",
                max_nfev=FIT_STEPS,
            )
        except InfeasibleError:
            continue
        found.append(_registration(problem, whole(answer.x)))
    return min(found, key=lambda one: one.rms, default=None)


def refine(
    mechanism: Mechanism,
    start: Registration,
    positions: Positions,
    rotations: Rotations,
    tensions: CableSeries,
    *,
    stretch: bool = True,
) -> Registration:
    """The same arrangement once more, with one compliance for all cables fitted along unless `stretch` is false.

    `tensions` (N, n) in N at the instants of the poses. Rows with NaN in anything or with a slack cable are left out,
    with and without stretch, so that the two misfits compare. The compliance is signed: a negative one speaks against
    the arrangement. Raises RefusedError where too few rows are left.
    """
    known = np.all(np.isfinite(np.column_stack([positions, tensions])), axis=1) & np.all(tensions > 0.0, axis=1)
    if known.sum() < FEWEST:
        raise RefusedError(
            f"{int(known.sum())} samples have a pose and only taut cables at once; a registration needs {FEWEST}.",
            hint="Do motion capture and robot log overlap?",
        )
    rows = np.flatnonzero(known)[_spread(int(known.sum()), FIT_POSES)]
    about = tensions[rows] - tensions[rows].mean(axis=0) if stretch else None
    fit = _fit(mechanism, positions[rows], rotations[rows], _parameters(start), about)
    return start if fit is None else fit


def _starts(mechanism: Mechanism, positions: Positions) -> list[np.ndarray]:
    """World and cluster turned by quarters about the vertical, the platform below the middle of the pulleys."""
    cables = mechanism.robot.cables
    middle = np.mean([cable.d for cable in cables], axis=0)
    halfway = 0.5 * np.mean([cable.a for cable in cables], axis=0)
    starts: list[np.ndarray] = []
    for world_yaw, body_yaw in product(QUARTERS, QUARTERS):
        shift = middle - Rotation.from_rotvec([0.0, 0.0, world_yaw]).apply(positions.mean(axis=0))
        shift[2] = 0.0  # both worlds usually stand on the floor
        starts.append(np.concatenate([shift, [0.0, 0.0, world_yaw], halfway, [0.0, 0.0, body_yaw]]))
    return starts


def _fit(
    mechanism: Mechanism,
    positions: Positions,
    rotations: Rotations,
    start: np.ndarray,
    tensions: CableSeries | None = None,
    *,
    steps: int = FIT_STEPS,
) -> Registration | None:
    """Least squares from one start; None where it leads to a pose without a model."""
    problem = _LengthProblem(mechanism, positions, rotations, tensions)
    try:
        answer = least_squares(problem.residual, start, jac=problem.jacobian, method="lm", max_nfev=steps)
    except InfeasibleError:
        return None
    return _registration(problem, answer.x)


def _registration(problem: "_LengthProblem", parameters: np.ndarray) -> Registration:
    remaining = problem.residual(parameters).reshape(-1, problem.mechanism.n)
    lengths = problem.lengths(parameters)
    world, body = _transforms(parameters)
    return Registration(
        world=world,
        body=body,
        lengths=lengths.mean(axis=0),
        rms=float(np.sqrt(np.mean(remaining**2))),
        rms_per_cable=np.sqrt(np.mean(remaining**2, axis=0)),
        compliance=problem.compliance(lengths),
    )


@dataclass(frozen=True, eq=False)
class _LengthProblem:
    """Lengths without their mean, and without the stretch that fits best, as a function of the twelve numbers.

    Mean and stretch enter linearly, so they are projected out (Golub & Pereyra 1973) instead of being unknowns.
    """

    mechanism: Mechanism
    positions: Positions
    rotations: Rotations
    tensions: CableSeries | None
    """about their mean, N"""

    def lengths(self, parameters: np.ndarray) -> CableSeries:
        return self.mechanism.lengths(*self._poses(parameters))

    def residual(self, parameters: np.ndarray) -> np.ndarray:
        return self._remaining(self.lengths(parameters)).ravel()

    def jacobian(self, parameters: np.ndarray) -> np.ndarray:
        """∂ residual/∂ parameters: Ξ times the twist that each of them gives the platform."""
        placed_positions, placed = self._poses(parameters)
        world, body = _transforms(parameters)
        twists = np.zeros((len(placed), 6, 12))
        twists[:, :3, :3] = np.eye(3)
        turn = _left_jacobian(parameters[3:6])
        twists[:, :3, 3:6] = -skew(placed_positions - world.translation) @ turn
        twists[:, 3:, 3:6] = turn
        twists[:, :3, 6:9] = -placed
        turn = placed @ _left_jacobian(parameters[9:12])
        twists[:, :3, 9:] = -placed @ skew(body.translation[None]) @ _left_jacobian(parameters[9:12])
        twists[:, 3:, 9:] = -turn
        columns = self.mechanism.structure_matrix(placed_positions, placed) @ twists
        return np.stack([self._remaining(column).ravel() for column in np.moveaxis(columns, 2, 0)], axis=1)

    def compliance(self, lengths: CableSeries) -> float:
        """m/N"""
        if self.tensions is None:
            return 0.0
        return float((lengths * self.tensions).sum() / (self.tensions**2).sum())

    def _remaining(self, lengths: CableSeries) -> CableSeries:
        about = lengths - lengths.mean(axis=0)
        return about if self.tensions is None else about - self.compliance(about) * self.tensions

    def _poses(self, parameters: np.ndarray) -> tuple[Positions, Rotations]:
        world, body = _transforms(parameters)
        return Registration(world, body, np.empty(0), 0.0, np.empty(0)).poses(self.positions, self.rotations)


def _transforms(parameters: np.ndarray) -> tuple[Transform, Transform]:
    turns = Rotation.from_rotvec(parameters[[[3, 4, 5], [9, 10, 11]]]).as_matrix()
    return Transform(turns[0], parameters[:3]), Transform(turns[1], parameters[6:9])


def _parameters(registration: Registration) -> np.ndarray:
    world, body = registration.world, registration.body
    turns = Rotation.from_matrix(np.array([world.rotation, body.rotation])).as_rotvec()
    return np.concatenate([world.translation, turns[0], body.translation, turns[1]])


def _distinct(fits: Iterable[Registration | None]) -> tuple[Registration, ...]:
    """Without the failed ones and without a second of the same rotations; the best first."""
    kept: list[Registration] = []
    for fit in sorted((fit for fit in fits if fit is not None), key=lambda fit: fit.rms):
        if not any(_same(fit, other) for other in kept):
            kept.append(fit)
    return tuple(kept)


def _same(one: Registration, other: Registration) -> bool:
    return all(
        float(Rotation.from_matrix(a.T @ b).magnitude()) < SAME_ROTATION
        for a, b in ((one.world.rotation, other.world.rotation), (one.body.rotation, other.body.rotation))
    )


def _left_jacobian(turn: Vector3) -> Matrix3:
    """J with exp(w + dw) = exp(J dw) exp(w) for a rotation vector w (Chirikjian, Stochastic Models 2, §10.8.5)."""
    angle = float(np.linalg.norm(turn))
    cross = skew(turn[None])[0]
    if angle < 1e-6:
        return np.eye(3) + 0.5 * cross
    return np.eye(3) + (1.0 - np.cos(angle)) / angle**2 * cross + (angle - np.sin(angle)) / angle**3 * cross @ cross


def _spread(count: int, wanted: int) -> np.ndarray:
    """At most `wanted` indices spread evenly over `count`."""
    return np.unique(np.linspace(0, count - 1, min(count, wanted)).astype(int))
