"""From exact recordings to equations: every variant must find the body that was put in."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fidim_lab.data.records import Body, Role, Window
from fidim_lab.errors import RefusedError, SetupError
from fidim_lab.identification.equations import tls
from fidim_lab.identification.equations.problem import WindowEquations, build, mass_matrices
from fidim_lab.identification.motion.measured import measure
from fidim_lab.identification.motion.recipe import BEST, PAPER, BalanceRows, Variant
from fidim_lab.identification.motion.surface import free_directions
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import free_twist_basis, marker_selector
from fidim_lab.model.regressor import free_regressor


def solved(problem):
    body = problem.campaign.robot.nominal
    for _ in range(2):
        W = [e.decimated(body).reshape(-1, 10) for e in problem.of_role(Role.IDENTIFY)]
        body = Body.from_vector(tls.solve(np.concatenate(W)).values)
    return body


def relative_errors(found: Body, truth: Body) -> np.ndarray:
    scale = np.concatenate([np.full(3, np.linalg.norm(truth.com)), np.full(6, truth.inertia[:3].max())])
    return np.abs(found.vector - truth.vector) / scale


def test_exact_motion_gives_exact_parameters(irma4, exact_motions, true_body):
    """Eq. 20 with the simulated poses, twists and accelerations themselves: nothing is filtered."""
    mechanism = Mechanism(irma4)
    W = []
    for _, motion in exact_motions:
        xi = mechanism.structure_matrix(motion.positions, motion.rotations)
        basis = free_twist_basis(xi, marker_selector(motion.rotations, irma4.marker, (0, 1)))
        W.append(free_regressor(motion, irma4.gravity, basis).reshape(-1, 10))
    found = tls.solve(np.concatenate(W))
    np.testing.assert_allclose(found.values, true_body.vector, atol=1e-10)


@pytest.mark.parametrize(
    ("recipe", "cluster", "within"),
    [
        (BEST, False, 2e-3),
        (BEST, True, 2e-3),
        (replace(BEST, variant=Variant.SURFACE), True, 2e-3),
        (replace(BEST, variant=Variant.FREE), False, 2e-3),
        (replace(BEST, rows=BalanceRows.FREE_COORDINATES), False, 5e-3),
    ],
)
def test_noise_free_recordings_give_the_body_back(recorded, true_body, recipe, cluster, within):
    problem = build(recorded(cluster=cluster), recipe)
    assert not problem.unused
    assert relative_errors(solved(problem), true_body).max() < within


def test_the_papers_form_is_biased_by_its_filter_even_without_noise(recorded, true_body):
    ours = relative_errors(solved(build(recorded(), BEST)), true_body).max()
    papers = relative_errors(solved(build(recorded(), PAPER)), true_body).max()
    assert papers < 0.2
    assert papers > 5 * ours


def test_variant_is_chosen_by_the_markers(recorded):
    assert {e.measured.variant for e in build(recorded(), BEST).equations} == {Variant.SURFACE}
    assert {e.measured.variant for e in build(recorded(cluster=True), BEST).equations} == {Variant.FULL}


@pytest.mark.parametrize("variant", list(Variant))
def test_measured_motion_is_the_motion(recorded, exact_motions, variant):
    campaign = recorded(cluster=True)
    found = measure(Mechanism(campaign.robot), campaign, campaign.windows[0], replace(BEST, variant=variant))
    truth = exact_motions[0][1]
    rows = found.samples
    np.testing.assert_allclose(found.motion.positions, truth.positions[rows], atol=1e-5)
    turn = np.swapaxes(found.motion.rotations, 1, 2) @ truth.rotations[rows]
    assert np.rad2deg(Rotation.from_matrix(turn).magnitude().max()) < 0.01
    np.testing.assert_allclose(found.motion.twists, truth.twists[rows], atol=5e-3)
    np.testing.assert_allclose(found.motion.accelerations, truth.accelerations[rows], atol=0.15)


def test_marker_rows_do_not_depend_on_the_basis(recorded, true_body):
    [equations, *_] = build(recorded(), replace(BEST, equations=None)).equations
    turn = np.array([[0.8, -0.7], [0.5, 1.4]])
    other = WindowEquations(
        equations.measured, equations.platform, equations.directions @ turn, equations.recipe, equations.noise
    )
    np.testing.assert_allclose(equations.rows(true_body), other.rows(true_body), atol=1e-9)


def test_full_pose_rows_with_many_markers_are_those_with_their_cholesky_factor(recorded, true_body):
    """Four markers give 12 accelerations of rank 6; six rows must weigh the same as all twelve."""
    [equations, *_] = build(recorded(cluster=True), replace(BEST, equations=None)).equations
    N, J = equations.directions, equations.measured.jacobian
    M = mass_matrices(true_body, equations.measured.motion.rotations)
    B = J @ np.linalg.solve(np.swapaxes(J, 1, 2) @ J, M @ N)
    rows = B @ np.linalg.solve(np.swapaxes(B, 1, 2) @ B, np.swapaxes(N, 1, 2)) @ equations.platform
    short = equations.rows(true_body)
    assert (rows.shape[1], short.shape[1]) == (12, 6)
    np.testing.assert_allclose(np.swapaxes(rows, 1, 2) @ rows, np.swapaxes(short, 1, 2) @ short, rtol=1e-6, atol=1e-6)


def test_free_directions_span_the_null_space(irma4, exact_motions):
    motion = exact_motions[0][1]
    xi = Mechanism(irma4).structure_matrix(motion.positions, motion.rotations)
    N = free_directions(xi)
    assert N.shape == (len(motion.t), 6, 2)
    np.testing.assert_allclose(xi @ N, 0.0, atol=1e-12)


@pytest.mark.parametrize("freedoms", [3, 1])
def test_any_number_of_cables(irma4, recorded, freedoms):
    """One cable fewer and one more (the fifth held at its own length): λ = 3 and 1 equations a sample."""
    campaign = recorded(cluster=True)
    cables = (
        irma4.cables[:3] if freedoms == 3 else (*irma4.cables, replace(irma4.cables[0], d=np.array([1.2, -1.3, 0.6])))
    )
    robot = replace(campaign.robot, cables=cables)
    mechanism = Mechanism(robot)
    window = campaign.windows[0]
    exact = measure(Mechanism(campaign.robot), campaign, window, BEST).motion
    lengths = mechanism.lengths(exact.positions[:1], exact.rotations[:1])
    other = replace(
        campaign, robot=robot, windows=(replace(window, lengths=np.repeat(lengths, len(window.t), axis=0)),)
    )
    [equations] = build(other, BEST).equations
    assert equations.freedoms == freedoms
    assert np.isfinite(equations.rows(robot.nominal)).all()


def test_gaps_cost_their_neighbourhood_and_are_told(recorded, true_body):
    campaign = recorded()
    markers = campaign.windows[0].markers.copy()
    markers[300:320] = np.nan
    holed = replace(campaign, windows=(replace(campaign.windows[0], markers=markers), *campaign.windows[1:]))
    problem = build(holed, BEST)
    equations = problem.equations[0]
    assert len(equations.times) == len(equations.rows(true_body))
    apart = np.abs(equations.times[:, None] - campaign.windows[0].t[300:320]).min()
    assert apart > 0.5  # half of both kernels: 0.2 s + 0.5 s or less for a shorter stretch
    assert any("20 samples (0.20 s)" in note for note in equations.measured.notes)
    assert relative_errors(solved(problem), true_body).max() < 3e-3


def test_a_hidden_marker_cuts_nothing_out_of_a_full_pose(recorded, true_body):
    campaign = recorded(cluster=True)
    markers = campaign.windows[0].markers.copy()
    markers[200:300, 2] = np.nan
    holed = replace(campaign, windows=(replace(campaign.windows[0], markers=markers), *campaign.windows[1:]))
    problem = build(holed, BEST)
    whole = build(campaign, BEST).equations[0]
    assert len(problem.equations[0].times) == len(whole.times)
    assert any("marker 3 is hidden" in note for note in problem.equations[0].measured.notes)
    assert relative_errors(solved(problem), true_body).max() < 2e-3


def test_what_a_window_lacks_is_said(recorded):
    campaign = recorded()
    blind = replace(campaign.windows[0], lengths=None)
    with pytest.raises(SetupError, match="w1 has no cable lengths"):
        measure(Mechanism(campaign.robot), campaign, blind, BEST)
    with pytest.raises(SetupError, match="three markers"):
        measure(Mechanism(campaign.robot), campaign, blind, replace(BEST, variant=Variant.FULL))


def test_one_bad_window_is_left_out_with_its_reason_and_all_bad_is_refused(recorded):
    campaign = recorded()
    blind = replace(campaign.windows[0], lengths=None)
    problem = build(replace(campaign, windows=(blind, *campaign.windows[1:])), BEST)
    assert [u.window.id for u in problem.unused] == ["w1"]
    assert "no cable lengths" in problem.unused[0].reason
    with pytest.raises(RefusedError, match="No window of role 'identify'"):
        build(replace(campaign, windows=(blind, campaign.windows[4])), BEST)


def test_bad_conditioning_is_masked_and_warned(recorded):
    campaign = recorded()
    strict = replace(BEST, variant=Variant.FREE, max_condition=7.0)
    [found, *_] = [measure(Mechanism(campaign.robot), campaign, w, strict) for w in campaign.windows[:1]]
    free = measure(Mechanism(campaign.robot), campaign, campaign.windows[0], replace(strict, max_condition=1e9))
    worst = free.conditioning.max()
    limit = float(np.quantile(free.conditioning, 0.7))
    found = measure(Mechanism(campaign.robot), campaign, campaign.windows[0], replace(strict, max_condition=limit))
    assert found.conditioning.max() <= limit < worst
    assert 0.6 < len(found.samples) / len(free.samples) < 0.8
    assert any("badly conditioned" in note and "30 % of the samples" in note for note in found.notes)
    with pytest.raises(RefusedError, match="badly conditioned"):
        measure(Mechanism(campaign.robot), campaign, campaign.windows[0], replace(strict, max_condition=1.0))


@pytest.mark.parametrize("gaps", [0, 6])
def test_a_window_without_a_whole_stretch_names_what_broke_it_up(recorded, gaps):
    """Samples left out because their pose is not known are no gap of the recording; both are told where both are."""
    campaign = recorded()
    first = campaign.windows[0]
    markers = first.markers.copy()
    for k in range(1, gaps + 1):
        markers[k * len(markers) // (gaps + 1) :][:12] = np.nan
    free = replace(BEST, variant=Variant.FREE, max_condition=1e9)
    half = float(np.median(measure(Mechanism(campaign.robot), campaign, first, free).conditioning))
    strict = BEST if gaps else replace(free, max_condition=half)
    broken = replace(campaign, windows=(replace(first, markers=markers), *campaign.windows[1:]))
    with pytest.raises(RefusedError, match="longest stretch has") as refused:
        build(replace(broken, windows=broken.windows[:1]), strict)
    said = str(refused.value)
    assert ("gaps of the recording" in said) is bool(gaps)
    assert ("hardly moves the markers" in said) is not bool(gaps)
    assert "three markers" in said


def test_the_papers_form_says_that_it_needs_four_cables(recorded):
    campaign = recorded()
    robot = replace(campaign.robot, cables=campaign.robot.cables[:3])
    windows = tuple(replace(w, lengths=w.lengths[:, :3]) for w in campaign.windows)
    with pytest.raises(RefusedError, match=r"takes 2 free coordinates \(x, y of the marker\); 3 cables leave 3"):
        build(replace(campaign, robot=robot, windows=windows), PAPER)


def test_wrong_geometry_shows_as_misfit(recorded):
    campaign = recorded()
    window: Window = campaign.windows[0]
    assert window.lengths is not None
    off = replace(window, lengths=window.lengths + np.array([0.01, 0.0, 0.0, 0.0]))
    good = measure(Mechanism(campaign.robot), campaign, window, BEST)
    bad = measure(Mechanism(campaign.robot), campaign, off, BEST)
    assert good.misfit < 1e-5
    assert bad.misfit > 1e-3
    assert any("not as the robot file says" in note for note in bad.notes)


def test_decimation_keeps_no_more_than_is_independent(recorded, true_body):
    [equations, *_] = build(recorded(), BEST).equations
    whole, thin = equations.rows(true_body), equations.decimated(true_body)
    assert len(thin) == round(2 * 10.0 * len(whole) / 100.0)
    np.testing.assert_array_equal(thin[[0, -1]], whole[[0, -1]])
    [papers, *_] = build(recorded(), PAPER).equations
    assert len(papers.decimated(true_body)) == 100
