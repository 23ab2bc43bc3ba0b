"""First-order response of windows to a wrench with any time course.

With n cables only λ = 6 − n directions of acceleration are free, so the course of any wrench along a known motion is λ
functions of time. Each is a sum of cubic B-splines; the answer of a window's markers to every one of these bumps, its
own unknowns projected out, is one table (`WindowResponse`). Weighing a candidate is then a small matrix product.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from jaxtyping import Float
from scipy.interpolate import BSpline

from fidim_lab.errors import OurBugError
from fidim_lab.identification.mle.trajectories.likelihood import LOOSE_POSE, LOOSE_RATE, Likelihood, Simulation
from fidim_lab.mismatch.unknown_force.thresholds import UNKNOWN_FORCE
from fidim_lab.model.batch import over_samples
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion.forcing import forcing
from fidim_lab.model.sensitivity import markers
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.model.sensitivity.integrate import Trajectories
from fidim_lab.model.sensitivity.variation import variations
from fidim_lab.model.slots import Effect, PlatformState


@dataclass(frozen=True)
class UnitWrench(Effect):
    """A steady wrench [force; torque about P] on the platform: θ is its six components, N and N m."""

    @property
    def parameters(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Its components."""
        return ("fx", "fy", "fz", "tx", "ty", "tz")

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """θ itself."""
        return theta


@dataclass(frozen=True, eq=False)
class Along:
    """The motion of one window at the nodes of its grid, and how a wrench accelerates it there."""

    window: str
    t: Float[np.ndarray, " N"]
    """s on the window's own clock"""
    positions: Float[np.ndarray, "N 3"]
    rotations: Float[np.ndarray, "N 3 3"]
    twists: Float[np.ndarray, "N 6"]
    free: Float[np.ndarray, "N free 6"]
    """acceleration in each free direction for each unit of wrench, 1/kg and 1/(kg m)"""


@dataclass(frozen=True, eq=False)
class WindowResponse:
    """One window's sums of squares by shared parameters and bumps, its own unknowns chosen best."""

    along: Along
    project: Float[np.ndarray, "J S"]
    """coefficients of the bumps from values at every second node"""
    gram: Float[np.ndarray, "K K"]
    """of [shared, bumps (J · free), residual]; residual is predicted − recorded over the noise"""
    count: int
    """numbers recorded, less the window's own unknowns"""


@dataclass(frozen=True, eq=False)
class Responses:
    """All windows side by side: shorter ones are filled up with zeros. S: every second node is enough for a course."""

    windows: tuple[WindowResponse, ...]
    sample: tuple[np.ndarray, ...]
    """t (W S 1), positions (W S 3), rotations (W S 3 3), twists (W S 6)"""
    free: Float[np.ndarray, "W S free 6"]
    project: Float[np.ndarray, "W J S"]
    gram: Float[np.ndarray, "W m m"]
    """of [shared, bumps (J · free), residual]"""
    shared: int

    @staticmethod
    def of(windows: Sequence[WindowResponse], shared: int) -> "Responses":
        """Put together what `responses` found; `shared`: number of shared parameters."""
        along = [one.along for one in windows]
        count, most = (max(one.project.shape[k] for one in windows) for k in (1, 0))
        free = along[0].free.shape[1]
        size = shared + most * free + 1
        gram = np.zeros((len(windows), size, size))
        project = np.zeros((len(windows), most, count))
        for w, one in enumerate(windows):
            place = np.r_[0 : one.gram.shape[0] - 1, size - 1]
            gram[w][np.ix_(place, place)] = one.gram
            project[w, : one.project.shape[0], : one.project.shape[1]] = one.project

        def filled(parts: Sequence[np.ndarray]) -> np.ndarray:
            return np.stack([np.concatenate([x, np.repeat(x[-1:], count - len(x), axis=0)]) for x in parts])

        thin = np.s_[:: UNKNOWN_FORCE.responses_thin]
        sample = (
            filled([one.t[thin, np.newaxis] for one in along]),
            filled([one.positions[thin] for one in along]),
            filled([one.rotations[thin] for one in along]),
            filled([one.twists[thin] for one in along]),
        )
        return Responses(tuple(windows), sample, filled([one.free[thin] for one in along]), project, gram, shared)

    def coefficients(self, wrenches: Float[np.ndarray, "W S 6 d"], features: Float[np.ndarray, "W S k"]) -> np.ndarray:
        """(W, J · free, d · k): the bumps that make up each product of a wrench and a feature along the motions."""
        pushed = self.free @ wrenches
        courses = pushed[..., np.newaxis] * features[..., np.newaxis, np.newaxis, :]
        count, nodes, free = courses.shape[:3]
        found = self.project @ courses.reshape(count, nodes, -1)
        return found.reshape(count, self.project.shape[1] * free, -1)


