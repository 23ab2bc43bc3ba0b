import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fidim_lab.data.campaign import IndexEntry, read_campaign, write_campaign, write_index
from fidim_lab.data.plan_file import read_plan, write_plan
from fidim_lab.data.records import Alignment, Campaign, Plan, PlannedWindow, Robot, Role, Window
from fidim_lab.data.rigs.alignment_file import write_alignment
from fidim_lab.data.window_csv import read_window_csv
from fidim_lab.data.window_mcap import window_as_mcap
from fidim_lab.errors import FileError


@pytest.fixture
def campaign(irma4: Robot) -> Campaign:
    t = np.arange(50) * 0.01
    markers = np.round(np.random.default_rng(1).normal(size=(50, 1, 3)), 6)
    lengths = np.full((50, 4), 1.25)
    windows = [
        Window(f"w{k}", role, t, markers + k, lengths, None, np.array([1.0, 0.5, -0.25]))
        for k, role in enumerate([Role.IDENTIFY, Role.VALIDATE])
    ]
    return Campaign("two windows", irma4, 100.0, tuple(windows))


def test_round_trip(campaign: Campaign, tmp_path: Path) -> None:
    write_campaign(tmp_path, campaign)
    back = read_campaign(tmp_path)
    assert (back.name, back.sample_rate) == ("two windows", 100.0)
    assert [w.id for w in back.of_role(Role.VALIDATE)] == ["w1"]
    for ours, theirs in zip(back.windows, campaign.windows, strict=True):
        np.testing.assert_allclose(ours.markers, theirs.markers, atol=1e-9)
        np.testing.assert_array_equal(ours.lengths, theirs.lengths)  # type: ignore[arg-type]
        np.testing.assert_array_equal(ours.equilibrium, theirs.equilibrium)  # type: ignore[arg-type]


LATE = Alignment(0.004, 2e-4, 0.99, "2026-01-01T00:00:00Z", "vicon-udp", 100.0, 250.0)


def test_lengths_are_those_of_the_instants_at_which_late_markers_were_seen(campaign: Campaign, tmp_path: Path) -> None:
    first, *others = campaign.windows
    lengths = 1.25 + 0.1 * first.t[:, None] * np.arange(1, 5)
    currents = np.tile(lengths[:, :1], 4)
    currents[20] = np.nan
    moving = replace(first, lengths=lengths, currents=currents)
    write_campaign(tmp_path, replace(campaign, windows=(moving, *others)))
    write_alignment(tmp_path / "alignment.toml", LATE)
    back = read_campaign(tmp_path)
    assert back.alignment == LATE
    found = back.windows[0]
    np.testing.assert_allclose(found.markers, first.markers, atol=1e-9)
    before = 1.25 + 0.1 * (first.t[1:, None] - 0.004) * np.arange(1, 5)
    assert found.lengths is not None
    np.testing.assert_allclose(found.lengths[1:], before, atol=2e-6)
    np.testing.assert_allclose(found.lengths[0], lengths[0], atol=2e-6)  # nothing was recorded before it
    assert found.currents is not None
    assert np.flatnonzero(np.isnan(found.currents[:, 0])).tolist() == [20, 21]
    np.testing.assert_allclose(back.windows[1].lengths, others[0].lengths, atol=1e-9)  # type: ignore[arg-type]
    write_campaign(tmp_path, back)
    again = read_campaign(tmp_path)  # not twice
    assert again.alignment is None
    np.testing.assert_allclose(again.windows[0].lengths, found.lengths, atol=2e-6)


