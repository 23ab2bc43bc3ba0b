"""Bodies that CAD may mean: spread to all sides, and tuned to the frequencies that were seen."""

from itertools import combinations

import numpy as np
import pytest

from fidim_lab.data.records import Body, Robot
from fidim_lab.identification.excitation.bodies import Bodies
from fidim_lab.identification.excitation.place import ExcitationPlace
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.mechanism import Mechanism


@pytest.fixture(scope="module")
def place(irma4: Robot) -> ExcitationPlace:
    mechanism = Mechanism(irma4, native=True)
    rest = equilibrium_at(mechanism, irma4.nominal, np.array([1.25, -0.15, -0.2]))
    return ExcitationPlace.at(mechanism, rest.lengths)


def test_any_two_parameters_are_off_in_all_four_ways(irma4: Robot):
    around = Bodies.around(irma4.nominal)
    signs = np.sign([body.vector - irma4.nominal.vector for body in around.others])
    signs, inside = signs[:8], signs[8:]
    assert len(inside) == 32
    for a, b in combinations(range(6), 2):
        assert len({tuple(row) for row in signs[:, [a, b]]}) == 4


def test_those_between_fill_what_the_corners_leave(irma4: Robot):
    around = Bodies.around(irma4.nominal)
    corners, inside = np.split(np.array([body.vector - irma4.nominal.vector for body in around.others]), [8])
    parts = inside / np.abs(corners).max(axis=0)
    assert np.abs(parts).max() < 1.0
    assert np.abs(parts.mean(axis=0)).max() < 0.15
    middle = np.abs(parts) < 0.5  # a quarter of them: the square root of what is even
    np.testing.assert_allclose(middle.mean(axis=0), 0.25, atol=0.1)


def test_all_bodies_swing_at_the_frequencies_seen_and_are_still_apart(irma4: Robot, place: ExcitationPlace):
    vector = irma4.nominal.vector * (1 + 0.05 * np.array([0, 0, 1, 1, -1, 1, 0, 0, 0]))
    true = ExcitationPlace.at(place.mechanism, place.equilibrium.lengths, Body.from_vector(vector)).swing.frequencies
    assert np.abs(true / place.swing.frequencies - 1).max() > 0.02
    before = Bodies.around(irma4.nominal)
    tuned = before.tuned(place, true, (0, 1))
    assert len(tuned.others) >= 30
    for body in (tuned.likely, *tuned.others):
        found = ExcitationPlace.at(place.mechanism, place.equilibrium.lengths, body).swing.frequencies
        np.testing.assert_allclose(found, true, rtol=0.004)
    spread = [np.std([b.vector for b in bodies.others], axis=0) for bodies in (before, tuned)]
    assert np.median(spread[1] / spread[0]) > 0.5, "frequencies say little of most parameters"


def test_a_mode_that_was_not_seen_says_nothing(place: ExcitationPlace, irma4: Robot):
    wrong = place.swing.frequencies * np.array([1.0, 1.5])
    tuned = Bodies.around(irma4.nominal).tuned(place, wrong, (0,))
    np.testing.assert_allclose(tuned.likely.vector, irma4.nominal.vector, atol=1e-9)


def test_frequencies_that_no_body_has_change_nothing(place: ExcitationPlace, irma4: Robot):
    before = Bodies.around(irma4.nominal)
    assert before.tuned(place, 30 * place.swing.frequencies, (0, 1)) is before
