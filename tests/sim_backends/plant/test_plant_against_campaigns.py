"""The plant against recorded campaigns of yet another simulator, whose truth is known: only noise may be left.

Fitted are where the hand let go (two numbers) and the lengths within their rounding (four, with that prior).
"""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Body, Window
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.plant import Plant
from sim_backends.plant.world import make_world

pytestmark = pytest.mark.shared
NOISE, ROUNDING = 1e-4, 1e-5

CAMPAIGNS = [
    ("open-nothing-left-out", ()),
    ("open-air-drag", ("air-drag-linear:c=0.5",)),
    ("open-swivel-friction", ("swivel-friction:c=0.007",)),
    ("open-anchor-moved", ("anchor-offset:cable=2,dx=-0.005,dy=0.006,dz=0.004",)),
    ("open-two-at-once", ("rotational-drag:c=0.04", "cable-length-bias:cable=1,bias=-0.005")),
]
ELASTIC = ("open-elastic-cables", ("cable-elasticity:k=6e4,c=40",))


def _chi2_per_dof(shared: Path, name: str, effects: tuple[str, ...], horizons: tuple[float, ...], k: int = 0) -> float:
    campaign = read_campaign(shared / "campaigns" / name)
    truth = json.loads((shared / "campaigns" / "truth" / f"{name}.json").read_text())
    hidden = tuple(parse_effect(text, 4) for text in effects)
    body = Body(np.array(truth["s"]), np.array(truth["I"]))
    world = make_world(campaign.robot, np.random.default_rng(0), hidden, body=body)
    world = replace(world, mass=truth["m"], markers=campaign.robot.markers)
    residual = _residual(Plant(world), campaign.windows[k])
    unknown = np.zeros(6)
    for horizon in horizons:
        samples = round(horizon * 100) + 1
        unknown = least_squares(residual, unknown, args=(samples,), max_nfev=4).x
    misfit = residual(unknown, samples)[:-4]
    return float(misfit @ misfit) / (len(misfit) - 6)


def _residual(plant: Plant, window: Window) -> Callable[[np.ndarray, int], np.ndarray]:
    assert window.lengths is not None
    held = window.lengths[0]

    def residual(unknown: np.ndarray, samples: int) -> np.ndarray:
        lengths = held + unknown[2:] * ROUNDING
        alone = plant.rest(lengths)
        aside = window.markers[0, 0, :2] - alone.marker[:2] + unknown[:2] * NOISE
        plant.place(plant.rest(lengths, displacement=aside), lengths)
        seen = [plant.markers()]
        for t in window.t[1:samples]:
            plant.advance(t)
            seen.append(plant.markers())
        return np.append(((np.array(seen) - window.markers[:samples]) / NOISE).ravel(), unknown[2:])

    return residual


@pytest.mark.parametrize(("name", "effects"), [CAMPAIGNS[0], CAMPAIGNS[-1]])
def test_a_second_of_a_window_is_met_to_its_noise(shared, name, effects):
    assert 0.8 < _chi2_per_dof(shared, name, effects, (1.0,)) < 1.25


@pytest.mark.slow
@pytest.mark.parametrize(("name", "effects"), [*CAMPAIGNS[1:4], ELASTIC])
def test_four_seconds_of_a_window_are_met_to_their_noise(shared, name, effects):
    assert 0.9 < _chi2_per_dof(shared, name, effects, (1.0, 4.0)) < 1.1


def test_without_the_hidden_physics_the_window_is_not_met(shared):
    assert _chi2_per_dof(shared, "open-two-at-once", (), (1.0,)) > 3.0
