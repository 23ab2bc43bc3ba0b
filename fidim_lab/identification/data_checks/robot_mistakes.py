"""Mistakes in the robot file (or the files beside it) that are gross and simple: which one change makes the data fit?

Cables, anchors or attachments in another order, millimetres or feet for metres, a mirrored or exchanged axis, a robot
turned by a quarter or half: each is undone in turn (`robot_changes`), and a few poses are fitted to markers, lengths
and an upright platform. `find_mistakes` is for a kinematic misfit of several millimetres; small errors of geometry are
for the effects of the catalogue.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from fidim_lab.data.records import Robot, Window
from fidim_lab.errors import FidimError
from fidim_lab.identification.data_checks.robot_changes import Change, robot_changes
from fidim_lab.identification.data_checks.thresholds import DATA_CHECKS
from fidim_lab.identification.markers.clock_check import even_grid
from fidim_lab.identification.motion import surface
from fidim_lab.model.mechanism import Mechanism


@dataclass(frozen=True)
class Mistake:
    """A change that makes the kinematics fit."""

    says: str
    before: float
    """m, rms misfit of markers and lengths as the files are"""
    after: float
    """m, with the change"""
    order: tuple[int, ...] | None = None
    """of the cables, 1-based, where that is the change: cable k of the robot file is order[k − 1] of the recording"""


@dataclass(frozen=True, eq=False)
class _Sample:
    markers: Float[np.ndarray, "S M 3"]
    lengths: Float[np.ndarray, "S n"]


def find_mistakes(robot: Robot, windows: tuple[Window, ...], least: float = 3e-3) -> tuple[Mistake, ...]:
    """The simple changes that make a gross misfit (m, more than `least`) fit, best first; none where none does.

    A misfit so large that nothing can be made of the recording, and that no change cures, is a mistake as well.
    """
    sample = _sampled(robot, windows)
    if sample is None:
        return ()
    before = _misfit(Change("as it is", robot), sample, None)
    if before < least:
        return ()
    unchanged = Mechanism(robot)
    tried = [
        (_misfit(change, sample, unchanged if change.robot is robot else None), change)
        for change in robot_changes(robot)
    ]
    tried.sort(key=lambda pair: pair[0])
    best = tried[0][0]
    if best < DATA_CHECKS.hopeless and best * DATA_CHECKS.robot_mistakes_better < min(before, 1e3):
        return tuple(
            _mistake(change, before, after)
            for after, change in tried[:3]
            if after <= DATA_CHECKS.robot_mistakes_tie * best
        )
    return (_uncured(tried[0][1], before, best, len(tried)),) if before > DATA_CHECKS.hopeless else ()


def _mistake(change: Change, before: float, after: float) -> Mistake:
    says = f"{change.says}: with that undone, markers and cable lengths agree within {after * 1e3:.2g} mm; "
    says += f"as the files are, {_missed(before)}."
    if after > DATA_CHECKS.robot_mistakes_part:
        says += " That is still too much: something else is wrong as well."
    return Mistake(says, before, after, None if change.order is None else tuple(k + 1 for k in change.order))


def _uncured(nearest: Change, before: float, after: float, tried: int) -> Mistake:
    says = f"Markers and cable lengths contradict it: {_missed(before)}. None of {tried} simple changes cures that "
    says += "(order of cables, units, axes, turns); nearest: "
    says += f"{nearest.says[0].lower()}{nearest.says[1:]} ({after * 1e3:.2g} mm)."
    return Mistake(says, before, after)


def _missed(before: float) -> str:
    return "no pose fits" if not np.isfinite(before) else f"they miss by {before * 1e3:.3g} mm"


def _sampled(robot: Robot, windows: tuple[Window, ...]) -> _Sample | None:
    """Markers averaged over five samples, at a few places of a few windows."""
    markers, lengths = [], []
    most = min((w.markers.shape[1] for w in windows), default=0)
    for window in windows[:: max(1, len(windows) // DATA_CHECKS.robot_mistakes_windows)]:
        if window.lengths is None or not np.isfinite(window.lengths).any(axis=0).all():
            continue
        held = np.nanmean(window.lengths, axis=0)
        columns = even_grid(window.t).spread(window.markers[:, :most].reshape(len(window.t), -1))
        rows = np.flatnonzero(np.isfinite(columns).all(axis=1))
        if len(rows) < DATA_CHECKS.robot_mistakes_samples:
            continue
        for row in rows[np.linspace(0, len(rows) - 1, DATA_CHECKS.robot_mistakes_samples + 2).astype(int)[1:-1]]:
            markers.append(columns[row].reshape(most, 3))
            lengths.append(held)
    if not markers or len(lengths[0]) != robot.n:
        return None
    return _Sample(np.array(markers), np.array(lengths))


def _misfit(change: Change, sample: _Sample, mechanism: Mechanism | None) -> float:
    """rms of what markers and lengths are off the best nearly upright poses, m; the median over the poses."""
    made = mechanism or Mechanism(change.robot)
    lengths = sample.lengths * change.length_scale
    if change.order is not None:
        lengths = lengths[:, list(change.order)]
    markers = (sample.markers - change.about) @ change.turn.T + change.about
    body = made.robot.markers[: markers.shape[1]]
    R = np.tile(np.eye(3), (len(markers), 1, 1))
    p = (markers - body).mean(axis=1)
    try:
        for _ in range(DATA_CHECKS.robot_mistakes_rounds):
            step = _step(made, lengths, markers, body, p, R)
            p = p + step[:, :3]
            R[:] = Rotation.from_rotvec(step[:, 3:]).as_matrix() @ R
        left = np.concatenate([_off(markers, body, p, R), lengths - made.lengths(p, R)], axis=1)
    except (FidimError, np.linalg.LinAlgError):
        return np.inf
    lean = np.linalg.norm(Rotation.from_matrix(R).as_rotvec(), axis=1)
    each = np.sqrt((left**2).sum(axis=1) / max(1, left.shape[1] - 6)) + 0.01 * np.maximum(
        0.0, lean - 2 * DATA_CHECKS.robot_mistakes_upright
    )
    return float(np.median(each)) if np.isfinite(each).all() else np.inf


def _off(markers: np.ndarray, body: np.ndarray, p: np.ndarray, R: np.ndarray) -> np.ndarray:
    return (markers - p[:, np.newaxis] - np.einsum("nij,mj->nmi", R, body)).reshape(len(p), -1)


def _step(
    made: Mechanism, lengths: np.ndarray, markers: np.ndarray, body: np.ndarray, p: np.ndarray, R: np.ndarray
) -> np.ndarray:
    """One Gauss–Newton step of all poses, (S, 6)."""
    prior = np.zeros((len(p), 3, 6))
    prior[:, :, 3:] = np.eye(3)
    rows = np.concatenate(
        [
            surface.marker_jacobian(R, body) / DATA_CHECKS.robot_mistakes_close,
            made.structure_matrix(p, R) / DATA_CHECKS.robot_mistakes_close,
            prior / DATA_CHECKS.robot_mistakes_upright,
        ],
        axis=1,
    )
    turned = Rotation.from_matrix(R).as_rotvec()
    right = np.concatenate(
        [
            _off(markers, body, p, R) / DATA_CHECKS.robot_mistakes_close,
            (lengths - made.lengths(p, R)) / DATA_CHECKS.robot_mistakes_close,
            -turned / DATA_CHECKS.robot_mistakes_upright,
        ],
        axis=1,
    )
    across = np.swapaxes(rows, 1, 2)
    step = np.linalg.solve(across @ rows, (across @ right[..., np.newaxis]))[..., 0]
    size = np.abs(step).max(axis=1, keepdims=True)
    return step * np.minimum(1.0, DATA_CHECKS.robot_mistakes_longest / np.maximum(size, 1e-300))
