"""The place of the capture frame, of the markers on the body, and the encoders' zeros.

One least squares over poses of many instants: markers say where the platform is in the capture frame, held lengths
say it in the robot frame. The poses are eliminated (Schur complement), so that many cost little. What is free is chosen
(`Free`); everything free has a prior, wide where nothing is known, so that what the recordings do not show stays put
and is told by its standard deviation.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from fidim_lab.arrays import Matrix3, PerCable, Positions, Rotations, Vector3
from fidim_lab.data.records import Robot
from fidim_lab.errors import RefusedError
from fidim_lab.identification.data_checks.poses import PoseSamples, fit_poses
from fidim_lab.identification.motion import surface
from fidim_lab.model.mechanism import Mechanism

WIDE = 10.0
"""m and rad: the prior of what nothing is known about"""
UPRIGHT = 0.25
"""rad that a platform may lean; only lengths and markers that leave a rotation open let this count"""
STEPS = 60
LONGEST = 0.3
"""m or rad in one step"""
SETTLED = 1e-9
"""m and rad"""


@dataclass(frozen=True)
class Free:
    """What is fitted beside the poses."""

    frame: bool = False
    markers: bool = False
    """each marker by itself"""
    zeros: bool = False
    """one constant for each encoder"""
    anchor: int | None = None
    """of this cable (0-based), to first order"""

    @property
    def says(self) -> str:
        """For people."""
        names = ("frame", "markers", "zeros")
        return ", ".join(name for name in names if getattr(self, name)) or "nothing"


@dataclass(frozen=True, eq=False)
class Placement:
    """Capture frame → robot frame (x ↦ turn x + shift), markers on the body, and the offset of each encoder."""

    turn: Matrix3
    shift: Vector3
    body: Float[np.ndarray, "M 3"]
    zeros: PerCable
    anchor: Vector3 = field(default_factory=lambda: np.zeros(3))
    """m, of the cable that `Free` names"""

    @staticmethod
    def of(robot: Robot, markers: int) -> "Placement":
        """As the robot file has it."""
        return Placement(np.eye(3), np.zeros(3), robot.markers[:markers], np.zeros(robot.n))


@dataclass(frozen=True, eq=False)
class WindowPlacement:
    """The answer."""

    placement: Placement
    positions: Positions
    rotations: Rotations
    """of the poses"""
    sd_turn: Vector3
    """rad, about the robot's axes"""
    sd_shift: Vector3
    sd_body: Float[np.ndarray, "M 3"]
    sd_zeros: PerCable
    markers: Float[np.ndarray, "S M 3"]
    """m, measured − modelled, in the robot frame"""
    lengths: Float[np.ndarray, "S n"]
    """m, the same"""
    chi2: float
    unknowns: int
    """beside the poses"""
    chi2_per_dof: float
    """of markers and lengths; the standard deviations are multiplied by its root where it is above 1"""

    @property
    def rms(self) -> float:
        """m, of everything, with its degrees of freedom where they are few"""
        values = np.concatenate([self.markers.ravel(), self.lengths.ravel()])
        return float(np.sqrt(np.nanmean(values**2)))


def place(
    mechanism: Mechanism,
    sample: PoseSamples,
    free: Free,
    start: "Placement | WindowPlacement",
    noise: tuple[float, float],
) -> WindowPlacement:
    """Fit from a guess, or go on from an answer and its poses.

    mechanism: of the sample's robot, without effects. noise: standard deviations of a marker coordinate and of a
    length, m.

    Raises InfeasibleError where no pose has these lengths, RefusedError where it does not settle.
    """
    placement = start.placement if isinstance(start, WindowPlacement) else start
    now = _State(mechanism, sample, noise, placement, free.anchor)
    if isinstance(start, WindowPlacement):
        p, turned = start.positions, start.rotations
    else:
        p, turned = fit_poses(mechanism, sample.lengths - start.zeros, now.seen(start), body=start.body)
    for _ in range(STEPS):
        system = _System.of(now, placement, p, turned, free)
        theta, poses = system.step()
        longest = max(float(np.abs(theta).max(initial=0.0)), float(np.abs(poses).max()))
        scale = min(1.0, LONGEST / longest)
        p = p + scale * poses[:, :3]
        turned = Rotation.from_rotvec(scale * poses[:, 3:]).as_matrix() @ turned
        placement = _moved(placement, scale * theta, free)
        if longest < SETTLED:
            return _answer(now, placement, p, turned, free)
    raise RefusedError(f"The placing of frame and markers does not settle in {STEPS} steps.")