def test_an_alignment_that_is_none_is_an_error_with_its_place(campaign: Campaign, tmp_path: Path) -> None:
    write_campaign(tmp_path, campaign)
    (tmp_path / "alignment.toml").write_text('format = "fidim-alignment/1"\nlag = 3.0\n', encoding="utf-8")
    with pytest.raises(FileError, match=r"alignment\.toml: lag"):
        read_campaign(tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("sample_rate = 100.0", "", "sample_rate: is missing"),
        ('role = "validate"', 'role = "rehearse"', "window 2, role"),
        ('id = "w1"', 'id = "w0"', "window 2, id: 'w0' occurs twice"),
        ('file = "windows/w1.csv"', 'file = "windows/w9.csv"', "w9.csv: no such file"),
        (
            'file = "windows/w1.csv"',
            'file = "windows/w1.txt"',
            "window w1, file: 'windows/w1.txt' is not a .csv or .mcap",
        ),
        ('robot = "robot.toml"', 'robot = "none.toml"', "none.toml: no such file"),
    ],
)
def test_mistakes_in_the_index(campaign: Campaign, tmp_path: Path, old: str, new: str, expected: str) -> None:
    write_campaign(tmp_path, campaign)
    index = tmp_path / "campaign.toml"
    assert old in index.read_text()
    index.write_text(index.read_text().replace(old, new))
    with pytest.raises(FileError, match=re.escape(expected)):
        read_campaign(tmp_path)


def test_a_missing_folder_and_an_empty_campaign(campaign: Campaign, tmp_path: Path) -> None:
    with pytest.raises(FileError, match="no such folder"):
        read_campaign(tmp_path / "none")
    write_campaign(tmp_path, replace(campaign, windows=()))
    with pytest.raises(FileError, match="lists no windows"):
        read_campaign(tmp_path)


def test_more_markers_than_the_robot_has(campaign: Campaign, tmp_path: Path) -> None:
    window = campaign.windows[0]
    window = replace(window, markers=np.concatenate([window.markers, window.markers], axis=1))
    write_campaign(tmp_path, replace(campaign, windows=(window,)))
    with pytest.raises(FileError, match="2 markers, the robot file has 1"):
        read_campaign(tmp_path)


def test_the_index_is_replaced_whole(tmp_path: Path) -> None:
    write_index(tmp_path, "a", 100.0, [])
    write_index(tmp_path, "b", 100.0, [IndexEntry("w1", Role.IDENTIFY, None)])
    assert 'name = "b"' in (tmp_path / "campaign.toml").read_text()
    assert [p.name for p in tmp_path.iterdir()] == ["campaign.toml"]


def test_plan_round_trip_and_mistakes(tmp_path: Path) -> None:
    window = PlannedWindow(
        "i01", Role.IDENTIFY, np.array([1.1, 1.2]), np.array([0.03, -0.01]), np.array([1.0, 0, -0.3])
    )
    write_plan(tmp_path / "p.toml", Plan("p", (window,)))
    back = read_plan(tmp_path / "p.toml", 2)
    np.testing.assert_array_equal(back.windows[0].lengths, [1.1, 1.2])
    with pytest.raises(FileError, match="window 1, lengths: 2 values for a robot of 4 cables"):
        read_plan(tmp_path / "p.toml", 4)
    write_plan(tmp_path / "p.toml", Plan("p", (window, window)))
    with pytest.raises(FileError, match="window 2, id: 'i01' occurs twice"):
        read_plan(tmp_path / "p.toml", 2)


@pytest.mark.shared
def test_every_open_campaign_reads(shared: Path) -> None:
    folders = sorted((shared / "campaigns").glob("open-*"))
    assert folders
    for folder in folders:
        campaign = read_campaign(folder)
        assert len(campaign.of_role(Role.IDENTIFY)) == 12
        assert len(campaign.of_role(Role.VALIDATE)) == 6


@pytest.mark.parametrize("named", ["none.toml", "/dev/zero", "windows", "windows/w0.csv"])
def test_a_robot_file_that_is_none_is_told_with_the_file_that_names_it(
    campaign: Campaign, tmp_path: Path, named: str
) -> None:
    write_campaign(tmp_path, campaign)
    index = tmp_path / "campaign.toml"
    index.write_text(index.read_text().replace('"robot.toml"', f'"{named}"'))
    with pytest.raises(FileError, match=rf"{named}: .* The key robot of campaign\.toml names it\.$"):
        read_campaign(tmp_path)


