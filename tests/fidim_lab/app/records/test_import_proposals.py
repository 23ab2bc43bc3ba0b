"""Tables that nobody described: the map that `fidim import csv` proposes reads them, by the user's commands alone."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from fidim_lab.app.cli import fidim
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.robot_file import write_robot
from fidim_lab.errors import SetupError

from .conftest import Swing

STAMPS = pd.date_range("2026-03-01 23:59:58.990", periods=20_000, freq="10ms")


def markers(swing: Swing, times: dict[str, object]) -> pd.DataFrame:
    """mm, behind columns of times."""
    axes = [f"m{m}_{axis}" for m in range(5) for axis in "xyz"]
    places = pd.DataFrame((1e3 * swing.markers).reshape(len(swing.t), -1), columns=axes).round(4)
    return pd.concat([pd.DataFrame(times), places], axis=1)


def poses(swing: Swing, turns: np.ndarray, names: str) -> pd.DataFrame:
    table = np.column_stack([swing.t, swing.p, turns])
    return pd.DataFrame(table, columns=["t", "x", "y", "z", *names.split()]).round(7)


def moments(swing: Swing) -> pd.DatetimeIndex:
    return STAMPS[: len(swing.t)]


def ros_1(swing: Swing) -> pd.DataFrame:
    """As `rostopic echo -p` and its like write a bag: three times, of which two are parts of one."""
    stamp = 1_700_000_000_000_000_000 + np.arange(len(swing.t)) * 10_000_000
    times = {"rosbagTimestamp": stamp + 1_234_567, "header.seq": np.arange(len(stamp))}
    times |= {"header.stamp.secs": stamp // 10**9, "header.stamp.nsecs": stamp % 10**9}
    table = pd.DataFrame(times)
    for axis, place in zip("xyz", swing.p.T, strict=True):
        table[f"pose.position.{axis}"] = place
    for axis, turn in zip("xyzw", swing.quaternions.T, strict=True):
        table[f"pose.orientation.{axis}"] = turn
    return table


def with_end(swing: Swing) -> str:
    lines = markers(swing, {"time": swing.t}).to_csv(index=False).splitlines()
    return "\n".join([*lines[:300], lines[0], *lines[300:], "", f"Samples: {len(swing.t)}", "Mean,1,2,3"])


TABLES: dict[str, Callable[[Swing], str]] = {
    "date, time, milliseconds": lambda s: markers(
        s, {"Datum": moments(s).strftime("%d.%m.%Y"), "Zeit": moments(s).strftime("%H:%M:%S"),
            "ms": moments(s).microsecond // 1000},
    ).to_csv(sep=";", index=False),
    "time, microseconds": lambda s: markers(
        s, {"time": moments(s).strftime("%H:%M:%S"), "us": moments(s).microsecond}
    ).to_csv(index=False),
    "date, time": lambda s: markers(
        s, {"date": moments(s).strftime("%Y-%m-%d"), "time": moments(s).strftime("%H:%M:%S.%f")}
    ).to_csv(index=False),
    "a bag of ROS 1": lambda s: ros_1(s).to_csv(index=False),
    "names again, and words at the end": with_end,
    "a quaternion by letters": lambda s: poses(s, s.quaternions, "a b c d").to_csv(index=False),
    "a pose without names": lambda s: poses(s, s.quaternions, "a b c d").to_csv(index=False, header=False),
    "a matrix by letters": lambda s: poses(s, s.R.reshape(-1, 9), "a b c d e f g h i").to_csv(index=False),
}  # fmt: skip


@pytest.mark.parametrize("name", TABLES)
def test_a_proposed_map_reads_its_table(name: str, swing: Swing, tmp_path: Path):
    write_robot(tmp_path / "robot.toml", swing.robot)
    (tmp_path / "take.csv").write_text(TABLES[name](swing), encoding="utf-8")
    command = ["import", "csv", str(tmp_path / "take.csv"), "--robot", str(tmp_path / "robot.toml")]
    command += ["--out", str(tmp_path / "out")]
    asked = CliRunner().invoke(fidim, command)
    assert isinstance(asked.exception, SetupError)
    (tmp_path / "map.toml").write_text(asked.stdout, encoding="utf-8")
    done = CliRunner().invoke(fidim, [*command, "--map", str(tmp_path / "map.toml")])
    assert done.exit_code == 0, done.output
    windows = read_campaign(tmp_path / "out").windows
    assert sum(window.t[-1] - window.t[0] for window in windows) > 15.0
    for window in windows:
        off = window.markers - swing.markers[np.rint(window.t * 100).astype(int)]
        assert np.nanmax(np.abs(off)) < 3e-4
