"""IRMA4U recordings: which file is what, and every wrong field by name."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io

from fidim_lab.data.importers.irma4u import find_sources, read_geometry, read_log
from fidim_lab.data.importers.registry import read_recording
from fidim_lab.errors import FileError, SetupError

SAMPLES = 1200


def log_fields() -> dict[str, Any]:
    rng = np.random.default_rng(1)
    return {
        "t": 4.42 + 1e-3 * np.arange(SAMPLES),
        "cable_length": rng.normal(size=(4, SAMPLES)),
        "swivel": rng.normal(size=(4, SAMPLES)),
        "tensions": rng.normal(size=(4, SAMPLES)),
        "epsilon": rng.normal(size=(3, SAMPLES)),
    }


@pytest.fixture
def log_file(tmp_path: Path) -> Path:
    scipy.io.savemat(tmp_path / "log.mat", {"st_out": log_fields()})
    return tmp_path / "log.mat"


def cell(*items: object) -> np.ndarray:
    array = np.empty(len(items), dtype=object)
    array[:] = items
    return array


def geometry_fields() -> dict[str, Any]:
    axes = cell(np.array([0, 0, -1], dtype=np.int16), np.array([0, 1, 0]), np.array([1, 0, 0]))
    pulley = {"r": 0.03, "CableEnterPosition": np.array([1.0, -1.1, 1.8]), "FixedFrame": axes}
    platform = {
        "m": 10.0,
        "PtoG": np.array([0.0, 0.0, 0.2]),
        "InertialMatrix": np.diag([0.2, 0.1, 0.15]),
        "points": cell(np.array([0.1, 0.0, 0.3]), np.array([-0.1, 0.0, 0.3])),
    }
    other = {**pulley, "CableEnterPosition": np.array([-1.0, -1.1, 1.8])}
    return {"EndEffector": {"Platform": platform}, "Trasmission": {"Pulley": cell(pulley, other)}}


def geometry_file(tmp_path: Path, s: dict[str, Any]) -> Path:
    scipy.io.savemat(tmp_path / "cad.mat", {"s": s})
    return tmp_path / "cad.mat"


def test_the_recording_is_found_in_its_folder(lab_recording):
    recording = read_recording("irma4u", [lab_recording.folder])
    assert recording.name == "Motion07"
    assert recording.markers.rate == 100.0
    assert recording.markers.positions.shape == (3000, 6, 3)
    assert np.isnan(recording.markers.positions[1950:1953, 2]).all()
    assert np.diff(recording.log.t) == pytest.approx(1e-3)
    for ours, truth in zip(recording.robot.cables, lab_recording.robot.cables, strict=True):
        for name in ("d", "a", "radius", "x", "y", "z"):
            assert getattr(ours, name) == pytest.approx(getattr(truth, name))
    assert recording.robot.nominal.vector == pytest.approx(lab_recording.robot.nominal.vector, abs=1e-12)


def test_inertia_is_moved_from_the_centre_of_mass_to_p(tmp_path: Path):
    robot = read_geometry(geometry_file(tmp_path, geometry_fields()))
    assert robot.nominal.inertia == pytest.approx([0.02 + 0.04, 0.01 + 0.04, 0.015, 0, 0, 0])
    assert robot.n == 2


def test_two_logs_are_refused_and_the_named_one_wins(lab_recording, tmp_path: Path):
    folder = tmp_path / "two"
    shutil.copytree(lab_recording.folder, folder)
    second = folder / "Motion08_exp.mat"
    shutil.copy(folder / "Motion07_exp.mat", second)
    (folder / "notes.txt").write_text("Bring more tape.")
    with pytest.raises(SetupError, match=r"More than one robot log.*Motion07_exp.mat, Motion08_exp.mat.*Name the one"):
        find_sources([folder])
    assert find_sources([folder, second]).log == second


def test_the_cad_file_is_preferred_to_later_calibrations(lab_recording, tmp_path: Path):
    folder = tmp_path / "calibrated"
    shutil.copytree(lab_recording.folder, folder)
    (folder / "robot_cad.mat").rename(folder / "UACDPR_LAB3.mat")
    later = shutil.copy(folder / "UACDPR_LAB3.mat", folder / "A_later.mat")
    assert find_sources([folder]).geometry.name == "UACDPR_LAB3.mat"
    assert find_sources([folder, later]).geometry.name == "A_later.mat"


def test_what_is_missing_or_foreign_is_named(tmp_path: Path, log_file: Path):
    with pytest.raises(SetupError, match="No marker export"):
        find_sources([tmp_path])
    with pytest.raises(FileError, match="no such file or folder"):
        find_sources([tmp_path / "none"])
    foreign = tmp_path / "notes.txt"
    foreign.write_text("Bring more tape.")
    with pytest.raises(FileError, match="neither a trajectory export"):
        find_sources([tmp_path, foreign])
    with pytest.raises(SetupError, match="irma5"):
        read_recording("irma5", [tmp_path])


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"swivel": None}, "st_out.swivel: is missing"),
        ({"tensions": np.zeros((3, SAMPLES))}, "st_out.tensions: has shape 3 × 1200; 4 × 1200 was expected"),
        ({"epsilon": np.zeros((3, 7))}, "st_out.epsilon: has shape 3 × 7"),
        ({"cable_length": np.full((4, SAMPLES), np.nan)}, "st_out.cable_length: holds values that are not finite"),
        ({"t": np.arange(9.0)}, "st_out.t: 9 samples"),
        ({"t": np.r_[np.arange(1199.0), 3.0]}, "st_out.t: time does not increase at sample 1200 (3 s)"),
        ({"t": "now"}, "st_out.t: is text"),
    ],
)
def test_a_wrong_log_names_the_field(tmp_path: Path, change: dict[str, Any], says: str):
    fields = {name: value for name, value in (log_fields() | change).items() if value is not None}
    scipy.io.savemat(tmp_path / "log.mat", {"st_out": fields})
    with pytest.raises(FileError) as caught:
        read_log(tmp_path / "log.mat", 4)
    assert says in str(caught.value)


def test_a_log_of_another_robot_is_refused(log_file: Path):
    assert read_log(log_file, 4).lengths.shape == (SAMPLES, 4)
    with pytest.raises(FileError, match="3 × 1200 was expected"):
        read_log(log_file, 3)


def changed(path: str, value: object) -> dict[str, Any]:
    s = geometry_fields()
    *outer, last = path.split(".")
    table: Any = s
    for key in outer:
        table = table[key] if not key.isdigit() else table[int(key)]
    table[last] = value
    return s


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        ("EndEffector.Platform.m", -1.0, "s.EndEffector.Platform.m: a mass of -1 kg"),
        ("EndEffector.Platform.m", np.zeros(2), "s.EndEffector.Platform.m: has shape 1 × 2; one number was expected"),
        ("EndEffector.Platform.InertialMatrix", -np.eye(3), "InertialMatrix: is not symmetric and positive definite"),
        ("EndEffector.Platform.points", cell(np.zeros(3)), "2 pulleys and 1 attachment points"),
        ("Trasmission.Pulley.1.r", -0.03, "Pulley{2}.r: a radius of -0.03 m"),
        ("Trasmission.Pulley.0.CableEnterPosition", np.zeros(2), "Pulley{1}.CableEnterPosition: has shape 1 × 2"),
        ("Trasmission.Pulley.1.FixedFrame", cell(*np.ones((3, 3))), "Pulley{2}.FixedFrame: is not a right-handed"),
        ("Trasmission.Pulley.1.FixedFrame", cell(*-np.eye(3)), "Pulley{2}.FixedFrame: is not a right-handed"),
        ("EndEffector.Platform", 3.0, "s.EndEffector.Platform: is an array of 1 × 1 numbers; a struct was expected"),
    ],
)
def test_a_wrong_geometry_names_the_field(tmp_path: Path, path: str, value: object, says: str):
    file = geometry_file(tmp_path, changed(path, value))
    with pytest.raises(FileError) as caught:
        read_geometry(file)
    assert says in str(caught.value)
