"""`--hide`: what it reads and refuses, and that each effect changes the motion in the way its physics says."""

import re
from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Body
from fidim_lab.effects.catalogue import catalogue
from fidim_lab.errors import SetupError
from sim_backends.plant.hidden import CATALOGUE, parse_effect
from sim_backends.plant.plant import Plant
from sim_backends.plant.sensors import Cameras

LENGTHS = np.array([1.42, 1.40, 1.45, 1.47])
ASIDE = np.array([0.03, -0.02])

ONLY_SENSORS = {"frame-misalignment", "capture-scale", "clock-rate", "time-offset", "sensor-fault"}
DISSIPATIVE = {
    "air-drag-linear": "c",
    "air-drag-quadratic": "c",
    "rotational-drag": "c",
    "rotational-drag-quadratic": "c",
    "swivel-friction": "c",
    "swivel-damping": "c",
    "pulley-friction": "viscous",
    "attachment-friction": "viscous",
}


def test_every_effect_that_explain_knows_can_be_hidden(irma4):
    assert sorted(CATALOGUE) == sorted({effect.id for effect in catalogue(irma4)})


def test_an_effect_is_read_with_its_defaults():
    effect = parse_effect("anchor-offset:cable=4,dx=0.006", 4)
    assert (effect.id, effect.cable, effect["dx"], effect["dy"]) == ("anchor-offset", 4, 0.006, -0.004)
    assert parse_effect("cable-elasticity", 4).cable is None
    assert parse_effect("winch-hold-compliance", 4).cable == 1


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("air-drag", "Known: air-drag-linear"),
        ("air-drag-lineer", "Did you mean air-drag-linear? Known"),
        ("air-drag-linear:c=-0.1", "c is -0.1 N s/m (drag at the centre of mass); 0 or more can be meant"),
        ("sensor-fault:outliers=1.5", "1 or less can be meant"),
        ("swivel-friction:c=99999", "c is 99999 N m (dry torque about each swivel axis); 70 or less can be meant"),
        ("anchor-offset:cable=1,dx=-600", "-50 or more can be meant"),
        ("cable-creep:T=-1", "0 or more can be meant"),
        ("loose-mass:m=-1", "0 or more can be meant"),
        ("air-drag-linear:d=1", "Allowed: c"),
        ("air-drag-linear:c", "the key c has no value. Write c=NUMBER"),
        ("air-drag-linear:cable=1", "Allowed: c"),
        ("air-drag-linear:c=much", "not a finite number"),
        ("air-drag-linear:c=nan", "not a finite number"),
        ("anchor-offset:cable=5", "cables 1 to 4"),
        ("anchor-offset:cable=1.5", "cables 1 to 4"),
    ],
)
def test_what_cannot_be_hidden_is_refused_with_what_can(text, says):
    with pytest.raises(SetupError, match=re.escape(says)):
        parse_effect(text, 4)


def test_a_radius_below_zero_is_refused(world_of):
    with pytest.raises(SetupError, match="negative radius"):
        world_of("pulley-radius:dr=-0.03")


def _absent(effect: str) -> str:
    return effect + ":" + ",".join(f"{key}=0" for key in CATALOGUE[effect].keys)


@pytest.fixture(scope="module")
def clean(swing):
    return swing(duration=0.5)[1]


@pytest.mark.parametrize("effect", sorted(CATALOGUE))
@pytest.mark.sampled(10)
def test_an_effect_whose_parameters_are_zero_is_absent(effect, swing, clean):
    if effect == "cable-creep":
        text = "cable-creep:delta=0"
    elif effect == "loose-mass":
        text = "loose-mass:m=0"
    elif effect == "unknown":
        text = "unknown:k=0"
    elif effect == "hand-contact":
        text = "hand-contact:fx=0,fy=0,fz=0"
    else:
        text = _absent(effect)
    _, moved = swing(text, duration=0.2)
    assert np.abs(moved - clean[: len(moved)]).max() < 1e-8


@pytest.mark.parametrize("effect", sorted(set(CATALOGUE) - ONLY_SENSORS - {"hand-contact"}))
@pytest.mark.sampled(16)
def test_an_effect_of_default_size_is_seen(effect, swing, clean):
    _, moved = swing(effect, duration=0.5)
    assert 3e-6 < np.abs(moved - clean).max() < 0.1


@pytest.mark.parametrize("effect", ["air-drag-linear", "rotational-drag", "swivel-friction", "swivel-damping"])
@pytest.mark.parametrize("size", [1.0, 2.0])
@pytest.mark.sampled(4)
def test_what_dissipates_takes_energy_in_proportion(effect, size, world_of):
    default = CATALOGUE[effect].keys["c"].default
    lost = []
    for c in (0.1 * default, 0.1 * size * default):
        lost.append(_lost_energy(world_of(f"{effect}:c={c}")))
    assert lost[1] / lost[0] == pytest.approx(size, rel=0.05)


