"""Motive's exports with all kinds of columns: rigid body, markers that it set, measured ones, labelled or not."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from fidim_lab.app.cli import fidim
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.robot_file import write_robot

from .conftest import BODY, FROM_Z_UP, RATE, Swing

Y_UP = FROM_Z_UP["y"]


@dataclass(frozen=True)
class Export:
    """What was ticked in Motive's dialog."""

    version: str = "1.25"
    rotation: str = "Quaternion"
    bodies: bool = True
    solved: bool = True
    labelled: bool = True
    unlabelled: int = 0
    """columns of markers that lost their label, a piece of the take each"""
    space: str = "Global"
    labels: bool = True
    """whether rows say that they are Type, Name …"""

    def text(self, swing: Swing) -> str:
        columns: list[tuple[str, str, str, str, np.ndarray]] = []
        places = swing.markers @ Y_UP.T

        def add(kind: str, name: str, what: str, axes: str, values: np.ndarray) -> None:
            columns.extend((kind, name, what, axis, column) for axis, column in zip(axes, values.T, strict=True))

        if self.bodies:
            turns = Rotation.from_matrix(Y_UP @ swing.R @ Y_UP.T)
            if self.rotation == "Quaternion":
                add("Rigid Body", "plate", "Rotation", "XYZW", turns.as_quat())
            else:
                angles = turns.as_euler(self.rotation, degrees=True)  # pyright: ignore[reportArgumentType, reportCallIssue]
                ordered = angles[:, [self.rotation.index(axis) for axis in "XYZ"]]
                add("Rigid Body", "plate", "Rotation", "XYZ", ordered)
            add("Rigid Body", "plate", "Position", "XYZ", swing.p @ Y_UP.T)
            columns.append(("Rigid Body", "plate", "Mean Marker Error", "", np.full(len(swing.t), 2e-4)))
        if self.solved:
            rigid = (swing.p[:, None] + np.einsum("nij,mj->nmi", swing.R, BODY)) @ Y_UP.T
            for m in range(5):
                add("Rigid Body Marker", f"plate:Marker{m + 1}", "Position", "XYZ", rigid[:, m])
                columns.append(
                    ("Rigid Body Marker", f"plate:Marker{m + 1}", "Marker Quality", "", np.ones(len(swing.t)))
                )
        pieces = np.array_split(np.arange(len(swing.t)), self.unlabelled // 5 or 1)
        lost = np.zeros((len(swing.t), 5), dtype=bool)
        loose: list[tuple[str, np.ndarray]] = []
        for k in range(self.unlabelled):
            rows, m = pieces[k // 5], k % 5
            piece = np.full((len(swing.t), 3), np.nan)
            piece[rows] = places[rows, m]
            lost[rows, m] = True
            loose.append((f"Unlabeled {1000 + 7 * k}", piece))
        if self.labelled:
            for m in (3, 0, 4, 1, 2):
                add("Marker", f"plate:Marker{m + 1}", "Position", "XYZ", places[:, m])
        for name, piece in loose:
            add("Marker", name, "Position", "XYZ", piece)
        return self._joined(swing, columns)

    def _joined(self, swing: Swing, columns: list[tuple[str, str, str, str, np.ndarray]]) -> str:
        head = f"Format Version,{self.version},Take Name,Take 2026-03-01 10.00.00 AM,Take Notes,,Capture Frame Rate,"
        head += f"{RATE:.6f},Export Frame Rate,{RATE:.6f},Capture Start Time,2026-03-01 10.00.00.000 AM,"
        head += f"Total Frames in Take,{len(swing.t)},Total Exported Frames,{len(swing.t)},"
        head += f"Rotation Type,{self.rotation},Length Units,Meters,Coordinate Space,{self.space}"
        kinds, names, what, axes, _ = zip(*columns, strict=True)
        rows = [("Type", kinds), ("Name", [f'"{name}"' for name in names]), ("ID", ['"4E:A1"'] * len(columns))]
        rows += [("Parent", ["plate"] * len(columns))] if self.version >= "1.24" else []
        lines = [head, "", *(",".join(["", word if self.labels else "", *cells]) for word, cells in rows)]
        lines += [",".join(["", "", *what]), ",".join(["Frame", "Time (Seconds)", *axes])]
        table = np.column_stack([column for *_, column in columns])
        for k, row in enumerate(table):
            cells = ["" if np.isnan(value) else f"{value:.6f}" for value in row]
            lines.append(",".join([str(k), f"{k / RATE:.6f}", *cells]))
        return "\ufeff" + "\r\n".join(lines) + "\r\n"


def imported(swing: Swing, folder: Path, export: Export, *options: str) -> tuple[int, str]:
    """Exit code, and all that was said."""
    write_robot(folder / "robot.toml", swing.robot)
    (folder / "take.csv").write_text(export.text(swing), encoding="utf-8")
    arguments = ["motive-csv", str(folder / "take.csv"), "--robot", str(folder / "robot.toml")]
    done = CliRunner().invoke(fidim, ["import", *arguments, "--out", str(folder / "out"), *options])
    return done.exit_code, " ".join(f"{done.output} {done.exception or ''}".split())


def markers_of(swing: Swing, folder: Path) -> np.ndarray:
    """Which markers are seen (B,); those that are stand where they were."""
    seen = []
    for window in read_campaign(folder / "out").windows:
        off = window.markers - swing.markers[np.rint(window.t * RATE).astype(int)]
        assert np.nanmax(np.abs(off)) < 3e-4
        seen.append(np.isfinite(window.markers).all(axis=2).mean(axis=0))
    assert len(seen) >= 3
    return np.mean(seen, axis=0)


EVERYTHING = Export(unlabelled=20)
MEASURED: dict[str, Export] = {
    "all kinds of columns, 1.25": EVERYTHING,
    "all kinds of columns, 1.2": replace(EVERYTHING, version="1.2", rotation="XYZ", labels=False),
    "no labels at all": Export(bodies=False, solved=False, labelled=False, unlabelled=40),
}


@pytest.mark.parametrize("name", MEASURED)
def test_measured_markers_go_first_whatever_stands_beside_them(name: str, swing: Swing, tmp_path: Path):
    code, said = imported(swing, tmp_path, MEASURED[name])
    assert code == 0, said
    assert "check" not in said
    assert markers_of(swing, tmp_path) == pytest.approx(1.0, abs=0.02)


def test_markers_that_were_computed_count_as_the_pose_they_tell(swing: Swing, tmp_path: Path):
    """The errors of one pose are in all of them: five would be taken for five witnesses."""
    code, said = imported(swing, tmp_path, Export(labelled=False))
    assert code == 0, said
    assert "rigid to the last digit" in said
    assert np.sort(markers_of(swing, tmp_path)) == pytest.approx([0, 0, 1, 1, 1], abs=0.02)


@pytest.mark.parametrize("rotation", ["Quaternion", "XYZ", "ZYX", "YXZ"])
def test_rotations_in_every_order(rotation: str, swing: Swing, tmp_path: Path):
    export = Export(rotation=rotation, solved=False, labelled=False)
    code, said = imported(swing, tmp_path, export)
    assert code == 0, said
    assert "check" not in said
    assert np.sort(markers_of(swing, tmp_path)) == pytest.approx([0, 0, 1, 1, 1], abs=0.02)


def test_places_relative_to_a_moving_frame_are_refused(swing: Swing, tmp_path: Path):
    code, said = imported(swing, tmp_path, Export(space="Local"))
    assert code != 0
    assert "Coordinate Space: Global" in said
