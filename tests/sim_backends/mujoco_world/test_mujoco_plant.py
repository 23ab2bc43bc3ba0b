"""The MuJoCo world against the native plant: two engines, two formulations, one motion."""

import importlib.util
import sys
from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Robot
from fidim_lab.errors import InfeasibleError, OurBugError, SetupError
from fidim_lab.identification.workspace import Workspace, rest_near
from fidim_lab.model.mechanism import Mechanism
from sim_backends.mujoco_world import plant as mujoco_plant
from sim_backends.mujoco_world.engine import engine
from sim_backends.mujoco_world.forces import SUPPORTED
from sim_backends.mujoco_world.plant import MujocoPlant
from sim_backends.plant.hidden import CATALOGUE, KNOWN, parse_effect
from sim_backends.plant.plant import Plant
from sim_backends.plant.world import World, make_world

LENGTHS = np.array([1.42, 1.40, 1.45, 1.47])
ASIDE = np.array([0.03, -0.02])


def _world(robot: Robot, *effects: str) -> World:
    return make_world(robot, np.random.default_rng(3), tuple(parse_effect(text, robot.n) for text in effects))


def _swing(plant: Plant | MujocoPlant, lengths: np.ndarray, aside: np.ndarray, duration: float):
    """Markers (N, M, 3) and tensions (N, n) at 100 Hz after a release at 60 s."""
    plant.place(plant.rest(lengths, displacement=aside), lengths, 60.0)
    plant.begin_window(1)
    markers, tensions = [plant.markers()], [plant.tensions]
    for k in range(1, round(100 * duration) + 1):
        plant.advance(60.0 + k / 100)
        markers.append(plant.markers())
        tensions.append(plant.tensions)
    return np.array(markers), np.array(tensions)


needs_mujoco = pytest.mark.skipif(importlib.util.find_spec("mujoco") is None, reason="MuJoCo is not installed")


@pytest.fixture(scope="module")
def plain(irma4: Robot) -> np.ndarray:
    return _swing(Plant(_world(irma4)), LENGTHS, ASIDE, 3.0)[0]


@needs_mujoco
def test_three_seconds_agree_to_micrometres(irma4: Robot, plain: np.ndarray):
    markers, tensions = _swing(MujocoPlant(_world(irma4)), LENGTHS, ASIDE, 3.0)
    _, native = _swing(Plant(_world(irma4)), LENGTHS, ASIDE, 3.0)
    assert np.ptp(plain[:, 0], axis=0).max() > 0.05
    np.testing.assert_allclose(markers, plain, atol=2e-5)
    np.testing.assert_allclose(tensions, native, atol=0.6)


@pytest.mark.parametrize(
    "effects",
    [
        ["air-drag-linear:c=5"],
        ["body-step:m=0.4,at=0"],
        ["air-drag-quadratic:c=20"],
        ["rotational-drag"],
        ["constant-force", "gravity-tilt"],
        ["periodic-force"],
        ["umbilical"],
        ["umbilical:rest=0.9,k=20"],
        ["hand-contact:start=0.5,stop=1.2,window=1"],
        ["unknown:k=-5,w=0.1"],
        ["anchor-offset:cable=2", "attachment-offset:cable=3", "pulley-radius", "marker-offset"],
        ["cable-length-bias:cable=1"],
    ],
)
@needs_mujoco
@pytest.mark.sampled(5)
def test_hidden_effects_agree(irma4: Robot, plain: np.ndarray, effects: list[str]):
    world = _world(irma4, *effects)
    native, _ = _swing(Plant(world), LENGTHS, ASIDE, 1.5)
    assert np.abs(native - plain[:151]).max() > 1e-4  # it is there: 5 times what they may differ by
    np.testing.assert_allclose(_swing(MujocoPlant(world), LENGTHS, ASIDE, 1.5)[0], native, atol=2e-5)


