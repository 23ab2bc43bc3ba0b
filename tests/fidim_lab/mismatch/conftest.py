"""Short campaigns of the other simulator with something hidden in them, and the fit of the model as it is."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Robot
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.mismatch.fitting.baseline import Baseline, fit_baseline
from fidim_lab.mismatch.fitting.holdout import HeldOut
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.linearised.hypotheses import Hypothesis
from fidim_lab.mismatch.residuals.whiteness import Whiteness
from fidim_lab.mismatch.selection.candidates import Candidate
from fidim_lab.mismatch.selection.select import Selection, select
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign

DOF = 21_000
"""of the fits that are made from one of a quiet campaign"""
HELD_DOF = 18_000


@pytest.fixture(scope="session")
def baseline_of(irma4: Robot) -> Callable[..., Baseline]:
    """From what is hidden, a seed, so many windows to identify from (one more is held out), and their seconds."""

    def made(*texts: str, seed: int, windows: int, seconds: float) -> Baseline:
        plan = random_plan(irma4, "hidden", windows, 1, seed)
        hidden = tuple(parse_effect(text, irma4.n) for text in texts)
        world = make_world(irma4, np.random.default_rng(seed), hidden)
        rng = np.random.default_rng(seed + 1)
        campaign, _ = simulate_campaign(irma4, plan, world, rng, recording=Sampling(seconds))
        return fit_baseline(campaign, native=True, say=lambda _: None)

    return made


@pytest.fixture(scope="session")
def quiet(baseline_of: Callable[..., Baseline]) -> Baseline:
    """Nothing is hidden: what other fits and searches are made from by other figures."""
    return baseline_of(seed=40, windows=3, seconds=2.0)


@pytest.fixture(scope="session")
def searched(quiet: Baseline) -> Selection:
    """The search that found nothing."""
    return select(quiet, lambda _: None)


@pytest.fixture(scope="session")
def fit_with(quiet: Baseline) -> Callable[..., Fit]:
    """A fit with so many shared parameters beside the body, all 0 but the first, and this χ²; of the declared noise."""

    def made(further: int, chi2: float, *, first: float = 0.0, dof: int = DOF) -> Fit:
        fit, count = quiet.fit, len(quiet.fit.remainders)
        theta = np.zeros(further)
        theta[:1] = first
        simulation = fit.journey.optimum.simulation
        point = replace(simulation.point, shared=np.concatenate([fit.values, theta]))
        optimum = replace(fit.journey.optimum, simulation=replace(simulation, point=point))
        left = tuple(replace(one, chi2=chi2 / count, dof=dof // count, noise=None) for one in fit.remainders)
        return replace(fit, journey=replace(fit.journey, optimum=optimum), remainders=left)

    return made


@pytest.fixture(scope="session")
def claim(fit_with: Callable[..., Fit]) -> Callable[..., Candidate]:
    """A model with these effects, by χ²/dof of what it was fitted to and of held-out windows, and what is left."""

    def made(
        *tried: Hypothesis,
        fitted: float = 1.0,
        held_out: float = 1.0,
        held_dof: int = HELD_DOF,
        excess: float = 0.0,
        white: bool = False,
        at_an_edge: bool = False,
        dof: int = DOF,
    ) -> Candidate:
        further = sum(len(one.effect.parameters) for one in tried)
        body = len(fit_with(0, 0.0).values)
        fit = fit_with(further, fitted * (dof - body - further), first=float(at_an_edge), dof=dof)
        bounds = (at_an_edge, *(False,) * (further - 1)) if further else ()
        held = HeldOut(held_out * held_dof, held_dof, 1e-4 * held_out, {})
        left = Whiteness(1.0, float(white), (0.0, 10.0), None, excess, 1.0, "White." if white else "Not white.")
        return Candidate(Completed(tried, fit, whole=True, at_bound=bounds), held, left)

    return made
