"""Every effect against the independent simulation that hides it: sim_backends shares no formula with the model.

Both start from the same state; what is left between them is compared with the effect's own influence.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
import pytest

from benchmarks.identification.elastic_motion import simulate_elastic_motion
from fidim_lab.data.records import Pose, Robot
from fidim_lab.effects.catalogue import by_id
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.effects.geometry.markers import MarkerStalk
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import consistent_twist, simulate_free_motion
from fidim_lab.model.motion.contributions import seen_compliances_at
from fidim_lab.model.motion.dynamics import default_extra
from fidim_lab.model.motion.forcing import sightings, start_gaps
from fidim_lab.model.sensitivity.grid import FINE, Grid
from fidim_lab.model.sensitivity.integrate import States, integrate
from fidim_lab.model.sensitivity.markers import at_nodes
from fidim_lab.model.sensitivity.measurement import MarkerMeasurement
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.plant import Plant
from sim_backends.plant.sensors import Cameras
from sim_backends.plant.world import World, make_world

LENGTHS = np.array([1.42, 1.40, 1.45, 1.47])
ASIDE = np.array([0.03, -0.02])
TIMES = np.arange(0, 1.0001, 0.02)

# as hidden, as named (id, variant, cable), θ as a function of the middle of the entry points
CASES: list[tuple[str, tuple[str, int, int | None], Callable[[np.ndarray], list[float]]]] = [
    ("air-drag-linear:c=0.5", ("air-drag-linear", 0, None), lambda _: [0.5]),
    ("air-drag-quadratic:c=1", ("air-drag-quadratic", 0, None), lambda _: [1.0]),
    ("rotational-drag:c=0.04", ("rotational-drag", 0, None), lambda _: [0.04]),
    ("rotational-drag:c=0.03", ("rotational-drag", 1, None), lambda _: [0.03] * 3),
    ("rotational-drag-quadratic:c=0.1", ("rotational-drag-quadratic", 0, None), lambda _: [0.1]),
    ("swivel-friction:c=0.007", ("swivel-friction", 0, None), lambda _: [0.007]),
    ("swivel-friction:c=0.02,give=0.03", ("swivel-friction", 5, None), lambda _: [0.02, 0.03]),
    ("swivel-damping:c=0.02", ("swivel-damping", 0, None), lambda _: [0.02]),
    ("swivel-inertia:J=0.01", ("swivel-inertia", 0, None), lambda _: [0.01]),
    ("pulley-friction:viscous=0.03,dry=0.01", ("pulley-friction", 0, None), lambda _: [0.03, 0.01]),
    ("pulley-friction:viscous=0,dry=0,arm=2e-4", ("pulley-friction", 5, None), lambda _: [2e-4]),
    ("attachment-friction:viscous=0.02,dry=0.01", ("attachment-friction", 0, None), lambda _: [0.02, 0.01]),
    ("cable-creep:cable=2,delta=0.003,T=2", ("cable-creep", 0, 2), lambda _: [0.003, 2.0]),
    ("cable-mass:mu=0.02", ("cable-mass", 0, None), lambda _: [0.02]),
    ("cable-torsion:k=0.1,p=0.02", ("cable-torsion", 0, None), lambda _: [0.1, 0.02]),
    ("cable-torsion:k=0,hose=0.3", ("cable-torsion", 1, None), lambda _: [0.3, 0.0]),
    ("lay-torque:c=3e-4", ("lay-torque", 0, None), lambda _: [3e-4]),
    ("anchor-offset:cable=4,dx=0.006,dy=0.002,dz=-0.003", ("anchor-offset", 0, 4), lambda _: [0.006, 0.002, -0.003]),
    ("attachment-offset:cable=3,dx=6e-3,dy=2e-3,dz=1e-3", ("attachment-offset", 0, 3), lambda _: [6e-3, 2e-3, 1e-3]),
    ("pulley-radius:dr=0.002", ("pulley-radius", 0, None), lambda _: [0.002]),
    ("gravity-tilt:rx=0.004,ry=-0.003", ("gravity-tilt", 0, None), lambda _: [0.004, -0.003]),
    ("periodic-force:f=1.1,psi=0", ("periodic-force", 0, None), lambda _: [0.1, 0.4, 0.05, 0, 0, 0, 1.1]),
    ("constant-force", ("constant-force", 0, None), lambda _: [0.3, -0.4, 0.0]),
    ("body-force", ("body-force", 0, None), lambda _: [0.3, 0.2, 0.0, 0.0, 0.0, 0.03]),
    (
        "umbilical:k=4,c=0.3,bx=0.1,by=-0.05,bz=0.2",
        ("umbilical", 0, None),
        lambda middle: [4, 0.3, *(4 * (np.array([0.6, 0.5, 0.3]) + middle)), 0.1, -0.05, 0.2],
    ),
    ("umbilical:k=4,c=0.3,rest=0.5", ("umbilical", 1, None), lambda _: [4, 0.3, 0.6, 0.5, 0.3, 0.5, 0, 0, 0]),
    ("loose-mass:m=0.3,f=2.6,zeta=0.03,bz=0.15", ("loose-mass", 0, None), lambda _: [0.3, 2.6, 0.03, 0, 0, 0.15]),
]


@dataclass(frozen=True, eq=False)
class Hidden:
    """A motion of the plant with something hidden, and its state at the start."""

    plant: Plant
    pose: Pose
    twist: np.ndarray
    tensions: np.ndarray
    """N, at the start"""
    markers: np.ndarray
    """(N, 3) the main one at TIMES, true"""


def _world(robot: Robot, *texts: str) -> World:
    hidden = tuple(parse_effect(text, robot.n) for text in texts)
    return replace(make_world(robot, np.random.default_rng(0), hidden, body=robot.nominal), mass=robot.mass)


@pytest.fixture(scope="module")
def hide(irma4) -> Callable[[str], Hidden]:
    def release(text: str) -> Hidden:
        plant = Plant(_world(irma4, text))
        plant.place(plant.rest(LENGTHS, displacement=ASIDE), LENGTHS)
        plant.begin_window(1)
        state, pose, tensions = plant._motion.x, plant.pose, plant.tensions
        spin = pose.rotation @ state[10:13]
        twist = np.concatenate([state[7:10] - np.cross(spin, pose.rotation @ irma4.nominal.com), spin])
        seen = [plant.markers()[0]]
        for t in TIMES[1:]:
            plant.advance(t)
            seen.append(plant.markers()[0])
        return Hidden(plant, pose, twist, tensions, np.array(seen))

    return release


def _markers(mechanism: Mechanism, found: Hidden) -> np.ndarray:
    body = mechanism.robot.nominal
    twist = consistent_twist(mechanism, body, found.pose, found.twist)
    motion = simulate_free_motion(mechanism, body, found.pose, twist, TIMES).motion
    return motion.positions + motion.rotations @ mechanism.robot.marker


def _effect(robot: Robot, named: tuple[str, int, int | None]) -> NamedEffect:
    return by_id(robot, named[0], named[2])[named[1]]


@pytest.mark.parametrize(("text", "named", "theta_of"), CASES, ids=[case[0].split(",")[0] for case in CASES])
def test_motion(text, named, theta_of, irma4, hide):
    found = hide(text)
    middle = np.mean([cable.d for cable in irma4.cables], axis=0)
    completed = Mechanism(irma4, (_effect(irma4, named),), theta_of(middle))
    influence = np.abs(_markers(Mechanism(irma4), found) - found.markers).max()
    left = np.abs(_markers(completed, found) - found.markers).max()
    assert influence > 2e-5
    assert left < 5e-5 * influence


def _stretched(robot, hide, text, effect, softness):
    """Influence, and what first order and springs leave of it."""
    found = hide(text)
    mechanism = Mechanism(robot, (effect,), [softness, *effect.absent[1:]])
    springs = simulate_elastic_motion(mechanism, robot.nominal, found.pose, found.twist, TIMES, LENGTHS).motion
    return tuple(
        np.abs(markers - found.markers).max()
        for markers in (
            _markers(Mechanism(robot), found),
            _markers(mechanism, found),
            springs.positions + springs.rotations @ robot.marker,
        )
    )


@pytest.mark.parametrize(("EA", "first_order"), [(1e6, 0.05), (1e7, 5e-3)])
def test_elastic_cables(EA, first_order, irma4, hide):
    effect = _effect(irma4, ("cable-elasticity", 0, None))
    influence, left, exactly = _stretched(irma4, hide, f"cable-elasticity:EA={EA}", effect, 1 / EA)
    assert left < first_order * influence
    assert exactly < 1e-4 * influence


def test_elastic_cables_whatever_their_length(irma4, hide):
    effect = _effect(irma4, ("cable-elasticity", 1, None))
    influence, _, exactly = _stretched(irma4, hide, "cable-elasticity:k=6e4,c=40", effect, 1 / 6e4)
    assert exactly < 1e-5 * influence


@pytest.mark.parametrize(("k", "first_order"), [(1e6, 0.03), (1e7, 3e-3)])
def test_posts_that_bend(k, first_order, irma4, hide):
    """The plant moves the pulleys; the model has what that stores depend on the pose."""
    effect = _effect(irma4, ("frame-compliance", 0, None))
    influence, left, exactly = _stretched(irma4, hide, f"frame-compliance:k={k}", effect, 1 / k)
    assert left < first_order * influence
    assert exactly < 1e-3 * influence


def test_one_elastic_cable_among_rigid_ones(irma4, hide):
    effect = _effect(irma4, ("cable-elasticity", 0, 2))
    influence, left, exactly = _stretched(irma4, hide, "cable-elasticity:cable=2,EA=1e6", effect, 1 / 1e6)
    assert left < 0.05 * influence
    assert exactly < 1e-3 * influence


def test_a_winch_that_yields_and_its_encoder(irma4, hide):
    effect, k = _effect(irma4, ("winch-hold-compliance", 0, 1)), 1e6
    influence, left, exactly = _stretched(irma4, hide, f"winch-hold-compliance:cable=1,k={k}", effect, 1 / k)
    assert left < 0.05 * influence
    assert exactly < 1e-4 * influence
    plant = hide(f"winch-hold-compliance:cable=1,k={k}").plant
    seen = seen_compliances_at(Mechanism(irma4, (effect,)), [None] * 4, ca.SX([1 / k]))
    reading = LENGTHS + np.array(ca.DM(seen)).ravel() * plant.tensions / irma4.mass
    np.testing.assert_allclose(plant.encoder_lengths(), reading, atol=1e-12)
    assert np.abs(reading - LENGTHS).max() > 1e-5


@pytest.mark.parametrize(
    ("text", "named", "theta", "tolerance"),
    [
        ("cable-length-bias:cable=2,bias=0.004", ("cable-length-bias", 0, 2), [0.004], 1e-9),
        ("anchor-offset:cable=4,dx=0.006,dy=0,dz=0", ("anchor-offset", 0, 4), [0.006, 0, 0], 1e-9),
        ("attachment-offset:cable=1,dx=0.006,dy=0,dz=0", ("attachment-offset", 0, 1), [0.006, 0, 0], 1e-9),
        ("pulley-radius:dr=0.003", ("pulley-radius", 0, None), [0.003], 1e-9),
        ("cable-creep:cable=2,delta=0.003,T=2", ("cable-creep", 0, 2), [0.003, 2.0], 1e-9),
        ("cable-elasticity:EA=1e6", ("cable-elasticity", 0, None), [1e-6, 40.0], 2e-7),
        ("winch-hold-compliance:cable=1,k=1e6", ("winch-hold-compliance", 0, 1), [1e-6, 40.0], 2e-7),
    ],
)
def test_lengths_at_the_start(text, named, theta, tolerance, irma4, hide):
    """Geometry, bias and stretch together give what the encoders read with no tension: the held lengths."""
    found = hide(text)
    mechanism = Mechanism(irma4, (_effect(irma4, named),), theta)
    inputs = [0, found.pose.position, found.pose.rotation.ravel(), found.twist, [], irma4.nominal.vector, theta]
    lengths = np.array(start_gaps(mechanism)(*inputs)[0]).ravel()
    np.testing.assert_allclose(lengths, LENGTHS, atol=tolerance)
    geometric = Mechanism(irma4).lengths(found.pose.position[None], found.pose.rotation[None])[0]
    if named[0] != "cable-creep":
        assert np.abs(geometric - LENGTHS).max() > 100 * tolerance


def test_a_swaying_frame(irma4, hide):
    """The plant moves the anchors; the model moves with the frame, and the cameras see both."""
    f, amplitude = 1.1, np.array([1e-3, 5e-4, 0.0])
    found = hide(f"frame-sway:ax=1e-3,ay=5e-4,az=0,f={f},psi=0")
    theta = [*amplitude, 0, 0, 0, f]
    mechanism = Mechanism(irma4, (_effect(irma4, ("frame-sway", 0, None)),), theta)
    against_frame = np.concatenate([found.twist[:3] - 2 * np.pi * f * amplitude, found.twist[3:]])
    twist = consistent_twist(mechanism, irma4.nominal, found.pose, against_frame)
    motion = simulate_free_motion(mechanism, irma4.nominal, found.pose, twist, TIMES).motion
    compiled = sightings(mechanism)
    seen = [
        np.array(compiled(t, p, R.ravel(), v, [], np.zeros(6), theta)[0]).ravel()
        for t, p, R, v in zip(TIMES, motion.positions, motion.rotations, motion.twists, strict=True)
    ]
    influence = np.abs(_markers(Mechanism(irma4), found) - found.markers).max()
    assert influence > 1e-4
    assert np.abs(np.array(seen) - found.markers).max() < 5e-5 * influence


@pytest.mark.parametrize(("k", "zeta", "axis", "leans"), [(3e-4, 0.05, 2, (0.2, -0.3)), (1.3e-4, 0.6, 1, (0, 0.1))])
def test_a_marker_on_a_stalk(k, zeta, axis, leans, irma4, hide):
    """The plant carries the marker as a state of its own; the model makes it out of the platform's motion."""
    along = np.roll([1.0, *leans], axis)
    keys = ",".join(f"e{axis}={value}" for axis, value in zip("xyz", along, strict=True))
    found = hide(f"marker-stalk:k={k},zeta={zeta},{keys}")
    mechanism = Mechanism(irma4, (MarkerStalk(axis=axis),), [k, zeta, *leans])
    states = States(found.pose.position[None], found.pose.rotation[None], found.twist[None])
    shared, grid = np.concatenate([irma4.nominal.vector, mechanism.theta]), Grid.covering(TIMES[-1], FINE)
    motion = integrate(mechanism, shared, states, grid, np.zeros(1))
    cameras = MarkerMeasurement(mechanism, mechanism.theta)
    seen = cameras.seen(at_nodes(motion, cameras.followed(irma4.markers))[0], 1, grid, TIMES, 0.0)[:, 0]
    influence = np.abs(_markers(Mechanism(irma4), found) - found.markers).max()
    assert influence > 1e-4
    assert np.abs(seen - found.markers).max() < 1e-3 * influence


