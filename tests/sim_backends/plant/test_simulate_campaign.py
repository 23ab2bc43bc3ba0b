"""Campaigns without protocol bytes: shape, determinism, and what the truth says."""

import json

import numpy as np
import pytest

from fidim_lab.data.records import Plan, PlannedWindow, Robot, Role
from fidim_lab.errors import InfeasibleError
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.sensors import Noise
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign

LENGTHS = np.array([1.42, 1.40, 1.45, 1.47])
SHORT = Sampling(duration=1.0, rate=100.0)


def _plan(*lengths: np.ndarray) -> Plan:
    return Plan(
        name="short",
        windows=tuple(
            PlannedWindow(
                id=f"i{k:02}",
                role=Role.IDENTIFY,
                lengths=value,
                displacement=np.array([0.02, -0.01]),
                position=np.array([1.2, -0.2, -0.15]),
            )
            for k, value in enumerate(lengths, 1)
        ),
    )


def _simulate(robot: Robot, *effects: str, seed: int = 3, noise: Noise | None = None):
    rng = np.random.default_rng(seed)
    world = make_world(robot, rng, tuple(parse_effect(text, robot.n) for text in effects))
    return world, *simulate_campaign(robot, _plan(LENGTHS, LENGTHS - 0.02), world, rng, noise, SHORT)


def test_windows_have_the_columns_of_the_format(irma4: Robot):
    world, campaign, truth = _simulate(irma4)
    assert [window.id for window in campaign.windows] == ["i01", "i02"]
    for window in campaign.windows:
        assert window.lengths is not None
        assert window.currents is not None
        assert window.markers.shape == (101, 1, 3)
        assert window.lengths.shape == window.currents.shape == (101, 4)
        np.testing.assert_allclose(window.t, np.arange(101) / 100)
        np.testing.assert_allclose(np.rint(window.lengths / 2e-5), window.lengths / 2e-5, atol=1e-6)
        assert window.equilibrium is not None
        start = window.markers[0, 0] - window.equilibrium
        np.testing.assert_allclose(start[:2], [0.02, -0.01], atol=1e-3)
    assert json.loads(json.dumps(truth))["s"] == pytest.approx(world.body.com.tolist())
    assert truth["slack"] == {}


def test_currents_carry_the_weight(irma4: Robot):
    world, campaign, _ = _simulate(irma4)
    currents = campaign.windows[0].currents
    assert currents is not None
    assert irma4.winches is not None
    tension = currents * [winch.newton_per_ampere for winch in irma4.winches]
    assert tension.min() > 10.0
    # Four slanted cables pull with more than the weight in all, and not with many times as much.
    assert world.mass * 9.81 < tension.sum(axis=1).mean() < 6 * world.mass * 9.81


def test_the_same_seed_gives_the_same_bytes(irma4: Robot):
    first, second = (_simulate(irma4, "air-drag-linear")[1] for _ in range(2))
    other = _simulate(irma4, "air-drag-linear", seed=4)[1]
    for a, b in zip(first.windows, second.windows, strict=True):
        assert a.markers.tobytes() == b.markers.tobytes()
    assert first.windows[0].markers.tobytes() != other.windows[0].markers.tobytes()


def test_cameras_with_a_late_clock_see_the_platform_later(irma4: Robot):
    ideal = Noise(marker=0.0, encoder=0.0, current=0.0)
    on_time = _simulate(irma4, noise=ideal)[1].windows[0].markers
    late = _simulate(irma4, "time-offset:offset=0.05", noise=ideal)[1].windows[0].markers
    np.testing.assert_allclose(late[:95], on_time[5:100], atol=1e-7)


def test_the_truth_names_what_is_hidden(irma4: Robot):
    _, _, truth = _simulate(irma4, "anchor-offset:cable=2,dx=0.004", "rotational-drag")
    case = truth["case"]
    assert isinstance(case, dict)
    assert case["label"] == ["anchor-offset", "rotational-drag"]
    assert case["cable"] == 2
    assert case["par"]["anchor-offset"]["dx"] == 0.004


def test_a_window_without_a_rest_is_named(irma4: Robot):
    rng = np.random.default_rng(0)
    world = make_world(irma4, rng)
    with pytest.raises(InfeasibleError, match="Window i02"):
        simulate_campaign(irma4, _plan(LENGTHS, np.array([2.2, 1.0, 1.3, 1.0])), world, rng, recording=SHORT)
