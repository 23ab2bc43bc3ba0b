"""Friction that goes with the tension and gives way before it slips: a spring for small turns, then dry friction."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fidim_lab.effects.dissipation.attachment_friction import AttachmentFrictionGivingWay
from fidim_lab.model.kinematics import equilibrium_at
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.slots import PlatformState

GIVING = AttachmentFrictionGivingWay()
DRY, ABOUT_Z, GIVE = 0.05, 0.2, 0.03
ABOUT_Z_ALONE = (0.0, 0.0, ABOUT_Z, GIVE)


@pytest.fixture(scope="module")
def rubbed(irma4):
    """θ → (spin in the body frame, extra, tensions) → wrench, rates of the extra states, power; it turns about P."""
    mechanism = Mechanism(irma4)
    pose = equilibrium_at(mechanism, irma4.nominal, np.array([1.25, -0.15, -0.2])).pose
    position, rotation = ca.SX(ca.DM(pose.position)), ca.SX(ca.DM(pose.rotation))
    spin, extra, tensions = ca.SX.sym("spin", 3), ca.SX.sym("extra", 4), ca.SX.sym("tensions", 4)
    state = replace(
        PlatformState(ca.SX(0), position, rotation, ca.vertcat(ca.SX.zeros(3), rotation @ spin), ()),
        cables=mechanism.cables_at(position, rotation, ca.SX(0, 1)),
    ).of_effect(extra, irma4.mass, np.array(irma4.gravity))

    def made(theta):
        each = ca.horzcat(*(GIVING.tension_wrench(k, state, ca.SX(theta)) for k in (1, 2, 3, 4)))
        whole = GIVING.wrench(state, ca.SX(theta)) + each @ tensions
        rates, power = GIVING.extra_rates(state, ca.SX(theta)), ca.dot(state.twist, whole)
        return ca.Function("rubbed", [spin, extra, tensions], [whole, rates, power])

    return made


@pytest.fixture(scope="module")
def usual(irma4):
    """Tensions at which friction has the size that its parameters say, N."""
    return np.full(4, irma4.mass * np.linalg.norm(irma4.gravity) / 4)


@pytest.fixture(scope="module")
def about_z(rubbed, usual):
    """Angle (rad) and torque (N m) about the body's z axis in the last of some oscillations at 1 rad/s."""
    turned = rubbed(ABOUT_Z_ALONE)

    def found(amplitude: float, turns: float = 3.0) -> tuple[np.ndarray, np.ndarray]:
        def rates(t, extra):
            return np.array(turned([0, 0, amplitude * np.cos(t)], extra, usual)[1]).ravel()

        t = np.linspace(0, 2 * np.pi * turns, 6001)
        states = solve_ivp(rates, (0, t[-1]), np.zeros(4), t_eval=t, rtol=1e-9, atol=1e-11).y.T
        last = t >= 2 * np.pi * (turns - 1)
        spins = np.stack([0 * t, 0 * t, amplitude * np.cos(t)], axis=1)[last]
        torques = np.array([np.array(turned(*one, usual)[0])[3:, 0] for one in zip(spins, states[last], strict=True)])
        return amplitude * np.sin(t[last]), np.sign(torques[:, 2]) * np.linalg.norm(torques, axis=1)

    return found


def test_a_small_turn_meets_a_spring(about_z):
    angle, torque = about_z(1e-4 * GIVE)
    # REST_RATE forgets nothing here but slowly: the torque goes with the angle
    slope = np.polyfit(angle, torque, 1)[0]
    assert np.abs(torque).max() < 2e-4 * ABOUT_Z
    assert slope < 0


def test_a_large_turn_meets_dry_friction(about_z):
    angle, torque = about_z(1.0)
    assert np.abs(torque).max() == pytest.approx(ABOUT_Z, rel=0.02)
    work = -np.trapezoid(torque, angle)
    assert work == pytest.approx(4 * ABOUT_Z * 1.0, rel=0.1), "a path of four amplitudes against the dry torque"


def test_a_turn_of_the_size_of_the_give_meets_both(about_z):
    angle, torque = about_z(GIVE)
    work = -np.trapezoid(torque, angle)
    assert 0 < work < 4 * ABOUT_Z * GIVE
    stiffness = -(torque @ angle) / (angle @ angle)
    large = about_z(10 * GIVE)
    assert stiffness > 3 * -(large[1] @ large[0]) / (large[0] @ large[0]), "small swings are held more stiffly"


def test_built_up_it_takes_energy_and_stays(rubbed, usual):
    """As friction that slips at once: about n dry ‖ω‖ a second, for cables turn far less than the platform."""
    turned, spin = rubbed((0.0, DRY, 0.0, GIVE)), np.array([0.4, -1.2, 0.7])
    there = np.concatenate([spin / np.linalg.norm(spin), [1.0]])
    _, rates, power = (np.array(value).ravel() for value in turned(spin, there, usual))
    np.testing.assert_allclose(rates, 0.0, atol=1e-2 * np.linalg.norm(spin) / GIVE)
    assert power[0] == pytest.approx(-4 * DRY * np.linalg.norm(spin), rel=0.2)


def test_without_tension_only_viscous_friction_is_left(rubbed, usual):
    spin, built = [0.4, -1.2, 0.7], [0.3, -0.7, 0.4, 0.9]
    slack, viscous = (np.array(rubbed((0.02, d, d, GIVE))(spin, built, 0 * usual)[0]) for d in (DRY, 0.0))
    np.testing.assert_array_equal(slack, viscous)
    assert np.linalg.norm(slack) > 0.02


def test_twice_the_tension_is_twice_the_friction(rubbed, usual):
    turned, spin, built = rubbed((0.0, DRY, ABOUT_Z, GIVE)), [0.4, -1.2, 0.7], [0.3, -0.7, 0.4, 0.9]
    once, twice = (np.array(turned(spin, built, size * usual)[0]).ravel() for size in (1.0, 2.0))
    assert np.linalg.norm(once[3:]) > DRY
    np.testing.assert_allclose(twice, 2 * once, rtol=1e-12)
