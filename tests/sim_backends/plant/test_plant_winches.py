"""Cables that winches move, and cables that go slack."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.errors import InfeasibleError, OurBugError
from sim_backends.plant.mechanics.unilateral import impact, pushes, taut
from sim_backends.plant.plant import HandLaw, Plant
from sim_backends.plant.world import make_world

LENGTHS = np.array([1.42, 1.40, 1.45, 1.47])
TICK = 0.01


def _travel(plant: Plant, start: np.ndarray, end: np.ndarray, duration: float) -> float:
    """Move along a cubic with constant acceleration in each tick; the largest distance from the rest underway, m."""
    away, lengths, rates = 0.0, start.copy(), np.zeros_like(start)
    ticks = round(duration / TICK)
    for k in range(ticks):
        u0, u1 = k / ticks, (k + 1) / ticks
        speeds = [6 * u * (1 - u) / duration for u in (u0, u1)]
        acceleration = (speeds[1] - speeds[0]) / TICK * (end - start)
        plant.advance(plant.t + TICK, lengths, rates, acceleration)
        lengths = lengths + rates * TICK + acceleration * TICK**2 / 2
        rates = rates + acceleration * TICK
        if k % 20 == 0:
            near = plant.pose
            away = max(away, float(np.linalg.norm(plant.markers()[0] - plant.rest(lengths, near).marker)))
    np.testing.assert_allclose(lengths, end, atol=1e-4)
    return away


def test_slow_travel_follows_the_rests(world_of):
    plant = Plant(world_of())
    plant.settle(LENGTHS)
    goal = LENGTHS + np.array([0.1, 0.06, 0.02, 0.08])
    begin = plant.markers()[0]
    assert _travel(plant, LENGTHS, goal, 6.0) < 0.01
    assert np.linalg.norm(plant.markers()[0] - begin) > 0.08
    assert plant.slack == ()


def test_travel_keeps_the_true_lengths_at_what_is_paid_out(world_of, lengths_of):
    world = world_of()
    plant = Plant(world)
    plant.settle(LENGTHS)
    rates = np.array([0.05, -0.03, 0.02, 0.04])
    acceleration = rates * 2
    plant.advance(0.3, LENGTHS, np.zeros(4), acceleration)
    np.testing.assert_allclose(plant.encoder_lengths(), LENGTHS + acceleration * 0.045, atol=1e-12)
    np.testing.assert_allclose(lengths_of(world, plant), plant.encoder_lengths(), atol=1e-8)


def test_a_cable_paid_out_fast_goes_slack_and_comes_back_without_gaining_energy(world_of, lengths_of):
    plant = Plant(world_of())
    plant.settle(LENGTHS)
    out = np.array([0.0, 0.0, 0.0, 0.12])
    plant.advance(0.05, LENGTHS, out / 0.05, np.zeros(4))
    held = LENGTHS + out
    plant.advance(0.06, held)
    assert [interval.cable for interval in plant.slack] == [4]
    assert plant.tensions[3] == 0.0
    after_release = plant.energy()
    energies = []
    for k in range(1, 300):
        plant.advance(0.06 + k * TICK)
        energies.append(plant.energy())
        assert (lengths_of(plant.world, plant) < held + 1e-5).all()
        assert plant.tensions.min() >= -1e-5
    # The fourth cable is now too long for good; the others were loose in the fall, and caught the platform.
    lasting = {interval.cable for interval in plant.slack if interval.stop is None}
    caught = {interval.cable for interval in plant.slack if interval.stop is not None}
    assert lasting == {4}
    assert caught == {1, 2, 3}
    assert max(energies) <= after_release + 1e-4
    assert energies[-1] < after_release - 1e-3


def test_all_cables_slack_is_free_fall(world_of):
    plant = Plant(world_of())
    plant.settle(LENGTHS)
    plant.advance(0.1, LENGTHS, np.full(4, 3.0), np.zeros(4))
    before = plant.pose.position
    plant.advance(0.2, None, np.full(4, 3.0), np.zeros(4))
    assert {interval.cable for interval in plant.slack} == {1, 2, 3, 4}
    assert (plant.tensions == 0.0).all()
    after_first = plant.pose.position
    plant.advance(0.3, None, np.full(4, 3.0), np.zeros(4))
    second_difference = plant.pose.position - 2 * after_first + before
    # P turns about G a little; G itself falls exactly.
    np.testing.assert_allclose(second_difference[2], -9.81 * 0.01, atol=5e-3)


def test_time_never_goes_back(world_of):
    plant = Plant(world_of())
    plant.settle(LENGTHS)
    plant.advance(0.5)
    with pytest.raises(OurBugError, match="go back"):
        plant.advance(0.4)
    with pytest.raises(OurBugError, match="No marker positions"):
        plant.markers(0.9)


def test_a_hand_that_is_there_moves_the_platform_and_is_gone_at_its_time(world_of):
    plant = Plant(world_of())
    rest = plant.settle(LENGTHS)
    target = rest.marker + np.array([0.02, 0.0, 0.0])
    plant.hand = HandLaw(target, np.array([3e3, 3e3, 0]), np.array([300.0, 300, 0]), 5.0, fading=3.0, until=3.2)
    plant.advance(3.0)
    held = plant.markers()[0]
    assert 0.005 < held[0] - rest.marker[0] < 0.03
    for k in range(20):
        plant.advance(3.0 + (k + 1) * TICK)
    free = plant.energy()
    plant.advance(5.0)
    assert plant.energy() == pytest.approx(free, abs=1e-5)


def test_dependent_cables_are_refused_in_words(irma4):
    twice = replace(irma4, cables=(*irma4.cables[:3], irma4.cables[2]))
    plant = Plant(make_world(twice, np.random.default_rng(0), body=irma4.nominal))
    sound = Plant(make_world(irma4, np.random.default_rng(0), body=irma4.nominal)).rest(LENGTHS)
    with pytest.raises(InfeasibleError, match="dependent"):
        plant.place(sound, LENGTHS)


def test_complementarity_of_pulls_and_gaps():
    rng = np.random.default_rng(0)
    for _ in range(50):
        a = rng.normal(size=(3, 3))
        condensed, wanted = a @ a.T + 0.1 * np.eye(3), rng.normal(size=3)
        p = pushes(condensed, wanted)
        gap = condensed @ p - wanted
        assert p.min() >= 0
        assert gap.min() > -1e-9
        assert abs(p @ gap) < 1e-8


def test_only_touching_cables_take_part():
    condensed, wanted = np.eye(3), np.ones(3)
    touching = np.array([True, False, True])
    np.testing.assert_allclose(impact(condensed, wanted, touching), [1.0, 0.0, 1.0])
    assert taut(condensed, wanted * [1, 1, -1], touching).tolist() == [True, False, False]
