"""What the paper found on its robot, to be set beside ours when the robot is theirs (spec/model.md §3, paper §5)."""

from types import MappingProxyType

import numpy as np

from fidim_lab.data.records import Robot
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot

FOUND = MappingProxyType(
    {
        "paper, free": (0.002, -0.0025, 0.1984, 0.0569, 0.0627, 0.0314, 2e-4, -2e-4, 1.6e-4),
        "paper, full": (0.0016, -0.0025, 0.2, 0.0563, 0.0627, 0.0322, 4.8e-5, -2.5e-4, 3.4e-4),
    }
)
"""s in m and I about P in m², per unit mass, in the order of PARAMETER_NAMES, free coordinates and full pose"""
SAME = 1e-3
"""m within which anchors and attachments are the paper's"""


def is_papers_robot(robot: Robot) -> bool:
    """Whether anchors and attachments are those of the paper's Table 1."""
    theirs = read_robot(PAPERS_ROBOT)
    places, known = ([[*c.d, *c.a] for c in r.cables] for r in (robot, theirs))
    return robot.n == theirs.n and bool(np.allclose(places, known, rtol=0.0, atol=SAME))
