"""Odd files of other programs, imported by the user's command: read right, or refused with the cause.

Each says something wrongly or in a dialect: units, rates, axes, quaternions, names twice, columns of velocities.
"""

import json
from collections.abc import Callable
from copy import copy
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from fidim_lab.app.cli import fidim
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.robot_file import write_robot

from .conftest import FROM_Z_UP, RATE, Swing

NAMES = [f"m{k}" for k in range(5)]
AXES = [f"{name}{axis}" for name in NAMES for axis in "xyz"]
POSE = ["x", "y", "z", "q1", "q2", "q3", "q4"]


def lines_of(*columns: np.ndarray, sep: str = ",", decimal: str = ".", quote: str = "") -> list[str]:
    table = np.column_stack([column.reshape(len(column), -1) for column in columns])
    return [sep.join(f"{quote}{value:.9g}{quote}".replace(".", decimal) for value in row) for row in table]


def in_order(swing: Swing, up: str = "z", unit: float = 1e-3) -> np.ndarray:
    return swing.markers @ FROM_Z_UP[up].T / unit


def vicon(swing: Swing, *, scale: float = 1e3, unit: str = "mm", speeds: bool = False) -> str:
    names, axes, units = list(NAMES), ["X", "Y", "Z"] * 5, [unit] * 15
    values = [scale * swing.markers]
    if speeds:
        names, axes, units = names * 2, axes + ["X'", "Y'", "Z'"] * 5, units + ["mm/s"] * 15
        values.append(np.gradient(values[0], 1 / RATE, axis=0))
    head = ["Trajectories", "100", ",," + ",,,".join(names), ",".join(["Frame", "Sub Frame", *axes])]
    counted = np.arange(3001.0, 3001.0 + len(swing.t))
    return "\n".join([*head, ",," + ",".join(units), *lines_of(counted, 0 * swing.t, *values)])


def exchanged(swing: Swing, *, scale: float = 1e3, mirror: float = 1.0) -> str:
    """Two labels change places in the middle, so that no order of them fits the whole take."""
    markers = swing.markers * [1.0, 1.0, mirror]
    half = len(markers) // 2
    markers[half:, [1, 3]] = markers[half:, [3, 1]]
    other = copy(swing)
    other.markers = markers
    return vicon(other, scale=scale)


def motive(swing: Swing, *, up: str = "y", rate: str = "100.0", every: int = 1, names: list[str] = NAMES) -> str:
    head = ["Format Version,1.25", f"Export Frame Rate,{rate}", "Rotation Type,Quaternion", "Length Units,Meters"]
    rows = [",".join(head), ""]
    for what, cells in (("Type", ["Marker"] * 5), ("Name", names), ("", ["Position"] * 5)):
        rows.append(",".join(["", what, *(cell for cell in cells for _ in "xyz")]))
    rows.append(",".join(["Frame", "Time (Seconds)", *["X", "Y", "Z"] * 5]))
    counted = np.arange(len(swing.t))[::every]
    return "\n".join([*rows, *lines_of(counted, swing.t[::every], in_order(swing, up, 1.0)[::every])])


def qtm(swing: Swing, *, blind: slice = slice(0), rate: str = "100", up: str = "z", timed: bool = False) -> str:
    places = in_order(swing, up).copy()
    places[blind] = np.nan
    lead = [np.arange(1.0, 1.0 + len(swing.t)), swing.t] if timed else []
    head = [f"FREQUENCY\t{rate}", "DATA_INCLUDED\t3D", "\t".join(["MARKER_NAMES", *NAMES])]
    return "\r\n".join([*head, *lines_of(*lead, places, sep="\t")]).replace("nan", "")


def trc(
    swing: Swing, *, up: str = "y", rate: str = "100.00", unit: str = "mm", sep: str = "\t", far: float = 0.0
) -> str:
    head = ["PathFileType\t4\t(X/Y/Z)\ta.trc", "DataRate\tCameraRate\tNumFrames\tUnits", f"{rate}\t100\t9\t{unit}"]
    gap = "\t\t\t" if sep == "\t" else "\t"
    head += [
        "Frame#\tTime\t" + gap.join(NAMES),
        "\t\t" + "\t".join(f"{axis}{k}" for k in range(1, 6) for axis in "XYZ"),
    ]
    counted = np.arange(1.0, 1.0 + len(swing.t))
    return "\n".join([*head, *lines_of(counted, swing.t, in_order(swing, up) + far, sep="\t")]).replace("\t", sep)


def with_cells(text: str, row: int, column: int, cells: dict[int, str]) -> str:
    """A table with other cells in one column: how many rows below `row` → what stands there."""
    lines = text.split("\n")
    for k, cell in cells.items():
        split = lines[row + k].split(",")
        split[column] = cell
        lines[row + k] = ",".join(split)
    return "\n".join(lines)


