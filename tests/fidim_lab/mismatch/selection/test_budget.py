"""A search that goes on for too long is ended: what there is is told, and that it was ended."""

import numpy as np
import pytest

from fidim_lab.data.records import Campaign, Robot
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.mismatch.conclusion.explanation import Verdict
from fidim_lab.mismatch.explain import explain
from fidim_lab.mismatch.selection.budget import Patience
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign


@pytest.fixture(scope="module")
def dragged(irma4: Robot) -> Campaign:
    plan = random_plan(irma4, "short", 3, 1, 3)
    world = make_world(irma4, np.random.default_rng(3), (parse_effect("air-drag-linear:c=0.5", irma4.n),))
    return simulate_campaign(irma4, plan, world, np.random.default_rng(4), recording=Sampling(3.0))[0]


def test_patience_counts_cpu_time_from_when_it_is_made() -> None:
    assert Patience(0.0).ended
    assert not Patience(1e6).ended
    assert Patience(30.0, begin=-1e6).ended


@pytest.mark.slow
def test_without_patience_nothing_is_tried_and_that_is_said(dragged: Campaign) -> None:
    said: list[str] = []
    found = explain(dragged, native=False, say=said.append, patience=0.0)
    assert found.verdict is Verdict.UNKNOWN_PHYSICS
    assert not found.effects
    assert "ended after 0 s of CPU time" in found.message
    assert "--patience" in found.message
    assert not [sentence for sentence in said if sentence.startswith("fitting air-drag")]


@pytest.mark.slow
def test_a_search_that_ends_by_itself_says_nothing_of_patience(dragged: Campaign) -> None:
    found = explain(dragged, native=False)
    assert [cause.id for cause in found.effects] == ["air-drag-linear"]
    assert "patience" not in found.message
