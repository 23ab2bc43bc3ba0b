"""The prior that keeps short recordings' searches among bodies that can exist."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.linalg import eigh
from scipy.spatial.transform import Rotation

from fidim_lab.data.records import Body
from fidim_lab.identification.equations.consistency import can_exist, pseudo_inertia
from fidim_lab.identification.mle.trajectories.normal import FACTOR, NearBody

PLATE = Body(com=np.array([0.0, 0.01, -0.1]), inertia=np.array([0.05, 0.06, 0.07, 0.0, 0.0, 0.0]))


def body_of(moments: np.ndarray, turn: np.ndarray, com: np.ndarray) -> Body:
    """Second moments (m²) along turned axes about G."""
    R = Rotation.from_rotvec(turn).as_matrix()
    spread = R @ np.diag(moments) @ R.T + np.outer(com, com)
    inertia = np.trace(spread) * np.eye(3) - spread
    return Body(com=com, inertia=inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])


some = st.floats(-0.2, 0.2)
bodies = st.builds(
    body_of,
    arrays(float, 3, elements=st.floats(1e-3, 0.2)),
    arrays(float, 3, elements=st.floats(-3, 3)),
    arrays(float, 3, elements=some),
)


def squared(near: Body, body: Body) -> float:
    return float((NearBody(near).residual(body.vector) ** 2).sum())


@settings(max_examples=40, deadline=None)
@given(bodies, bodies)
def test_the_distance_is_that_of_the_logarithms_of_generalized_eigenvalues(near, body):
    ratios = eigh(pseudo_inertia(body), pseudo_inertia(near), eigvals_only=True)
    expected = (np.log(ratios) ** 2).sum() / np.log(FACTOR) ** 2
    assert squared(near, body) == pytest.approx(expected, rel=1e-6, abs=1e-9)
    assert squared(near, body) == pytest.approx(squared(body, near), rel=1e-6, abs=1e-9)


@settings(max_examples=40, deadline=None)
@given(bodies, bodies, arrays(float, 3, elements=some), arrays(float, 3, elements=some))
def test_it_is_the_same_in_every_frame(near, body, shift, turn):
    A = np.eye(4)
    A[:3, :3], A[:3, 3] = Rotation.from_rotvec(turn).as_matrix(), shift

    def moved(one: Body) -> Body:
        J = A @ pseudo_inertia(one) @ A.T
        inertia = np.trace(J[:3, :3]) * np.eye(3) - J[:3, :3]
        return Body(com=J[:3, 3], inertia=inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])

    assert squared(moved(near), moved(body)) == pytest.approx(squared(near, body), rel=1e-5, abs=1e-7)


@settings(max_examples=40, deadline=None)
@given(bodies, bodies)
def test_its_derivatives_are_those_of_differences(near, body):
    rows, step = NearBody(near).rows(body.vector), 1e-7
    np.testing.assert_array_equal(rows[:, -1], NearBody(near).residual(body.vector))
    for k, unit in enumerate(np.eye(9)):
        there, back = (NearBody(near).residual(body.vector + sign * step * unit) for sign in (1, -1))
        size = 1e-4 * (1 + np.abs(rows[:, k]).max())
        np.testing.assert_allclose((there - back) / (2 * step), rows[:, k], atol=size)


def test_twice_a_second_moment_costs_its_logarithm():
    double = body_of(np.array([2.0, 1.0, 1.0]) * 0.02, np.zeros(3), np.zeros(3))
    single = body_of(np.array([1.0, 1.0, 1.0]) * 0.02, np.zeros(3), np.zeros(3))
    assert squared(single, double) == pytest.approx((np.log(2) / np.log(FACTOR)) ** 2)
    assert squared(PLATE, PLATE) == pytest.approx(0.0, abs=1e-20)


def test_a_body_that_cannot_exist_is_infinitely_far():
    impossible = Body(np.zeros(3), np.array([0.01, 0.01, 0.021, 0, 0, 0]))
    assert not can_exist(impossible)
    assert squared(PLATE, impossible) == np.inf