def named_gaps(swing: Swing) -> str:
    """Cells of Excel, MATLAB, R and C for what was not seen."""
    text = "\n".join([",".join(["time", *AXES]), *lines_of(swing.t, in_order(swing))])
    return with_cells(text, 300, 4, dict(enumerate(["#NV", "#DIV/0!", "NaN", "NA", "-nan(ind)", "-1.#IND", "1.#QNAN"])))


def quoted(swing: Swing) -> str:
    rows = lines_of(swing.t, in_order(swing), decimal=",", quote='"')
    return "\n".join([",".join(f'"{name}"' for name in ["time", *AXES]), *rows])


def dated(form: str) -> Callable[[Swing], str]:
    def text(swing: Swing) -> str:
        began = datetime(2026, 3, 1, 11, 59, 50)
        stamps = [(began + timedelta(seconds=float(t))).strftime(form) for t in swing.t]
        rows = lines_of(in_order(swing, unit=1e-2), sep=";")
        return "\n".join([";".join(["time", *AXES]), *(";".join(pair) for pair in zip(stamps, rows, strict=True))])

    return text


def poses(swing: Swing, *, turn: np.ndarray | None = None, order: list[int] | None = None, unit: float = 1.0) -> str:
    numbers = (swing.quaternions * (1.0 if turn is None else turn))[:, order or [0, 1, 2, 3]]
    return "\n".join([",".join(["time", *POSE]), *lines_of(swing.t, swing.p / unit, numbers)])


def numbered(swing: Swing) -> str:
    return "\n".join([",".join(["time", *AXES]), *lines_of(np.arange(len(swing.t)) + 1.0, in_order(swing))])


def long(swing: Swing) -> str:
    """Every marker of a sample in a row of its own."""
    return "\n".join(["time,m0x,m0y,m0z", *lines_of(np.repeat(swing.t, 5), in_order(swing).reshape(-1, 3))])


def left_handed(swing: Swing) -> str:
    mirror = np.diag([1.0, 1.0, -1.0])
    turned = Rotation.from_matrix(mirror @ Rotation.from_quat(swing.quaternions).as_matrix() @ mirror)
    return "\n".join([",".join(["time", *POSE]), *lines_of(swing.t, swing.p @ mirror, turned.as_quat())])


MARKER_MAP = 'format = "fidim-columns/1"\ntime = "time"\n' + "".join(
    f'[[marker]]\nname = "{name}"\ncolumns = ["{name}x", "{name}y", "{name}z"]\n' for name in NAMES
)
POSE_MAP = (
    'format = "fidim-columns/1"\ntime = "time"\nunit = "m"\n[[body]]\nname = "platform"\n'
    'position = ["x", "y", "z"]\nquaternion = ["q1", "q2", "q3", "q4"]\norder = "xyzw"\n'
)
ONE_MAP = MARKER_MAP[: MARKER_MAP.index("[[marker]]", MARKER_MAP.index("[[marker]]") + 1)]
MAPS = {"markers": MARKER_MAP, "poses": POSE_MAP, "one": ONE_MAP}

