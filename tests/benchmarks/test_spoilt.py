"""Spoilt recordings: some kinds of the benchmark, small; and how they are counted."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.spoilt.__main__ import drawn, page, run, spoilt
from benchmarks.spoilt.judge import Judged, Verdict
from benchmarks.spoilt.kinds import KINDS
from benchmarks.spoilt.spoiling import Kind
from benchmarks.spoilt.worlds import yawed
from fidim_lab.data.campaign import write_campaign
from fidim_lab.data.records import Campaign, Role, Window
from fidim_lab.identification.cleaning.free_motion import hands

NAMED = {kind.name: kind for kind in KINDS}


@pytest.mark.parametrize("name", ["milliseconds", "millimetres", "rows twice"])
def test_what_cannot_be_read_is_refused_with_its_cause(name: str):
    (one,) = run([0], 5, [NAMED[name]])
    assert one.verdict is Verdict.REFUSED, one.says


def test_names_that_can_be_put_right_give_the_body():
    (one,) = run([0], 5, [NAMED["markers in another order"]])
    assert one.verdict is Verdict.RIGHT, one.says


@pytest.mark.slow
def test_a_hand_is_cut_or_at_least_named():
    (one,) = run([0], 5, [NAMED["held at start"]])
    assert one.verdict in (Verdict.RIGHT, Verdict.REFUSED), one.says


@pytest.mark.parametrize("kind", KINDS, ids=[kind.name for kind in KINDS])
def test_every_kind_gives_a_campaign_that_can_be_written(kind: Kind, tmp_path):
    _, second, rng = drawn(0, 5, [kind])
    assert second is None
    campaign, known = spoilt(kind, second, rng, 5)
    write_campaign(tmp_path / "campaign", campaign)
    assert known.body.vector.shape == (9,)


def test_a_pure_yaw_keeps_its_energy_and_dies_out_with_drag():
    still = yawed(np.random.default_rng(1), drag=False, several=False).campaign.windows[0]
    slowed = yawed(np.random.default_rng(1), drag=True, several=False).campaign.windows[0]
    height = [window.markers[:, 0, 2] for window in (still, slowed)]
    first, last = slice(0, len(still.t) // 2), slice(len(still.t) // 2, None)
    assert np.ptp(height[0][first]) == pytest.approx(np.ptp(height[0][last]), rel=0.01)
    assert np.ptp(height[1][last]) < 0.99 * np.ptp(height[1][first])


def test_the_page_counts_each_verdict_once():
    one = Judged("spikes", "spikes", 0, Verdict.RIGHT, 1.0, "", 1.0)
    text = page([one, replace(one, kind="spikes + axes", verdict=Verdict.SILENT, worst=9.0)])
    assert "| spikes | 2 | 1 | 1 | 0 | 0 | 5.0 |" in text
    assert "| two kinds | 1 | 0 | 1 | 0 | 0 | 9.0 |" in text


@pytest.mark.slow
@pytest.mark.parametrize("number", [39, 72])
def test_another_body_is_found_by_one_marker_though_a_wide_geometry_nearly_explains_it(number: int):
    (one,) = run([number], 707, [NAMED["another body in one window"]])
    assert one.verdict is Verdict.RIGHT, one.says
    assert "its motion contradicts that of the other 3" in one.says


def test_another_body_is_in_one_window_only():
    campaign, known = spoilt(NAMED["another body in one window"], None, np.random.default_rng(3), 5)
    off = [
        float(np.abs(made.markers - true.markers).max())
        for made, true in zip(campaign.windows, known.campaign.windows, strict=True)
    ]
    assert sum(by > 10 * campaign.robot.sensors.marker_noise for by in off) == 1
    assert any(window.role is Role.VALIDATE for window in campaign.windows)


@pytest.mark.parametrize("held", [0.0, 1.2])
def test_where_a_slow_faint_swing_turns_round_it_is_not_held(held: float):
    """A period of 3.4 s: for half a second nothing is seen to move. Held before the release, it is cut until then."""
    robot = yawed(np.random.default_rng(3), drag=False, several=False).campaign.robot
    t = np.arange(1001) / 50.0
    late = np.maximum(t - held, 0.0)
    yaw = 0.3 * np.exp(-late / 6.0) * np.cos(1.85 * late)
    arm, plumb = abs(robot.cables[0].a[1]), robot.cables[0].d[2]
    places = np.zeros((len(t), 3))
    places[:, 2] = plumb - np.sqrt(plumb**2 - 4 * (arm * np.sin(yaw / 2)) ** 2)
    turns = Rotation.from_rotvec(yaw[:, np.newaxis] * [0.0, 0.0, 1.0]).as_matrix()
    markers = places[:, np.newaxis] + np.einsum("nij,mj->nmi", turns, robot.markers)
    markers += robot.sensors.marker_noise * np.random.default_rng(1).normal(size=markers.shape)
    window = Window("w1", Role.IDENTIFY, t, markers, np.full((len(t), 2), plumb), None)
    found = hands(Campaign("slow", robot, 50.0, (window,)))
    if not held:
        assert found == {}
    else:
        ((begin, end),) = found["w1"]
        assert begin == -np.inf
        assert held - 0.05 < end < held + 0.6
