"""The completed model: what it refuses, springs on their own, and that machine code gives the same."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from benchmarks.identification.elastic_motion import simulate_elastic_motion
from fidim_lab.effects.cables.cable_elasticity import CableElasticity, CableStiffness, WinchHoldCompliance
from fidim_lab.effects.dissipation.drag import AirDragLinear
from fidim_lab.effects.geometry.cable_geometry import CableCreep
from fidim_lab.effects.loads.loose_mass import LooseMass
from fidim_lab.effects.wrenches import at_arm
from fidim_lab.errors import InfeasibleError, OurBugError, SetupError
from fidim_lab.model.kinematics import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.modes import modes
from fidim_lab.model.motion import consistent_twist, simulate_free_motion
from fidim_lab.model.motion.rigid_body import energy
from fidim_lab.model.slots import PlatformState

LENGTHS = np.array([1.38, 1.39, 1.36, 1.32])
TIMES = np.arange(0, 0.5001, 0.01)


@pytest.fixture(scope="module")
def swing(irma4):
    mechanism = Mechanism(irma4)
    rest = pose_from_lengths(mechanism, irma4.nominal, LENGTHS)
    return rest.pose, modes(mechanism, irma4.nominal, rest).shapes @ [0.1, -0.1]


class Undamped(CableStiffness):
    def stretch_damping(self, number, theta):
        return ca.SX(0)


def test_springs_keep_energy(irma4, swing):
    """Kinetic, potential and stored in the cables, ½ stretch²/κ."""
    k = 1e5
    mechanism = Mechanism(irma4, (Undamped(),), [1 / k])
    pose, twist = swing
    shorter = LENGTHS - irma4.mass * np.array([7.0, 5.0, 6.0, 8.0]) / k
    found = simulate_elastic_motion(mechanism, irma4.nominal, pose, twist + 0.02, TIMES, shorter)
    motion = found.motion
    stored = energy(mechanism, irma4.nominal, motion.positions, motion.rotations, motion.twists)
    stretch = mechanism.lengths(motion.positions, motion.rotations) - shorter
    np.testing.assert_allclose(found.tensions, k * stretch / irma4.mass, rtol=1e-9)
    springs = k / 2 * (stretch**2).sum(axis=1) / irma4.mass
    assert np.ptp(springs) > 1e-4
    assert np.ptp(stored + springs) < 1e-5 * np.ptp(springs)


def test_compliances_in_series_add(irma4, swing):
    pose, twist = swing
    softer = Mechanism(irma4, (Undamped(), Undamped()), [1e-6, 2e-6])
    one = Mechanism(irma4, (Undamped(),), [3e-6])
    args = (irma4.nominal, pose, twist, TIMES[:20], LENGTHS - 3e-4)
    np.testing.assert_allclose(
        simulate_elastic_motion(softer, *args).motion.positions,
        simulate_elastic_motion(one, *args).motion.positions,
        atol=1e-13,
    )


class PullingLess(Undamped):
    """A tenth of each tension does not reach the platform."""

    def tension_wrench(self, number, state, theta):
        cable = state.cables[number - 1]
        return 0.1 * at_arm(cable.arm, cable.direction)


def test_what_grows_with_tension_adds_to_the_pull(irma4, swing):
    pose, twist = swing
    args = (irma4.nominal, pose, twist, TIMES[:20], LENGTHS - 3e-4)
    losing = simulate_elastic_motion(Mechanism(irma4, (PullingLess(),), [1e-6]), *args)
    softer = simulate_elastic_motion(Mechanism(irma4, (Undamped(),), [1e-6 / 0.9]), *args)
    np.testing.assert_allclose(losing.motion.positions, softer.motion.positions, atol=1e-12)
    np.testing.assert_allclose(0.9 * losing.tensions, softer.tensions, rtol=1e-9)


def test_a_rigid_cable_is_no_spring(irma4, swing):
    mechanism = Mechanism(irma4, (WinchHoldCompliance(cable=3),))
    with pytest.raises(SetupError, match="Cable 3 cannot be a spring: its compliance is 0 m"):
        simulate_elastic_motion(mechanism, irma4.nominal, *swing, TIMES, LENGTHS)


def test_a_creeping_cable_lets_the_platform_go_with_it(irma4, swing):
    pose, twist = swing
    mechanism = Mechanism(irma4, (CableCreep(cable=2),), [0.01, 0.5])
    with pytest.raises(InfeasibleError, match=r"would stretch cable 2 by -2.0e-02 m/s.*consistent_twist"):
        simulate_free_motion(mechanism, irma4.nominal, pose, twist, TIMES)
    following = consistent_twist(mechanism, irma4.nominal, pose, twist)
    motion = simulate_free_motion(mechanism, irma4.nominal, pose, following, TIMES).motion
    grown = mechanism.lengths(motion.positions, motion.rotations) - LENGTHS
    expected = np.outer(0.01 * -np.expm1(-TIMES / 0.5), [0, 1, 0, 0])
    np.testing.assert_allclose(grown, expected, atol=1e-7)


def test_stretch_follows_the_tension(irma4, swing):
    """To first order in the compliance, all along the motion."""
    softness = 1e-8
    mechanism = Mechanism(irma4, (CableElasticity(),), [softness])
    pose, twist = swing
    following = consistent_twist(mechanism, irma4.nominal, pose, twist)
    found = simulate_free_motion(mechanism, irma4.nominal, pose, following, TIMES)
    motion = found.motion
    lengths = mechanism.lengths(motion.positions, motion.rotations)
    free = lengths - np.array([c.radius for c in irma4.cables]) * mechanism.wrap_angles(
        motion.positions, motion.rotations
    )
    stretch = softness * free * irma4.mass * found.tensions
    assert np.ptp(stretch, axis=0).min() > 1e-8
    np.testing.assert_allclose(lengths - lengths[0], stretch - stretch[0], atol=2e-9)


def test_a_state_that_lacks_something_is_our_bug(irma4):
    p, R, v, theta = ca.SX.sym("p", 3), ca.SX.sym("R", 3, 3), ca.SX.sym("v", 6), ca.SX.sym("theta", 6)
    loose, drag = Mechanism(irma4, (LooseMass(),)), Mechanism(irma4, (AirDragLinear(),))
    state = PlatformState(time=ca.SX(0), position=p, rotation=R, twist=v, cables=drag.cables_at(p, R, theta))
    with pytest.raises(OurBugError, match="6 extra states expected, 0 given"):
        loose.wrench_at(state, theta)
    with pytest.raises(OurBugError, match=r"centre of mass.*give it `com`"):
        drag.wrench_at(state, theta)
    assert drag.wrench_at(replace(state, com=p), theta).numel() == 6


def test_machine_code_gives_the_same_digits(irma4, swing, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    effects, theta = (LooseMass(), CableCreep(cable=1)), [0.3, 2.6, 0.03, 0, 0, 0.15, 0.0, 2.0]
    slow, fast = (Mechanism(irma4, effects, theta, native=native) for native in (False, True))
    one, two = (simulate_free_motion(m, irma4.nominal, *swing, TIMES) for m in (slow, fast))
    np.testing.assert_array_equal(one.motion.positions, two.motion.positions)
    np.testing.assert_array_equal(one.extra_states, two.extra_states)
    assert one.extra_states.shape == (len(TIMES), 6)
