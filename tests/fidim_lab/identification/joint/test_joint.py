"""One body and one geometry from several robots: honest ±, better than each alone, and what predicts what."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from fidim_lab.data.records import Body, Campaign, Pose, Robot, Survey
from fidim_lab.effects.dissipation.pulley_friction import SwivelFriction
from fidim_lab.errors import SetupError
from fidim_lab.identification.joint.cross import of_pose
from fidim_lab.identification.joint.fit import alone, fit_jointly, fit_some
from fidim_lab.identification.joint.found import JointFit
from fidim_lab.identification.joint.identify import JointResult, identify_jointly
from fidim_lab.identification.joint.sharing import in_common
from fidim_lab.identification.results.result import ResultOutcome
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import simulate_free_motion

from .conftest import Surveyed, only


def in_sd(found: JointResult, truth: Body) -> np.ndarray:
    each = zip(found.result.parameters.values(), truth.vector, strict=True)
    return np.array([(one.value - true) / one.sd for one, true in each])


@pytest.fixture(scope="module")
def joint(surveyed: Surveyed) -> JointResult:
    return identify_jointly(surveyed(0), native=True)


def test_the_joint_body_is_true_within_its_uncertainty(joint: JointResult, body: Body) -> None:
    assert joint.result.outcome is ResultOutcome.CONVERGED, joint.result.message
    assert np.abs(in_sd(joint, body)).max() < 4
    assert joint.result.noise_ratio == pytest.approx(1.0, abs=0.1)


def test_nothing_dissipates_where_nothing_was_simulated(joint: JointResult) -> None:
    assert joint.dissipation == {}


def test_friction_is_found_at_the_joint_that_has_it(surveyed: Surveyed, body: Body) -> None:
    campaigns = surveyed(0, effect=SwivelFriction(), theta=(0.02,))
    found = identify_jointly(campaigns, native=True, predict=False)
    assert set(found.dissipation) == {"swivel-friction c"}
    value, sd = found.dissipation["swivel-friction c"]
    assert abs(value - 0.02) < 4 * sd < 0.004
    assert np.abs(in_sd(found, body)).max() < 4
    assert found.result.outcome is ResultOutcome.CONVERGED, found.result.message
    assert "swivel-friction (c 0.02 N m)" in " ".join(found.result.warnings)


def test_every_campaign_is_predicted_by_fits_that_have_not_seen_it(joint: JointResult) -> None:
    pairs = {(one.fitted, one.predicted): one for one in joint.cross}
    assert set(pairs) == {
        *(((k,), other) for k in range(3) for other in range(3) if other != k),
        *((tuple(j for j in range(3) if j != k), k) for k in range(3)),
    }
    assert all(one.rms is not None and one.rms < 1e-3 for one in joint.cross)
    assert pairs[(0, 2), 1].rms == pytest.approx(1e-4, rel=0.3)  # the noise: cables 1 to 3 are known by the others
    four, more = pairs[(0,), 2].rms, pairs[(0, 1), 2].rms
    assert four is not None
    assert more is not None
    assert four > 2 * more  # four cables alone do not tell the swing on two


def test_the_geometry_of_a_cable_is_one_for_all_campaigns(joint: JointResult) -> None:
    assert joint.result.geometry is not None
    moved = [one.what for one in joint.result.geometry.moved]
    assert moved.count("anchor") == moved.count("attachment") == 4
    assert joint.shared[:2] == ("3 of 4 anchors", "3 of 4 attachments")


def test_together_is_better_than_each_alone(surveyed: Surveyed) -> None:
    common = in_common(surveyed(0))
    whole = fit_jointly(common, alone(common, native=True), native=True)
    sd = np.sqrt(np.diag(whole.tempered_covariance))[:9]
    for k in range(3):
        single = fit_some(common, whole, (k,), native=True)
        assert (sd < np.sqrt(np.diag(single.tempered_covariance))[:9]).all()


@pytest.mark.slow
def test_errors_are_as_large_as_stated(surveyed: Surveyed, body: Body) -> None:
    z = [in_sd(identify_jointly(surveyed(seed), native=True, predict=False), body) for seed in range(1, 21)]
    of_each = np.sqrt(np.mean(np.square(z), axis=0))
    assert 0.8 < np.sqrt(np.mean(np.square(z))) < 1.25
    assert (of_each > 0.6).all()
    assert (of_each < 1.5).all()


@pytest.mark.slow
def test_a_plain_least_squares_gives_the_same(surveyed: Surveyed) -> None:
    """Independent: scipy's solver with finite differences, on rotation vectors and the project's other integrator."""
    campaigns = surveyed(5, cables=(3, 2), windows=1, seconds=1.0)
    common = in_common(campaigns)
    ours = fit_jointly(common, alone(common, native=True), native=True)
    robots = [campaign.robot for campaign in common.campaigns]
    starts = [states_of(ours, k) for k in range(2)]

    def residual(x: np.ndarray) -> np.ndarray:
        body, offsets, rows = Body.from_vector(x[:9]), x[9:27].reshape(3, 2, 3), []
        for k, (robot, which) in enumerate(zip(robots, ((0, 1, 2), (0, 2)), strict=True)):
            moved = [
                replace(c, d=c.d + offsets[j, 0], a=c.a + offsets[j, 1])
                for c, j in zip(robot.cables, which, strict=True)
            ]
            own = x[27 + 12 * k : 39 + 12 * k]
            rows.append(of_window(replace(robot, cables=tuple(moved)), common.campaigns[k], body, own))
        weights = np.repeat([1e-3, 0.5e-3], 3)
        return np.concatenate([*rows, (x[9:27].reshape(3, 6) / weights).ravel()])

    x = np.concatenate([ours.values[:9], np.zeros(18), *starts])
    found = least_squares(residual, x, x_scale="jac", method="trf", max_nfev=12)
    cov = np.linalg.inv(np.asarray(found.jac).T @ np.asarray(found.jac) + 1e-12 * np.eye(len(x)))[:9, :9]
    sd = np.sqrt(np.diag(cov))
    assert (np.abs(found.x[:9] - ours.values[:9]) < 0.1 * sd).all()
    assert np.sqrt(np.diag(ours.tempered_covariance))[:9] == pytest.approx(sd, rel=0.15)


def states_of(ours: JointFit, k: int) -> np.ndarray:
    """Position, rotation vector and twist at the begin of the only window."""
    states = ours.optimum.states[k]
    turn = Rotation.from_matrix(states.rotations[0]).as_rotvec()
    return np.concatenate([states.positions[0], turn, states.twists[0]])


def of_window(robot: Robot, campaign: Campaign, body: Body, own: np.ndarray) -> np.ndarray:
    """Markers and lengths over their noise; a twist that would stretch the cables is held to none."""
    (window,) = campaign.windows
    assert window.lengths is not None
    mechanism, pose = Mechanism(robot), Pose(own[:3], Rotation.from_rotvec(own[3:6]).as_matrix())
    xi = mechanism.structure_matrix(pose.position[None], pose.rotation[None])[0]
    free = own[6:] - np.linalg.pinv(xi) @ (xi @ own[6:])
    motion = simulate_free_motion(mechanism, body, pose, free, window.t - window.t[0]).motion
    places = motion.positions[:, None] + np.einsum("nij,mj->nmi", motion.rotations, robot.markers)
    lengths = mechanism.lengths(pose.position[None], pose.rotation[None])[0] - np.mean(window.lengths, axis=0)
    return np.concatenate([
        ((places - window.markers) / robot.sensors.marker_noise).ravel(),
        lengths / robot.sensors.encoder_resolution,
        xi @ own[6:] / 1e-3,
    ])  # fmt: skip


def test_cables_of_one_name_at_two_places_are_refused(surveyed: Surveyed) -> None:
    one, other = surveyed(0, cables=(3, 2), windows=1)
    named = replace(one.robot, cables=tuple(replace(c, name=f"c{k}") for k, c in enumerate(one.robot.cables)))
    far = replace(other.robot.cables[0], name="c0", d=other.robot.cables[0].d + 0.03)
    moved = replace(other.robot, cables=(far, replace(other.robot.cables[1], name="c2")))
    with pytest.raises(SetupError, match=r"cable 'c0', d: .* differ by 30 mm; 7\.07 mm are allowed"):
        in_common([replace(one, robot=named), replace(other, robot=moved)])


def test_names_go_before_values(surveyed: Surveyed) -> None:
    one, other = surveyed(0, cables=(3, 2), windows=1)
    named = replace(one.robot, cables=tuple(replace(c, name=f"c{k}") for k, c in enumerate(one.robot.cables)))
    others = replace(other.robot, cables=tuple(replace(c, name=f"x{k}") for k, c in enumerate(other.robot.cables)))
    common = in_common([replace(one, robot=named), replace(other, robot=others)])
    assert common.anchors == ((0, 1, 2), (3, 4))
    unnamed = in_common([one, other])
    assert unnamed.anchors == ((0, 1, 2), (0, 2))


def test_two_surveys_of_one_place_are_brought_together(surveyed: Surveyed) -> None:
    one, other = surveyed(0, cables=(3, 2), windows=1)
    again = replace(other.robot.cables[0], d=other.robot.cables[0].d + 2e-3)
    common = in_common([one, replace(other, robot=replace(other.robot, cables=(again, other.robot.cables[1])))])
    a, b = (campaign.robot.cables[0].d for campaign in common.campaigns)
    assert common.anchors[1][0] == 0
    np.testing.assert_allclose(a, b)
    np.testing.assert_allclose(a, one.robot.cables[0].d + 1e-3)


def test_bodies_of_two_masses_are_refused(surveyed: Surveyed) -> None:
    one, other = surveyed(0, cables=(3, 2), windows=1)
    heavier = replace(other, robot=replace(other.robot, mass=1.1 * other.robot.mass))
    with pytest.raises(SetupError, match="one body has one mass"):
        in_common([one, heavier])


def test_exact_geometry_stays_exact(surveyed: Surveyed, base: Robot) -> None:
    campaigns = surveyed(0, cables=(3, 2), windows=2)
    exact = Survey.alike(4, 0.0, 0.0)
    true = replace(base, survey=exact)
    on_true = [replace(c, robot=only(true, w)) for c, w in zip(campaigns, ((0, 1, 2), (0, 2)), strict=True)]
    found = identify_jointly(on_true, native=True, predict=False)
    assert found.result.geometry is not None
    assert found.result.geometry.moved == ()
    assert found.result.outcome is ResultOutcome.CONVERGED


def test_the_pose_part_of_a_residual_knows_no_marker_that_is_off() -> None:
    random = np.random.default_rng(3)
    places = random.uniform(-0.2, 0.2, (50, 5, 3))
    turned, moved = 1e-4 * random.standard_normal((2, 50, 1, 3))
    rigid = moved + np.cross(turned, places)
    rms = float(np.sqrt(np.mean(rigid**2)))
    assert of_pose(rigid, places) == pytest.approx(rms, rel=1e-9)
    rigid[:, 2] = np.nan  # a marker that is not seen takes nothing away
    assert of_pose(rigid, places) == pytest.approx(float(np.sqrt(np.nanmean(rigid**2))), rel=1e-9)
    noise = 1e-3 * random.standard_normal((50, 5, 3))
    assert of_pose(noise, places) == pytest.approx(1e-3 * np.sqrt(6 / 15), rel=0.1)  # 6 of 15 numbers
    assert of_pose(noise[:, :2], places[:, :2]) is None
