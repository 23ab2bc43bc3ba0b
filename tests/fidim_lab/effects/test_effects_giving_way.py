"""Friction that gives way before it slips: a spring for small turns, dry friction for large ones."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fidim_lab.effects.attachment_friction import AttachmentFrictionGivingWay
from fidim_lab.model.slots import PlatformState

GIVING = AttachmentFrictionGivingWay()
DRY, ABOUT_Z, GIVE = 0.05, 0.2, 0.03
THETA = np.array([0.0, DRY, ABOUT_Z, GIVE])


@pytest.fixture(scope="module")
def turned():
    """(spin, extra) → torque about P and rates of the extra states, for a platform without cables that turns at P."""
    spin, extra = ca.SX.sym("spin", 3), ca.SX.sym("extra", 4)
    rotation = ca.SX.eye(3)
    state = PlatformState(ca.SX(0), ca.SX.zeros(3), rotation, ca.vertcat(ca.SX.zeros(3), spin), (), extra=extra)
    outputs = [GIVING.wrench(state, ca.SX(THETA))[3:], GIVING.extra_rates(state, ca.SX(THETA))]
    return ca.Function("turned", [spin, extra], outputs)


def about_z(turned, amplitude: float, turns: float = 3.0) -> tuple[np.ndarray, np.ndarray]:
    """Angle (rad) and torque (N m) about z in the last of some oscillations at 1 rad/s."""

    def rates(t, extra):
        return np.array(turned([0, 0, amplitude * np.cos(t)], extra)[1]).ravel()

    t = np.linspace(0, 2 * np.pi * turns, 6001)
    found = solve_ivp(rates, (0, t[-1]), np.zeros(4), t_eval=t, rtol=1e-9, atol=1e-11)
    spins = amplitude * np.cos(t)
    torque = np.array([float(turned([0, 0, spin], b)[0][2]) for spin, b in zip(spins, found.y.T, strict=True)])
    last = t >= 2 * np.pi * (turns - 1)
    return amplitude * np.sin(t[last]), torque[last]


def test_a_small_turn_meets_a_spring(turned):
    angle, torque = about_z(turned, 1e-4 * GIVE)
    # REST_RATE forgets nothing here but slowly: the torque goes with the angle
    slope = np.polyfit(angle, torque, 1)[0]
    assert np.abs(torque).max() < 2e-4 * ABOUT_Z
    assert slope < 0


def test_a_large_turn_meets_dry_friction(turned):
    angle, torque = about_z(turned, 1.0)
    assert np.abs(torque).max() == pytest.approx(ABOUT_Z, rel=0.02)
    work = -np.trapezoid(torque, angle)
    assert work == pytest.approx(4 * ABOUT_Z * 1.0, rel=0.1), "a path of four amplitudes against the dry torque"


def test_a_turn_of_the_size_of_the_give_meets_both(turned):
    angle, torque = about_z(turned, GIVE)
    work = -np.trapezoid(torque, angle)
    assert 0 < work < 4 * ABOUT_Z * GIVE
    stiffness = -(torque @ angle) / (angle @ angle)
    large = about_z(turned, 10 * GIVE)
    assert stiffness > 3 * -(large[1] @ large[0]) / (large[0] @ large[0]), "small swings are held more stiffly"


def test_built_up_it_points_against_the_rotation(turned):
    """As friction that slips at once does: there b neither grows nor turns."""
    spin = np.array([0.4, -1.2, 0.7])
    there = np.concatenate([spin / np.linalg.norm(spin), [1.0]])
    torque, rates = (np.array(value).ravel() for value in turned(spin, there))
    np.testing.assert_allclose(rates, 0.0, atol=1e-2 * np.linalg.norm(spin) / GIVE)
    np.testing.assert_allclose(torque, [0.0, 0.0, -ABOUT_Z], atol=1e-12)  # without cables dry_z alone