@pytest.mark.parametrize(("effect", "key"), DISSIPATIVE.items())
def test_dissipation_never_gives_energy(effect, key, world_of):
    plant = Plant(world_of(f"{effect}:{key}={CATALOGUE[effect].keys[key].default}"))
    plant.place(plant.rest(LENGTHS, displacement=np.array([0.03, -0.02])), LENGTHS)
    energies = [plant.energy()]
    for k in range(1, 41):
        plant.advance(k / 100)
        energies.append(plant.energy())
    assert np.diff(energies).max() < 1e-8
    assert energies[-1] < energies[0] - 1e-5


def _lost_energy(world) -> float:
    plant = Plant(world)
    plant.place(plant.rest(LENGTHS, displacement=np.array([0.03, -0.02])), LENGTHS)
    before = plant.energy()
    plant.advance(0.5)
    return before - plant.energy()


@pytest.mark.parametrize(
    "effect",
    [
        "swivel-inertia",
        "cable-mass:mu=0.1",
        "cable-elasticity:c=0",
        "umbilical:c=0",
        "loose-mass:zeta=0",
        "anchor-offset",
        "gravity-tilt",
        "pulley-radius",
    ],
)
def test_what_does_not_dissipate_keeps_energy(effect, world_of):
    plant = Plant(world_of(effect))
    plant.place(plant.rest(LENGTHS, displacement=np.array([0.03, -0.02])), LENGTHS)
    before = plant.energy()
    plant.advance(1.0)
    assert plant.energy() == pytest.approx(before, abs=1e-4)


@pytest.mark.parametrize("effect", ["swivel-inertia:J=0.05", "cable-elasticity:EA=3e4"])
def test_more_inertia_and_softer_cables_swing_more_slowly(effect, swing):
    def crossings(*effects: str) -> float:
        plant, seen = swing(*effects, duration=4.0)
        y = seen[:, 1] - plant.rest(LENGTHS).marker[1]
        at = np.flatnonzero(np.diff(np.sign(y)))
        return float(np.mean(np.diff(at[:9])))

    assert crossings(effect) > crossings() * 1.0005


def test_a_held_winch_gives_way_and_its_encoder_sees_it(world_of):
    plant = Plant(world_of("winch-hold-compliance:cable=2,k=1e5,c=0"))
    plant.settle(LENGTHS)
    np.testing.assert_allclose(plant.encoder_lengths() - LENGTHS, [0, plant.tensions[1] / 1e5, 0, 0], atol=1e-12)


def test_stretch_is_tension_times_length_over_stiffness(world_of, lengths_of):
    plant = Plant(world_of("cable-elasticity:EA=1e5,c=0"))
    rest = plant.settle(LENGTHS)
    stretch = lengths_of(plant.world, plant) - LENGTHS
    # ρ is the length without the wrap, some centimetres.
    np.testing.assert_allclose(stretch, rest.tensions * LENGTHS / 1e5, rtol=0.06)
    np.testing.assert_allclose(plant.encoder_lengths(), LENGTHS)


def test_creep_follows_its_exponential_unseen_by_the_encoder(world_of, lengths_of):
    plant = Plant(world_of("cable-creep:cable=3,delta=0.004,T=2"))
    plant.settle(LENGTHS)
    for k in range(1, 301):
        plant.advance(k / 100)
    crept = lengths_of(plant.world, plant) - LENGTHS
    np.testing.assert_allclose(crept, [0, 0, 0.004 * (1 - np.exp(-1.5)), 0], atol=1e-7)
    np.testing.assert_allclose(plant.encoder_lengths(), LENGTHS)


def test_an_encoder_zero_is_reading_minus_truth(world_of, lengths_of):
    plant = Plant(world_of("cable-length-bias:cable=2,bias=0.004"))
    plant.settle(LENGTHS)
    np.testing.assert_allclose(plant.encoder_lengths() - lengths_of(plant.world, plant), [0, 0.004, 0, 0], atol=1e-9)


def test_gravity_tilt_turns_the_weight_and_keeps_its_size(world_of):
    gravity = world_of("gravity-tilt:rx=0.01,ry=0").gravity
    np.testing.assert_allclose(gravity, [0.0, 9.81 * np.sin(0.01), -9.81 * np.cos(0.01)], atol=1e-12)


