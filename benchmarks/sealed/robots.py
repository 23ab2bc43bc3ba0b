"""Robots for the benchmark: relatives of the paper's, none like it, so that nothing is tuned to one.

Size, weight, places of drums and attachments, body, markers, noise and frame rate are drawn; room and platform are
turned together about the vertical, so that no axis is the paper's; encoders and motor currents are not always recorded.
"""

from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.arrays import Matrix3, Vector3
from fidim_lab.data.records import Body, Cable, Limits, Robot, Sensors

RATES = (50.0, 100.0, 100.0, 120.0, 200.0)
"""Hz of motion capture"""


@dataclass(frozen=True, eq=False)
class Setup:
    """A robot, and how it is recorded."""

    robot: Robot
    rate: float
    """Hz"""
    lengths: bool
    """whether encoders are recorded"""


def random_setup(paper: Robot, rng: np.random.Generator) -> Setup:
    """A relative of the paper's robot. It may be one that can hardly swing: whoever plans for it finds out."""
    scale, spread = float(np.exp(rng.uniform(np.log(0.7), np.log(1.6)))), float(rng.uniform(0.8, 1.25))
    weight = float(np.exp(rng.uniform(np.log(0.5), np.log(2.5))))
    turn = about_vertical(rng.uniform(-np.pi, np.pi))
    has_currents = rng.random() < 0.8
    robot = replace(
        paper,
        cables=tuple(_cable(cable, rng, scale, spread, turn) for cable in paper.cables),
        mass=weight * paper.mass,
        nominal=_body(paper.nominal, rng, spread, turn),
        marker=rng.normal(0.0, 0.03, 3),
        extra_markers=tuple(rng.uniform(-0.25, 0.25, 3) * spread for _ in range(int(rng.integers(0, 4)))),
        limits=Limits((weight * paper.limits.tension[0], weight * paper.limits.tension[1])),
        sensors=Sensors(float(np.exp(rng.uniform(np.log(5e-5), np.log(3e-4)))), paper.sensors.encoder_resolution),
        winches=paper.winches if has_currents else None,
    )
    return Setup(robot, float(rng.choice(RATES)), bool(rng.random() < 0.8))


def about_vertical(angle: float) -> Matrix3:
    """Rotation about z, rad."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _cable(cable: Cable, rng: np.random.Generator, scale: float, spread: float, turn: Matrix3) -> Cable:
    """One drum and its attachment, scaled, moved by some per cent, turned with the room."""
    return Cable(
        d=turn @ (scale * cable.d + rng.normal(0.0, 0.04 * scale, 3)),
        a=turn @ (spread * cable.a + rng.normal(0.0, 0.012 * spread, 3)),
        radius=cable.radius * float(rng.uniform(0.6, 1.8)),
        x=turn @ cable.x,
        y=turn @ cable.y,
        z=turn @ cable.z,
    )


def _body(paper: Body, rng: np.random.Generator, spread: float, turn: Matrix3) -> Body:
    """Centre of mass and inertia about P of a body `spread` times as large, its moments about G changed one by one."""
    com: Vector3 = turn @ (spread * paper.com + rng.normal(0.0, [5e-3, 5e-3, 0.012], 3))
    moments = spread**2 * np.diag(paper.inertia_about_com) * rng.uniform(0.85, 1.2, 3)
    return Body.from_about_com(com, turn @ np.diag(moments) @ turn.T)
