"""The body that plans are made with, from the windows recorded so far, and what may still hang there."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Body, Campaign, Robot
from fidim_lab.errors import RefusedError
from fidim_lab.identification.excitation.bodies import Bodies, sizes
from fidim_lab.identification.excitation.identified import CERTAIN, bodies_of
from fidim_lab.identification.excitation.place import ExcitationPlace
from fidim_lab.model.mechanism import Mechanism


def first(campaign: Campaign, count: int) -> Campaign:
    return replace(campaign, windows=campaign.windows[:count])


def off(body: Body, true: Body, nominal: Body) -> np.ndarray:
    return np.abs(body.vector - true.vector) / sizes(nominal)


def test_a_few_windows_tell_the_body_and_say_how_well(irma4: Robot, recorded, true_body: Body):
    campaign = recorded(noise=1e-4)
    one, three = (bodies_of(first(campaign, count)) for count in (1, 3))
    assert off(irma4.nominal, true_body, irma4.nominal).max() > 0.1
    assert off(three.likely, true_body, irma4.nominal).max() < 0.01
    for found in (one, three):
        assert np.all(np.abs(found.likely.vector - true_body.vector) < 3 / CERTAIN * found.spread)
    assert np.all(three.spread <= one.spread * 1.01)
    assert np.all(one.spread <= CERTAIN * 0.1 * sizes(irma4.nominal) * (1 + 1e-9)), "no worse than CAD"
    assert three.sure
    assert not one.sure


def test_what_one_window_leaves_open_leaves_no_frequency_open(irma4: Robot, recorded):
    """Parameters that may be off by percents are so together: all bodies swing as was recorded."""
    campaign = first(recorded(noise=1e-4), 1)
    bodies, mechanism, lengths = bodies_of(campaign), Mechanism(irma4, native=True), campaign.windows[0].lengths
    assert lengths is not None
    rest = lengths.mean(axis=0)

    def frequencies(others: tuple[Body, ...]) -> np.ndarray:
        return np.array([ExcitationPlace.at(mechanism, rest, body).swing.frequencies for body in others])

    seen = frequencies((bodies.likely,))
    assert np.abs(frequencies(bodies.others) / seen - 1).max() < 0.015
    alone = Bodies.within(bodies.likely, np.diag(bodies.spread))
    assert np.abs(frequencies(alone.others) / seen - 1).max() > 0.03, "were each off by itself"


def test_recordings_of_something_else_say_nothing(irma4: Robot, recorded):
    campaign = first(recorded(noise=1e-4), 2)
    lengths = [
        w.lengths * np.linspace(1.0, 1.1, len(w.t))[:, np.newaxis] for w in campaign.windows if w.lengths is not None
    ]
    moved = [replace(w, lengths=other) for w, other in zip(campaign.windows, lengths, strict=True)]
    with pytest.raises(RefusedError):
        bodies_of(replace(campaign, windows=tuple(moved)))


def test_bodies_within_what_is_known_lie_close(irma4: Robot):
    spread = 0.002 * sizes(irma4.nominal)
    bodies = Bodies.within(irma4.nominal, np.diag(spread))
    assert bodies.sure
    assert len(bodies.others) == 40
    away = np.array([body.vector for body in bodies.others]) - irma4.nominal.vector
    assert np.all(np.abs(away) <= spread * (1 + 1e-9))
    assert not Bodies.around(irma4.nominal).sure
