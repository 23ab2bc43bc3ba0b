"""Physics outside the catalogue: each force against numpy at one state, and that it does to energy what it should."""

import casadi as ca
import numpy as np
import pytest

from fidim_lab.data.robot_file import read_robot
from sim_backends.plant.hidden import CATALOGUE, KNOWN, parse_effect
from sim_backends.plant.mechanics.kinematics import matrix_of, platform
from sim_backends.plant.mechanics.outside_terms import OUTSIDE_TERMS
from sim_backends.plant.outside import OUTSIDE
from sim_backends.plant.session_kinds import SESSION
from sim_backends.plant.world import make_world
from sim_backends.simulate import truth_of

G, V = np.array([1.2, -0.1, -0.4]), np.array([0.3, -0.2, 0.1])
Q, SPIN = np.array([0.98, 0.1, -0.05, 0.12]) / np.linalg.norm([0.98, 0.1, -0.05, 0.12]), np.array([0.4, -0.3, 0.5])
PLACE = np.array([-0.08, -0.07, -0.7])


def wrench(irma4_file, text: str, t: float = 0.0, v=V, spin=SPIN):
    """Force and moment at the state, and the world."""
    world = make_world(read_robot(irma4_file), np.random.default_rng(1), (parse_effect(text, 4),))
    x, now = ca.SX.sym("x", 13), ca.SX.sym("now", 3)
    effect = world.hidden[0]
    found = OUTSIDE_TERMS[effect.id](platform(world, x, now), effect)
    function = ca.Function("f", [x, now], [found.force, found.moment])
    force, moment = function(np.concatenate([G, Q, v, spin]), [t, t, 1.0])
    return np.array(force).ravel(), np.array(moment).ravel(), world


def test_every_kind_outside_has_a_force_and_none_an_id_of_the_catalogue():
    assert set(OUTSIDE) == set(OUTSIDE_TERMS)
    assert not (set(OUTSIDE) | set(SESSION)) & set(CATALOGUE)
    assert set(KNOWN) == {*CATALOGUE, *SESSION, *OUTSIDE}


def test_saddle_is_no_spring_to_any_point(irma4_file):
    force, moment, world = wrench(irma4_file, "unknown-gradient:k=2.5")
    away = G - world.middle - PLACE
    assert force == pytest.approx(2.5 * np.array([away[1], away[0], 0.0]))
    assert not moment.any()


def test_a_rotor_turns_across_the_rotation_and_does_no_work(irma4_file):
    force, moment, _ = wrench(irma4_file, "unknown-rotor:hx=0.01,hz=0.03")
    R = matrix_of(Q)
    assert moment == pytest.approx(np.cross(R @ [0.01, 0.0, 0.03], R @ SPIN))
    assert moment @ (R @ SPIN) == pytest.approx(0.0, abs=1e-15)
    assert not force.any()


def test_knocks_come_at_their_period_with_the_width_asked_for(irma4_file):
    text = "unknown-knock:fx=0.5,fy=0,period=0.9,w=0.03"
    assert wrench(irma4_file, text, t=1.8)[0] == pytest.approx([0.5, 0.0, 0.0])
    assert wrench(irma4_file, text, t=0.9 + 0.03)[0][0] == pytest.approx(0.5 * np.exp(-0.5), rel=0.01)
    assert abs(wrench(irma4_file, text, t=0.45)[0]).max() < 1e-3


@pytest.mark.parametrize(("factor", "power"), [(2.0, 8.0)])
def test_cubic_drag_grows_with_the_third_power_against_the_velocity(irma4_file, factor, power):
    slow, fast = (wrench(irma4_file, "unknown-cubic:c=3", v=f * V)[0] for f in (1.0, factor))
    assert slow == pytest.approx(-3.0 * np.linalg.norm(V) ** 2 * V)
    assert fast == pytest.approx(power * slow)


def test_eddy_brake_acts_near_its_place_only(irma4_file):
    force, _, world = wrench(irma4_file, "unknown-eddy:c=2,w=0.2")
    away = np.linalg.norm(G - world.middle - PLACE) / 0.2
    assert force == pytest.approx(-2.0 * np.exp(-(away**2) / 2) * V)
    here = dict(zip("xyz", G - world.middle, strict=True))
    text = "unknown-eddy:c=2,w=0.2," + ",".join(f"{key}={value:.17g}" for key, value in here.items())
    assert wrench(irma4_file, text)[0] == pytest.approx(-2.0 * V)


def test_ripple_of_the_swivels_is_a_torque_within_its_size_that_does_not_pull_along_the_axis(irma4_file):
    force, _, world = wrench(irma4_file, "unknown-ripple:c=0.01,teeth=40")
    total = np.zeros(3)
    for cable in world.cables:
        attachment = G + matrix_of(Q) @ (cable.a - world.body.com) - cable.d
        east, north = attachment @ cable.x, attachment @ cable.y
        lever = np.hypot(east, north)
        across = (east * cable.y - north * cable.x) / lever
        total += 0.01 * np.sin(40 * np.arctan2(across @ cable.x, across @ cable.y)) / lever * across
    assert force == pytest.approx(total)
    assert 0 < np.linalg.norm(force) < 4 * 0.01 / 0.3


