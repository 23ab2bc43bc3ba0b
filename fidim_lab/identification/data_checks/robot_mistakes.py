"""Gross and simple mistakes in the robot file (or the files beside it): which one change makes the data fit?

Cables, anchors or attachments in another order, millimetres or feet for metres, a mirrored or exchanged axis, a robot
turned by a quarter or half: each is undone in turn (`robot_changes`), and a few poses are fitted to markers, lengths
and an upright platform. `find_mistakes` is for a kinematic misfit of several millimetres; small errors of geometry are
for the effects of the catalogue.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Robot, Window
from fidim_lab.data.rigid_body import fit_pose
from fidim_lab.errors import FidimError
from fidim_lab.identification.data_checks.many_robots import alike
from fidim_lab.identification.data_checks.placed import placed, rests
from fidim_lab.identification.data_checks.poses import PoseSamples, misfit, misfits, sampled
from fidim_lab.identification.data_checks.robot_changes import Change, robot_changes
from fidim_lab.identification.data_checks.thresholds import DATA_CHECKS
from fidim_lab.model.mechanism import Mechanism

PLACED = ("a capture frame that is not the robot's", "a marker that is not where the robot file has it on the body")
"""what `placed` fits, where the recordings determine it"""
POSE = 6
"""numbers of a pose: as many markers and lengths are met by one, whatever is wrong, but that it leans"""
OPEN = f" These recordings do not show whether it is {' or '.join(PLACED)}: look there next."


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
    doubtful: bool = False
    """a fitted frame or marker (`placed`) that cures some millimetres, not down to noise: others look the same. Or
    nothing cures them, where the recordings determine no frame or no marker"""


def find_mistakes(robot: Robot, windows: tuple[Window, ...], least: float = 3e-3) -> tuple[Mistake, ...]:
    """The simple changes that make a gross misfit (m, more than `least`) fit, best first; none where none does.

    A misfit so large that nothing can be made of the recording, and that no change cures, is a mistake as well.
    """
    sample = sampled(robot, windows)
    if sample is None:
        return ()
    robot = sample.robot
    unchanged = Mechanism(robot)
    before = misfit(unchanged, sample.lengths, sample.markers)
    if before >= least:
        before = min(before, _hanging(unchanged, sample), _as_markers_say(unchanged, sample))
    if before < least:
        return ()
    tried = _tried(robot_changes(robot), sample)
    fitted: list[tuple[float, Change]] = []
    # What people mix up comes first where it leaves little: what is fitted to the data fits better still.
    partly = not _cures(before, tried[0][0]) or tried[0][0] > DATA_CHECKS.robot_mistakes_part
    if partly:
        fitted = _tried(placed(robot, sample), sample)
        tried = sorted((*fitted, *tried), key=lambda pair: pair[0])
    best = tried[0][0]
    noise = max(robot.sensors.marker_noise, robot.sensors.encoder_resolution)

    def doubtful(after: float) -> bool:
        return before < DATA_CHECKS.robot_mistakes_fitted and after > DATA_CHECKS.robot_mistakes_noise * noise

    measured = sample.markers[0].size + robot.n
    open_ = measured <= POSE or (partly and len(fitted) < len(PLACED))
    guessed = open_ and best > DATA_CHECKS.robot_mistakes_part and before > DATA_CHECKS.hopeless
    if _cures(before, best) and not guessed:
        return tuple(
            _doubted(mistake) if (after, change) in fitted and doubtful(after) else mistake
            for after, change in tried[:3]
            if after <= DATA_CHECKS.robot_mistakes_tie * best
            for mistake in [_mistake(change, before, after, open_=open_)]
        )
    if before <= DATA_CHECKS.hopeless and not open_:
        return ()
    uncured = _uncured(tried[0][1], before, best, len(tried), open_=open_)
    return (replace(uncured, doubtful=before <= DATA_CHECKS.hopeless),)


def _hanging(unchanged: Mechanism, sample: PoseSamples) -> float:
    """The misfit near the poses at which the nominal body rests: cables of unlike lengths make it lean by a radian."""
    try:
        near = np.array([pose.rotation for pose in rests(unchanged, sample)])
    except FidimError:
        return np.inf
    return misfit(unchanged, sample.lengths, sample.markers, near)


def _as_markers_say(unchanged: Mechanism, sample: PoseSamples) -> float:
    """The misfit near the rotations that three markers or more show: two cables let a platform lean by any angle."""
    near = fit_pose(sample.markers, unchanged.robot.markers[: sample.markers.shape[1]])[1]
    return misfit(unchanged, sample.lengths, sample.markers, near) if np.isfinite(near).all() else np.inf


def _cures(before: float, after: float) -> bool:
    return after < DATA_CHECKS.hopeless and after * DATA_CHECKS.robot_mistakes_better < min(before, 1e3)


def _tried(changes: Iterable[Change], sample: PoseSamples) -> list[tuple[float, Change]]:
    """Each change with the misfit that it leaves, best first."""
    found: list[tuple[float, Change]] = []
    for _, some in groupby(sorted(changes, key=_kind), key=_kind):
        together = list(some)
        lengths = np.array([_lengths(change, sample) for change in together])
        markers = np.array([_markers(change, sample) for change in together])
        found += zip(misfits([change.robot for change in together], lengths, markers).tolist(), together, strict=True)
    return sorted(found, key=lambda pair: pair[0])


def _kind(change: Change) -> tuple[bool, ...]:
    return alike(change.robot)


def _lengths(change: Change, sample: PoseSamples) -> Float[np.ndarray, "S n"]:
    lengths = sample.lengths * change.length_scale
    return lengths if change.order is None else lengths[:, list(change.order)]


def _markers(change: Change, sample: PoseSamples) -> Float[np.ndarray, "S M 3"]:
    return (sample.markers - change.about) @ change.turn.T + change.about + change.shift


def _mistake(change: Change, before: float, after: float, *, open_: bool) -> Mistake:
    says = f"{change.says}: if corrected, markers and cable lengths agree within {after * 1e3:.2g} mm; "
    says += f"as the files are, {_missed(before)}."
    if after > DATA_CHECKS.robot_mistakes_part:
        says += " That is still too much: something else is wrong as well."
    says += OPEN if open_ else ""
    order = None if change.order is None else tuple(k + 1 for k in change.order)
    return Mistake(says, before, after, order)


def _doubted(mistake: Mistake) -> Mistake:
    return replace(mistake, says=f"Perhaps: {mistake.says}", doubtful=True)


def _uncured(nearest: Change, before: float, after: float, tried: int, *, open_: bool) -> Mistake:
    says = f"{_missed(before).capitalize()}. {tried} simple changes "
    says += "(order of cables, units, axes, turns) were tried, and none removes this; the nearest: "
    says += f"{nearest.says[0].lower()}{nearest.says[1:]} ({after * 1e3:.2g} mm)."
    says += OPEN if open_ else ""
    return Mistake(says, before, after)


def _missed(before: float) -> str:
    return (
        "no pose fits"
        if not np.isfinite(before)
        else f"they differ by {before * 1e3:.3g} mm"
        if before < 1.0
        else f"they differ by {before:.3g} m"
    )
