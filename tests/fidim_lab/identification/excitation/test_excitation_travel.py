"""Travel timed for the modes, carried out by the independent plant; a sample of the Monte-Carlo of the benchmark."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.excite.runs import CLOSE, one, window_of
from fidim_lab.data.records import Robot
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.excitation.place import ExcitationPlace
from fidim_lab.identification.excitation.travel import Trapezoid, Travel, travel, travelled
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.mechanism import Mechanism
from sim_backends.plant.plant import Plant
from sim_backends.plant.world import make_world


@pytest.fixture(scope="module")
def places(irma4: Robot) -> tuple[ExcitationPlace, ExcitationPlace]:
    mechanism = Mechanism(irma4, native=True)
    spots = (np.array([1.05, -0.3, -0.35]), np.array([1.4, 0.05, -0.15]))
    rests = [equilibrium_at(mechanism, irma4.nominal, spot) for spot in spots]
    first, second = (ExcitationPlace.at(mechanism, rest.lengths) for rest in rests)
    return first, second


def swing_left(robot: Robot, places: tuple[ExcitationPlace, ExcitationPlace], move: Travel) -> tuple[float, float]:
    """Peak to peak of the plant's marker after the move (m), and its smallest tension (N)."""
    start, goal = (place.equilibrium.lengths for place in places)
    plant = Plant(make_world(robot, np.random.default_rng(1), body=robot.nominal))
    plant.settle(start)
    way = float(np.abs(goal - start).max())
    ramp = move.speed / move.acceleration
    shape = Trapezoid(ramp, way / move.speed + ramp)
    offset, rate, least = np.zeros(robot.n), np.zeros(robot.n), np.inf
    for _, duration, unit in shape.pieces():
        steps = int(np.ceil(duration / 0.01))
        for _ in range(steps):
            h, a = duration / steps, unit * (goal - start)
            plant.advance(plant.t + h, start + offset, rate, a)
            offset, rate = offset + rate * h + a * h**2 / 2, rate + a * h
            least = min(least, float(plant.tensions.min()))
    np.testing.assert_allclose(start + offset, goal, atol=1e-9)
    seen = []
    for _ in range(200):
        plant.advance(plant.t + 0.01, goal, np.zeros(robot.n), np.zeros(robot.n))
        seen.append(plant.markers()[0])
    return float(np.ptp(seen, axis=0).max()), least


def test_a_timed_move_leaves_the_platform_still(irma4: Robot, places: tuple[ExcitationPlace, ExcitationPlace]):
    planned = travel(*places, 0.5, 2.0)
    hasty = travelled(*places, 0.5, 2.0)
    still, least = swing_left(irma4, places, planned)
    wild, _ = swing_left(irma4, places, hasty)
    assert planned.left <= 1e-3
    assert still < 2.5e-3  # twice the amplitude, and what 10 ms between samples miss
    assert wild > 3 * still
    assert hasty.left == pytest.approx(wild / 2, rel=0.5)
    assert least == pytest.approx(planned.tension[0], rel=0.05)
    assert planned.speed <= 0.5
    assert planned.acceleration <= 2.0 * (1 + 1e-9)


def test_a_slow_limit_is_kept_and_no_slower_than_needed(places: tuple[ExcitationPlace, ExcitationPlace]):
    slow, fast = travel(*places, 0.1, 0.2), travel(*places, 0.4, 2.0)
    assert slow.speed <= 0.1
    assert fast.seconds < slow.seconds


def test_moves_that_would_break_tensions_are_refused(places: tuple[ExcitationPlace, ExcitationPlace]):
    rests = np.concatenate([place.equilibrium.tensions_in_newton(place.robot.mass) for place in places])
    robot, tension = places[0].robot, (rests.min() - 0.05, rests.max() + 0.05)
    tight = replace(robot, limits=replace(robot.limits, tension=tension))
    there = [replace(place, mechanism=Mechanism(tight, native=True)) for place in places]
    with pytest.raises(InfeasibleError, match="pull the cables by"):
        travel(*there, 0.5, 4.0)


@pytest.mark.slow
def test_a_sample_of_the_monte_carlo_keeps_all_tensions(irma4: Robot):
    mechanism = Mechanism(irma4, native=True)
    rests = [equilibrium_at(mechanism, irma4.nominal, np.array(p)) for p in ((1.25, -0.15, -0.2), (1.1, -0.1, -0.4))]
    windows = [window_of(mechanism, np.array([*rest.lengths, 0.04, 0.03])) for rest in rests]
    low, high = irma4.limits.tension
    off: list[float] = []
    for run in range(6):
        tries = one(run, windows[run % 2])
        assert not isinstance(tries, str), tries
        for each in tries:
            assert low <= each.tension[0] < each.tension[1] <= high
        off.append(min(abs(tries[-1].error), abs(tries[-1].off)))
    assert sum(part <= CLOSE for part in off) >= 5, off  # 97 % of many
