"""Other forms of an effect, as free: they begin where they do the same at the usual length."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from fidim_lab.data.records import Robot
from fidim_lab.effects.cables.cable_elasticity import DampedElasticity, DampedFrame, DampedStiffness, DampedWinch
from fidim_lab.effects.dissipation.drag import AirDragLinear
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.effects.plausibility import Context
from fidim_lab.model.mechanism import Mechanism


def compliance(robot: Robot, effect: NamedEffect, theta: np.ndarray, place: np.ndarray) -> tuple[float, ...]:
    """Of cable 2 (m/N), its free length (m), and how level it is."""
    cable = Mechanism(robot).cables_at(ca.SX(place), ca.SX.eye(3), ca.SX(0, 1))[1]
    level = ca.sumsqr(cable.direction[:2])
    found = ca.Function("found", [], [effect.compliance(2, cable, ca.SX(theta)), cable.free_length, level])()
    return tuple(float(found[name]) for name in ("o0", "o1", "o2"))


FORMS = [
    (DampedElasticity(), {DampedStiffness(), DampedFrame()}),
    (DampedStiffness(), {DampedElasticity(), DampedFrame()}),
    (DampedFrame(), {DampedElasticity(), DampedStiffness()}),
    (DampedElasticity(2), {DampedStiffness(2), DampedWinch(2)}),
    (DampedStiffness(2), {DampedElasticity(2), DampedWinch(2)}),
    (DampedWinch(2), {DampedElasticity(2), DampedStiffness(2)}),
]


@pytest.mark.parametrize(("form", "others"), FORMS)
def test_other_springs_yield_alike_at_the_usual_length(
    irma4: Robot, form: NamedEffect, others: set[NamedEffect]
) -> None:
    theta = np.array([3e-6, 55.0])
    place = np.mean([cable.d for cable in irma4.cables], axis=0) + np.array([0.1, 0.0, -0.8])
    yields, length, level = compliance(irma4, form, theta, place)
    context = replace(Context.of(irma4), free_length=length, level=level)
    found = dict(form.other_forms(theta, context))
    assert set(found) == others
    for other, begin in found.items():
        assert begin[1] == theta[1]
        assert compliance(irma4, other, begin, place)[0] == pytest.approx(yields, rel=1e-9)
        np.testing.assert_allclose(dict(other.other_forms(begin, context))[form], theta)


def test_most_effects_have_one_form(irma4: Robot) -> None:
    assert AirDragLinear().other_forms(np.array([0.5]), Context.of(irma4)) == ()
