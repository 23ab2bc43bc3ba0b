"""A search that begins with what an earlier one of nearly the same windows ended with."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fidim_lab.data.records import Robot
from fidim_lab.effects.catalogue import by_id
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.mismatch.cleaning.contacts import Contact, without
from fidim_lab.mismatch.fitting.baseline import Baseline, fit_baseline
from fidim_lab.mismatch.fitting.refit import Completed, _phases_of, refit
from fidim_lab.mismatch.linearised.hypotheses import Hypothesis
from fidim_lab.mismatch.selection.select import Selection, select
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign


def seen(fit: Fit, ids: list[str], astray: np.ndarray | None) -> Fit:
    """The fit with windows of these ids, and what their states ended with."""
    likelihood, simulation = fit.likelihood, fit.journey.optimum.simulation
    recordings = zip(likelihood.recordings, ids, strict=False)
    named = tuple(replace(one, window=replace(one.window, id=id)) for one, id in recordings)
    point = replace(simulation.point, states=replace(simulation.point.states, astray=astray))
    optimum = replace(fit.journey.optimum, simulation=replace(simulation, point=point))
    journey = replace(fit.journey, optimum=optimum)
    return replace(fit, likelihood=replace(likelihood, recordings=named), journey=journey)


def test_phases_are_carried_along_by_the_windows_ids(quiet: Baseline) -> None:
    own, same = (
        next(one for one in by_id(quiet.campaign.robot, "periodic-force") if one.of_each_window is wide)
        for wide in (True, False)
    )

    def known(astray: np.ndarray | None, effect: NamedEffect) -> Completed:
        term = Hypothesis(effect, np.zeros(len(effect.parameters)), ())
        return Completed((term,), seen(quiet.fit, ["i01", "i02"], astray), whole=True)

    donor = seen(quiet.fit, ["i02", "i02, part 2", "i01"], None)
    phases = np.array([[0.1], [0.2]])
    found = _phases_of(known(phases, own), donor)
    assert found is not None
    assert found.tolist() == [0.2, 0.0, 0.1]
    assert _phases_of(known(phases, same), donor) is None
    assert _phases_of(known(None, own), donor) is None


def searched(start: Baseline, **more: Any) -> tuple[Selection, list[str]]:
    says: list[str] = []
    return select(start, says.append, **more), says


@pytest.mark.slow
def test_what_is_known_to_do_is_not_searched_again(irma4: Robot) -> None:
    world = make_world(irma4, np.random.default_rng(71), (parse_effect("air-drag-linear:c=0.5", irma4.n),))
    plan = random_plan(irma4, "known", 6, 2, 71)
    campaign, _ = simulate_campaign(irma4, plan, world, np.random.default_rng(72), recording=Sampling(6.0))
    first, _ = searched(fit_baseline(campaign, native=True, say=lambda _: None))
    other = fit_baseline(without(campaign, [Contact("i02", 2.5, 2.8, 3.0, 0.1)]), native=True, say=lambda _: None)
    again, says = searched(other, known=first.best.model)
    assert again.best.is_white
    assert [h.effect.id for h in again.best.model.tried] == ["air-drag-linear"]
    assert again.best in again.tried
    assert "testing all effects" not in says
    # a term that it had beside, needless in these windows, is dropped
    drag, force = (
        next(h for h in other.tried.direct if h.effect.id == id) for id in ("air-drag-linear", "constant-force")
    )
    both = refit(other.whole_ground, other.short, [drag, force], [np.array([0.5]), np.zeros(3)], other.context)
    assert both is not None
    pruned, _ = searched(other, known=both)
    assert [h.effect.id for h in pruned.best.model.tried] == ["air-drag-linear"]
    # of a model that does not do, nothing is kept
    empty = fit_baseline(campaign, native=True, say=lambda _: None).as_it_is
    assert "testing all effects" in searched(other, known=empty)[1]
