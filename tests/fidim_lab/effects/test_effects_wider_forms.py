"""More general forms of an effect: where they begin they pull as the simple form did."""

import casadi as ca
import numpy as np
import pytest

from fidim_lab.data.records import Robot
from fidim_lab.effects.dissipation.drag import AirDragLinear, AirDragQuadratic
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.effects.loads.constant_force import ConstantForce
from fidim_lab.effects.loads.umbilical import Umbilical
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.slots import PlatformState


def pull(robot: Robot, effect: NamedEffect, theta: np.ndarray, place: np.ndarray) -> np.ndarray:
    position, rotation, twist = ca.SX.sym("p", 3), ca.SX.eye(3), ca.SX.zeros(6)
    mechanism = Mechanism(robot)
    state = PlatformState(
        time=ca.SX(0),
        position=position,
        rotation=rotation,
        twist=twist,
        cables=mechanism.cables_at(position, rotation, ca.SX(0, 1)),
    )
    return np.array(ca.Function("pull", [position], [effect.wrench(state, ca.SX(theta))])(place)).ravel()


def test_a_hose_with_a_rest_length_begins_where_the_simple_one_pulls_alike(irma4: Robot) -> None:
    middle = np.mean([cable.d for cable in irma4.cables], axis=0)
    end, k = middle + np.array([0.9, 0.4, 0.3]), 3.0
    simple = np.concatenate([[k, 0.2], k * end, np.zeros(3)])
    place = middle + np.array([0.0, 0.0, -0.7])
    expected = pull(irma4, Umbilical(), simple, place)
    wide = Umbilical().wider(simple, irma4)
    assert len(wide) == 3
    for effect, theta in wide:
        low, high = effect.bounds()
        assert effect.id == "umbilical"
        assert (theta >= low).all()
        assert (theta <= high).all()
    for effect, theta in wide[:2]:
        np.testing.assert_allclose(pull(irma4, effect, theta, place), expected, rtol=0.01, atol=1e-3)


def test_without_a_spring_there_is_nothing_to_generalise(irma4: Robot) -> None:
    assert Umbilical().wider(np.array([0.0, 0.1, 0.2, 0.1, 0.0, 0.0, 0.0, 0.0]), irma4) == ()


def test_most_effects_have_no_wider_form(irma4: Robot) -> None:
    assert ConstantForce().wider(np.array([0.5, 0.0, 0.0]), irma4) == ()


@pytest.mark.parametrize("air", [AirDragLinear(), AirDragQuadratic()])
def test_drag_of_another_power_begins_as_strong_and_grows_otherwise(irma4: Robot, air: NamedEffect) -> None:
    ((effect, theta),) = air.wider(np.array([0.7]), irma4)
    assert effect.id == "unknown"
    along = np.array([0.6, -0.64, 0.48])  # a unit vector
    for speed in (0.5, 1.0, 2.0):
        drag = -0.7 * speed ** theta[1] * along
        np.testing.assert_allclose(resisted(irma4, effect, theta, speed * along), drag, rtol=1e-6)
    simple, values = effect.narrower(theta) or (effect, theta)
    assert simple == air
    np.testing.assert_allclose(resisted(irma4, simple, values, along), resisted(irma4, effect, theta, along), rtol=1e-6)
    assert air.wider(np.array([0.0]), irma4) == ()


def resisted(robot: Robot, effect: NamedEffect, theta: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """The force on a platform that moves at this velocity (m/s) and does not turn."""
    twist = ca.SX.sym("twist", 6)
    position = ca.SX([0.0, 0.0, -0.7])
    state = PlatformState(
        time=ca.SX(0),
        position=position,
        rotation=ca.SX.eye(3),
        twist=twist,
        cables=Mechanism(robot).cables_at(position, ca.SX.eye(3), ca.SX(0, 1)),
        com=ca.SX.zeros(3),
    )
    wrench = ca.Function("wrench", [twist], [effect.wrench(state, ca.SX(theta))])([*velocity, 0.0, 0.0, 0.0])
    return np.array(wrench).ravel()[:3]
