"""The robot that a reader can turn: a scene as numbers for the page's script, and the picture that stands in for it."""

import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fidim_lab.app.report.drawings.drawing import Drawing
from fidim_lab.app.report.drawings.scene import Scene, slanted
from fidim_lab.app.report.drawings.svg import points_for
from fidim_lab.arrays import Positions

PATH_POINTS = 300
"""of each window's path: enough for the eye, small in the file"""
LONGEST_ARROW = 0.15
"""of the scene's size"""


@dataclass(frozen=True)
class Solid:
    """What the template sets."""

    scene: str
    """JSON: anchors [n][3], windows [{id, held [n][3] or null, path [N][3] or null in gaps}], arrows [[from, to]]; m"""
    still: Drawing
    """in print, and without script"""


def solid(drawn: Scene, arrows: Sequence[tuple[np.ndarray, np.ndarray]] = (), caption: str = "") -> Solid:
    """`arrows`: (where, force) in m and N, drawn in one scale: the longest is a part of the scene."""
    paths = [hanging.path for hanging in drawn.hanging]
    spread = np.vstack([drawn.anchors, *paths])
    size = float(np.linalg.norm(np.nanmax(spread, axis=0) - np.nanmin(spread, axis=0)))
    longest = max((float(np.linalg.norm(force)) for _, force in arrows), default=0.0)
    scale = LONGEST_ARROW * size / longest if longest > 0 else 0.0
    most = points_for(len(paths), PATH_POINTS)
    scene = {
        "anchors": _rounded(drawn.anchors),
        "windows": [
            {
                "id": hanging.window,
                "held": None if hanging.attachments is None else _rounded(hanging.attachments),
                "path": _rounded(hanging.path[:: max(1, -(-len(hanging.path) // most))]),
            }
            for hanging in drawn.hanging
        ],
        "arrows": [_rounded(np.stack([place, place + scale * force])) for place, force in arrows],
    }
    said = caption or "The robot: pulleys with their cable's number, the platform at rest, recorded paths."
    return Solid(json.dumps(scene, separators=(",", ":")), Drawing(slanted(drawn), said, "robot", zoom=False))


def _rounded(places: Positions) -> list[list[float] | None]:
    """Tenths of a millimetre; None where nothing was seen."""
    return [[round(float(x), 4) for x in place] if np.isfinite(place).all() else None for place in places]
