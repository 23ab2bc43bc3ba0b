"""A picture of a robot file: the robot at rest, and one of its cables at its pulley with every symbol of the file.

World frame, D, swivel axis z, x, y, wrap angle φ, swivel angle σ, A, P, markers: what docs/own-robot.md explains.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fidim_lab.app.report.drawings.svg import COLOURS, styled, to_svg
from fidim_lab.data.records import Cable, Robot
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.statics import Equilibrium

SHOWN = 3.0
"""radii of cable that are drawn before and after the pulley"""


@styled
def robot_picture(robot: Robot, rest: Equilibrium, cable: int = 1) -> str:
    """SVG: from above, from the side, and cable `cable` (from 1) in its pulley's plane and along its swivel axis."""
    x, y, z = np.eye(3)
    figure = Figure(figsize=(9.2, 8.4))
    above, side, plane, along = figure.subplots(2, 2).ravel()
    figure.subplots_adjust(left=0.08, right=0.97, bottom=0.06, top=0.95, hspace=0.24, wspace=0.22)
    _view(above, robot, rest, (x, y), ("x / m", "y / m"))
    _view(side, robot, rest, (x, z), ("x / m", "z / m"))
    above.set_title("From above (world frame)")
    side.set_title("From the side (world frame)")
    at = (rest.pose.position[np.newaxis], rest.pose.rotation[np.newaxis])
    mechanism, one = Mechanism(robot), robot.cables[cable - 1]
    wrap = float(mechanism.wrap_angles(*at)[0, cable - 1])
    swivel = float(mechanism.swivel_angles(*at)[0, cable - 1])
    _pulley_plane(plane, one, cable, wrap)
    _along_axis(along, one, cable, swivel)
    return to_svg(figure)


def _view(
    axis: Axes, robot: Robot, rest: Equilibrium, seen: tuple[np.ndarray, np.ndarray], labels: tuple[str, str]
) -> None:
    projection, pose = np.stack(seen, axis=1), rest.pose
    held = (pose.position + np.array([cable.a for cable in robot.cables]) @ pose.rotation.T) @ projection
    axis.fill(*held.T, facecolor=COLOURS[0], alpha=0.15)
    for number, (cable, end) in enumerate(zip(robot.cables, held, strict=True), start=1):
        anchor = cable.d @ projection
        axis.plot(*np.stack([anchor, end]).T, color="0.45", lw=0.9)
        axis.plot(*anchor, "s", color="black", ms=5)
        axis.plot(*end, "o", color=COLOURS[0], ms=4)
        _say(axis, f"D{number}", anchor)
        _say(axis, f"A{number}", end, COLOURS[0])
    places = {"P": np.zeros(3), "G": robot.nominal.com}
    for name, (sign, colour) in {"P": ("+", "black"), "G": ("x", COLOURS[4])}.items():
        place = (pose.position + pose.rotation @ places[name]) @ projection
        axis.plot(*place, sign, color=colour, ms=8, mew=1.6)
        _say(axis, name, place, colour)
    for number, marker in enumerate(robot.markers, start=1):
        place = (pose.position + pose.rotation @ marker) @ projection
        axis.plot(*place, "*", color=COLOURS[1], ms=7)
        _say(axis, "marker" if number == 1 else f"m{number}", place, COLOURS[1], (4, -11))
    axis.set_aspect("equal", adjustable="datalim")
    axis.margins(0.1)
    axis.set_xlabel(labels[0])
    axis.set_ylabel(labels[1])


