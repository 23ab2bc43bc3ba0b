"""Rest: forces balance, a hand holds the marker where it is wanted, and another formulation finds the same place."""

import numpy as np
import pytest

from fidim_lab.data.records import Robot
from fidim_lab.errors import InfeasibleError
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from sim_backends.plant.plant import Plant

LENGTHS = np.array([1.42, 1.40, 1.45, 1.47])


def _pulls(plant: Plant) -> tuple[np.ndarray, np.ndarray]:
    """Directions of the cables (n, 3) by finite differences of nothing but geometry: from A along the straight part."""
    pose, world = plant.pose, plant.world
    points = np.array([pose.position + pose.rotation @ cable.a for cable in world.cables])
    directions = []
    for cable, a in zip(world.cables, points, strict=True):
        c = a - cable.d
        flat = (c @ cable.x) * cable.x + (c @ cable.y) * cable.y
        centre = cable.d + cable.radius * flat / np.linalg.norm(flat)
        to_a = a - centre
        distance = np.linalg.norm(to_a)
        # The tangent makes the angle arcsin(r/L) with the line from the circle's centre.
        axis = np.cross(flat, cable.z) / np.linalg.norm(flat)
        angle = -np.arcsin(cable.radius / distance)
        unit = to_a / distance
        directions.append(-(unit * np.cos(angle) + np.cross(axis, unit) * np.sin(angle)))
    return points, np.array(directions)


def test_tensions_carry_the_weight_and_turn_nothing(world_of):
    plant = Plant(world_of(seed=4))
    rest = plant.settle(LENGTHS)
    points, directions = _pulls(plant)
    pulls = rest.tensions[:, None] * directions
    world = plant.world
    centre = plant.pose.position + plant.pose.rotation @ world.body.com
    np.testing.assert_allclose(pulls.sum(axis=0), [0, 0, world.mass * 9.81], atol=1e-6)
    np.testing.assert_allclose(np.cross(points - centre, pulls).sum(axis=0), 0.0, atol=1e-6)
    assert rest.tensions.min() > 20.0


def test_what_is_at_rest_stays_there(world_of):
    plant = Plant(world_of("cable-mass", "umbilical", "constant-force", "loose-mass", "gravity-tilt", seed=2))
    rest = plant.settle(LENGTHS)
    np.testing.assert_allclose(plant.tensions, rest.tensions, rtol=1e-6)
    plant.advance(1.0)
    assert np.linalg.norm(plant.markers()[0] - rest.marker) < 1e-7


@pytest.mark.parametrize("lengths", [LENGTHS, np.array([1.1682, 1.1171, 1.5453, 1.5518])])
def test_the_reference_model_finds_the_same_rest(irma4: Robot, world_of, lengths):
    plant = Plant(world_of())
    rest = plant.settle(lengths)
    other = pose_from_lengths(Mechanism(irma4), irma4.nominal, lengths)
    np.testing.assert_allclose(rest.pose.position, other.pose.position, atol=1e-7)
    np.testing.assert_allclose(rest.pose.rotation, other.pose.rotation, atol=1e-6)


def test_a_hand_holds_the_marker_aside_and_the_tensions_stay_when_it_lets_go(world_of):
    plant = Plant(world_of())
    alone = plant.rest(LENGTHS)
    aside = plant.rest(LENGTHS, displacement=np.array([0.05, 0.03]))
    np.testing.assert_allclose((aside.marker - alone.marker)[:2], [0.05, 0.03], atol=3e-4)
    plant.place(aside, LENGTHS)
    np.testing.assert_allclose(plant.tensions, aside.tensions, rtol=1e-6)


def test_lengths_without_a_rest_on_all_cables_are_refused(world_of):
    with pytest.raises(InfeasibleError, match=r"cable 1 would have to push|no rest"):
        Plant(world_of()).settle(np.array([2.2, 1.0, 1.3, 1.0]))
