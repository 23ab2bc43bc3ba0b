"""Robot logs whose cables stand in another order than the robot file's, or count otherwise: told with the remedy."""

import contextlib
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from fidim_lab.app.cli import fidim
from fidim_lab.data.campaign import read_campaign

TAKES = ("i01", "i02", "i03")
MAP = 'format = "fidim-columns/1"\ntime = "t"\nunit = "m"\nup = "z"\n' + "".join(
    f'[[marker]]\nname = "{name}"\ncolumns = ["{p}x", "{p}y", "{p}z"]\n'
    for name, p in zip("ABCD", ("", "m2", "m3", "m4"), strict=True)
)
ZEROS = np.array([0.31, -0.12, 0.44, 0.05])
"""m, of the encoders: nobody knows them"""


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three equilibria of a robot, each with its recorded window."""
    folder = tmp_path_factory.mktemp("simulated")
    simulate = ["simulate", "--robot", "robot.toml", "--out", "sim", "--equilibria", "3", "--validate", "0"]
    simulate.append("--own-sensors")
    with contextlib.chdir(folder):
        for words in (["init", "robot"], simulate):
            done = CliRunner().invoke(fidim, words)
            assert done.exit_code == 0, done.output
    (folder / "map.toml").write_text(MAP, encoding="utf-8")
    cables = "".join(f'[[cable]]\nlength = "l{k}"\nswivel = "s{k}"\n' for k in range(1, 5))
    (folder / "log.toml").write_text(f'format = "fidim-log/1"\ntime = "t"\n{cables}', encoding="utf-8")
    return folder


def imported(
    simulated: Path,
    folder: Path,
    order: list[int],
    *options: str,
    takes: tuple[str, ...] = TAKES,
    zeros: bool = True,
    early: bool = False,
    counts: Callable[[np.ndarray], np.ndarray] = np.asarray,
) -> str:
    """What was said.

    order: which cable stands in each column of the logs; early: they have swivels, and begin while winches still move;
    counts: what the logs have of lengths (N, 4), m.
    """
    for name in takes:
        table = pd.read_csv(simulated / "sim" / "windows" / f"{name}.csv")
        for kind, columns in (("takes", [c for c in table if c[-1] in "xyz"]), ("logs", [f"l{k + 1}" for k in order])):
            (folder / kind).mkdir(exist_ok=True)
            one = table[["t", *columns]].copy()
            if kind == "logs":
                one[columns] = counts(one[columns].to_numpy() - zeros * ZEROS)
                one.columns = ["t", *(f"l{k}" for k in range(1, 5))]
            if kind == "logs" and early:
                turned = table[[f"s{k + 1}" for k in order]].to_numpy()
                one[[f"s{k}" for k in range(1, 5)]] = turned
                before = pd.concat([one.iloc[:1]] * 700, ignore_index=True)
                before["t"] = -7.0 + np.arange(700) / 100.0
                before[[f"l{k}" for k in range(1, 5)]] += 0.2 * np.linspace(1.0, 0.0, 700)[:, np.newaxis]
                one = pd.concat([before, one], ignore_index=True)
            one.to_csv(folder / kind / f"{name}.csv", index=False)
    arguments = ["csv", str(folder / "takes"), "--map", str(simulated / "map.toml")]
    arguments += ["--robot", str(simulated / "robot.toml"), "--log", str(folder / "logs" / "*.csv")]
    arguments += ["--log-map", str(simulated / "log.toml")] if early else []
    done = CliRunner().invoke(fidim, ["import", *arguments, "--out", str(folder / "out"), *options])
    assert done.exit_code == 0, (done.output, done.exception)
    return " ".join(done.output.split())


@pytest.mark.sampled(2)
@pytest.mark.parametrize("zeros", [True, False])
@pytest.mark.parametrize("order", [[1, 0, 2, 3], [0, 3, 2, 1], [3, 0, 1, 2]])
def test_another_order_is_told_with_the_option_that_sets_it_right(
    order: list[int], zeros: bool, simulated: Path, tmp_path: Path
):
    said = imported(simulated, tmp_path, order, zeros=zeros)
    wanted = ",".join(str(order.index(k) + 1) for k in range(4))
    assert f"give --cables {wanted}" in said
    windows = read_campaign(tmp_path / "out").windows
    assert all(window.encoder_zeros is None and window.currents is None for window in windows)
    again = tmp_path / "again"
    again.mkdir()
    said = imported(simulated, again, order, "--cables", wanted, zeros=zeros)
    assert "check" not in said
    found = [window.encoder_zeros for window in read_campaign(again / "out").windows]
    assert np.ptp(np.array(found, dtype=float), axis=0) == pytest.approx(0.0, abs=2e-4)


@pytest.mark.parametrize(
    ("counts", "says"),
    [
        (lambda lengths: lengths * [1, -1, 1, 1], "the log of cable 2 counts the other way round"),
        (lambda lengths: lengths * [1, 1, 2, 1], "the log of cable 3 moves 2 times as far as the poses"),
        (lambda lengths: lengths / (2.0 * np.pi), "the log of cable 1, 2, 3, 4 moves 0.159 times as far as the poses"),
        (lambda lengths: lengths - lengths[0], "has the same length in all windows, the poses have not"),
    ],
)
def test_logs_that_count_otherwise_are_named_and_blame_no_anchor(
    counts: Callable[[np.ndarray], np.ndarray], says: str, simulated: Path, tmp_path: Path
):
    assert says in imported(simulated, tmp_path, [0, 1, 2, 3], counts=counts)
    assert all(window.encoder_zeros is None for window in read_campaign(tmp_path / "out").windows)


def test_clocks_are_found_though_the_swivels_are_exchanged_too(simulated: Path, tmp_path: Path):
    said = imported(simulated, tmp_path, [1, 0, 2, 3], early=True)
    assert "give --cables 2,1,3,4" in said
    again = tmp_path / "again"
    again.mkdir()
    assert "check" not in imported(simulated, again, [1, 0, 2, 3], "--cables", "2,1,3,4", early=True)


def test_one_pose_tells_an_order_by_known_zeros_alone(simulated: Path, tmp_path: Path):
    for name, zeros in (("known", False), ("unknown", True)):
        (tmp_path / name).mkdir()
        said = imported(simulated, tmp_path / name, [1, 0, 2, 3], takes=TAKES[:1], zeros=zeros)
        assert ("give --cables 2,1,3,4" in said) is not zeros


def test_the_right_order_is_not_doubted(simulated: Path, tmp_path: Path):
    assert "check" not in imported(simulated, tmp_path, [0, 1, 2, 3])
    for take in json.loads((tmp_path / "out" / "import.json").read_text(encoding="utf-8"))["takes"]:
        assert not take["warnings"]


@pytest.mark.parametrize(
    ("options", "cause"),
    [
        (["--log", "*.csv", "--cables", "2,1,3"], "not an order of the numbers 1 to 4"),
        (["--log", "*.csv", "--cables", "a"], "is not numbers"),
        (["--cables", "2,1,3,4"], "--log names the log"),
    ],
)
def test_what_is_no_order_is_refused(options: list[str], cause: str, simulated: Path, tmp_path: Path):
    window = str(simulated / "sim" / "windows" / "i01.csv")
    arguments = ["csv", window, "--map", str(simulated / "map.toml"), "--robot", str(simulated / "robot.toml")]
    done = CliRunner().invoke(fidim, ["import", *arguments, "--out", str(tmp_path / "out"), *options])
    assert done.exit_code != 0
    assert cause in " ".join(f"{done.output} {done.exception}".split())
