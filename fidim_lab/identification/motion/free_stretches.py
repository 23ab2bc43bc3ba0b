"""Where a platform swings freely, in recordings of a robot whose geometry is known only by survey.

With locked motors the Newton–Euler equations, projected on what the cables leave free, balance by themselves (Eq. 21).
What is left over is a hand, a catch or a touch. A surveyed geometry leaves something over too, nearly constant within
one recording: its median is taken away. A stretch is free where what remains is near the recording's own usual level
and the platform moves. Unlike `hand_free` no share of the inertial forces is asked for, so slow swings count, and the
friction of a real joint, which grows beside them as they die away, does not cut them.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import Positions, Rotations, Series, runs
from fidim_lab.errors import RefusedError
from fidim_lab.identification.motion.hand_free import FreeStretch, moving_mean, sampling_step, smooth_motion
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.regressor import parameter_vector, platform_regressor


@dataclass(frozen=True)
class StretchRule:
    """The thresholds. Of 57 recordings with known releases, a factor of 3, 4 or 6 finds 51, 53 or 50 within 0.3 s."""

    low_pass: float = 8.0
    """Hz, zero phase"""
    over: float = 0.4
    """s, over which the residual is averaged"""
    factor: float = 4.0
    """times the recording's own level"""
    least: float = 0.02
    """m/s², added to it: what white noise of 0.02 mm at 100 Hz leaves after the low-pass"""
    speed: float = 0.003
    """m/s; slower than this it hangs still"""
    over_speed: float = 1.0
    """s, over which the speed is averaged: longer than half a swing"""
    shortest: float = 3.0
    """s: two or more swings of any such robot"""
    arm: float = 0.2
    """m, by which rotations are made comparable with translations"""


def find_free_motion(
    mechanism: Mechanism, t: Series, positions: Positions, rotations: Rotations, rule: StretchRule | None = None
) -> tuple[FreeStretch, ...]:
    """Find the free stretches of one recording, in the order of time; arguments as of `find_hand_free`.

    Raises RefusedError where the recording is too short or nothing moves, InfeasibleError at a singular pose.
    """
    rule = rule or StretchRule()
    step = sampling_step(t, rule.shortest)
    motion = smooth_motion(t, positions, rotations, rule.low_pass)
    scale = np.array([1.0, 1.0, 1.0, rule.arm, rule.arm, rule.arm])
    free = _free_directions(mechanism.structure_matrix(motion.positions, motion.rotations) / scale)
    regressor = platform_regressor(motion, mechanism.robot.gravity)
    wrench = (regressor @ parameter_vector(mechanism.robot.nominal)) / scale
    left_over = np.einsum("nij,nj->ni", free, wrench)
    speed = np.sqrt(
        np.maximum(moving_mean(((motion.twists * scale) ** 2).sum(axis=1), round(rule.over_speed / step)), 0.0)
    )
    moves = speed > rule.speed
    if moves.sum() * step < rule.shortest:
        raise RefusedError(f"The platform moves for {moves.sum() * step:.1f} s only; {rule.shortest:g} s are needed.")
    left_over = left_over - np.median(left_over[moves], axis=0)
    residual = np.sqrt(np.maximum(moving_mean((left_over**2).sum(axis=1), round(rule.over / step)), 0.0))
    level = float(np.median(residual[moves]))
    calm = moves & (residual < rule.factor * level + rule.least)
    found = (FreeStretch(float(t[a]), float(t[b - 1])) for a, b in runs(calm))
    return tuple(stretch for stretch in found if stretch.duration >= rule.shortest)


def _free_directions(structure: Float[np.ndarray, "N n 6"]) -> Float[np.ndarray, "N 6 6"]:
    """Projector on what the cables leave free; unlike a basis it changes smoothly with the pose."""
    held = np.linalg.pinv(structure) @ structure
    return np.eye(6) - held
