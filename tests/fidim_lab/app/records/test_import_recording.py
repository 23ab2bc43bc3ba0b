"""`fidim import`: a simulated lab recording end to end, and the real one where it is at hand."""

import json
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from fidim_lab.app.records.import_recording import import_command, run_import
from fidim_lab.app.records.import_report import summary
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Role
from fidim_lab.data.rigid_body import fit_pose
from fidim_lab.errors import FileError, RefusedError, SetupError
from fidim_lab.model.mechanism import Mechanism

LOG_END = 28.495
"""s; the simulated log stops before the motion capture does, and nothing is made up after it"""


@pytest.fixture(scope="module")
def imported(lab_recording, tmp_path_factory):
    return run_import("irma4u", [lab_recording.folder], tmp_path_factory.mktemp("import") / "out")


def test_the_campaign_holds_the_hidden_motion(imported, lab_recording):
    campaign = read_campaign(imported.folder)
    assert campaign.sample_rate == 100.0
    assert campaign.robot.markers == pytest.approx(lab_recording.body_markers, abs=5e-4)
    assert campaign.robot.sensors.marker_noise == pytest.approx(lab_recording.noise, rel=0.1)
    mechanism = Mechanism(campaign.robot)
    for window in campaign.windows:
        rows = np.rint(window.t / 0.01).astype(int)
        positions, rotations, _ = fit_pose(window.markers, campaign.robot.markers)
        assert positions == pytest.approx(lab_recording.positions[rows], abs=5e-3)
        assert window.lengths is not None
        logged = window.t < LOG_END
        assert np.isfinite(window.lengths).all(axis=1).tolist() == logged.tolist()
        assert mechanism.lengths(positions, rotations)[logged] == pytest.approx(window.lengths[logged], abs=2e-3)
        swivels = mechanism.swivel_angles(positions, rotations)
        for cable in range(4):
            assert np.ptp((window.further[f"s{cable + 1}"] - swivels[:, cable])[logged]) < 3e-3
            assert np.isfinite(window.further[f"f{cable + 1}"][logged]).all()


def test_all_windows_share_the_rest_position_before_the_first_push(imported, lab_recording):
    at_rest = lab_recording.positions[0] + lab_recording.body_markers[0]
    for window in read_campaign(imported.folder).windows:
        assert window.equilibrium == pytest.approx(at_rest, abs=5e-3)


def test_the_shortest_windows_are_held_out(imported):
    windows = read_campaign(imported.folder).windows
    held_out = [window.duration for window in windows if window.role is Role.VALIDATE]
    fitted = [window.duration for window in windows if window.role is Role.IDENTIFY]
    assert len(held_out) == 1
    assert len(fitted) == 3
    assert max(held_out) <= min(fitted)


def test_the_journal_says_what_was_found_and_why(imported, lab_recording):
    journal = json.loads((imported.folder / "import.json").read_text(encoding="utf-8"))
    assert journal["format"] == "fidim-import/1"
    clock = journal["clock"]["log_minus_markers"]
    assert abs(clock["offset"] - lab_recording.clock_offset) < max(4 * clock["sd"], 5e-4)
    assert journal["registration"]["tilt"] == pytest.approx(lab_recording.tilt, abs=3e-3)
    assert [entry["chosen"] for entry in journal["arrangements"]].count(True) == 1
    assert all("before it" in window["says"] for window in journal["windows"])


def test_the_summary_is_for_people(imported):
    console = Console(record=True, width=150, file=None, quiet=False)
    with console.capture() as capture:
        summary(imported, console)
    text = capture.get()
    for words in ("rigid to 0.0", "20 ", "chosen", "391204", "3 directions move, not 2", "a hand adds energy", "w4"):
        assert words in text


def test_the_command_prints_and_writes_json(lab_recording, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    json_file = tmp_path / "found.json"
    assert import_command("irma4u", [lab_recording.folder], tmp_path / "out", json_file) == 0
    assert json.loads(json_file.read_text(encoding="utf-8"))["kind"] == "irma4u"


def test_nothing_is_overwritten_and_nothing_half_is_left(lab_recording, tmp_path: Path):
    (tmp_path / "notes.md").write_text("mine")
    with pytest.raises(SetupError, match="exists already"):
        run_import("irma4u", [lab_recording.folder], tmp_path)
    with pytest.raises(FileError):
        run_import("irma4u", [tmp_path / "none"], tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_recording_that_ends_after_the_first_push_is_refused(lab_recording, tmp_path: Path):
    lines = (lab_recording.folder / "Motion07.txt").read_text(encoding="utf-8").splitlines()
    short = tmp_path / "Motion07.txt"
    short.write_text("\n".join(lines[: 5 + 520]), encoding="utf-8")
    with pytest.raises(RefusedError, match="too short to align two clocks"):
        run_import("irma4u", [lab_recording.folder, short], tmp_path / "out")


REAL_WINDOWS = ((9.58, 11.89), (16.88, 19.12), (23.56, 26.85), (35.39, 38.57), (48.61, 51.04))
"""spec/irma4u.md §2"""


@pytest.mark.shared
def test_the_real_recording_agrees_with_the_study(shared: Path, tmp_path: Path):
    report = run_import("irma4u", [shared / "recordings" / "irma4u"], tmp_path / "real")
    assert report.cluster.rms == pytest.approx(0.174e-3, abs=0.005e-3)
    assert report.chosen.rigid.rms == pytest.approx(0.633e-3, abs=0.02e-3)
    assert report.registration.rms < 0.516e-3  # the study's, without the clock offset
    assert 13e-6 < report.registration.compliance < 30e-6
    assert 1.6 < np.degrees(report.registration.tilt) < 2.1
    assert report.chosen.clock.correlation > 0.98
    assert report.chosen.load_cells.offset == pytest.approx(-0.03, abs=0.008)
    assert report.hand_free.balance.free_directions == 3
    assert len(report.hand_free.windows) == 5
    for window, (begin, end) in zip(report.hand_free.windows, REAL_WINDOWS, strict=True):
        assert window.begin == pytest.approx(begin, abs=0.5)
        assert window.end == pytest.approx(end, abs=0.3)
    assert [window.role for window in report.campaign.windows] == [
        Role.IDENTIFY,
        Role.VALIDATE,
        Role.IDENTIFY,
        Role.IDENTIFY,
        Role.VALIDATE,
    ]
