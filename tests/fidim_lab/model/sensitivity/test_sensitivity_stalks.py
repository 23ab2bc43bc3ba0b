"""Markers on stalks: the oscillator on a moving foot, and its derivatives in the residuals of recordings."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fidim_lab.data.records import Role
from fidim_lab.effects.geometry.markers import MarkerStalk
from fidim_lab.identification.mle.fit import fit
from fidim_lab.identification.mle.trajectories.likelihood import Likelihood, Point, linearised, simulate, stepped
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.model.sensitivity.grid import FINE, Grid
from fidim_lab.model.sensitivity.markers import swung, swung_by
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign

GRID = Grid.covering(1.0, FINE)
REST = np.array([0.3, -1.0])


def felt(t: np.ndarray) -> np.ndarray:
    return np.stack([1.2 * np.cos(9 * t) - 0.4 * np.sin(15 * t), 0.8 * np.sin(13 * t)], axis=-1)


@pytest.mark.parametrize(("hertz", "damping"), [(5.0, 0.03), (12.0, 0.3), (12.0, 1.0), (300.0, 0.1)])
def test_the_oscillator_is_that_of_its_equation(hertz, damping):
    w = 2 * np.pi * hertz

    def rates(t, state):
        y, rate = state[:2], state[2:]
        return np.concatenate([rate, w**2 * (felt(np.array(t)) - y) - 2 * damping * w * rate])

    start = np.concatenate([REST, np.zeros(2)])
    known = solve_ivp(rates, (0, 1.0), start, t_eval=GRID.t, rtol=1e-10, atol=1e-10, method="DOP853")
    found = swung(felt(GRID.t), GRID, w, damping, REST)
    np.testing.assert_allclose(found[:, 0].T, known.y[:2], atol=2e-6)
    np.testing.assert_allclose(found[:, 1].T, known.y[2:], atol=2e-6 * w)
    np.testing.assert_allclose(
        found[:, 2], [rates(*one)[2:] for one in zip(GRID.t, known.y.T, strict=True)], atol=2e-6 * w**2
    )


def test_its_derivatives_by_pulsation_and_damping():
    given, w, damping = felt(GRID.t), 50.0, 0.1
    found = swung_by(given, swung(given, GRID, w, damping, REST), GRID, w, damping)
    for k, step in enumerate((1e-3, 1e-5)):
        ends = [
            swung(given, GRID, w + sign * step * (k == 0), damping + sign * step * (k == 1), REST) for sign in (1, -1)
        ]
        numeric = (ends[0] - ends[1]) / (2 * step)
        np.testing.assert_allclose(found[k], numeric, atol=1e-6 * np.abs(numeric).max())


@pytest.fixture(scope="module")
def recorded(irma4) -> tuple[Likelihood, Point]:
    """Two windows on a stalk of 8 Hz that stands askew, one of them begun some time ago."""
    world = make_world(irma4, np.random.default_rng(5))
    plan = random_plan(irma4, "short", 2, 1, 5)
    campaign, _ = simulate_campaign(irma4, plan, world, np.random.default_rng(6), recording=Sampling(1.0))
    found = fit(Mechanism(irma4), campaign.of_role(Role.IDENTIFY))
    theta = np.array([1 / (16 * np.pi) ** 2, 0.1, 0.3, -0.2])
    base, point = found.likelihood, found.journey.optimum.point
    late = (base.recordings[0], replace(base.recordings[1], begin=0.5))
    likelihood = Likelihood(Mechanism(irma4, (MarkerStalk(),), theta), late, base.guesses, base.noise, base.resolution)
    return likelihood, Point(np.concatenate([point.shared, theta]), point.states)


def test_residuals_have_their_derivatives(recorded):
    likelihood, point = recorded
    ends = np.ones(2)
    at = simulate(likelihood, point, ends, FINE)
    found = {one.window: one for one in linearised(likelihood, at)}
    assert all(np.abs(one.by_shared[:, BODY]).max() > 1e5 for one in found.values())
    alone = {one.window: one.by_own for one in linearised(likelihood, at, held=True)}
    assert all(alone[w] == pytest.approx(one.by_own) for w, one in found.items())
    own, shared = likelihood.own, len(point.shared)
    steps = [*([1e-6] * own), *(1e-6 * np.maximum(1.0, np.abs(point.shared)))]
    steps[own + BODY] = 1e-9
    for k in range(own + shared):
        ends_of = []
        for sign in (1, -1):
            step = np.zeros(own + shared)
            step[k] = sign * steps[k]
            moved = stepped(likelihood, at, np.tile(step[:own], (2, 1)), step[own:])
            ends_of.append(simulate(likelihood, moved, ends, FINE))
        for w, one in found.items():
            numeric = (ends_of[0].residuals[w].markers - ends_of[1].residuals[w].markers) / (2 * steps[k])
            exact = (one.by_own[:, k] if k < own else one.by_shared[:, k - own])[: len(numeric)]
            assert np.abs(exact - numeric).max() < 1e-4 * max(np.abs(numeric).max(), 1.0), (k, w)