def _pulley_plane(axis: Axes, cable: Cable, number: int, wrap: float) -> None:
    """The cable in the plane of its pulley: u to the right, z upwards; m from D."""
    r = cable.radius or 0.025
    axis.set_title(f"Cable {number} in the plane of its pulley")
    before = np.array([[0.0, -SHOWN * r], [0.0, 0.0]])
    leave = np.array([np.sin(wrap), np.cos(wrap)])
    at = np.zeros(2)
    if cable.radius:
        turns = np.linspace(0.0, wrap, 60)
        arc = np.stack([r - r * np.cos(turns), r * np.sin(turns)], axis=1)
        circle = np.linspace(0.0, 2.0 * np.pi, 90)
        axis.plot(r + r * np.cos(circle), r * np.sin(circle), color="0.6", lw=0.9)
        axis.plot(*arc.T, color=COLOURS[0], lw=2.2)
        for end in (np.zeros(2), arc[-1]):
            axis.plot(*np.stack([[r, 0.0], end]).T, color="0.6", lw=0.8, ls="--")
        _say(axis, f"wrap φ = {np.degrees(wrap):.0f}°", np.array([r, 0.0]), "0.3", (-22, 14))
        _say(axis, f"radius {1e3 * r:.1f} mm", np.array([r, 0.0]), "0.3", (-22, -14))
        at = arc[-1]
    after = np.stack([at, at + SHOWN * r * leave])
    for way in (before, after):
        axis.plot(*way.T, color=COLOURS[0], lw=2.2)
    axis.plot(*after[0], "o", color="black", ms=4)
    _say(axis, "B", after[0])
    _say(axis, f"to A{number}, a in the body frame", after[1], COLOURS[0], (-60, -12))
    _say(axis, "from the winch", before[0], COLOURS[0], (6, 0))
    _point_d(axis, number)
    _arrow(axis, (0.0, 1.9 * r), f"z = {_vector(cable.z)}", COLOURS[1])
    _arrow(axis, (3.2 * r, 0.0), "u, towards A", COLOURS[2])
    axis.set_aspect("equal", adjustable="datalim")
    axis.margins(0.14)
    axis.set_axis_off()


def _along_axis(axis: Axes, cable: Cable, number: int, swivel: float) -> None:
    """The same seen against the swivel axis: x to the right, y upwards; m from D."""
    r = cable.radius or 0.025
    u = np.array([np.cos(swivel), np.sin(swivel)])
    axis.set_title(f"Cable {number} from the end of z: the pulley swivels")
    axis.plot(*np.stack([np.zeros(2), 2.0 * r * u]).T, color="0.55", lw=6, solid_capstyle="round")
    axis.plot(*np.stack([2.0 * r * u, 4.5 * r * u]).T, color=COLOURS[0], lw=2.2)
    _say(axis, f"to A{number}", 4.5 * r * u, COLOURS[0])
    _say(axis, "pulley", 1.8 * r * u, "0.3", (10, -8))
    turns = np.linspace(0.0, swivel, 40)
    axis.plot(1.3 * r * np.cos(turns), 1.3 * r * np.sin(turns), color=COLOURS[2], lw=1.2)
    _say(
        axis, f"σ = {np.degrees(swivel):.0f}°", 1.5 * r * np.array([np.cos(swivel / 2), np.sin(swivel / 2)]), COLOURS[2]
    )
    _point_d(axis, number)
    _arrow(axis, (2.6 * r, 0.0), f"x = {_vector(cable.x)}", COLOURS[1])
    _arrow(axis, (0.0, 2.6 * r), f"y = {_vector(cable.y)}", COLOURS[1])
    axis.set_aspect("equal", adjustable="datalim")
    axis.margins(0.2)
    axis.set_axis_off()


def _point_d(axis: Axes, number: int) -> None:
    axis.plot(0.0, 0.0, "s", color="black", ms=6)
    _say(axis, f"D{number}", np.zeros(2), "black", (-20, -14))


def _arrow(axis: Axes, end: tuple[float, float], text: str, colour: str) -> None:
    axis.plot(*end, alpha=0.0)  # an arrow does not widen the picture by itself
    axis.annotate("", end, (0.0, 0.0), arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.4})
    axis.annotate(text, end, (5, 4), textcoords="offset points", color=colour)


def _say(axis: Axes, text: str, place: np.ndarray, colour: str = "black", offset: tuple[float, float] = (5, 4)) -> None:
    axis.annotate(text, (float(place[0]), float(place[1])), offset, textcoords="offset points", color=colour)


def _vector(values: np.ndarray) -> str:
    return "[" + ", ".join(f"{value:.3g}" for value in np.round(values, 3) + 0.0) + "]"
