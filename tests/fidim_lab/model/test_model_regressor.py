"""The regressor against Eq. 8–9 written out, which are not linear in the parameters by construction."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fidim_lab.data.records import Body, Motion
from fidim_lab.model.regressor import free_regressor, parameter_vector, platform_regressor

RNG = np.random.default_rng(6)
GRAVITY = np.array([0.1, -0.2, -9.8])


@pytest.fixture
def motion():
    return Motion(
        t=np.arange(8.0),
        positions=RNG.normal(size=(8, 3)),
        rotations=Rotation.random(8, rng=RNG).as_matrix(),
        twists=RNG.normal(size=(8, 6)),
        accelerations=RNG.normal(size=(8, 6)),
    )


def newton_euler(body, motion, k):
    """M v̇ + C v − φ about P, from momentum balance about the centre of mass."""
    R, w, alpha = motion.rotations[k], motion.twists[k, 3:], motion.accelerations[k, 3:]
    s = R @ body.com
    about_com = R @ body.inertia_about_com @ R.T
    force = motion.accelerations[k, :3] + np.cross(alpha, s) + np.cross(w, np.cross(w, s)) - GRAVITY
    torque = about_com @ alpha + np.cross(w, about_com @ w) + np.cross(s, force)
    return np.concatenate([force, torque])


def test_regressor_is_newton_and_euler(motion):
    body = Body(com=np.array([0.01, -0.02, 0.19]), inertia=np.array([0.06, 0.07, 0.05, 0.002, -0.003, 0.004]))
    found = platform_regressor(motion, GRAVITY) @ parameter_vector(body)
    np.testing.assert_allclose(found, [newton_euler(body, motion, k) for k in range(8)], atol=1e-13)


def test_free_regressor_projects(motion):
    basis = RNG.normal(size=(8, 6, 2))
    full = platform_regressor(motion, GRAVITY)
    assert full.shape == (8, 6, 10)
    np.testing.assert_allclose(free_regressor(motion, GRAVITY, basis)[3], basis[3].T @ full[3])
