"""Scores beside a model whose cables are springs, against simulations with θ a little off."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Robot, Role
from fidim_lab.effects.cables.cable_elasticity import CableElasticity, CableStiffness, DampedElasticity
from fidim_lab.effects.loads.oscillation import PeriodicForce
from fidim_lab.identification.mle.fit import Fit, fit
from fidim_lab.identification.mle.trajectories.likelihood import Point, simulate
from fidim_lab.identification.mle.trajectories.normal import Prior
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.mismatch.fitting.sprung import STIFFEST, begins_anew, bounded, left_at_first, stiffest
from fidim_lab.mismatch.linearised.columns_sprung import SprungScorer
from fidim_lab.mismatch.linearised.hypotheses import Hypotheses, hypotheses
from fidim_lab.mismatch.residuals.residual import Leftover
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.model.sensitivity.grid import FINE
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign

CHECKED = ("air-drag-linear", "anchor-offset (cable 2)", "cable-creep (cable 3)", "marker-offset", "periodic-force")
"""one for each way in which an effect enters"""


def elastic_fit(robot: Robot) -> Fit:
    plan = random_plan(robot, "short", 2, 1, 5)
    world = make_world(robot, np.random.default_rng(5), (parse_effect("cable-elasticity:EA=6e4", robot.n),))
    campaign, _ = simulate_campaign(robot, plan, world, np.random.default_rng(6), recording=Sampling(1.0))
    return fit(Mechanism(robot, (CableElasticity(),), [1 / 6e4]), campaign.of_role(Role.IDENTIFY))


def few(robot: Robot) -> Hypotheses:
    every = hypotheses(robot)
    direct = tuple(h for h in every.direct if h.label in CHECKED and h.absent[-1] in (0.0, 4.0))
    periodic = tuple(h for h in every.periodic if h.effect.id in CHECKED and h.absent[-1] == 1.1)
    return replace(every, direct=direct, periodic=periodic)


@pytest.mark.slow
def test_columns_beside_springs_are_derivatives(irma4: Robot) -> None:
    found = elastic_fit(irma4)
    assert found.likelihood.springs is not None
    assert found.chi2_per_dof < 1.5  # away from cables that get slack, where derivatives have a kink
    simulation = found.journey.optimum.simulation
    scorer = SprungScorer(found.likelihood.mechanism, few(irma4))
    window = next(c for c in scorer.columns(found.likelihood, simulation) if c.window == 0)
    checked = 0
    for h, place in zip(scorer.tried.every, scorer.tried.slices, strict=True):
        for k, column in zip(h.scored, range(place.start, place.stop), strict=True):
            step = 1e-2 * h.effect.parameters[k].scale
            ends = [_rows(found, h.effect, h.absent, k, sign * step) for sign in (1, -1)]
            numeric, exact = (ends[0] - ends[1]) / (2 * step), window.by_scored[:, column]
            # as near as the derivatives of a trajectory with springs are: largest at its very end
            assert np.linalg.norm(exact - numeric) < 0.03 * np.linalg.norm(numeric), (h.label, k)
            checked += 1
    assert checked == 1 + 3 + 1 + 3 + 6


def _rows(found: Fit, effect: object, absent: np.ndarray, k: int, change: float) -> np.ndarray:
    theta = absent.copy()
    theta[k] += change
    base, point = found.likelihood, found.journey.optimum.point
    effects = (*base.mechanism.effects, effect)
    mechanism = Mechanism(base.mechanism.robot, effects, [*point.shared[9:], *theta], springs=True)  # pyright: ignore[reportArgumentType]
    there = Point(np.concatenate([point.shared, theta]), point.states)
    moved = simulate(replace(base, mechanism=mechanism), there, found.journey.ends, FINE)
    assert moved is not None
    return moved.residuals[0].rows


def test_a_fit_cannot_take_a_damper_for_a_drive(irma4: Robot) -> None:
    damped = Mechanism(irma4, (PeriodicForce(), DampedElasticity()), springs=True)
    size = BODY + len(damped.theta)
    prior = bounded(Prior(np.zeros(size), np.ones(size)), damped)
    assert prior.low is not None
    np.testing.assert_array_equal(prior.low[-2:], [STIFFEST, 0.0])
    assert (prior.low[:-2] == -np.inf).all(), "what moves no cable is bounded where the fit has ended"


def test_springs_begin_anew_where_others_become_springs(irma4: Robot) -> None:
    one = Mechanism(irma4, (CableElasticity(cable=2),), [1e-5], springs=True)
    assert stiffest(one)[0] > 0
    assert stiffest(Mechanism(irma4, (PeriodicForce(),))).max() == -np.inf

    class Known:
        class likelihood:  # noqa: N801
            mechanism = one

    every = Mechanism(irma4, (CableStiffness(),), [1e-5], springs=True)
    assert begins_anew(every, Known)  # pyright: ignore[reportArgumentType]
    assert not begins_anew(one, Known)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(("rings", "drifts", "expected"), [(1.5, 0.0, True), (0.0, 0.0, False), (0.0, 0.5, False)])
def test_what_rings_is_left_at_first(rings: float, drifts: float, expected: bool) -> None:
    t = np.arange(0.0, 10.0, 0.01)
    values = np.random.default_rng(4).normal(size=(len(t), 1, 3))
    values += (rings * np.exp(-t / 0.3) * np.sin(250 * t) + drifts * np.sin(7 * t))[:, np.newaxis, np.newaxis]
    values[5] = np.nan
    assert left_at_first([Leftover(f"i{k}", t, values, 1e-4, 8) for k in range(4)]) is expected
