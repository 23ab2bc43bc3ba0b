"""A search that goes on for too long is ended: what there is is told, and that it was ended."""

import numpy as np
import pytest

from fidim_lab.data.records import Campaign, Robot
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.mismatch.budget import WORK, Budget
from fidim_lab.mismatch.conclusion.explanation import Verdict
from fidim_lab.mismatch.explain import explain
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.grid import QUICK, Grid
from fidim_lab.model.sensitivity.integrate import States, integrate
from fidim_lab.model.sensitivity.work import IntegrationWork, work_done
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign


@pytest.fixture(scope="module")
def dragged(irma4: Robot) -> Campaign:
    plan = random_plan(irma4, "short", 3, 1, 3)
    world = make_world(irma4, np.random.default_rng(3), (parse_effect("air-drag-linear:c=0.5", irma4.n),))
    return simulate_campaign(irma4, plan, world, np.random.default_rng(4), recording=Sampling(3.0))[0]


def test_a_budget_is_spent_by_work_or_by_cpu_time_from_when_it_is_made() -> None:
    assert Budget(patience=0.0).is_spent
    assert not Budget(patience=1e6).is_spent
    assert Budget(patience=30.0, since=-1e6).is_spent
    assert not Budget(effort=2.0, begun=work_done() - IntegrationWork(0, WORK)).is_spent
    assert Budget(effort=0.5, begun=work_done() - IntegrationWork(0, WORK)).is_spent


def test_work_is_counted_in_nodes_and_is_the_same_each_time(irma4: Robot) -> None:
    mechanism, body = Mechanism(irma4), irma4.nominal
    rest = equilibrium_at(mechanism, body, np.array([1.2, -0.1, -0.5]))
    states = States(rest.pose.position[np.newaxis], rest.pose.rotation[np.newaxis], np.zeros((1, 6)))
    counted = []
    for _ in range(2):
        begin = work_done()
        grid = Grid.covering(2.0, QUICK)
        integrate(mechanism, body.vector, states, grid, np.zeros(1))
        counted.append((work_done() - begin).nodes)
    assert counted[0] == counted[1] == grid.nodes


@pytest.mark.slow
@pytest.mark.parametrize(
    ("limit", "told"),
    [({"patience": 0.0}, ("after 0 s of CPU time", "--patience")), ({"effort": 0.0}, ("limit of work", "--effort"))],
)
def test_a_search_without_means_tries_nothing_and_says_so(dragged: Campaign, limit, told) -> None:
    said: list[str] = []
    found = explain(dragged, native=False, say=said.append, **limit)
    assert found.verdict is Verdict.UNKNOWN_PHYSICS
    assert not found.effects
    assert all(words in found.message for words in told)
    assert not [sentence for sentence in said if sentence.startswith("fitting air-drag")]


@pytest.mark.slow
def test_a_search_that_ends_by_itself_says_nothing_of_its_limits(dragged: Campaign) -> None:
    found = explain(dragged, native=False)
    assert [cause.id for cause in found.effects] == ["air-drag-linear"]
    assert "--effort" not in found.message
