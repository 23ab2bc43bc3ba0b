"""Which robots markers can watch, and how uncertain their geometry is."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Survey
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.misfit import foretold, length_misfit, redundancy
from procedures.guards.geometry_guard import SURVEY, lacks, uncertainty

LENGTHS = np.array([1.34283, 1.43119, 1.56772, 1.45231])


@pytest.mark.parametrize(("cables", "markers", "told"), [(4, 1, 1), (3, 1, 0), (3, 2, 2), (1, 3, 1), (4, 0, -2)])
def test_how_much_is_told_twice(cables, markers, told):
    assert redundancy(cables, markers) == told


def test_three_cables_and_one_marker_are_not_watched(irma4):
    assert lacks(irma4) == ""
    three = replace(irma4, cables=irma4.cables[:3])
    assert "with 3 cables and 1 marker a turn of the platform explains any place" in lacks(three)
    assert lacks(replace(three, extra_markers=(np.array([0.1, 0.0, 0.0]),))) == ""


def test_a_stated_survey_counts_instead_of_the_usual_one(irma4):
    assert uncertainty(irma4) == SURVEY
    survey = replace(Survey.alike(4, 3e-4, 4e-4), encoder_zero=1.2e-3)
    assert uncertainty(replace(irma4, survey=survey)) == pytest.approx(1.3e-3)


@pytest.mark.parametrize("cable", [0, 1, 2, 3])
@pytest.mark.parametrize("by", [0.02, -0.02])
def test_a_cable_of_another_length_shows_and_a_slack_one_only_where_it_is_longer(irma4, cable, by):
    mechanism = Mechanism(irma4)
    misfit = length_misfit(mechanism)
    true = LENGTHS + by * np.eye(4)[cable]
    here, told = (pose_from_lengths(mechanism, irma4.nominal, lengths).pose for lengths in (true, LENGTHS))
    seen = (here.position + here.rotation @ irma4.marker)[np.newaxis]
    every, none = np.ones(4, dtype=bool), np.zeros(4, dtype=bool)
    off, pose = misfit(seen, LENGTHS, every, told)
    assert 0.15 * abs(by) < np.linalg.norm(off) <= 1.001 * abs(by), "the true error is one that explains it"
    part = foretold(mechanism, told)
    assert part @ part == pytest.approx(part, abs=1e-9)
    some, _ = misfit(seen, LENGTHS, none, pose)
    assert (some >= 0.0).all()
    assert np.linalg.norm(some) > 0.15 * by
    rest, _ = misfit(seen, true, every, here)
    assert np.linalg.norm(rest) < 1e-4
