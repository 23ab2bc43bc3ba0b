"""The MCAP file of a window: what is in it, with which times, and that a broken-off one tells why."""

import math
from itertools import pairwise

import numpy as np
import pytest

from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.files.mcap_file import read_mcap
from fidim_lab.data.window_mcap import read_window_mcap
from procedures.outcomes import Outcome


@pytest.fixture
def recorded(world, lab, tmp_path):
    assert world.run(lab.one, tmp_path / "run").outcome is Outcome.PASS
    return tmp_path / "run"


def test_the_same_rows_as_the_campaign_at_full_precision(recorded):
    campaign = read_campaign(recorded)
    (window,) = campaign.windows
    columns = read_window_mcap(recorded / "windows" / "i01.mcap", campaign.robot.n)
    assert np.array_equal(columns.t, window.t)
    for name, decimals in (("markers", 6), ("lengths", 6), ("currents", 4)):
        full, rounded = getattr(columns, name), getattr(window, name)
        assert np.allclose(full, rounded, rtol=0, atol=0.51 * 10.0**-decimals, equal_nan=True), name


def test_each_topic_with_its_times(recorded):
    log = read_mcap(recorded / "windows" / "i01.mcap")
    assert log.complete
    assert log.metadata["fidim-window"]["window"] == "i01"
    rows, poses = log.of("/window"), log.of("/marker/1")
    assert len(rows) == len(poses) == 1001
    for row, pose in zip(rows, poses, strict=True):
        assert row.value.device_time == pytest.approx(row.value.device_frame / 100.0)
        assert row.value.t == pytest.approx(row.value.device_time - rows[0].value.device_time, abs=1e-9)
        assert row.publish_time == pytest.approx(row.value.host_time, abs=1e-8)
        assert row.log_time >= row.publish_time - 1e-8
        place = pose.value.pose.position
        assert [place.x, place.y, place.z] == list(row.value.markers)
    for cable in range(1, 5):
        samples = [message.value for message in log.of(f"/winch/{cable}")]
        assert len(samples) >= 1000
        times = [sample.host_time for sample in samples]
        assert all(b > a for a, b in pairwise(times))
        assert {sample.state for sample in samples} == {"operation enabled"}
        assert samples[5].tension == pytest.approx(samples[5].current * log_factor(recorded, cable), rel=1e-9)


def log_factor(folder, cable):
    return read_campaign(folder).robot.winches[cable - 1].newton_per_ampere


def test_events_go_on_to_the_verdict(recorded):
    texts = [message.value.message for message in read_mcap(recorded / "windows" / "i01.mcap").of("/events")]
    assert any("record" in text and "pass" in text for text in texts)
    assert "check" in texts[-2]
    assert "accept" in texts[-1]


def test_a_window_broken_off_by_a_guard_says_so(world, lab, tmp_path):
    world.at("Record", lambda: setattr(world.winches[1], "tension", 400.0), after=1.0)
    report = world.run(lab.one, tmp_path / "run")
    assert report.outcome is Outcome.ERROR
    log = read_mcap(tmp_path / "run" / "rejected" / "i01-attempt1.mcap.part")
    assert not log.complete
    (trip,) = log.of("/guards")
    assert trip.value.guard == "tension"
    assert trip.value.reaction == "quick stop"
    last = log.of("/events")[-1].value
    assert last.level == 4
    assert trip.value.says in last.message


def test_a_lost_frame_is_a_row_without_a_source(world, lab, tmp_path):
    world.at("Record", lambda: setattr(world.markers, "silent_until", world.now() + 0.05), after=1.0)
    world.run(lab.one, tmp_path / "run")
    rows = [message.value for message in read_mcap(tmp_path / "run" / "windows" / "i01.mcap").of("/window")]
    lost = [row for row in rows if math.isnan(row.host_time)]
    assert 3 <= len(lost) <= 7
    assert all(row.device_frame == 0 and math.isnan(row.markers[0]) for row in lost)
