"""A robot drawn in letters, for a terminal: from above and from the side, true to scale."""

import numpy as np

from fidim_lab.arrays import Positions
from fidim_lab.data.records import Robot
from fidim_lab.model.statics import Equilibrium

ROWS = 15
"""of one view"""
WIDEST = 44
"""columns of one view"""
TALL = 2.0
"""times as tall as wide is a letter of a terminal"""
KEY = "1 2 … D   ○ A   P body frame   m main marker   G centre of mass   · cable"


def robot_views(robot: Robot, rest: Equilibrium) -> str:
    """Two views of the robot at rest, side by side, with what the signs mean."""
    x, y, z = np.eye(3)
    above = _view(robot, rest, (x, y), "from above: x →, y ↑")
    side = _view(robot, rest, (x, z), "from the side: x →, z ↑")
    wide = max(len(line) for line in above)
    rows = max(len(above), len(side))
    padded = [[*view, *[""] * (rows - len(view))] for view in (above, side)]
    return "\n".join([*(f"{a:<{wide}}   {b}".rstrip() for a, b in zip(*padded, strict=True)), KEY])


def _view(robot: Robot, rest: Equilibrium, axes: tuple[np.ndarray, np.ndarray], title: str) -> list[str]:
    projection = np.stack(axes, axis=1)
    pose = rest.pose
    anchors = np.array([cable.d for cable in robot.cables]) @ projection
    held = (pose.position + np.array([cable.a for cable in robot.cables]) @ pose.rotation.T) @ projection
    body = {"P": np.zeros(3), "G": robot.nominal.com, "m": robot.marker}
    places = {sign: (pose.position + pose.rotation @ point) @ projection for sign, point in body.items()}
    canvas = _Canvas(np.concatenate([anchors, held, *(place[np.newaxis] for place in places.values())]))
    for anchor, attachment in zip(anchors, held, strict=True):
        canvas.line(anchor, attachment)
    for attachment in held:
        canvas.put("○", attachment)
    for sign, place in places.items():
        canvas.put(sign, place)
    for number, anchor in enumerate(anchors, start=1):
        canvas.put(str(number), anchor)
    low, high = canvas.low, canvas.high
    span = f"{low[0]:.2f} … {high[0]:.2f} m, {low[1]:.2f} … {high[1]:.2f} m"
    return [title, span, *canvas.lines()]


class _Canvas:
    """Letters on a grid over a range of coordinates, m."""

    def __init__(self, points: Positions) -> None:
        self.low, self.high = points.min(axis=0), points.max(axis=0)
        size = np.maximum(self.high - self.low, 1e-3)
        self._scale = min((WIDEST - 1) / size[0], TALL * (ROWS - 1) / size[1])
        """columns for a metre"""
        columns = round(float(size[0]) * self._scale) + 1
        rows = round(float(size[1]) * self._scale / TALL) + 1
        self._letters = [[" "] * columns for _ in range(rows)]

    def put(self, sign: str, place: np.ndarray) -> None:
        """A letter at a place."""
        row, column = self._cell(place)
        self._letters[row][column] = sign

    def line(self, begin: np.ndarray, end: np.ndarray) -> None:
        """Points from one place to another."""
        steps = int(float(np.abs(end - begin).max()) * self._scale) + 2
        for part in np.linspace(0.0, 1.0, steps):
            self.put("·", begin + part * (end - begin))

    def lines(self) -> list[str]:
        """From top to bottom."""
        return ["".join(row).rstrip() for row in self._letters]

    def _cell(self, place: np.ndarray) -> tuple[int, int]:
        column = round(float(place[0] - self.low[0]) * self._scale)
        row = round(float(self.high[1] - place[1]) * self._scale / TALL)
        return min(max(row, 0), len(self._letters) - 1), min(max(column, 0), len(self._letters[0]) - 1)