@pytest.mark.slow
def test_gusts_have_the_size_asked_for_and_another_course_for_each_seed(irma4_file):
    t = np.arange(0.0, 200.0, 1.0)
    one, other = ([wrench(irma4_file, f"unknown-gusts:f=0.2,seed={seed}", t=now)[0] for now in t] for seed in (1, 2))
    assert np.sqrt(np.mean(np.sum(np.square(one), axis=1))) == pytest.approx(0.2, rel=0.1)
    assert abs(np.corrcoef(np.ravel(one), np.ravel(other))[0, 1]) < 0.2


def test_a_stop_pushes_back_on_its_far_side_only(irma4_file):
    force, _, world = wrench(irma4_file, "unknown-stop:k=50,about=0.5")
    facing = np.array([np.cos(0.5), np.sin(0.5), 0.0])
    beyond = (G - world.middle - PLACE) @ facing
    assert force == pytest.approx(-50.0 * max(0.0, beyond) * facing)
    turned, _, _ = wrench(irma4_file, f"unknown-stop:k=50,about={0.5 + np.pi}")
    assert turned == pytest.approx(-50.0 * max(0.0, -beyond) * -facing)
    assert force.any() != turned.any()


def test_a_slack_spring_pulls_by_what_its_way_without_force_leaves(irma4_file):
    away = G - wrench(irma4_file, "unknown-slack")[2].middle - PLACE
    assert wrench(irma4_file, "unknown-slack:k=10,w=0")[0] == pytest.approx(-10.0 * away)
    assert wrench(irma4_file, "unknown-slack:k=10,w=0.02")[0] == pytest.approx(
        -10.0 * np.sign(away) * np.maximum(np.abs(away) - 0.02, 0.0)
    )


def test_a_sail_is_felt_across_its_plate_only(irma4_file):
    facing = matrix_of(Q) @ [np.cos(0.6), np.sin(0.6), 0.0]
    into = V @ facing
    force, moment, _ = wrench(irma4_file, "unknown-sail:c=2")
    assert force == pytest.approx(-2.0 * abs(into) * into * facing, rel=1e-3)
    assert not moment.any()


def test_drag_of_a_thing_that_stands_out_goes_by_its_own_velocity_and_turns_the_platform(irma4_file):
    force, moment, world = wrench(irma4_file, "unknown-offset-drag:c=2,bx=0.15,by=0,bz=0.1")
    arm = matrix_of(Q) @ (np.array([0.15, 0.0, 0.1]) - world.body.com)
    velocity = V + np.cross(matrix_of(Q) @ SPIN, arm)
    assert force == pytest.approx(-2.0 * np.linalg.norm(velocity) * velocity, rel=1e-3)
    assert moment == pytest.approx(np.cross(arm, force))


@pytest.mark.parametrize("power", [0.0, 0.5, 1.5])
def test_drag_by_a_power_of_speed(irma4_file, power):
    force, _, _ = wrench(irma4_file, f"unknown-power:c=0.3,p={power}")
    assert force == pytest.approx(-0.3 * np.linalg.norm(V) ** (power - 1) * V, rel=1e-3)


def test_lift_does_no_work(irma4_file):
    force, _, _ = wrench(irma4_file, "unknown-lift:k=0.7")
    assert force == pytest.approx(0.7 * np.cross(matrix_of(Q) @ SPIN, V))
    assert force @ V == pytest.approx(0.0, abs=1e-15)


def test_a_dipole_turns_into_the_field(irma4_file):
    force, moment, _ = wrench(irma4_file, "unknown-dipole:mx=0.02,my=0,mz=0.03")
    assert not force.any()
    assert moment == pytest.approx(np.cross(matrix_of(Q) @ [0.02, 0.0, 0.03], [0.45, 0.0, -0.9]))


def test_a_bath_drags_below_its_level(irma4_file):
    height = G[2] - wrench(irma4_file, "unknown-bath")[2].middle[2]
    assert wrench(irma4_file, f"unknown-bath:c=3,z={height + 0.1}")[0] == pytest.approx(-3.0 * V)
    assert wrench(irma4_file, f"unknown-bath:c=3,z={height}")[0] == pytest.approx(-1.5 * V)
    assert wrench(irma4_file, f"unknown-bath:c=3,z={height - 0.1}")[0] == pytest.approx(0.0 * V, abs=1e-7)


def test_the_truth_calls_it_unknown(irma4_file):
    _, _, world = wrench(irma4_file, "unknown-cubic")
    case = truth_of(world, "b1")["case"]
    assert case["label"] == ["unknown"]
    assert case["title"] == "unknown-cubic"
