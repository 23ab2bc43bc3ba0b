"""Geometry is surveyed: errors of the robot file go into the ±, and a file that is exact stays exact."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fidim_lab.data.records import Body, Campaign, Robot, Role, Survey
from fidim_lab.data.robot_file import read_robot, write_robot
from fidim_lab.identification.equations.consistency import can_exist, nearest_existing
from fidim_lab.identification.equations.estimators import Method
from fidim_lab.identification.identify import identify
from fidim_lab.identification.mle.geometry_words import furthest
from fidim_lab.identification.results.result import Geometry, IdentificationResult, Moved, ResultOutcome
from fidim_lab.identification.survey import as_found, nuisances, prior_sd, typical
from fidim_lab.model.mechanism import Mechanism

NOISE = 1e-4


def moved(robot: Robot, *, anchors: float, attachments: float, seed: int) -> Robot:
    """The robot with its pulleys and attachments put elsewhere at random."""
    random = np.random.default_rng(seed)
    cables = tuple(
        replace(c, d=c.d + anchors * random.standard_normal(3), a=c.a + attachments * random.standard_normal(3))
        for c in robot.cables
    )
    return replace(robot, cables=cables)


def identified(campaign: Campaign) -> IdentificationResult:
    return identify(campaign, Method.MLE, native=True)


def errors(found: IdentificationResult, true_body: Body) -> np.ndarray:
    sd = np.array([parameter.sd for parameter in found.parameters.values()])
    return (found.body.vector - true_body.vector) / sd


@pytest.fixture(scope="module")
def campaign(recorded) -> Campaign:
    return recorded(noise=NOISE, cluster=True, seconds=3.0)


def test_an_exact_file_stays_exact(campaign: Campaign, true_body: Body) -> None:
    found = identified(campaign)
    assert found.geometry is not None
    assert found.geometry.moved == ()
    assert np.abs(errors(found, true_body)).max() < 4
    assert found.to_json()["geometry"] == {"chi2_gain": found.geometry.chi2_gain, "moved": []}


def test_errors_of_a_file_without_survey_are_found_and_counted(campaign: Campaign, true_body: Body) -> None:
    wrong = replace(campaign, robot=moved(campaign.robot, anchors=1e-3, attachments=5e-4, seed=3))
    believed = identified(replace(wrong, robot=replace(wrong.robot, survey=Survey.alike(4, 0.0, 0.0))))
    found = identified(wrong)
    assert found.geometry is not None
    assert {one.what for one in found.geometry.moved} == {"anchor", "attachment"}
    assert believed.outcome is ResultOutcome.MISFIT, (
        "the case must be one that a file believed as exact does not explain"
    )
    assert np.abs(errors(found, true_body)).max() < 4
    assert found.outcome is ResultOutcome.CONVERGED
    assert any("[survey]" in warning for warning in found.warnings)


def test_a_marker_that_is_elsewhere_is_found_and_the_cables_stay_exact(campaign: Campaign, true_body: Body) -> None:
    by = np.array([3e-3, -4e-3, 5e-3])
    windows = tuple(replace(w, markers=w.markers[:, :1]) for w in campaign.windows)
    robot = replace(campaign.robot, marker=campaign.robot.marker - by, extra_markers=())
    found = identified(replace(campaign, robot=robot, windows=windows))
    assert found.geometry is not None
    (marker,) = found.geometry.moved
    assert marker.what == "marker"
    np.testing.assert_allclose(marker.by, by, atol=4 * max(marker.sd))
    assert np.abs(errors(found, true_body)).max() < 4
    assert found.outcome.answers
    assert any("Clearly wrong: marker by" in warning for warning in found.warnings)
    # Held-out windows that go by another clock are not explained by it: then nothing is called wrong.
    told = identified(
        replace(
            campaign,
            robot=robot,
            windows=tuple(replace(w, t=1.1 * w.t) if w.role is Role.VALIDATE else w for w in windows),
        )
    )
    assert told.outcome is ResultOutcome.MISFIT
    assert any("marker by" in warning and "are not explained" in warning for warning in told.warnings)


@pytest.mark.parametrize("anchors", [0.0, 1e-3], ids=["nothing else", "a usual survey"])
def test_a_capture_that_is_not_level_is_found_and_named(anchors: float, campaign: Campaign, true_body: Body) -> None:
    """Anchors took up a part of it before: the body was wrong by 7 and 19 ±."""
    robot = moved(campaign.robot, anchors=anchors, attachments=0.5 * anchors, seed=3)
    level = Rotation.from_rotvec([3e-3, -2e-3, 0.0]).as_matrix() @ campaign.robot.gravity
    found = identified(replace(campaign, robot=replace(robot, gravity=level)))
    assert found.geometry is not None
    (gravity,) = (one for one in found.geometry.moved if one.what == "gravity")
    (frame,) = (one for one in found.geometry.moved if one.what == "frame")
    np.testing.assert_allclose(np.add(gravity.by, frame.by[:2]), [-3e-3, 2e-3], atol=1e-3)
    assert any(one.what == "anchor" for one in found.geometry.moved) is bool(anchors)
    assert np.abs(errors(found, true_body)).max() < 4
    assert found.outcome is ResultOutcome.CONVERGED
    assert any("gravity and capture frame" in warning for warning in found.warnings)


def test_a_capture_that_is_turned_is_told_in_its_units() -> None:
    frame = Moved("frame", None, (3.5e-3, 0.0, 1e-4, 2e-3, 0.0, -1e-3), (1e-4,) * 6)
    anchor = Moved("anchor", 2, (1e-3, 0.0, 0.0), (1e-5,) * 3)
    says = furthest(Geometry(1.0, (anchor, frame)), explained=True)
    assert says.startswith("Clearly wrong: capture frame by (+3.5, 0, +0.1) mrad and (+2, 0, -1) mm; anchor of cable 2")


def test_a_result_brings_each_of_several_markers_to_its_place(irma4: Robot) -> None:
    robot = replace(irma4, extra_markers=(irma4.marker + np.array([0.1, 0.0, 0.0]),))
    pieces = {("marker", None): (1e-3, 0.0, 0.0), ("marker 2", None): (0.0, 2e-3, 0.0), ("anchor", 3): (0.0, 0.0, 3e-3)}
    made = as_found(Mechanism(robot), pieces)
    assert [(type(effect).__name__, getattr(effect, "number", None)) for effect in made.effects] == [
        ("AnchorOffset", None), ("MarkerOffset", 1), ("MarkerOffset", 2),
    ]  # fmt: skip
    np.testing.assert_allclose(made.theta, [0.0, 0.0, 3e-3, 1e-3, 0.0, 0.0, 0.0, 2e-3, 0.0])


def test_a_stated_survey_is_the_prior(campaign: Campaign) -> None:
    survey = Survey.alike(4, 2e-3, 0.0)
    found = identified(replace(campaign, robot=replace(campaign.robot, survey=survey)))
    assert found.geometry is not None
    assert [(one.what, one.cable) for one in found.geometry.moved] == [("anchor", k) for k in (1, 2, 3, 4)]
    assert all(sd <= 2e-3 * 1.001 for one in found.geometry.moved for sd in one.sd)
    exact = identified(campaign)
    wider = [found.parameters[name].sd / exact.parameters[name].sd for name in found.parameters]
    assert min(wider) > 0.99
    assert max(wider) > 1.5


def test_what_each_key_leaves_open(irma4: Robot) -> None:
    survey = Survey(np.zeros((4, 3)), np.zeros((4, 3)), radius=1e-4, axis=1e-3, marker=1e-4, encoder_zero=1e-3)
    opened = nuisances(irma4, replace(survey, frame_shift=1e-3, gravity=1e-3))
    kinds = [one.what for one in opened]
    assert {kind: kinds.count(kind) for kind in kinds} == {
        "axis": 4, "encoder_zero": 4, "radius": 4, "marker": 1, "frame": 1, "gravity": 1,
    }  # fmt: skip
    assert len(prior_sd(opened)) == 4 * (2 + 1 + 1) + 3 + 6 + 2
    assert nuisances(irma4, Survey.alike(4, 0.0, 0.0)) == ()
    assert len(prior_sd(nuisances(irma4, typical(irma4)))) == 24


def test_a_robot_file_keeps_its_survey(irma4: Robot, tmp_path) -> None:
    survey = replace(Survey.alike(4, 1e-3, 5e-4), gravity=2e-3)
    survey.anchor[1] = (1e-3, 2e-3, 3e-3)
    write_robot(tmp_path / "robot.toml", replace(irma4, survey=survey))
    back = read_robot(tmp_path / "robot.toml").survey
    assert back is not None
    np.testing.assert_array_equal(back.anchor, survey.anchor)
    np.testing.assert_array_equal(back.attachment, survey.attachment)
    assert back.scalars == survey.scalars


def test_the_nearest_body_that_exists() -> None:
    inside = Body(np.array([0.0, 0.0, -0.2]), np.array([0.09, 0.09, 0.06, 0.0, 0.0, 0.0]))
    sd = np.array([1e-5, 1e-5, 0.04, 0.3, 0.02, 1e-5, 1e-4, 1e-4, 1e-4])
    assert nearest_existing(inside, np.diag(sd**2)) == (inside, 0.0)
    outside = replace(inside, inertia=np.array([0.02, 0.09, 0.06, 0.0, 0.0, 0.0]))
    found, away = nearest_existing(outside, np.diag(sd**2))
    assert not can_exist(outside)
    assert can_exist(found)
    assert away < 1.0, "I_xx alone is hardly known, and moves"
    np.testing.assert_allclose(found.inertia[2], outside.inertia[2], atol=3e-5)
    sure = nearest_existing(outside, np.diag((1e-6 * sd) ** 2))[1]
    assert sure > 100, "what is known well is not moved in silence"


def test_a_body_that_exists_is_found_from_any_estimate_and_no_farther_than_the_true_one() -> None:
    random = np.random.default_rng(0)
    moved = 0
    for _ in range(60):
        root = random.normal(size=(4, 4))
        points = root @ root.T
        points /= points[3, 3]
        inertia = np.trace(points[:3, :3]) * np.eye(3) - points[:3, :3]
        true = np.concatenate([points[:3, 3], inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]])
        spread = random.normal(size=(9, 9)) * 10 ** random.uniform(-4, 1, (9, 1))
        covariance = spread @ spread.T
        estimate = random.multivariate_normal(true, covariance)
        found, away = nearest_existing(Body.from_vector(estimate), covariance)
        assert can_exist(found)
        truly = float(np.sqrt((estimate - true) @ np.linalg.solve(covariance, estimate - true)))
        assert away < truly + 1.5, "the true one exists; the barrier keeps off the boundary"
        moved += away > 0
    assert moved > 20


def test_a_piece_is_not_called_off_where_the_fit_leaves_more_than_noise() -> None:
    """What is missing moves whatever is left open: its standard deviations know nothing of that."""
    told = Geometry(9.0, (Moved("anchor", 2, (4e-3, 1e-3, -2e-3), (1e-4, 1e-4, 1e-4)),))
    assert furthest(told, explained=True) == "Clearly wrong: anchor of cable 2 by (+4, +1, -2) mm."
    said = furthest(told, explained=False)
    assert "Clearly wrong" not in said
    assert "anchor of cable 2" in said
    assert "takes up a part of whatever is missing" in said
