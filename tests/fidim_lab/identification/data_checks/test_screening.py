"""Faults put into clean recordings are found with window, time and size; clean recordings give nothing."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Body, Campaign, Role, Window
from fidim_lab.identification.data_checks.robot_changes import robot_changes
from fidim_lab.identification.data_checks.robot_mistakes import find_mistakes
from fidim_lab.identification.data_checks.screening import screen
from fidim_lab.identification.markers.displaced import ScoreLimits
from fidim_lab.identification.markers.finding import DefectKind
from fidim_lab.identification.markers.samples import inspect
from fidim_lab.model.kinematics import equilibrium_at
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import simulate_free_motion

SHARED = Path(__file__).parents[5] / "shared" / "campaigns"
NOISE = 1e-4
PLACES = ((1.25, -0.15, -0.2), (1.1, 0.1, -0.35), (1.35, -0.35, -0.3), (1.4, 0.05, -0.25))
EXTRA = tuple(np.array(m) for m in ((0.15, 0.0, 0.1), (-0.08, 0.14, 0.12), (-0.06, -0.15, 0.05)))
BODY = Body(com=np.array([0.004, -0.003, 0.196]), inertia=np.array([0.058, 0.064, 0.033, 4e-4, -5e-4, 3e-4]))


@pytest.fixture(scope="module")
def exact(irma4):
    """Lengths and exact motions of four windows."""
    mechanism = Mechanism(irma4)
    t = np.arange(401) / 100
    found = []
    for k, place in enumerate(PLACES):
        rest = equilibrium_at(mechanism, BODY, np.array(place))
        xi = mechanism.structure_matrix(rest.pose.position[None], rest.pose.rotation[None])[0]
        free = np.linalg.svd(xi)[2][4:].T
        motion = simulate_free_motion(mechanism, BODY, rest.pose, free @ (1.2 * np.array([1, (-1) ** k])), t)
        assert motion.slack_time is None
        found.append((rest.lengths, motion.motion))
    return found


@pytest.fixture(scope="module")
def clean(irma4, exact):
    def make(seed: int = 0, markers: int = 1, noise: float = NOISE) -> Campaign:
        random = np.random.default_rng(seed)
        robot = replace(irma4, extra_markers=EXTRA[: markers - 1], sensors=replace(irma4.sensors, marker_noise=NOISE))
        windows = []
        for k, (lengths, motion) in enumerate(exact):
            places = motion.positions[:, None] + np.einsum("nij,mj->nmi", motion.rotations, robot.markers)
            places = places + noise * random.standard_normal(places.shape)
            held = np.tile(lengths, (len(motion.t), 1))
            windows.append(Window(f"w{k + 1}", Role.IDENTIFY, motion.t, places, held, None))
        return Campaign("made up", robot, 100.0, tuple(windows))

    return make


def changed(campaign: Campaign, **change) -> Campaign:
    """With the second window changed."""
    windows = list(campaign.windows)
    windows[1] = replace(windows[1], **change)
    return replace(campaign, windows=tuple(windows))


def marked(campaign: Campaign) -> np.ndarray:
    return campaign.windows[1].markers.copy()


def only_fault(campaign: Campaign):
    seen = screen(campaign)
    assert len(seen.faults) == 1, seen.says
    assert seen.faults[0].window == "w2"
    assert seen.faults
    assert not seen.contradicts_kinematics
    return seen, seen.faults[0]


@pytest.mark.parametrize("markers", [1, 4])
def test_a_clean_campaign_gives_no_finding(clean, markers):
    seen = screen(clean(markers=markers))
    assert seen.findings == ()
    assert seen.mistakes == ()
    assert not seen.contradicts_kinematics
    assert seen.noise_ratio == pytest.approx(1.0, abs=0.05)
    assert {one.name for one in seen.redundancy} >= {"markers-lengths"}


def test_false_alarms_on_simulated_nulls_are_below_one_per_cent(clean):
    """120 windows of nulls, tested with the limits of four windows each: 30 campaigns at 0.2 % expect 0.06 alarms."""
    alarms = 0
    for seed in range(30):
        campaign = clean(seed=100 + seed)
        limits = ScoreLimits.for_tests(sum(len(window.t) for window in campaign.windows))
        found = [inspect(w, 100.0, NOISE, np.full((1, 3), NOISE), limits).findings for w in campaign.windows]
        alarms += any(found)
    assert alarms == 0


@pytest.mark.parametrize("size", [9.0, 40.0, 400.0])
def test_a_spike_is_found_with_time_and_size(clean, size):
    campaign = clean()
    markers = marked(campaign)
    markers[150, 0, 1] += size * NOISE
    seen, fault = only_fault(changed(campaign, markers=markers))
    assert fault.kind is DefectKind.SPIKE
    assert fault.channel == "y"
    assert fault.t == (1.5, 1.5)
    assert fault.size == pytest.approx(size * NOISE, rel=0.1, abs=3 * NOISE)
    assert np.isnan(seen.campaign.windows[1].markers[150, 0]).all()
    assert seen.removed == {"w1": 0, "w2": 1, "w3": 0, "w4": 0}


def test_many_spikes_are_all_found(clean):
    campaign = clean(seed=3)
    markers, random = marked(campaign), np.random.default_rng(5)
    rows = np.arange(12, 390, 19) + random.integers(-4, 5, 20)
    markers[rows, 0] += 0.01 * np.array([1.0, -0.7, 0.4]) * random.choice([-1, 1], (20, 1))
    seen = screen(changed(campaign, markers=markers))
    gone = np.flatnonzero(np.isnan(seen.campaign.windows[1].markers[:, 0, 0]))
    assert set(rows) <= set(gone)
    assert len(gone) <= 22
    assert seen.faults
    assert not seen.contradicts_kinematics


def test_a_frozen_run_is_found(clean):
    campaign = clean(markers=4)
    markers = marked(campaign)
    markers[200:208, 2] = markers[200, 2]
    seen, fault = only_fault(changed(campaign, markers=markers))
    assert fault.kind is DefectKind.FROZEN
    assert fault.channel == "m3x"
    assert fault.t == (2.0, 2.07)
    assert fault.size == 8
    assert np.isnan(seen.campaign.windows[1].markers[201:208, 2]).all()
    assert np.isfinite(seen.campaign.windows[1].markers[:, [0, 1, 3]]).all()


def test_coarse_values_are_not_frozen(clean):
    campaign = clean()
    rounded = np.round(campaign.windows[1].markers, 4)
    assert not [f for f in screen(changed(campaign, markers=rounded)).findings if f.kind is DefectKind.FROZEN]


@pytest.mark.parametrize(("end", "until"), [(300, 2.99), (401, 4.0)])
def test_a_jump_is_found_with_its_interval(clean, end, until):
    campaign = clean()
    markers = marked(campaign)
    markers[250:end, 0] += [0.002, -0.001, 0.0]
    seen, fault = only_fault(changed(campaign, markers=markers))
    assert fault.kind is DefectKind.JUMP
    assert fault.t == (2.5, until)
    assert fault.size == pytest.approx(np.hypot(0.002, 0.001), rel=0.15)
    assert seen.removed["w2"] == end - 250


@pytest.mark.parametrize("marker", [0, 2])
@pytest.mark.parametrize("markers", [3, 4])
def test_a_jump_too_faint_for_its_neighbours_is_told_by_distances(clean, marker, markers):
    campaign = clean(markers=markers)
    places = marked(campaign)
    towards = places[0, marker] - np.delete(places[0], marker, axis=0).mean(axis=0)
    places[250:, marker] += 4 * NOISE * towards / np.linalg.norm(towards)
    seen, fault = only_fault(changed(campaign, markers=places))
    assert fault.kind is DefectKind.JUMP
    assert fault.channel[:-1] == ("" if marker == 0 else f"m{marker + 1}")
    assert fault.t == (pytest.approx(2.5, abs=0.1), 4.0)
    assert 2 * NOISE < fault.size < 6 * NOISE
    gone = np.isnan(seen.campaign.windows[1].markers).any(axis=2)
    assert gone[251:, marker].all()
    assert not gone[:220].any()
    assert not np.delete(gone, marker, axis=1).any()


@pytest.mark.parametrize("markers", [2, 3])
def test_a_faint_jump_that_changes_one_distance_alone_is_nobodys(clean, markers):
    campaign = clean(markers=markers)
    places = marked(campaign)
    towards = places[:, 0] - places[:, 1]
    if markers == 3:  # in the plane of the three, across the line to the third
        across = places[:, 0] - places[:, 2]
        towards -= across * ((towards * across).sum(axis=1) / (across**2).sum(axis=1))[:, np.newaxis]
    places[250:, 0] += 4 * NOISE * (towards / np.linalg.norm(towards, axis=1, keepdims=True))[250:]
    assert screen(changed(campaign, markers=places)).faults == ()


def test_distances_that_change_with_the_place_are_no_jump(clean):
    campaign = clean(markers=4)
    places = marked(campaign)
    places[:, 0] += 0.05 * (places[:, 0] - places[:, 0].mean(axis=0))
    assert screen(changed(campaign, markers=places)).faults == ()


@pytest.mark.parametrize("lost", [1, 5])
def test_lost_frames_behind_even_time_stamps_are_counted(clean, lost):
    campaign = clean()
    window = campaign.windows[1]
    speed = np.linalg.norm(window.markers[210:300, 0] - window.markers[200:290, 0], axis=1)
    at = 205 + int(np.argmax(speed))
    kept = np.delete(np.arange(401), slice(at, at + lost))
    short = replace(window, t=window.t[: len(kept)], markers=window.markers[kept], lengths=window.lengths[: len(kept)])
    windows = (campaign.windows[0], short, *campaign.windows[2:])
    _, fault = only_fault(replace(campaign, windows=windows))
    assert fault.kind in {DefectKind.SKIP, DefectKind.JUMP}  # in slow motion the two look alike; both are taken out
    assert at / 100 in (pytest.approx(fault.t[0], abs=0.015), pytest.approx(fault.t[1], abs=0.015))


def test_rows_that_are_openly_missing_are_a_gap_and_no_fault(clean):
    campaign = clean()
    kept = np.delete(np.arange(401), slice(250, 255))
    window = campaign.windows[1]
    cut = replace(window, t=window.t[kept], markers=window.markers[kept], lengths=window.lengths[kept])
    seen = screen(replace(campaign, windows=(campaign.windows[0], cut, *campaign.windows[2:])))
    assert [(f.kind, f.window, f.size) for f in seen.findings] == [(DefectKind.GAP, "w2", 5.0)]
    assert not seen.faults


def test_uneven_time_stamps_and_another_rate_are_said(clean):
    campaign = clean()
    t = campaign.windows[1].t.copy()
    t[100] += 0.002
    found = screen(changed(campaign, t=t)).findings
    assert (DefectKind.CLOCK, "w2") in {(f.kind, f.window) for f in found}
    found = screen(replace(campaign, sample_rate=102.0)).findings
    assert [f.window for f in found if f.kind is DefectKind.CLOCK] == ["w1", "w2", "w3", "w4"]


def test_an_encoder_that_slips_under_a_locked_motor_is_found(clean):
    campaign = clean()
    lengths = campaign.windows[1].lengths.copy()
    lengths[230:, 2] += 1e-3
    seen, fault = only_fault(changed(campaign, lengths=lengths))
    assert fault.channel == "l3"
    assert fault.t[0] == pytest.approx(2.3)
    assert fault.size == pytest.approx(1e-3)
    assert np.isnan(seen.campaign.windows[1].lengths[230:, 2]).all()


def test_noise_that_is_not_the_declared_is_measured(clean):
    seen = screen(clean(noise=3e-4))
    assert [f.kind for f in seen.findings] == [DefectKind.NOISE]
    assert seen.noise_ratio == pytest.approx(3.0, rel=0.05)
    assert not seen.faults


def test_a_moved_anchor_contradicts_the_kinematics(clean):
    campaign = clean()
    cables = list(campaign.robot.cables)
    cables[2] = replace(cables[2], d=cables[2].d + np.array([0.004, -0.003, 0.002]))
    seen = screen(replace(campaign, robot=replace(campaign.robot, cables=tuple(cables))))
    assert seen.contradicts_kinematics
    assert seen.mistakes == ()
    kinematic = next(one for one in seen.redundancy if one.name == "markers-lengths")
    assert kinematic.ratio > 10
    assert "kinematics disagree" in kinematic.says


@pytest.mark.slow
def test_swapped_cables_are_said_to_be_that(clean):
    campaign = clean()
    order = (0, 2, 1, 3)
    wrong = replace(campaign.robot, cables=tuple(campaign.robot.cables[k] for k in order))
    seen = screen(replace(campaign, robot=wrong))
    assert seen.mistakes[0].order == (1, 3, 2, 4)
    assert seen.mistakes[0].says.startswith("Cables 2 and 3 are swapped")
    assert seen.mistakes[0].after < 1e-3 < seen.mistakes[0].before


def _anchors(robot, turn):
    return replace(
        robot,
        cables=tuple(
            replace(c, d=turn @ c.d, x=turn @ c.x, y=np.cross(turn @ c.z, turn @ c.x), z=turn @ c.z)
            for c in robot.cables
        ),
    )


def _in_feet(robot):
    foot = 0.3048
    cables = tuple(replace(c, d=c.d / foot, a=c.a / foot, radius=c.radius / foot) for c in robot.cables)
    return replace(robot, cables=cables)


def _with_attachments(robot, order):
    return replace(
        robot, cables=tuple(replace(c, a=robot.cables[k].a) for c, k in zip(robot.cables, order, strict=True))
    )


def _with_radii(robot, factor):
    return replace(robot, cables=tuple(replace(c, radius=factor * c.radius) for c in robot.cables))


@pytest.mark.parametrize("lean", [-1.2, 0.0, -0.8])
@pytest.mark.sampled(1)
def test_a_platform_that_leans_by_its_markers_contradicts_nothing(irma4, lean):
    """Two cables on one side of the body let it hang turned by a radian and more."""
    robot = replace(irma4, cables=irma4.cables[:2], extra_markers=EXTRA)
    random, windows = np.random.default_rng(4), []
    turned = Rotation.from_rotvec([lean, 0.05, 0.2])
    for place in PLACES:
        spots = np.array(place) + turned.apply(robot.markers)
        held = Mechanism(robot).lengths(np.array(place)[None], turned.as_matrix()[None])
        markers = spots + NOISE * random.standard_normal((401, 4, 3))
        windows.append(Window("w", Role.IDENTIFY, np.arange(401) / 100, markers, np.tile(held, (401, 1)), None))
    assert find_mistakes(robot, tuple(windows)) == ()
    swapped = replace(robot, cables=robot.cables[::-1])
    assert find_mistakes(swapped, tuple(windows))
    for window in windows:
        window.markers[:, 0] = np.nan  # as is where one marker is covered
    assert find_mistakes(robot, tuple(windows)) == ()
    assert find_mistakes(swapped, tuple(windows))


@pytest.mark.parametrize("by", [(0.0, 0.08, 0.0), (0.06, 0.0, 0.05)])
def test_one_marker_on_three_cables_that_is_elsewhere_is_looked_for(irma4, by):
    """Neither a frame nor a marker is determined by so little: both are named."""
    robot = replace(irma4, cables=irma4.cables[:3], extra_markers=())
    random, windows = np.random.default_rng(4), []
    for k, place in enumerate(PLACES):
        turned = Rotation.from_rotvec([0.05 * k, -0.04, 0.02 * k]).as_matrix()
        held = Mechanism(robot).lengths(np.array(place)[None], turned[None])
        markers = np.array(place) + turned @ robot.marker + NOISE * random.standard_normal((401, 1, 3))
        windows.append(Window("w", Role.IDENTIFY, np.arange(401) / 100, markers, np.tile(held, (401, 1)), None))
    elsewhere = replace(robot, marker=robot.marker + np.array(by))
    found = find_mistakes(elsewhere, tuple(windows))
    assert "not where the robot file has it on the body" in found[0].says


def test_a_recording_whose_z_axis_is_another_is_named(clean):
    campaign = clean()
    y_up = tuple(replace(w, markers=w.markers[:, :, [0, 2, 1]] * [1.0, 1.0, -1.0]) for w in campaign.windows)
    found = find_mistakes(campaign.robot, y_up)
    assert found[0].says.startswith("The motion capture's axes are others: the robot's x, y, z are its x, −z, y")
    assert found[0].after < 1e-3


def test_what_no_simple_change_cures_is_said_not_guessed(clean):
    """Two mistakes at once: the nearest single one is named as no more than that."""
    campaign = clean()
    wrong = _with_radii(_with_attachments(_in_feet(campaign.robot), (1, 2, 0, 3)), 4.0)
    (found,) = find_mistakes(wrong, campaign.windows)
    assert "none removes this" in found.says
    assert found.after > 0.05


@pytest.mark.parametrize("cables", [4, 8])
def test_orders_that_are_tried_stay_few_and_hold_every_exchange(irma4, cables):
    robot = replace(irma4, cables=(irma4.cables * 2)[:cables])
    orders = [change.order for change in robot_changes(robot) if change.order is not None]
    assert len(orders) < 100
    assert len(set(orders)) == len(orders)
    assert (1, 0, *range(2, cables)) in orders
    assert (*range(1, cables), 0) in orders


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (_in_feet, "in feet for metres"),
        (lambda r: replace(r, cables=tuple(replace(c, a=c.a * 1000) for c in r.cables)), "millimetres for metres"),
        (lambda r: _anchors(r, np.diag([1.0, -1.0, 1.0])), "mirrored in y"),
        (lambda r: _anchors(r, np.diag([-1.0, -1.0, 1.0])), "turned by 180° about z"),
        (lambda r: _with_attachments(r, (1, 0, 2, 3)), "The attachments are in another order (2, 1, 3, 4)"),
        (lambda r: _with_attachments(r, (1, 2, 3, 0)), "The attachments are in another order (4, 1, 2, 3)"),
        (lambda r: _with_radii(r, 1 / 0.3048), "The pulley radii are in feet for metres"),
    ],
)  # fmt: skip
@pytest.mark.sampled(1)
def test_a_gross_mistake_in_the_robot_file_is_named(clean, wrong, said):
    campaign = clean()
    found = find_mistakes(wrong(campaign.robot), campaign.windows)
    assert any(said in mistake.says for mistake in found), found
    assert found[0].after < 1e-3


@pytest.mark.shared
@pytest.mark.skipif(not SHARED.is_dir(), reason="needs ../shared/campaigns")
def test_lost_frames_in_quick_motion_are_counted():
    campaign = read_campaign(SHARED / "open-two-at-once")
    window = campaign.windows[2]
    kept = np.delete(np.arange(1001), slice(500, 505))
    short = replace(window, t=window.t[:996], markers=window.markers[kept], lengths=None, currents=None)
    limits, sigma = ScoreLimits.for_tests(72000), np.full((4, 3), NOISE)
    found = inspect(short, 100.0, NOISE, sigma, limits).findings
    assert [(f.kind, f.size, f.t) for f in found] == [(DefectKind.SKIP, 5.0, (4.99, 5.0))]


@pytest.mark.shared
@pytest.mark.skipif(not SHARED.is_dir(), reason="needs ../shared/campaigns")
def test_the_shared_campaigns_have_no_fault_and_geometry_is_told_from_forces():
    kinematic = {"open-anchor-moved", "open-elastic-cables", "open-two-at-once"}
    for folder in sorted(SHARED.glob("open-*")):
        seen = screen(read_campaign(folder))
        assert seen.findings == (), folder.name
        assert seen.mistakes == (), folder.name
        assert seen.contradicts_kinematics == (folder.name in kinematic), folder.name
        assert not [one for one in seen.redundancy if one.name == "currents-statics" and one.contradicts]
