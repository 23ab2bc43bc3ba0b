"""Sensors: noise as declared, streams of their own, faults where they are wanted; and bodies that can exist."""

import numpy as np
import pytest

from fidim_lab.data.records import Robot
from sim_backends.plant.sensors import Cameras, CurrentSensors, Encoders, sensor_streams
from sim_backends.plant.world import exists, hidden_body, make_world

STILL = np.array([[1.0, 2.0, 3.0]])


def _frames(world, noise: float, count: int, seed: int = 0) -> np.ndarray:
    cameras = Cameras(world, noise, np.random.default_rng(seed))
    return np.array([cameras.see(k / 100, STILL)[0] for k in range(count)])


def test_camera_noise_is_white_and_as_declared(world_of):
    noise = _frames(world_of(), 1e-4, 4000) - STILL
    np.testing.assert_allclose(noise.std(axis=0), 1e-4, rtol=0.05)
    assert np.abs(np.mean(noise[1:] * noise[:-1], axis=0)).max() < 1e-9


def test_same_seed_same_frames(world_of):
    np.testing.assert_array_equal(_frames(world_of(), 1e-4, 20), _frames(world_of(), 1e-4, 20))
    assert not np.array_equal(_frames(world_of(), 1e-4, 20), _frames(world_of(), 1e-4, 20, seed=1))


def test_what_one_sensor_draws_does_not_move_another():
    first, second = sensor_streams(np.random.default_rng(5)), sensor_streams(np.random.default_rng(5))
    first.cameras.normal(size=100)
    np.testing.assert_array_equal(first.currents.normal(size=5), second.currents.normal(size=5))


def test_faulty_cameras_freeze_jump_and_throw(world_of):
    world = world_of("sensor-fault:outliers=0.02,size=0.05,frozen=0.3,jump=0.003")
    seen = _frames(world, 1e-4, 1001)
    thrown = np.abs(seen[:, 1] - 2.0) > 2e-3
    assert 0.008 < thrown.mean() < 0.04
    repeated = np.all(np.diff(seen, axis=0) == 0, axis=1)
    assert 29 <= repeated.sum() <= 31
    assert np.median(seen[500:, 0]) - np.median(seen[:500, 0]) == pytest.approx(0.003, abs=5e-5)


def test_encoders_count_whole_steps():
    encoders = Encoders(2e-5)
    lengths = np.array([1.234567, 0.9])
    assert encoders.counts(lengths).tolist() == [61728, 45000]
    np.testing.assert_allclose(encoders.read(lengths), lengths, atol=1.0001e-5)
    np.testing.assert_array_equal(Encoders(0.0).read(lengths), lengths)


def test_currents_are_tension_over_the_winch_constant(irma4: Robot):
    assert irma4.winches is not None
    ideal = CurrentSensors(irma4.winches, 0.0, np.random.default_rng(0)).read(np.full(4, 34.0))
    np.testing.assert_allclose(ideal, 1.0)
    noisy = CurrentSensors(irma4.winches, 0.05, np.random.default_rng(0))
    samples = np.array([noisy.read(np.full(4, 34.0)) for _ in range(1000)])
    np.testing.assert_allclose(samples.std(axis=0), 0.05, rtol=0.1)


@pytest.mark.parametrize("seed", range(20))
def test_a_hidden_body_can_exist_and_is_near_the_nominal_one(irma4: Robot, seed):
    body = hidden_body(irma4, np.random.default_rng(seed))
    assert exists(body.inertia_about_com)
    relative = np.abs(np.diag(body.inertia_about_com) / np.diag(irma4.nominal.inertia_about_com) - 1)
    assert 0.05 < relative.max() < 0.25
    assert 0 < np.abs(body.com[:2]).max() < 0.015
    assert (body.inertia[3:] != 0).all()


def test_a_flat_body_that_cannot_exist_is_recognised():
    assert exists(np.diag([1.0, 2.0, 2.5]))
    assert not exists(np.diag([1.0, 2.0, 3.5]))
    assert not exists(np.diag([-1.0, 2.0, 2.5]))


def test_the_same_seed_draws_the_same_world(irma4: Robot):
    first, second = (make_world(irma4, np.random.default_rng(8)) for _ in range(2))
    assert first.mass == second.mass
    np.testing.assert_array_equal(first.body.vector, second.body.vector)
    assert first.mass == pytest.approx(irma4.mass, rel=0.0101)
