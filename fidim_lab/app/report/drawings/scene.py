"""The robot in pictures: where the platform rests in each window, its cables, and the paths that were recorded.

`scene` finds the poses; `slanted` draws them as seen across a room, `views` from above, the side and the front.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from fidim_lab.app.report.drawings.svg import COLOURS, points_for, sheet, styled, thin, to_svg
from fidim_lab.arrays import Positions
from fidim_lab.data.records import Body, Campaign, Pose, Robot, Window
from fidim_lab.data.rigid_body import fit_pose
from fidim_lab.errors import FidimError
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism

AZIMUTH, ELEVATION = np.radians(-62.0), np.radians(24.0)
"""of the slanted view: from where it is looked at"""
PATH_POINTS = 200
"""of each window's path and coordinate: many paths lie over one another"""
OFF_PATH = 0.05
"""m; a rest found farther than this from the recorded path is another equilibrium than the robot's"""


@dataclass(frozen=True, eq=False)
class DrawnPose:
    """The platform in one window, world frame, m."""

    window: str
    attachments: Positions | None
    """(n, 3) where the cables hold it at rest; None where its pose is unknown"""
    path: Positions
    """(N, 3) of the main marker; NaN where it was not seen"""


@dataclass(frozen=True, eq=False)
class Scene:
    """The robot with everything that was recorded."""

    anchors: Positions
    """(n, 3) m"""
    hanging: tuple[DrawnPose, ...]


def scene(campaign: Campaign, mechanism: Mechanism, body: Body) -> Scene:
    """Where the platform of this body rests in each window: from its markers, else from its cable lengths."""
    robot = campaign.robot
    attachments = np.array([cable.a for cable in robot.cables])

    def hung(window: Window) -> DrawnPose:
        pose = _pose_from_markers(robot, window) or _pose_from_lengths(mechanism, body, window)
        held = None if pose is None else pose.position + attachments @ pose.rotation.T
        return DrawnPose(window.id, held, window.markers[:, 0])

    return Scene(np.array([cable.d for cable in robot.cables]), tuple(hung(window) for window in campaign.windows))


def _pose_from_markers(robot: Robot, window: Window) -> Pose | None:
    """The pose of the markers' mean places: nearly the pose at rest, as the motion goes to and fro."""
    seen = window.markers[np.isfinite(window.markers).all(axis=(1, 2))]
    if window.markers.shape[1] < 3 or not len(seen):
        return None
    position, rotation, _ = fit_pose(seen.mean(axis=0)[np.newaxis], robot.markers[: window.markers.shape[1]])
    return Pose(position[0], rotation[0]) if np.isfinite(position).all() else None


def _pose_from_lengths(mechanism: Mechanism, body: Body, window: Window) -> Pose | None:
    """The equilibrium of the mean cable lengths, where there is one near the path."""
    seen = window.markers[np.isfinite(window.markers[:, 0]).all(axis=1), 0]
    if window.lengths is None or not np.isfinite(window.lengths).any(axis=0).all() or not len(seen):
        return None
    robot, middle = mechanism.robot, seen.mean(axis=0)
    upright = Pose(middle - robot.marker, np.eye(3))
    try:
        pose = pose_from_lengths(mechanism, body, np.nanmean(window.lengths, axis=0), upright).pose
    except FidimError:  # a picture without cables is still a picture
        return None
    marker = pose.position + pose.rotation @ robot.marker
    return pose if np.linalg.norm(marker - middle) < OFF_PATH else None


def slanted(drawn: Scene) -> str:
    """The scene as one looks at it across a room, SVG."""
    across = np.array([-np.sin(AZIMUTH), np.cos(AZIMUTH), 0.0])
    back = np.sin(ELEVATION)
    up = np.array([-back * np.cos(AZIMUTH), -back * np.sin(AZIMUTH), np.cos(ELEVATION)])
    return _view(drawn, (across, up), ("", ""))


def views(drawn: Scene) -> tuple[tuple[str, str], ...]:
    """Pictures of a scene along its axes: (what is seen, SVG)."""
    x, y, z = np.eye(3)
    return (
        ("from above", _view(drawn, (x, y), ("x / m", "y / m"))),
        ("from the side", _view(drawn, (x, z), ("x / m", "z / m"))),
        ("from the front", _view(drawn, (y, z), ("y / m", "z / m"))),
    )


@styled
def _view(drawn: Scene, axes_seen: tuple[np.ndarray, np.ndarray], labels: tuple[str, str]) -> str:
    projection = np.stack(axes_seen, axis=1)
    figure, (axis,) = sheet(4.6, 3.6)
    anchors = drawn.anchors @ projection
    for hanging in drawn.hanging:
        if hanging.attachments is not None:
            _platform(axis, anchors, hanging.attachments @ projection)
    most = points_for(len(drawn.hanging), PATH_POINTS)
    for hanging in drawn.hanging:
        path = hanging.path @ projection
        t = np.arange(float(len(path)))
        kept = np.isin(t, np.concatenate([thin(t, path[:, k], most)[0] for k in (0, 1)]))
        axis.plot(*path[kept].T, color=COLOURS[1], lw=0.7)
    axis.plot(*anchors.T, "s", color="black", ms=5)
    for cable, place in enumerate(anchors, start=1):
        axis.annotate(str(cable), place, xytext=(4, 4), textcoords="offset points", fontweight="bold")
    _frame(axis, labels)
    return to_svg(figure)


def _platform(axis: Axes, anchors: Positions, held: Sequence[np.ndarray] | np.ndarray) -> None:
    for anchor, attachment in zip(anchors, held, strict=True):
        axis.plot(*np.stack([anchor, attachment]).T, color="0.55", lw=0.5)
    axis.fill(*np.asarray(held).T, facecolor=COLOURS[0], edgecolor=COLOURS[0], alpha=0.18, lw=0.8)


def _frame(axis: Axes, labels: tuple[str, str]) -> None:
    axis.set_aspect("equal", adjustable="datalim")
    axis.margins(0.08)
    if any(labels):
        axis.set_xlabel(labels[0])
        axis.set_ylabel(labels[1])
    else:
        axis.set_axis_off()
