"""Moves between equilibria, carried out by the plant: what they leave is what the planner says of the same body."""

import numpy as np
import pytest

from benchmarks.excite import travel
from benchmarks.excite.travel import moved
from fidim_lab.data.records import Robot
from fidim_lab.identification.excitation.place import ExcitationPlace
from fidim_lab.identification.excitation.travel import travelled
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.mechanism import Mechanism
from sim_backends.plant.world import make_world


def test_a_hasty_move_swings_as_far_as_is_said_and_does_not_settle(irma4: Robot, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(travel, "PATIENCE", 2.0)
    mechanism = Mechanism(irma4, native=True)
    spots = np.array([1.05, -0.3, -0.35]), np.array([1.4, 0.05, -0.15])
    start, goal = (
        ExcitationPlace.at(mechanism, equilibrium_at(mechanism, irma4.nominal, spot).lengths) for spot in spots
    )
    hasty = travelled(start, goal, 0.5, 2.0)
    world = make_world(irma4, np.random.default_rng(1), body=irma4.nominal)
    found = moved(world, (start, goal), hasty, 2e-3)
    assert found.seconds == pytest.approx(hasty.seconds)
    assert found.swing == pytest.approx(hasty.left, rel=0.5)
    assert found.settled > 1.0
    assert found.tension[0] == pytest.approx(hasty.tension[0], rel=0.1)
    easy = moved(world, (start, goal), hasty, 2 * found.swing)
    assert easy.settled == 0.0