@pytest.mark.parametrize("suffix", [".csv", ".mcap"])
@pytest.mark.parametrize(("gap", "refused"), [(0.4, False), (0.6, True), (36000.0, True)])
def test_a_window_with_less_than_half_of_its_time_sampled_is_refused(
    campaign: Campaign, tmp_path: Path, suffix: str, gap: float, refused: bool
) -> None:
    """50 samples of 0.01 s; ten hours between two of them would be computed in gigabytes."""
    first = campaign.windows[0]
    late = replace(first, t=first.t + gap * (np.arange(50) >= 30))
    path = tmp_path / f"windows/w0{suffix}"
    write_campaign(tmp_path, replace(campaign, windows=(late, *campaign.windows[1:])))
    if suffix == ".mcap":
        path.write_bytes(window_as_mcap(read_window_csv(path.with_suffix(".csv"), 4)))
        index = tmp_path / "campaign.toml"
        index.write_text(index.read_text().replace("w0.csv", "w0.mcap"))
    if not refused:
        assert read_campaign(tmp_path).windows[0].duration == pytest.approx(0.49 + gap)
        return
    says = rf"w0\{suffix}: sample 31, t: no sample for {gap + 0.01:.2f} s after t = 0\.29 s; .* and half must\."
    with pytest.raises(FileError, match=says):
        read_campaign(tmp_path)


def test_zeros_of_encoders_come_back_and_mistakes_in_them_are_named(tmp_path: Path, campaign: Campaign) -> None:
    zeros = np.linspace(1.5, 1.8, campaign.robot.n)
    window = replace(campaign.windows[0], lengths_by_poses=True, encoder_zeros=zeros)
    write_campaign(tmp_path, replace(campaign, windows=(window,)))
    np.testing.assert_allclose(read_campaign(tmp_path).windows[0].encoder_zeros, zeros, atol=1e-7)
    index = tmp_path / "campaign.toml"
    text = index.read_text()
    for wrong, says in (
        (text.replace('lengths = "poses"\n', "").replace('lengths = "poses", ', ""), "zeros of its own"),
        (re.sub(r"encoder_zeros = \[.*?\]", "encoder_zeros = [1.0]", text, flags=re.DOTALL), "1 numbers"),
        (re.sub(r"encoder_zeros = \[\s*[\d.]+", "encoder_zeros = [nan", text), "finite"),
    ):
        assert wrong != text
        index.write_text(wrong)
        with pytest.raises(FileError, match=says):
            read_campaign(tmp_path)


@pytest.mark.parametrize(("seen", "swivels", "read"), [(0, True, True), (1, False, True), (0, False, False)])
def test_a_window_is_read_where_something_shows_the_pose(
    campaign: Campaign, tmp_path: Path, seen: int, swivels: bool, read: bool
) -> None:
    """Swivel encoders alone do, and so does another marker where the main one is never seen."""
    first = campaign.windows[0]
    markers = np.full((len(first.t), 2, 3), np.nan)
    markers[:, 2 - seen :] = 1.0
    further = {f"s{cable}": np.zeros(len(first.t)) for cable in range(1, 5)} if swivels else {}
    robot = replace(campaign.robot, extra_markers=(np.array([0.1, 0.0, 0.0]),))
    dark = replace(first, markers=markers, further=further)
    write_campaign(tmp_path, replace(campaign, robot=robot, windows=(dark,)))
    if read:
        assert np.isfinite(read_campaign(tmp_path).windows[0].markers).any(axis=(0, 2)).sum() == seen
        return
    with pytest.raises(FileError, match=r"x, y, z: no marker is in any sample"):
        read_campaign(tmp_path)