READ: dict[str, tuple[str, Callable[[Swing], str], list[str]]] = {
    "frames from 3001 on": ("vicon-csv", vicon, []),
    "labels exchanged in the middle": ("vicon-csv", exchanged, []),
    "velocities beside places": ("vicon-csv", lambda swing: vicon(swing, speeds=True), []),
    "unit said wrongly, asked": ("vicon-csv", lambda swing: vicon(swing, unit="m"), ["--unit", "mm"]),
    "Motive set to z upwards": ("motive-csv", lambda swing: motive(swing, up="z"), []),
    "header without rate": ("motive-csv", lambda swing: motive(swing, rate=""), []),
    "rate with a comma": ("motive-csv", lambda swing: motive(swing, rate='"100,000"'), []),
    "rate said wrongly, asked": ("motive-csv", lambda swing: motive(swing, rate="120"), ["--rate", "100"]),
    "QTM set to y upwards": ("qtm-tsv", lambda swing: qtm(swing, up="y"), []),
    "nothing seen in the first rows": ("qtm-tsv", lambda swing: qtm(swing, blind=slice(1, 40)), []),
    "rows of a gap are blank": ("qtm-tsv", lambda swing: qtm(swing, blind=slice(600, 640)), []),
    "cameras triggered from outside": ("qtm-tsv", lambda swing: qtm(swing, rate="EXT", timed=True), []),
    "Cortex, z upwards": ("trc", lambda swing: trc(swing, up="z"), []),
    "TRC with blanks": ("trc", lambda swing: trc(swing, sep=" "), []),
    "decimal commas in quotes": ("csv", quoted, ["--map", "markers"]),
    "dates with points": ("csv", dated("%d.%m.%Y %H:%M:%S.%f"), ["--map", "markers"]),
    "months by name": ("csv", dated("%d-%b-%Y %H:%M:%S.%f"), ["--map", "markers"]),
    "words for what was not seen": ("csv", named_gaps, ["--map", "markers"]),
    "damaged cells": (
        "vicon-csv",
        lambda swing: with_cells(vicon(swing), 400, 3, {0: "6e9", 1: "-7e9", 40: "1e300", 90: "1e-300"}),
        [],
    ),
    "unit said wrongly by far, asked": ("trc", lambda swing: trc(swing, unit="m"), ["--unit", "mm"]),
    "halves of the day": ("csv", dated("%I:%M:%S.%f %p"), ["--map", "markers"]),
    "poses": ("csv", poses, ["--map", "poses"]),
    "frame numbers as times": ("csv", numbered, ["--map", "markers", "--rate", "100"]),
    "one name for all markers": ("motive-csv", lambda swing: motive(swing, names=["m"] * 5), []),
    "one name for two, of Vicon": ("vicon-csv", lambda swing: vicon(swing).replace("m3", "m2"), []),
    "one name for two, of QTM": ("qtm-tsv", lambda swing: qtm(swing).replace("m3", "m2"), []),
    "one name for two, of a TRC": ("trc", lambda swing: trc(swing).replace("m3", "m2"), []),
}
REFUSED: dict[str, tuple[str, Callable[[Swing], str], list[str], str]] = {
    "says m, is mm": ("vicon-csv", lambda swing: vicon(swing, unit="m"), [], "--unit mm"),
    "says mm, is m": ("vicon-csv", lambda swing: vicon(swing, scale=1.0), [], "--unit m"),
    "says m, is mm, far from 0": ("trc", lambda swing: trc(swing, unit="m", far=4000.0), [], "--unit mm"),
    "says mm, is m, labels exchanged": ("vicon-csv", lambda swing: exchanged(swing, scale=1.0), [], "--unit m"),
    "a mirror, labels exchanged": ("vicon-csv", lambda swing: exchanged(swing, mirror=-1.0), [], "in a mirror only"),
    "another rate": ("motive-csv", lambda swing: motive(swing, rate="120"), [], "120 Hz, its column of times 100 Hz"),
    "59.94 said of 60": ("trc", lambda swing: trc(swing, rate="99.9"), [], "99.9 Hz, its column of times 100 Hz"),
    "another rate of QTM": ("qtm-tsv", lambda swing: qtm(swing, rate="120", timed=True), [], "Say the right one"),
    "frame numbers as times": (
        "csv",
        numbered,
        ["--map", "markers"],
        "are they frame numbers, or ms at 1000 Hz?",
    ),
    "a row for each marker": ("csv", long, ["--map", "one"], "side by side in one row"),
    "one marker": ("csv", numbered, ["--map", "one", "--rate", "100"], "1 marker and no rigid body's rotations"),
    "a left-handed frame": ("csv", left_handed, ["--map", "poses"], "is the frame left-handed?"),
    "w first": ("csv", lambda swing: poses(swing, order=[3, 0, 1, 2]), ["--map", "poses"], "taken as w, x, y, z"),
    "w last": ("csv", lambda swing: poses(swing, order=[1, 2, 3, 0]), ["--map", "poses"], "taken as x, y, z, w"),
    "world to body": (
        "csv",
        lambda swing: poses(swing, turn=np.array([-1.0, -1.0, -1.0, 1.0])),
        ["--map", "poses"],
        "the other way round",
    ),
    "poses in mm": ("csv", lambda swing: poses(swing, unit=1e-3), ["--map", "poses"], "--unit mm"),
}


def imported(swing: Swing, folder: Path, kind: str, text: str, options: list[str]) -> tuple[int, str]:
    """Exit code, and all that was said."""
    write_robot(folder / "robot.toml", swing.robot)
    (folder / "take.txt").write_text(text, encoding="utf-8")
    for name, columns in MAPS.items():
        (folder / name).write_text(columns, encoding="utf-8")
    named = [str(folder / option) if option in MAPS else option for option in options]
    arguments = [kind, str(folder / "take.txt"), "--robot", str(folder / "robot.toml"), "--out", str(folder / "out")]
    done = CliRunner().invoke(fidim, ["import", *arguments, *named])
    return done.exit_code, " ".join(f"{done.output} {done.exception or ''}".split())