def responses(likelihood: Likelihood, simulation: Simulation) -> Responses:
    """The answers of all windows at a simulated point, in the order of the recordings. Raises OurBugError for none."""
    mechanism = likelihood.mechanism
    pushed = Mechanism(
        mechanism.robot, (*mechanism.effects, UnitWrench()), [*mechanism.theta.tolist(), *np.zeros(6).tolist()]
    )
    found: dict[int, WindowResponse] = {}
    for batch in simulation.batches:
        for place, w in enumerate(batch.members):
            one = batch.trajectories.only(place)
            found[int(w)] = _window(likelihood, simulation, int(w), one, pushed)
    if not found:
        raise OurBugError("The answer to a wrench needs at least one simulated window.")
    return Responses.of([found[w] for w in sorted(found)], len(simulation.point.shared))


def splines(t: Float[np.ndarray, " N"], spacing: float = UNKNOWN_FORCE.responses_spacing) -> Float[np.ndarray, "N J"]:
    """Cubic B-splines over the times (s), about `spacing` apart."""
    pieces = max(1, round(float(t[-1] - t[0]) / spacing))
    inner = np.linspace(t[0], t[-1], pieces + 1)
    knots = np.concatenate([np.full(3, t[0]), inner, np.full(3, t[-1])])
    return np.asarray(BSpline.design_matrix(t, knots, 3).toarray())


def _window(
    likelihood: Likelihood, simulation: Simulation, w: int, one: Trajectories, pushed: Mechanism
) -> WindowResponse:
    recording, own, shared = likelihood.recordings[w], likelihood.own, simulation.point.shared
    one = _until(one, float(simulation.ends[w]))
    along, directions = _along(recording.window.id, pushed, one, shared, likelihood.mechanism.freedoms)
    bumps = splines(along.t)
    courses = np.einsum("nj,nif->nijf", bumps, directions).reshape(len(along.t), 6, -1)
    first = own + len(shared)
    starts = np.zeros((1, 12, first + courses.shape[2]))
    starts[0, :, :first] = simulation.starts.states_by[w]
    by = variations(likelihood.mechanism, one, shared, starts, courses[np.newaxis])
    places = likelihood.mechanism.robot.markers[: recording.markers.shape[1]]
    use, seen = recording.seen_until(float(simulation.ends[w]))
    residual, known = simulation.residuals[w], np.isfinite(recording.lengths)
    jacobian = np.zeros((len(residual.rows), starts.shape[2]))
    by_markers = markers.varied_at(one, by, places, recording.t[use])[seen]
    jacobian[: len(residual.markers)] = likelihood.whitened(w, by_markers, seen)
    jacobian[len(residual.markers) : -own, :first] = simulation.starts.lengths_by[w][known] / likelihood.resolution
    jacobian[-own:, :own] = np.diag(1 / np.r_[np.full(6, LOOSE_POSE), np.full(own - 6, LOOSE_RATE)])
    basis = np.linalg.qr(jacobian[:, :own])[0]
    rest = np.column_stack([jacobian[:, own:], residual.rows])
    rest -= basis @ (basis.T @ rest)
    return WindowResponse(
        along, np.linalg.pinv(bumps[:: UNKNOWN_FORCE.responses_thin]), rest.T @ rest, len(residual.rows) - own
    )


def _until(one: Trajectories, end: float) -> Trajectories:
    """The trajectory as far as the window is used: whole blocks."""
    k = one.grid.resolution.intervals
    grid = one.grid.covering(min(end, one.grid.blocks * one.grid.resolution.block), one.grid.resolution)
    nodes = grid.blocks * k + 1
    parts = (one.positions, one.rotations, one.twists, one.accelerations, one.tensions)
    return Trajectories(grid, one.begins, *(part[:, :nodes] for part in parts), body_changes=one.body_changes)


def _along(
    window: str, pushed: Mechanism, one: Trajectories, shared: np.ndarray, freedoms: int
) -> tuple[Along, Float[np.ndarray, "N 6 free"]]:
    """The motion with its free directions of acceleration, turning as little as they can from node to node."""
    t = one.begins[0] + one.grid.t
    count = len(pushed.theta)
    absent = tuple(range(count - 6, count))
    theta = np.concatenate([shared[BODY:], np.zeros(6)])
    sample = (one.positions[0], one.rotations[0], one.twists[0], np.zeros((len(t), 0)))
    found = over_samples(forcing(pushed, absent), len(t), t[:, np.newaxis], *sample, shared[:BODY], theta)[0]
    by_wrench = found.reshape(len(t), 6 + pushed.n, -1)[:, :6, -6:]
    directions = np.linalg.svd(by_wrench)[0][..., :freedoms]
    for k in range(1, len(t)):
        left, _, right = np.linalg.svd(directions[k].T @ directions[k - 1])
        directions[k] = directions[k] @ (left @ right)
    free = np.swapaxes(directions, 1, 2) @ by_wrench
    return Along(window, t, one.positions[0], one.rotations[0], one.twists[0], free), directions
