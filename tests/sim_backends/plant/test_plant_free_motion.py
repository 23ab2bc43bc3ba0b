"""Free motion of the simulated platform against energy, closed forms, another length formula, and finer steps."""

from collections.abc import Callable

import numpy as np
import pytest

from fidim_lab.data.records import Body, Cable, Pose, Robot
from sim_backends.plant.mechanics import Rest
from sim_backends.plant.mechanics.kinematics import matrix_of, quaternion_of
from sim_backends.plant.plant import Plant
from sim_backends.plant.world import World

LENGTHS = np.array([1.42, 1.40, 1.45, 1.47])
TrueWorld = Callable[[Robot], World]


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5])
@pytest.mark.sampled(2)
def test_energy_and_lengths_are_kept_with_any_number_of_cables(n, ring, true_world: TrueWorld, lengths_of):
    world = true_world(ring(n))
    plant = Plant(world)
    lengths = np.full(n, 1.2)
    plant.place(plant.rest(lengths, displacement=np.array([0.02, 0.015])), lengths)
    before = plant.energy()
    heights, drift = [plant.markers()[0, 2]], 0.0
    for k in range(1, 301):
        plant.advance(k / 100)
        heights.append(plant.markers()[0, 2])
        drift = max(drift, np.abs(lengths_of(world, plant) - lengths).max())
    # What swings to and fro is much more than what is lost.
    assert np.ptp(heights) * world.mass * 9.81 > 1e-3
    assert plant.energy() == pytest.approx(before, abs=2e-6)
    assert drift < 1e-8
    assert plant.slack == ()


def test_ten_seconds_agree_with_a_converged_integration(swing):
    _, usual = swing(duration=10.0)
    _, fine = swing(duration=10.0, step=2.5e-3)
    assert np.abs(usual - fine).max() < 1e-6


def test_the_step_is_of_sixth_order(swing):
    _, fine = swing(duration=1.0, step=1e-3)
    errors = [np.abs(swing(duration=1.0, step=step)[1] - fine).max() for step in (10e-3, 5e-3)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(6.0, abs=0.8)


def test_lengths_hold_within_a_micrometre_for_ten_seconds(swing, world_of, lengths_of):
    plant, _ = swing(duration=10.0)
    assert np.abs(lengths_of(plant.world, plant) - LENGTHS).max() < 1e-6


def _bifilar(half: float) -> Robot:
    def cable(side: float) -> Cable:
        x = np.array([-side, 0.0, 0.0])
        z = np.array([0.0, side, 0.0])
        return Cable(
            d=np.array([side * half, 0, 0]),
            a=np.array([side * half, 0, 0.1]),
            radius=0.0,
            x=x,
            y=np.cross(z, x),
            z=z,
        )

    body = Body(com=np.zeros(3), inertia=np.array([0.02, 0.03, 0.04, 0, 0, 0]))
    return Robot(cables=(cable(1.0), cable(-1.0)), mass=5.0, nominal=body, marker=np.array([0.1, 0.0, 0.0]))


def test_a_bifilar_pendulum_turns_with_the_period_of_the_textbook(true_world: TrueWorld):
    """T = 2π k/b √(l/g) for small angles: k radius of gyration about the vertical, b half the distance of the wires."""
    half, length, yaw = 0.15, 1.0, 0.01
    robot = _bifilar(half)
    plant = Plant(true_world(robot))
    height = np.sqrt(length**2 - (2 * half * np.sin(yaw / 2)) ** 2)
    turned = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    centre = np.array([0.0, 0.0, -height - 0.1])
    start = Rest(np.concatenate([centre, quaternion_of(turned)]), np.ones(2), centre, Pose(centre, turned))
    plant.place(start, np.full(2, length))
    yaws = []
    for k in range(1, 801):
        plant.advance(k * 5e-3)
        yaws.append(plant.markers()[0, 1])
    crossings = np.flatnonzero(np.diff(np.sign(yaws)))
    exact = [k + yaws[k] / (yaws[k] - yaws[k + 1]) for k in crossings]
    period = 2 * np.mean(np.diff(exact)) * 5e-3
    assert period == pytest.approx(2 * np.pi * np.sqrt(0.04) / half * np.sqrt(length / 9.81), rel=1e-3)


def test_a_quaternion_and_its_matrix_belong_together():
    rng = np.random.default_rng(3)
    for q in rng.normal(size=(20, 4)):
        unit = q / np.linalg.norm(q)
        matrix = matrix_of(unit)
        np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-14)
        assert abs(quaternion_of(matrix) @ unit) == pytest.approx(1.0, abs=1e-12)


def test_positions_between_steps_are_interpolated(swing):
    plant, _ = swing(duration=0.5)
    before, after = plant.markers(0.4932), None
    exact, _ = swing(duration=0.0)
    exact.advance(0.4932)
    after = exact.markers()
    assert np.abs(before - after).max() < 1e-7