@pytest.mark.parametrize(
    ("text", "named", "theta"),
    [
        ("marker-offset:dx=4e-3,dy=-3e-3,dz=2e-3", ("marker-offset", 0, None), [4e-3, -3e-3, 2e-3]),
        (
            "frame-misalignment:rx=4e-3,ry=-3e-3,rz=5e-3,dx=2e-3,dy=-2e-3,dz=1e-3",
            ("frame-misalignment", 0, None),
            [4e-3, -3e-3, 5e-3, 2e-3, -2e-3, 1e-3],
        ),
        ("capture-scale:scale=3e-3", ("capture-scale", 0, None), [3e-3]),
        ("clock-rate:rate=0.01", ("clock-rate", 0, None), [0.01]),
        ("time-offset:offset=0.02", ("time-offset", 0, None), [0.02]),
    ],
)
def test_what_cameras_see(text, named, theta, irma4, hide, sample):
    world = _world(irma4, text)
    cameras = Cameras(world, 0.0, np.random.default_rng(0))
    mechanism = Mechanism(irma4, (_effect(irma4, named),))
    stamp = 3.0
    true = sample.position + world.markers @ sample.rotation.T
    state = (sample.position, sample.rotation.ravel(), sample.twist)
    seen, time = sightings(mechanism)(stamp, *state, [], np.zeros(6), theta)[:2]
    np.testing.assert_allclose(np.array(seen).ravel(), cameras.see(stamp, true).ravel(), atol=5e-8)
    assert float(time) == pytest.approx(cameras.exposure(stamp), abs=1e-12)


def test_extra_states_start_where_the_plant_has_them(irma4, hide):
    effect, _ = by_id(irma4, "loose-mass")
    plant = Plant(_world(irma4, "loose-mass:m=0.3,f=2.6,zeta=0.03,bz=0.15"))
    plant.place(plant.rest(LENGTHS, displacement=ASIDE), LENGTHS)
    mechanism = Mechanism(irma4, (effect,), [0.3, 2.6, 0.03, 0, 0, 0.15])
    np.testing.assert_allclose(default_extra(mechanism, plant.pose, np.zeros(6)), plant._motion.x[13:], atol=1e-9)