@dataclass(frozen=True, eq=False)
class _State:
    mechanism: Mechanism
    sample: PoseSamples
    noise: tuple[float, float]
    prior: Placement
    anchor: int | None

    def seen(self, placement: Placement) -> Float[np.ndarray, "S M 3"]:
        return self.sample.markers @ placement.turn.T + placement.shift

    def left(
        self, placement: Placement, p: Positions, R: Rotations
    ) -> tuple[Float[np.ndarray, "S M 3"], Float[np.ndarray, "S n"]]:
        modelled = p[:, np.newaxis] + np.einsum("nij,mj->nmi", R, placement.body)
        lengths = self.mechanism.lengths(p, R)
        if self.anchor is not None:
            along = self.mechanism.structure_matrix(p, R)[:, self.anchor, :3]
            lengths[:, self.anchor] -= along @ placement.anchor
        return self.seen(placement) - modelled, self.sample.lengths - placement.zeros - lengths


@dataclass(frozen=True, eq=False)
class _System:
    """Normal equations with the poses eliminated."""

    own: Float[np.ndarray, "S 6 6"]
    across: Float[np.ndarray, "S 6 K"]
    shared: Float[np.ndarray, "K K"]
    right_own: Float[np.ndarray, "S 6"]
    right_shared: Float[np.ndarray, " K"]

    @staticmethod
    def of(now: _State, placement: Placement, p: Positions, R: Rotations, free: Free) -> "_System":
        marker_noise, length_noise = now.noise
        off, short = now.left(placement, p, R)
        S, M = off.shape[:2]
        J = surface.marker_jacobian(R, placement.body) / marker_noise
        Xi = now.mechanism.structure_matrix(p, R) / length_noise
        upright = np.zeros((S, 3, 6))
        upright[:, :, 3:] = np.eye(3) / UPRIGHT
        rows = np.concatenate([J, Xi, upright], axis=1)
        columns = np.zeros((S, rows.shape[1], _count(free, M, now.mechanism.n)))
        columns[:, : 3 * M] = _of_markers(now.seen(placement), R, free, now.mechanism.n) / marker_noise
        of_zeros = 6 * free.frame + 3 * M * free.markers
        if free.zeros:
            columns[:, 3 * M : 3 * M + now.mechanism.n, of_zeros : of_zeros + now.mechanism.n] = (
                np.eye(now.mechanism.n) / length_noise
            )
        if free.anchor is not None:
            columns[:, 3 * M + free.anchor, -3:] = -Xi[:, free.anchor, :3]
        turned = Rotation.from_matrix(R).as_rotvec()
        right = np.concatenate([off.reshape(S, -1) / marker_noise, short / length_noise, -turned / UPRIGHT], axis=1)
        up = np.swapaxes(rows, 1, 2)
        flat = columns.reshape(rows.shape[0] * rows.shape[1], columns.shape[2])
        inner = flat.T @ flat + np.eye(columns.shape[2]) / WIDE**2
        of_prior = -_from_prior(placement, now.prior, free) / WIDE**2
        return _System(
            up @ rows,
            up @ columns,
            inner,
            np.einsum("nki,nk->ni", rows, right),
            flat.T @ right.ravel() + of_prior,
        )

    @property
    def information(self) -> Float[np.ndarray, "K K"]:
        """Of what is shared, the poses being unknown."""
        return self.shared - np.einsum("nik,nij->kj", self.across, np.linalg.solve(self.own, self.across))

    def step(self) -> tuple[Float[np.ndarray, " K"], Float[np.ndarray, "S 6"]]:
        """Of what is shared, and of the poses."""
        alone = np.linalg.solve(self.own, self.right_own[..., np.newaxis])[..., 0]
        right = self.right_shared - np.einsum("nik,ni->k", self.across, alone)
        theta = np.linalg.solve(self.information, right)
        own = alone - np.linalg.solve(self.own, (self.across @ theta)[..., np.newaxis])[..., 0]
        return theta, own


