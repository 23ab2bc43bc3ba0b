"""Short campaigns of the other simulator with something hidden in them, and the fit of the model as it is."""

from collections.abc import Callable

import numpy as np
import pytest

from fidim_lab.data.records import Robot
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.mismatch.fitting.baseline import Baseline, fit_baseline
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign


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