@pytest.mark.parametrize(("n", "radius"), [(2, 0.02), (3, 0.02), (3, 0.0), (5, 0.02)])
@needs_mujoco
def test_other_robots_agree(cable_ring, n: int, radius: float):
    robot = cable_ring(n, radius)
    world = _world(robot)
    lengths = rest_near(Mechanism(robot), Workspace(robot).place(np.array([0.1, 0.05, 0.0]), 0.8)).lengths
    plant = Plant(world)
    native, _ = _swing(plant, lengths, ASIDE, 1.5)
    assert plant.slack == ()
    assert np.ptp(native[:, 0], axis=0).max() > 0.01
    np.testing.assert_allclose(_swing(MujocoPlant(world), lengths, ASIDE, 1.5)[0], native, atol=2e-5)


@needs_mujoco
def test_the_second_window_begins_anew(irma4: Robot):
    plant = MujocoPlant(_world(irma4, "air-drag-linear"))
    first = _swing(plant, LENGTHS, ASIDE, 0.2)[0]
    np.testing.assert_array_equal(_swing(plant, LENGTHS, ASIDE, 0.2)[0], first)


@needs_mujoco
def test_exposures_between_the_samples_are_on_the_way(irma4: Robot):
    straight, stopped = MujocoPlant(_world(irma4)), MujocoPlant(_world(irma4))
    rest = straight.rest(LENGTHS, displacement=ASIDE)
    straight.place(rest, LENGTHS)
    stopped.place(rest, LENGTHS)
    straight.advance(0.5)
    for t in (0.1003, 0.100301, 0.2977, 0.5):
        stopped.advance(t)
    np.testing.assert_allclose(stopped.markers(), straight.markers(), atol=2e-6)


@needs_mujoco
def test_a_cable_that_should_be_slack_is_noted(irma4: Robot):
    plant = MujocoPlant(_world(irma4, "hand-contact:fz=300,start=0.1,stop=0.6"))
    _swing(plant, LENGTHS, ASIDE, 0.6)
    assert len({interval.cable for interval in plant.slack}) >= 2
    assert all(60.1 < interval.start < 60.6 for interval in plant.slack)
    assert _swing(plant, LENGTHS, ASIDE, 0.1)
    assert plant.slack == ()


@needs_mujoco
def test_a_pulley_that_is_not_wrapped_is_seen(irma4: Robot, monkeypatch):
    whole = mujoco_plant.multibody_xml
    plant = MujocoPlant(_world(irma4))
    rest = plant.rest(LENGTHS)
    monkeypatch.setattr(
        mujoco_plant,
        "multibody_xml",
        lambda *a: whole(*a).replace('<geom geom="pulley1" sidesite="side1"/>', ""),
    )
    with pytest.raises(InfeasibleError, match=r"cable 2: its length differs by .* mm"):
        plant.place(rest, LENGTHS)


@needs_mujoco
def test_time_does_not_go_back(irma4: Robot):
    plant = MujocoPlant(_world(irma4))
    plant.place(plant.rest(LENGTHS), LENGTHS, 5.0)
    with pytest.raises(OurBugError, match=r"go back from 5\.0"):
        plant.advance(4.0)


def test_what_it_cannot_simulate_is_refused_with_what_it_can(irma4: Robot):
    for name in sorted(set(CATALOGUE) - set(SUPPORTED)):
        with pytest.raises(SetupError, match=rf"--hide {name}: .*air-drag-linear.*--backend native"):
            MujocoPlant(_world(irma4, name))


def test_the_supported_effects_are_of_the_catalogue():
    assert set(SUPPORTED) <= set(KNOWN)


def test_without_mujoco_the_message_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(SetupError, match="pip install mujoco"):
        engine()


@needs_mujoco
def test_a_robot_may_have_eyelets_for_some_cables(irma4: Robot):
    cables = tuple(replace(c, radius=0.0) if k % 2 else c for k, c in enumerate(irma4.cables))
    world = _world(replace(irma4, cables=cables))
    pose = Plant(_world(irma4)).rest(LENGTHS).pose
    straight = np.array([np.linalg.norm(pose.position + pose.rotation @ c.a - c.d) for c in cables])
    lengths = np.where([c.radius == 0 for c in cables], straight, LENGTHS)
    native, _ = _swing(Plant(world), lengths, ASIDE, 0.5)
    np.testing.assert_allclose(_swing(MujocoPlant(world), lengths, ASIDE, 0.5)[0], native, atol=2e-5)
