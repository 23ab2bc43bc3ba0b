"""Short campaigns of the other simulator with something hidden in them, and the fit of the model as it is."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest

from fidim_lab.data.records import Campaign, Plan, Robot
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
def planned(irma4: Robot) -> Callable[..., Plan]:
    """The plan of so many windows, so many held out, by a seed: drawn once, a second or two."""
    return cache(partial(random_plan, irma4, "hidden"))


@pytest.fixture(scope="session")
def campaign_of(irma4: Robot, planned: Callable[..., Plan]) -> Callable[..., Campaign]:
    """From what is hidden, a seed, windows to identify from (`held_out` more are held out), and their seconds."""

    @cache
    def made(*texts: str, seed: int, windows: int, seconds: float, held_out: int = 1) -> Campaign:
        hidden = tuple(parse_effect(text, irma4.n) for text in texts)
        world, rng = make_world(irma4, np.random.default_rng(seed), hidden), np.random.default_rng(seed + 1)
        return simulate_campaign(irma4, planned(windows, held_out, seed), world, rng, recording=Sampling(seconds))[0]

    return made


@pytest.fixture(scope="session")
def baseline_of(campaign_of: Callable[..., Campaign]) -> Callable[..., Baseline]:
    """The fit of the model as it is to the campaign that `campaign_of` makes of the same."""

    @cache
    def made(*texts: str, seed: int, windows: int, seconds: float) -> Baseline:
        campaign = campaign_of(*texts, seed=seed, windows=windows, seconds=seconds)
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
    """A fit with these parameters (θ) beside the body, all but exactly known, and this χ²; of the declared noise."""

    def made(theta: np.ndarray, chi2: float, *, dof: int = DOF) -> Fit:
        fit, count, more = quiet.fit, len(quiet.fit.remainders), len(theta)
        optimum, prior = fit.journey.optimum, fit.prior
        point = replace(optimum.simulation.point, shared=np.concatenate([fit.values, theta]))
        size = optimum.tables.shape[1]
        old, new = np.r_[: size - 1, size + more - 1], np.arange(size - 1, size + more - 1)
        tables = np.zeros((len(optimum.tables), size + more, size + more))
        tables[np.ix_(range(len(tables)), old, old)] = optimum.tables
        tables[:, new, new] = 1e9
        simulation = replace(optimum.simulation, point=point)
        mean, sd = np.concatenate([prior.mean, theta]), np.concatenate([prior.sd, np.full(more, np.inf)])
        return replace(
            fit,
            journey=replace(fit.journey, optimum=replace(optimum, simulation=simulation, tables=tables)),
            remainders=tuple(replace(one, chi2=chi2 / count, dof=dof // count, noise=None) for one in fit.remainders),
            prior=replace(prior, mean=mean, sd=sd),
        )

    return made


@pytest.fixture(scope="session")
def claim(quiet: Baseline, fit_with: Callable[..., Fit]) -> Callable[..., Candidate]:
    """A model with these effects, by χ²/dof of what it was fitted to and of held-out windows, and what is left.

    theta: of all effects, in a row; unless given, as they are where they do nothing.
    """

    def made(
        *tried: Hypothesis,
        fitted: float = 1.0,
        held_out: float = 1.0,
        held_dof: int = HELD_DOF,
        excess: float = 0.0,
        white: bool = False,
        at_an_edge: bool = False,
        dof: int = DOF,
        theta: np.ndarray | None = None,
        whole: bool = True,
    ) -> Candidate:
        values = np.concatenate([np.zeros(0), *(one.absent for one in tried)]) if theta is None else theta
        if at_an_edge:
            values = np.concatenate([[1.0], values[1:]])
        fit = fit_with(values, fitted * (dof - len(quiet.fit.values) - len(values)), dof=dof)
        bounds = (at_an_edge, *(False,) * (len(values) - 1)) if len(values) else ()
        held = HeldOut(held_out * held_dof, held_dof, 1e-4 * held_out, {})
        left = Whiteness(1.0, float(white), (0.0, 10.0), None, excess, 1.0, "White." if white else "Not white.")
        return Candidate(Completed(tried, fit, whole=whole, at_bound=bounds), held, left)

    return made