@pytest.mark.parametrize("name", READ)
def test_odd_files_are_read(name: str, swing: Swing, tmp_path: Path):
    kind, write, options = READ[name]
    code, said = imported(swing, tmp_path, kind, write(swing), options)
    assert code == 0, said
    windows = read_campaign(tmp_path / "out").windows
    assert sum(window.t[-1] - window.t[0] for window in windows) > 15.0
    for window in windows:
        off = window.markers - swing.markers[np.rint(window.t * RATE).astype(int)]
        assert np.nanmax(np.abs(off)) < 3e-4, said


def test_a_clock_that_is_set_ends_a_window(swing: Swing, tmp_path: Path):
    """By 37 ms as NTP does: how much time passed is not known, and a window across it contradicts the others."""
    at = len(swing.t) // 2
    stamps = 1.75e12 + np.rint(1e3 * swing.t) + 37.0 * (np.arange(len(swing.t)) >= at)
    text = "\n".join(
        [
            ",".join(["time", *AXES]),
            *(f"{t:.0f},{row}" for t, row in zip(stamps, lines_of(in_order(swing)), strict=True)),
        ]
    )
    code, said = imported(swing, tmp_path, "csv", text, ["--map", "markers"])
    assert code == 0, said
    assert "stamps step by +37 ms" in said
    for window in read_campaign(tmp_path / "out").windows:
        early = window.t < swing.t[at]
        assert early.all() or not early.any()


def test_an_export_at_a_lower_rate_keeps_its_times(swing: Swing, tmp_path: Path):
    """Frame numbers count those of the cameras."""
    code, said = imported(swing, tmp_path, "motive-csv", motive(swing, rate="50", every=2), [])
    assert code == 0, said
    campaign = read_campaign(tmp_path / "out")
    assert campaign.sample_rate == 50.0
    for window in campaign.windows:
        off = window.markers - swing.markers[np.rint(window.t * RATE).astype(int)]
        assert np.nanmax(np.abs(off)) < 3e-4


def test_a_take_at_another_rate_is_left_out_and_told(swing: Swing, tmp_path: Path):
    for name, every in (("one", 1), ("two", 1), ("three", 1), ("slow", 2), ("slower", 4)):
        text = motive(swing, rate=f"{RATE / every:g}", every=every)
        (tmp_path / f"{name}.csv").write_text(text, encoding="utf-8")
    write_robot(tmp_path / "robot.toml", swing.robot)
    arguments = ["motive-csv", str(tmp_path), "--takes", "*.csv", "--robot", str(tmp_path / "robot.toml")]
    done = CliRunner().invoke(fidim, ["import", *arguments, "--out", str(tmp_path / "out")])
    said = " ".join(done.output.split())
    assert "left out: slow, slower: 25…50 Hz, while most takes have 100 Hz" in said  # one line for both
    campaign = read_campaign(tmp_path / "out")
    assert campaign.sample_rate == RATE
    assert not [window.id for window in campaign.windows if "slow" in window.id]


def test_what_was_decided_is_on_screen(swing: Swing, tmp_path: Path):
    _, said = imported(swing, tmp_path, "qtm-tsv", qtm(swing), [])
    told = json.loads((tmp_path / "out" / "import.json").read_text(encoding="utf-8"))["takes"][0]
    assert told["decided"]
    for words in told["decided"]:
        assert " ".join(words.removeprefix("window ").split()) in said


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_said_wrongly_is_refused_with_its_cause(name: str, swing: Swing, tmp_path: Path):
    kind, write, options, cause = REFUSED[name]
    code, said = imported(swing, tmp_path, kind, write(swing), options)
    assert code != 0
    assert cause in said
    assert not (tmp_path / "out" / "campaign.toml").exists()


def test_an_axis_that_the_lengths_contradict_is_told(swing: Swing, tmp_path: Path):
    imported(swing, tmp_path, "trc", trc(swing, up="z"), [])
    told = json.loads((tmp_path / "out" / "import.json").read_text(encoding="utf-8"))["takes"][0]
    assert "the file says y upwards" in told["warnings"][0]
    assert "z upwards was taken" in told["warnings"][0]


def test_an_import_without_a_window_may_be_repeated_into_the_same_folder(swing: Swing, tmp_path: Path):
    still = Swing(
        swing.robot, np.repeat(swing.p[:1], len(swing.p), axis=0), np.repeat(swing.R[:1], len(swing.R), axis=0)
    )
    code, said = imported(still, tmp_path, "qtm-tsv", qtm(still), [])
    assert code != 0
    assert "No window was found" in said
    assert imported(swing, tmp_path, "qtm-tsv", qtm(swing), [])[0] == 0
    code, said = imported(swing, tmp_path, "qtm-tsv", qtm(swing), [])
    assert code != 0
    assert "exists already" in said
