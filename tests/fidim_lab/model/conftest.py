"""Robots for the model's tests: the paper's, and made-up ones with any number of cables."""

import numpy as np
import pytest

from fidim_lab.data.records import Body, Cable, Pose, Robot
from fidim_lab.model.mechanism import Mechanism

# Table 1 of the paper: d, a, x, z
TABLE_1 = [
    ((0.219, -1.316, 0.527), (-0.144, -0.219, 0.264), (0, 1, 0), (-1, 0, 0)),
    ((2.295, -1.158, 0.521), (0.115, -0.233, 0.270), (-1, 0, 0), (0, -1, 0)),
    ((2.153, 0.973, 0.560), (0.142, 0.220, 0.266), (0, -1, 0), (1, 0, 0)),
    ((0.0532, 0.796, 0.532), (-0.120, 0.236, 0.266), (1, 0, 0), (0, 1, 0)),
]
NOMINAL = Body(com=np.array([0.0, 0.0, 0.19]), inertia=np.array([0.051, 0.069, 0.037, 0.0, 0.0, 0.0]))  # Eq. 43


def cable_of(d, a, x, z, radius=0.025) -> Cable:
    d, a, x, z = (np.array(vector, dtype=float) for vector in (d, a, x, z))
    return Cable(d=d, a=a, radius=radius, x=x, y=np.cross(z, x), z=z)


def hanging_robot(n: int, radius: float = 0.025) -> Robot:
    """n cables from an uneven ring of anchors 1 m above to a skewed ring of attachments; a body with all parameters."""
    cables = []
    for index in range(n):
        angle = 2 * np.pi * index / n + 0.3
        skewed = angle + 0.7 * (-1) ** index
        out, side = np.array([np.cos(angle), np.sin(angle), 0.0]), np.array([-np.sin(angle), np.cos(angle), 0.0])
        across = np.array([np.cos(skewed), np.sin(skewed), 0.0])
        up = np.array([0.0, 0.0, 1.0])
        anchor = (0.0 if n == 1 else 1.1 + 0.1 * index) * out + (1.0 + 0.03 * index) * up
        attachment = (0.0 if n == 1 else 0.25 + 0.02 * index) * across + (0.25 + 0.08 * (-1) ** (index // 2)) * up
        cables.append(cable_of(anchor, attachment, -out, side, radius))
    body = Body(com=np.array([0.01, -0.02, 0.12]), inertia=np.array([0.06, 0.07, 0.05, 0.002, -0.003, 0.004]))
    return Robot(cables=tuple(cables), mass=11.0, nominal=body, marker=np.array([0.02, -0.03, 0.05]))


@pytest.fixture(scope="session")
def paper() -> Mechanism:
    return Mechanism(
        Robot(cables=tuple(cable_of(*row) for row in TABLE_1), mass=11.0, nominal=NOMINAL, marker=np.zeros(3))
    )


@pytest.fixture(scope="session")
def make_robot():
    return hanging_robot


@pytest.fixture(scope="session", params=[1, 2, 3, 5])
def other(request) -> Mechanism:
    return Mechanism(hanging_robot(request.param))


@pytest.fixture(scope="session")
def somewhere() -> Pose:
    """A pose of the paper's robot with nothing special about it."""
    turn = np.array([[0.9752, -0.1898, 0.1134], [0.1987, 0.9770, -0.0772], [-0.0961, 0.0978, 0.9905]])
    u, _, v = np.linalg.svd(turn)
    return Pose(position=np.array([1.2, -0.2, -0.3]), rotation=u @ v)
