"""The marker's swing against its rest: a cable that slipped, an origin that moved, and honest swings."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from procedures.expected.nominal_rest import NominalRest
from procedures.outcomes import Outcome
from procedures.recording.marker_place import BESIDE, place_measurements
from procedures.settings import PlaceSettings

LENGTHS = (1.30283, 1.39119, 1.52772, 1.41231)
SETTINGS = PlaceSettings()
TRIFILAR = Path(__file__).parents[2] / "examples" / "robots" / "trifilar.toml"


def swing(rest, lengths, amplitude=0.02):
    """Two tones about the rest, where cables of these lengths let the marker be, with noise."""
    t = np.arange(400) / 100.0
    tones = np.column_stack([np.sin(2 * np.pi * f * t + phase) for f, phase in ((1.4, 0.3), (2.5, 1.0), (1.4, 2.0))])
    place = rest.allowed(lengths, rest.at(lengths).marker + amplitude * tones)
    return place + np.random.default_rng(2).normal(scale=1e-4, size=place.shape)


def judged(rest, place, lengths=LENGTHS):
    return place_measurements(rest, lengths, place, 100.0, rest.at(lengths).marker, SETTINGS)


@pytest.fixture(scope="module")
def rest():
    return NominalRest(read_robot(PAPERS_ROBOT))


@pytest.mark.parametrize("amplitude", [0.003, 0.01, 0.03])
def test_a_swing_passes_also_with_samples_missing(rest, amplitude):
    place = swing(rest, LENGTHS, amplitude)
    place[50:60] = np.nan
    assert [one.outcome for one in judged(rest, place)] == [Outcome.PASS] * 2


@pytest.mark.parametrize("cable", [1, 2, 3, 4])
def test_a_cable_that_slipped_is_found_by_the_places_its_length_allows(rest, cable):
    true = tuple(length + 0.03 * (number == cable) for number, length in enumerate(LENGTHS, start=1))
    beside, _ = judged(rest, swing(rest, true))
    assert (beside.name, beside.outcome) == (BESIDE, Outcome.FAIL)


@pytest.mark.parametrize("cable", [1, 2, 3, 4])
def test_a_cable_that_slips_late_in_a_window_is_found(rest, cable):
    true = tuple(length + 0.03 * (number == cable) for number, length in enumerate(LENGTHS, start=1))
    place = swing(rest, LENGTHS)
    place[-60:] = swing(rest, true)[-60:]
    assert judged(rest, place)[0].outcome == Outcome.FAIL


@pytest.mark.parametrize("way", [(0.03, 0, 0), (0, -0.03, 0), (0, 0, 0.03), (-0.028, 0.024, -0.008)])
def test_an_origin_that_moved_is_found_in_every_direction(rest, way):
    assert Outcome.FAIL in [one.outcome for one in judged(rest, swing(rest, LENGTHS, 0.01) + np.array(way))]


def test_three_cables_forbid_little_and_an_unseen_marker_tells_nothing(rest):
    three = NominalRest(read_robot(TRIFILAR))
    lengths = (2.0, 2.0, 2.0)
    t = np.arange(300) / 100.0
    aside = 0.03 * np.column_stack([np.sin(7.0 * t), np.cos(6.0 * t), 0.0 * t])
    found = judged(three, three.at(lengths).marker + aside, lengths)
    assert {one.outcome for one in found} == {Outcome.PASS}
    assert found[0].value < 2e-3
    assert {one.outcome for one in judged(rest, np.full((30, 3), np.nan))} == {Outcome.UNSET}


@pytest.mark.parametrize(
    ("robot", "lengths", "outcome"), [(TRIFILAR, (2.0,) * 3, Outcome.PASS), (PAPERS_ROBOT, LENGTHS, Outcome.FAIL)]
)
def test_a_swing_on_three_cables_may_be_more_uneven_than_on_four(robot, lengths, outcome):
    """Its middle 40 mm beside the rest, at an amplitude of 100 mm."""
    hanging = NominalRest(read_robot(robot))
    aside = np.column_stack([0.04 + 0.05 * np.sin(np.arange(300) / 14.0), np.zeros(300), np.zeros(300)])
    _, middle = judged(hanging, hanging.at(lengths).marker + aside, lengths)
    assert middle.outcome == outcome


@pytest.mark.parametrize("name", ["anchor-moved", "elastic-cables", "periodic-force", "two-at-once"])
@pytest.mark.sampled(1)
def test_honest_windows_pass_whatever_physics_is_hidden_in_them(shared, name):
    campaign = read_campaign(shared / "campaigns" / f"open-{name}")
    rest = NominalRest(campaign.robot)
    for window in campaign.windows:
        lengths = tuple(np.nanmean(window.lengths, axis=0))
        rested = np.array(window.equilibrium)
        found = place_measurements(rest, lengths, window.markers[:, 0, :], 100.0, rested, SETTINGS)
        assert {one.outcome for one in found} == {Outcome.PASS}, (window.id, found)
        assert found[0].value < found[0].high / 3


def test_what_a_rough_survey_leaves_is_no_slip(rest):
    """Anchors 10 mm elsewhere than the file says: the marker is off at rest as well as in the swing."""
    rng = np.random.default_rng(5)
    robot = read_robot(PAPERS_ROBOT)
    cables = tuple(replace(cable, d=cable.d + rng.normal(scale=0.01, size=3)) for cable in robot.cables)
    file = NominalRest(replace(robot, cables=cables))
    found = place_measurements(file, LENGTHS, swing(rest, LENGTHS), 100.0, rest.at(LENGTHS).marker, SETTINGS)
    assert {one.outcome for one in found} == {Outcome.PASS}
