"""`fidim reproduce --recordings` as a user types it."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from benchmarks.reproduce.processed import read_bodies, read_processed
from fidim_lab.app import cli
from fidim_lab.errors import FileError

Capsys = pytest.CaptureFixture[str]


def test_a_folder_of_another_kind_is_refused(tmp_path: Path, capsys: Capsys) -> None:
    assert cli.run(["reproduce", "--recordings", str(tmp_path)]) == 2
    assert "vicon" in capsys.readouterr().err


def test_options_of_the_simulation_do_not_go_with_recordings(tmp_path: Path, capsys: Capsys) -> None:
    assert cli.run(["reproduce", "--recordings", str(tmp_path), "--seed", "3"]) == 2
    assert "--seed cannot be used with --recordings" in capsys.readouterr().err


def test_filtered_poses_that_do_not_fit_are_named(tmp_path: Path) -> None:
    (tmp_path / "processed").mkdir()
    values = {"p": np.zeros((6, 5)), "v": np.zeros((6, 4)), "a": np.zeros((6, 5))}
    savemat(tmp_path / "processed" / "33_exp_2.mat", values)
    with pytest.raises(FileError, match=r"33_exp_2\.mat: p, v, a: have 5, 4 and 5 samples"):
        read_processed(tmp_path, 38)
    assert read_processed(tmp_path, 8) is None
    savemat(tmp_path / "processed" / "22_exp_1.mat", {"p": np.zeros((6, 5)), "v": np.zeros((6, 5))})
    with pytest.raises(FileError, match=r"22_exp_1\.mat: a"):
        read_processed(tmp_path, 49)


def test_bodies_of_the_laboratory_are_read_by_cables(tmp_path: Path) -> None:
    (tmp_path / "identification").mkdir()
    savemat(tmp_path / "identification" / "par_3.mat", {"X": np.arange(1.0, 11.0)})
    (body,) = read_bodies(tmp_path).values()
    np.testing.assert_array_equal(body.vector, np.arange(2.0, 11.0))


@pytest.mark.shared
@pytest.mark.slow
def test_from_some_of_the_takes(shared: Path, tmp_path: Path, capsys: Capsys) -> None:
    """A folder with fewer takes than the paper had is reproduced as far as it goes."""
    grab, some = shared / "recordings" / "grab", tmp_path / "grab"
    for name in ("config", "markers", "identification"):
        shutil.copytree(grab / name, some / name)
    wanted = {"44_exp": (12, 13, 19, 20, 21), "33_exp": (), "22_exp": ()}
    (some / "processed").mkdir()
    (some / "vicon").mkdir()
    for kind, numbers in wanted.items():
        for number in numbers:
            shutil.copy(grab / "processed" / f"{kind}_{number}.mat", some / "processed")
            shutil.copy(grab / "vicon" / f"v_nat_f_{number}.txt", some / "vicon")
    answer = tmp_path / "answer.json"
    assert cli.run(["reproduce", "--recordings", str(some), "--json", str(answer)]) == 0
    table = json.loads(answer.read_text(encoding="utf-8"))
    assert table["format"] == "fidim-recordings-reproduction/1"
    assert table["eq47"]["its_data"]["takes"] == [12, 13, 19, 20, 21]
    assert [one["take"] for one in table["fig3"]["takes"]] == [12, 20]
    assert table["maximum_likelihood"][0]["cables"] == [4]
    assert "no filtered poses of takes 8, 9" in capsys.readouterr().out
