"""Displacements that winches reach: smaller than a hand's, and then reached whatever damps."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.design import pool
from fidim_lab.identification.design.search import Some, reached, within_reach
from fidim_lab.identification.design.task import ByWinches
from fidim_lab.identification.excitation.bodies import Bodies
from fidim_lab.identification.excitation.knowledge import Knowledge
from fidim_lab.identification.excitation.place import ExcitationPlace, WinchLimits, wanted_amplitudes
from fidim_lab.identification.excitation.plan import planned

WINCHES = ByWinches(WinchLimits(speed=0.5, acceleration=4.0))


def silent(_: object) -> None:
    pass


@pytest.fixture(scope="module")
def some(drawn) -> Some:
    return Some(replace(drawn.task, winches=WINCHES, native=True), drawn.pool.z[:1])


@pytest.mark.slow
def test_displacements_get_smaller_and_are_in_reach_whatever_damps(drawn, some: Some):
    found = reached(some)
    assert found, "winches reach nothing at this place"
    for z in found:
        own = next(one for one in some.z if (one[:4] == z[:4]).all())
        size = float(np.linalg.norm(z[4:]) / np.linalg.norm(own[4:]))
        assert 0.09 <= size <= 0.9
        np.testing.assert_allclose(z[4:], size * own[4:])
        place = ExcitationPlace.at(some.task.mechanism(), z[:4])
        for damping in (0.08, 0.0):
            known = Knowledge(np.full(2, damping), np.ones(2), np.ones(2), np.full(2, 0.7 * damping))
            bodies = Bodies.around(place.body).others
            plan = planned(place, wanted_amplitudes(place, z[4:]), known, WINCHES.limits, bodies)
            assert np.linalg.norm(plan.reached) > 0.85 * np.linalg.norm(plan.wanted)


@pytest.mark.slow
def test_less_damping_and_stronger_winches_reach_farther(some: Some):
    def size(winches: ByWinches) -> float:
        found = reached(replace(some, task=replace(some.task, winches=winches), z=some.z[:1]))
        return max((float(np.linalg.norm(z[4:])) for z in found), default=0.0)

    usual = size(WINCHES)
    assert size(replace(WINCHES, damping=0.02)) > 1.1 * usual
    assert size(replace(WINCHES, limits=WinchLimits(speed=0.1, acceleration=0.3))) < 0.9 * usual


def test_too_few_places_are_refused_in_words(drawn, some: Some):
    weak = replace(some.task, winches=ByWinches(WinchLimits(0.005, 0.01)))
    two = pool.Pool(drawn.pool.z[:2], drawn.pool.tables[:2])
    with pytest.raises(InfeasibleError, match="Winches can excite the platform at 0 of 2 random places"):
        within_reach(drawn.mechanism, weak, two, map, silent)


def test_tables_are_those_of_the_windows(drawn):
    again = pool.tabled(drawn.mechanism, drawn.task, drawn.pool.z)
    np.testing.assert_allclose(again.z, drawn.pool.z)
    np.testing.assert_allclose(again.tables, drawn.pool.tables, rtol=1e-6, atol=1e-9)
