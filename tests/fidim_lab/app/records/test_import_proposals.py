"""Tables that nobody described: the map that `fidim import csv` proposes reads them, by the user's commands alone."""

import io
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.io
from click.testing import CliRunner

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


def matlab(content: dict[str, object]) -> bytes:
    out = io.BytesIO()
    scipy.io.savemat(out, content)
    return out.getvalue()


def words(*names: str) -> np.ndarray:
    return np.array(names, dtype=object)


def records(swing: Swing) -> list[dict[str, object]]:
    """One a sample; a marker is missing now and then."""
    rows = [{"t": k / 100, "at": {f"m{m}": place for m, place in enumerate(places.tolist())}}
            for k, places in enumerate(swing.markers.round(7))]  # fmt: skip
    for row in rows[100::97]:
        row["at"]["m2"] = None
    return rows


FILES: dict[str, Callable[[Swing], bytes]] = {
    "a struct with a field a marker": lambda s: matlab(
        {"data": {"time": s.t[:, None], **{f"m{m}": s.markers[:, m] for m in range(5)}, "notes": "a take"}}
    ),
    "arrays by themselves, lying": lambda s: matlab(
        {"t": s.t[None], **{f"m{m}": 1e3 * s.markers[:, m].T for m in range(5)}}
    ),
    "markers by axes by frames": lambda s: matlab(
        {"take": {"fs": 100.0, "labels": words(*"abcde"), "xyz": s.markers.transpose(1, 2, 0)}}
    ),
    "frames by axes by markers": lambda s: matlab({"rate": 100.0, "P": s.markers.transpose(0, 2, 1)}),
    "Simulink's structure with time": lambda s: matlab(
        {"out": {"time": s.t[:, None], "signals": {"values": s.markers.reshape(-1, 15), "dimensions": 15.0}}}
    ),
    "a matrix of all": lambda s: matlab({"x": np.column_stack([s.t + 3.0, 1e3 * s.markers.reshape(-1, 15)])}),
    "a place and a quaternion": lambda s: matlab({"t": s.t, "p": s.p, "q": s.quaternions}),
    "a place and a matrix": lambda s: matlab({"t": s.t, "pos": {"p": s.p.T}, "R": s.R.transpose(1, 2, 0)}),
    "a record in each line": lambda s: "".join(json.dumps(row) + "\n" for row in records(s)).encode(),
    "records in one list": lambda s: json.dumps(records(s), indent=1).encode(),
    "arrays of Python": lambda s: json.dumps(
        {
            "t": s.t.tolist(),
            "meta": {"by": "us"},
            "markers": np.where(s.t[:, None, None] == 2.0, np.nan, s.markers).tolist(),
        }
    ).encode(),
}


@pytest.mark.parametrize("name", [*TABLES, *FILES])
def test_a_proposed_map_reads_its_table(name: str, swing: Swing, tmp_path: Path):
    write_robot(tmp_path / "robot.toml", swing.robot)
    (tmp_path / "take.csv").write_bytes(FILES[name](swing) if name in FILES else TABLES[name](swing).encode())
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
