import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.motion import rigid

CLUSTER = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.0, 0.15, 0.05], [-0.1, -0.1, 0.1]])


def poses(count=50, seed=1):
    random = np.random.default_rng(seed)
    p = random.uniform(-1, 1, (count, 3))
    R = Rotation.from_rotvec(random.uniform(-1, 1, (count, 3))).as_matrix()
    return p, R, p[:, None] + np.einsum("nij,mj->nmi", R, CLUSTER)


def test_registration_finds_the_pose_whatever_markers_are_seen():
    p, R, markers = poses()
    markers[10:20, 1] = np.nan
    found_p, found_R, misfit = rigid.register(markers, CLUSTER, rigid.visibility(markers, 3))
    np.testing.assert_allclose(found_p, p, atol=1e-12)
    np.testing.assert_allclose(found_R, R, atol=1e-12)
    assert misfit.max() < 1e-7


def test_two_markers_or_three_in_line_give_no_rotation():
    _, _, markers = poses()
    markers[5, 2:] = np.nan
    found_p, _, _ = rigid.register(markers, CLUSTER, rigid.visibility(markers, 1))
    assert np.isnan(found_p[5]).all()
    assert np.isfinite(found_p[20]).all()
    line = np.outer([0.0, 1.0, 2.0], [0.1, 0.0, 0.0])
    assert rigid.spread(line) == pytest.approx(0.0, abs=1e-12)
    assert rigid.spread(CLUSTER) > rigid.MIN_SPREAD


def test_a_marker_fades_out_before_its_gap_so_that_the_pose_does_not_jump():
    _, _, markers = poses(60)
    markers[30:33, 0] = np.nan
    weights = rigid.visibility(markers, 5)[:, 0]
    np.testing.assert_allclose(weights[24:31], [1, 1, 0.8, 0.6, 0.4, 0.2, 0])
    np.testing.assert_allclose(weights[32:38], [0, 0.2, 0.4, 0.6, 0.8, 1])


@pytest.mark.parametrize("size", [1e-4, 0.03, 0.06, 0.9, 2.0])
def test_angular_velocity_and_acceleration_are_those_of_the_rotation(size):
    """Against differences of the rotation matrices themselves: [ω]× = Ṙ Rᵀ."""
    base, rate, acc = (np.array(v) for v in ([0.6, -0.64, 0.48], [0.7, 1.1, -0.4], [-2.0, 0.5, 1.5]))
    reference = Rotation.from_rotvec([0.3, -0.2, 0.9]).as_matrix()

    def omega_at(t):
        phi = size * base + rate * t + acc * t**2 / 2
        R, omega, alpha = rigid.from_rotation_vectors(phi[None], (rate + acc * t)[None], acc[None], reference)
        return R[0], omega[0], alpha[0]

    h = 1e-5
    R, omega, alpha = omega_at(0.0)
    cross = (omega_at(h)[0] - omega_at(-h)[0]) / (2 * h) @ R.T
    np.testing.assert_allclose(omega, [cross[2, 1], cross[0, 2], cross[1, 0]], atol=1e-8)
    np.testing.assert_allclose(alpha, (omega_at(h)[1] - omega_at(-h)[1]) / (2 * h), atol=1e-8)


def test_rotation_vectors_come_back_and_swapped_markers_are_refused():
    _, R, _ = poses()
    reference = rigid.mean_rotation(R)
    phi = rigid.rotation_vectors(R, reference)
    back, _, _ = rigid.from_rotation_vectors(phi, phi, phi, reference)
    np.testing.assert_allclose(back, R, atol=1e-12)
    with pytest.raises(InfeasibleError, match="marker labels"):
        rigid.rotation_vectors(np.diag([-1.0, -1.0, 1.0])[None] @ R[:1], R[0])
