"""What each effect must obey whatever its size: energy, the frame it is written in, and known equivalences."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fidim_lab.effects.catalogue import by_id
from fidim_lab.effects.plausibility import Context
from fidim_lab.model.kinematics import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.modes import modes
from fidim_lab.model.motion import simulate_free_motion
from fidim_lab.model.motion.contributions import inertia_at
from fidim_lab.model.motion.rigid_body import energy

DISSIPATIVE = [
    "air-drag-linear",
    "air-drag-quadratic",
    "rotational-drag",
    "rotational-drag-quadratic",
    "swivel-friction",
    "swivel-damping",
    "pulley-friction",
    "attachment-friction",
]
IN_THE_BODY_OR_THE_CABLES = [*DISSIPATIVE, "swivel-inertia", "cable-mass", "cable-elasticity", "loose-mass"]
LENGTHS = np.array([1.38, 1.39, 1.36, 1.32])
TIMES = np.arange(0, 1.001, 0.01)


@pytest.fixture(scope="module")
def swing(irma4):
    """A pose and a twist with which a mechanism of the robot is let go."""
    mechanism = Mechanism(irma4)
    rest = pose_from_lengths(mechanism, irma4.nominal, LENGTHS)
    return rest.pose, modes(mechanism, irma4.nominal, rest).shapes @ [0.15, -0.1]


def simulate(mechanism, swing, **changes):
    return simulate_free_motion(mechanism, mechanism.robot.nominal, *swing, changes.pop("times", TIMES), **changes)


@pytest.mark.parametrize("id", DISSIPATIVE)
def test_what_dissipates_takes_energy_in_every_motion(id, irma4, sample, probe, sized):
    rng = np.random.default_rng(5)
    for effect in by_id(irma4, id):
        theta = sized(effect)
        for _ in range(0 if effect.extra_states else 4):  # what has built up gives some of it back
            moving = probe(effect, at=replace(sample, twist=rng.normal(size=6)))
            baseline = probe(at=moving.sample)
            force = moving(_wrench, theta)[0] - baseline(_wrench, np.zeros(0))[0]
            each = moving(_by_tension, theta)[0].reshape(6, irma4.n)  # of 1 N/kg in every cable
            assert (force + each.sum(axis=1)) @ moving.sample.twist < 0


def _by_tension(equations):
    return [ca.densify(equations.by_tension)]


def _wrench(equations):
    return [equations.wrench]


@pytest.mark.parametrize("id", ["swivel-inertia", "cable-mass"])
def test_added_inertia_obeys_the_power_theorem(id, irma4, probe, sized, sample):
    """v · (A v̇ + b) = dT/dt for any acceleration: bias and mass belong to one energy."""
    for effect in by_id(irma4, id):
        probed = probe(effect)
        mechanism = probed.mechanism
        acceleration = np.array([0.3, 1.0, -2.0, 1.5, -0.7, 0.4])

        def power(equations, mechanism=mechanism, acceleration=acceleration):
            mass, bias = inertia_at(mechanism, equations.state, equations.symbols.theta)
            twist = equations.symbols.twist
            stored = ca.dot(twist, mass @ twist) / 2
            taken = ca.dot(twist, mass @ ca.DM(acceleration) + bias)
            return [taken, equations.along(stored, ca.SX(ca.DM(acceleration))), ca.densify(mass)]

        taken, changed, mass = probed(power, sized(effect))
        assert taken == pytest.approx(changed, rel=1e-12)
        eigenvalues = np.linalg.eigvalsh(mass.reshape(6, 6))
        np.testing.assert_allclose(mass.reshape(6, 6), mass.reshape(6, 6).T)
        assert eigenvalues[0] > -1e-12
        assert eigenvalues[-1] > 1e-6


@pytest.mark.parametrize("id", IN_THE_BODY_OR_THE_CABLES)
def test_a_turned_world_turns_the_motion(id, irma4, sample, probe, sized):
    turn = Rotation.from_rotvec([0.4, -1.1, 0.7]).as_matrix()
    cables = tuple(replace(c, d=turn @ c.d, x=turn @ c.x, y=turn @ c.y, z=turn @ c.z) for c in irma4.cables)
    other = replace(irma4, cables=cables, gravity=turn @ irma4.gravity)
    both = np.kron(np.eye(2), turn)
    turned = replace(
        sample,
        robot=other,
        position=turn @ sample.position,
        rotation=turn @ sample.rotation,
        twist=both @ sample.twist,
    )
    for effect in by_id(irma4, id)[:2]:
        here, there = probe(effect), probe(effect, at=turned)
        theta = sized(effect)
        if id == "loose-mass":
            theta[0] = 0.0  # its own states would have to be turned too
        found, expected = (one(_solution, theta)[0] for one in (there, here))
        np.testing.assert_allclose(found[:6], both @ expected[:6], rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(found[6:], expected[6:], rtol=1e-10)


def _solution(equations):
    return [equations.solve()]


def test_the_mechanism_counts_per_unit_mass(irma4, sample, probe):
    """The same drag slows a heavier platform less."""
    [drag] = by_id(irma4, "air-drag-linear")
    heavy = replace(sample, robot=replace(irma4, mass=2 * irma4.mass))
    light, slow = ((probe(drag, at=one)(_wrench, np.array([0.5]))[0]) for one in (sample, heavy))
    nothing = probe(at=sample)(_wrench, np.zeros(0))[0]
    np.testing.assert_allclose(light - nothing, 2 * (slow - nothing), rtol=1e-9)
    speed = sample.twist[:3] + np.cross(sample.twist[3:], sample.rotation @ irma4.nominal.com)
    np.testing.assert_allclose((light - nothing)[:3], -0.5 * speed / irma4.mass, rtol=1e-9)


def test_a_tilt_of_gravity_is_a_steady_force(irma4, sample, probe):
    [tilt], [force] = by_id(irma4, "gravity-tilt"), by_id(irma4, "constant-force")
    angles = np.array([0.01, -0.02])
    turned = Rotation.from_rotvec([*angles, 0]).as_matrix() @ irma4.gravity
    same = irma4.mass * (turned - irma4.gravity)
    one, two = probe(tilt)(_wrench, angles)[0], probe(force)(_wrench, same)[0]
    np.testing.assert_allclose(one, two, atol=2e-5)
    assert np.abs(one - probe()(_wrench, np.zeros(0))[0]).max() > 0.05


def test_a_fast_clock_is_a_weaker_gravity(irma4, swing):
    rate = 0.01
    pose, twist = swing
    true = simulate(Mechanism(irma4), swing, times=TIMES / (1 + rate))
    [force] = by_id(irma4, "constant-force")
    lifted = Mechanism(irma4, (force,), irma4.mass * irma4.gravity * ((1 + rate) ** -2 - 1))
    seen = simulate(lifted, (pose, twist / (1 + rate)))
    np.testing.assert_allclose(seen.motion.positions, true.motion.positions, atol=1e-8)


def test_a_force_on_the_platform_and_a_swaying_frame_move_it_alike(irma4, swing):
    f, u = 1.3, np.array([1e-3, -5e-4, 0, 2e-4, 0, 1e-4])
    [sway, *_], [force, *_] = by_id(irma4, "frame-sway"), by_id(irma4, "periodic-force")
    pushed = simulate(Mechanism(irma4, (force,), [*(irma4.mass * (2 * np.pi * f) ** 2 * u), f]), swing)
    carried = simulate(Mechanism(irma4, (sway,), [*u, f]), swing)
    np.testing.assert_allclose(pushed.motion.positions, carried.motion.positions, atol=1e-12)


def test_a_phase_of_its_own_shifts_the_oscillation(irma4, swing):
    f, phase = 1.3, 0.8
    same, own = by_id(irma4, "periodic-force")
    sine, cosine = np.array([0.2, -0.1, 0.3]), np.array([0.1, 0.4, -0.2])
    turned = [
        *(np.cos(phase) * sine - np.sin(phase) * cosine),
        *(np.sin(phase) * sine + np.cos(phase) * cosine),
        f,
    ]
    one = simulate(Mechanism(irma4, (own,), [*sine, *cosine, f]), swing, extra=np.array([phase]))
    two = simulate(Mechanism(irma4, (same,), turned), swing)
    np.testing.assert_allclose(one.motion.positions, two.motion.positions, atol=1e-12)
    np.testing.assert_array_equal(one.extra_states, np.full((len(TIMES), 1), phase))


def test_a_heavy_spring_without_rest_length_is_the_same_hose(irma4, swing):
    taut, resting = by_id(irma4, "umbilical")
    k, end = 4.0, np.array([0.6, 0.5, 0.3])
    middle = np.mean([cable.d for cable in irma4.cables], axis=0)
    one = simulate(Mechanism(irma4, (taut,), [k, 0, *(k * (end + middle)), 0.1, 0, 0.2]), swing)
    two = simulate(Mechanism(irma4, (resting,), [k, 0, *end, 0, 0.1, 0, 0.2]), swing)
    np.testing.assert_allclose(one.motion.positions, two.motion.positions, atol=1e-7)


def test_a_mass_on_an_axis_keeps_the_energy(irma4, swing):
    """Kinetic and potential energy of both, spring included, without damping."""
    _, sliding = by_id(irma4, "loose-mass")
    m, f, place, axis = 0.6, 2.4, np.array([0.05, -0.1, 0.2]), np.array([0.6, 0.0, 0.8])
    mechanism = Mechanism(irma4, (sliding,), [m, f, 0.0, *place, *(1.5 * axis)])
    found = simulate(mechanism, swing, step=1e-3)
    motion, (s, w) = found.motion, found.extra_states.T
    arms, along = motion.rotations @ place, motion.rotations @ axis
    speeds = motion.twists[:, :3] + np.cross(motion.twists[:, 3:], arms)
    across = (speeds**2).sum(axis=1) - (along * speeds).sum(axis=1) ** 2
    height = -(motion.positions + arms + s[:, np.newaxis] * along) @ irma4.gravity
    own = m * ((across + w**2 + (2 * np.pi * f * s) ** 2) / 2 + height) / irma4.mass
    body = energy(mechanism, irma4.nominal, motion.positions, motion.rotations, motion.twists)
    assert np.ptp(own) > 1e4 * np.ptp(own + body)
    assert np.ptp(s) > 1e-3


@pytest.mark.parametrize(("variant", "axis"), [(0, ()), (1, (1.0, -0.5, 0.3)), (1, (0.0, 0.0, 2.0))])
def test_a_stiff_loose_mass_is_part_of_the_body(irma4, swing, variant, axis):
    """At 40 Hz it moves with the platform: the heavier body without it moves alike."""
    loose = by_id(irma4, "loose-mass")[variant]
    m, place = 0.5, np.array([0.05, -0.1, 0.2])
    found = simulate(Mechanism(irma4, (loose,), [m, 40.0, 0.7, *place, *axis]), swing, step=1e-3)
    body, share = irma4.nominal, m / irma4.mass
    point = np.array([place @ place - p * p for p in place])
    point = np.append(point, [-place[0] * place[1], -place[0] * place[2], -place[1] * place[2]])
    heavier = replace(
        body,
        com=(body.com + share * place) / (1 + share),
        inertia=(body.inertia + share * point) / (1 + share),
    )
    expected = simulate_free_motion(Mechanism(irma4), heavier, *swing, TIMES)
    without = simulate(Mechanism(irma4), swing)
    gap = np.abs(found.motion.positions - expected.motion.positions).max()
    assert gap < 0.02 * np.abs(without.motion.positions - expected.motion.positions).max()


def test_a_motion_sharpens_what_is_plausible(irma4, swing):
    mechanism = Mechanism(irma4)
    found = simulate(mechanism, swing)
    context = Context.of_motion(mechanism, found.motion, irma4.mass * found.tensions)
    assert context.tension == pytest.approx((irma4.mass * found.tensions).mean(axis=0))
    swivels = np.unwrap(mechanism.swivel_angles(found.motion.positions, found.motion.rotations), axis=0)
    rates = np.abs(np.gradient(swivels, TIMES, axis=0))
    assert context.swivel_rate == pytest.approx(np.percentile(rates, 95, axis=0).max(), rel=0.05)
    wraps = mechanism.wrap_angles(found.motion.positions, found.motion.rotations)
    rates = np.abs(np.gradient(wraps, TIMES, axis=0))
    assert context.wrap_rate == pytest.approx(np.percentile(rates, 95, axis=0).max(), rel=0.05)
    assert context.speed < Context.of(irma4).speed