def _count(free: Free, markers: int, cables: int) -> int:
    return 6 * free.frame + 3 * markers * free.markers + cables * free.zeros + 3 * (free.anchor is not None)


def _of_markers(seen: Float[np.ndarray, "S M 3"], R: Rotations, free: Free, cables: int) -> Float[np.ndarray, "S K C"]:
    """∂(modelled − measured marker)/∂(shared): the frame moves what is measured, the body what is modelled."""
    S, M = seen.shape[:2]
    columns = np.zeros((S, 3 * M, _count(free, M, cables)))
    at = 0
    if free.frame:
        frame = np.zeros((S, M, 3, 6))
        frame[..., :3] = -np.eye(3)
        frame[..., 3:] = np.cross(seen[..., np.newaxis, :], np.eye(3)).swapaxes(2, 3)
        columns[:, :, :6] = frame.reshape(S, 3 * M, 6)
        at = 6
    for m in range(M if free.markers else 0):
        columns[:, 3 * m : 3 * m + 3, at + 3 * m : at + 3 * m + 3] = R
    return columns


def _moved(placement: Placement, theta: np.ndarray, free: Free) -> Placement:
    at = 0
    if free.frame:
        turn = Rotation.from_rotvec(theta[3:6]).as_matrix()
        placement = replace(placement, turn=turn @ placement.turn, shift=turn @ placement.shift + theta[:3])
        at = 6
    if free.markers:
        count = placement.body.size
        placement = replace(placement, body=placement.body + theta[at : at + count].reshape(-1, 3))
        at += count
    if free.zeros:
        count = len(placement.zeros)
        placement = replace(placement, zeros=placement.zeros + theta[at : at + count])
    return placement if free.anchor is None else replace(placement, anchor=placement.anchor + theta[-3:])


def _from_prior(placement: Placement, prior: Placement, free: Free) -> np.ndarray:
    parts: list[np.ndarray] = []
    if free.frame:
        turned = Rotation.from_matrix(placement.turn @ prior.turn.T).as_rotvec()
        parts += [placement.shift - prior.shift, turned]
    if free.markers:
        parts.append((placement.body - prior.body).ravel())
    if free.zeros:
        parts.append(placement.zeros - prior.zeros)
    if free.anchor is not None:
        parts.append(placement.anchor)
    return np.concatenate(parts) if parts else np.zeros(0)


def _answer(now: _State, placement: Placement, p: Positions, R: Rotations, free: Free) -> WindowPlacement:
    markers, lengths = now.left(placement, p, R)
    information = _System.of(now, placement, p, R, free).information
    chi2 = float((markers**2).sum() / now.noise[0] ** 2 + (lengths**2).sum() / now.noise[1] ** 2)
    dof = max(1, markers.size + lengths.size - 6 * len(p) - len(information))
    sd = np.sqrt(np.diag(np.linalg.inv(information)) * max(1.0, chi2 / dof)) if len(information) else np.zeros(0)
    at = 6 * free.frame
    of_body = at + placement.body.size * free.markers
    nothing = np.zeros(3)
    return WindowPlacement(
        placement,
        p,
        R,
        sd_turn=sd[3:6] if free.frame else nothing,
        sd_shift=sd[:3] if free.frame else nothing,
        sd_body=(sd[at:of_body] if free.markers else np.zeros(placement.body.size)).reshape(-1, 3),
        sd_zeros=sd[of_body : of_body + len(placement.zeros)] if free.zeros else np.zeros(len(placement.zeros)),
        markers=markers,
        lengths=lengths,
        chi2=chi2,
        unknowns=len(information),
        chi2_per_dof=chi2 / dof,
    )