def test_a_load_is_part_of_the_body_from_its_time_on(world_of):
    """The same motion as of a world whose one body is both together, by the parallel-axis theorem."""
    mass, at = 0.4, np.array([0.06, -0.03, 0.11])
    world = world_of("body-step:m=0.4,x=0.06,y=-0.03,z=0.11,at=100")
    plain = world_of()
    total = world.mass + mass
    com = (world.mass * world.body.com + mass * at) / total
    point = mass * (at @ at * np.eye(3) - np.outer(at, at))[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    both = replace(plain, mass=total, body=Body(com, (world.mass * world.body.inertia + point) / total))
    for start, same in ((50.0, plain), (150.0, both)):
        (loaded, energy), (merged, other) = _released(world, start), _released(same, start)
        np.testing.assert_allclose(loaded, merged, atol=1e-8)
        np.testing.assert_allclose(energy - energy[0], other - other[0], atol=1e-6)
    assert np.abs(_released(both, 0.0)[0] - _released(plain, 0.0)[0]).max() > 1e-3


def _released(world, start):
    """Main marker and energy in the second after a release at `start`."""
    plant = Plant(world)
    plant.place(plant.rest(LENGTHS), LENGTHS, start)
    plant.place(plant.rest(LENGTHS, displacement=ASIDE), LENGTHS, start)
    seen = []
    for k in range(101):
        plant.advance(start + k / 100)
        seen.append((plant.markers()[0], plant.energy()))
    return np.array([one for one, _ in seen]), np.array([one for _, one in seen])


def test_the_swaying_frame_carries_the_platform_along(world_of, lengths_of):
    """Far below the platform's own frequencies it follows the frame as a whole."""
    plant = Plant(world_of("frame-sway:ax=0.002,ay=0,az=0,f=0.05,psi=0"))
    rest = plant.settle(LENGTHS)
    for k in range(1, 501):
        plant.advance(k / 100)
    assert plant.markers()[0, 0] - rest.marker[0] == pytest.approx(0.002, abs=2e-4)


def test_a_platform_begins_at_rest_against_a_swaying_frame(world_of, lengths_of):
    """Its cables have their lengths from the first moment, and keep them: nothing jerks."""
    plant = Plant(world_of("frame-sway:ax=0.002,ay=0.001,az=0,f=1.6,psi=1"))
    plant.settle(LENGTHS)
    begin = plant.markers()[0] - 2e-3 * np.sin(1.0) * np.array([1.0, 0.5, 0.0])
    still = Plant(world_of())
    np.testing.assert_allclose(begin, still.settle(LENGTHS).marker, atol=1e-9)
    plant.advance(1e-4)
    speed = (plant.markers()[0] - plant.markers(0.0)[0]) / 1e-4
    np.testing.assert_allclose(speed, 2e-3 * 3.2 * np.pi * np.cos(1.0) * np.array([1.0, 0.5, 0.0]), atol=1e-5)


def test_hand_contact_acts_in_its_time_and_window_only(swing, clean):
    _, touched = swing("hand-contact:start=0.3,stop=0.4", duration=0.5)
    np.testing.assert_allclose(touched[:31], clean[:31], atol=1e-9)
    assert np.abs(touched[50] - clean[50]).max() > 3e-5
    _, other = swing("hand-contact:start=0.3,stop=0.4,window=2", duration=0.5)
    np.testing.assert_allclose(other, clean, atol=1e-12)


def test_what_only_sensors_feel_leaves_the_motion_alone(swing, clean):
    _, moved = swing(*sorted(ONLY_SENSORS), duration=0.5)
    np.testing.assert_array_equal(moved, clean)


def test_a_marker_offset_moves_what_is_seen_not_what_happens(world_of):
    true, moved = Plant(world_of()), Plant(world_of("marker-offset:dx=0.01,dy=0,dz=0"))
    first, second = true.settle(LENGTHS), moved.settle(LENGTHS)
    np.testing.assert_allclose(first.pose.position, second.pose.position, atol=1e-12)
    np.testing.assert_allclose(second.marker - first.marker, second.pose.rotation @ [0.01, 0, 0], atol=1e-9)


def test_misaligned_cameras_turn_and_shift(world_of):
    cameras = Cameras(world_of("frame-misalignment:rx=0,ry=0,rz=0.01,dx=0.1,dy=0,dz=0"), 0.0, np.random.default_rng(0))
    seen = cameras.see(0.0, np.array([[1.0, 0.0, 2.0]]))
    np.testing.assert_allclose(seen, [[np.cos(0.01) + 0.1, np.sin(0.01), 2.0]], atol=1e-12)


def test_clocks_of_cameras_that_run_fast_or_late(world_of):
    cameras = Cameras(world_of("clock-rate:rate=0.01", "time-offset:offset=0.02"), 0.0, np.random.default_rng(0))
    assert cameras.exposure(10.1) == pytest.approx(10.02)
