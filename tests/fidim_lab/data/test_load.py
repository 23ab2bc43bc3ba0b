"""`fidim_lab.data.load`: all windows as one table; MCAP and CSV campaigns alike."""

import subprocess
import sys

import numpy as np
import pytest

import fidim_lab.data
from fidim_lab.data.campaign import read_campaign, write_campaign
from fidim_lab.data.records import Campaign, Role, Window
from fidim_lab.errors import FileError


@pytest.fixture
def campaign(irma4) -> Campaign:
    rng = np.random.default_rng(1)

    def window(id_: str, role: Role) -> Window:
        lengths, currents = (np.round(rng.uniform(1.0, 3.0, size=(40, 4)), 4) for _ in range(2))
        markers = np.round(rng.normal(size=(40, 1, 3)), 6)
        further = {"temperature": np.round(rng.normal(size=40), 3)}
        return Window(id_, role, np.arange(40) / 100.0, markers, lengths, currents, np.array([1.0, 2.0, 3.0]), further)

    return Campaign("c", irma4, 100.0, (window("i01", Role.IDENTIFY), window("v01", Role.VALIDATE)))


@pytest.mark.parametrize("suffix", [".csv", ".mcap"])
def test_one_table_of_all_windows(campaign, tmp_path, suffix):
    write_campaign(tmp_path, campaign, suffix=suffix)
    loaded = fidim_lab.data.load(tmp_path)
    table = loaded.to_frame()
    lengths, currents = [f"l{k}" for k in range(1, 5)], [f"i{k}" for k in range(1, 5)]
    assert list(table.columns) == ["window", "role", "t", "x", "y", "z", *lengths, *currents, "temperature"]
    assert table.groupby("window", sort=False).size().to_dict() == {"i01": 40, "v01": 40}
    assert set(table[table.window == "v01"].role) == {"validate"}
    assert np.array_equal(table[table.window == "v01"][["x", "y", "z"]], campaign.windows[1].markers[:, 0])
    assert np.array_equal(loaded.to_frame("i01")[currents], campaign.windows[0].currents)
    assert loaded.robot.n == 4
    with pytest.raises(KeyError, match="there are i01, v01"):
        loaded.to_frame("i09")


def test_both_forms_are_the_same_campaign(campaign, tmp_path):
    write_campaign(tmp_path / "a", campaign)
    write_campaign(tmp_path / "b", campaign, suffix=".mcap")
    for one, other in zip(read_campaign(tmp_path / "a").windows, read_campaign(tmp_path / "b").windows, strict=True):
        assert (one.id, one.role) == (other.id, other.role)
        for name in ("t", "markers", "lengths", "currents"):
            assert np.array_equal(getattr(one, name), getattr(other, name)), name


def test_an_unfinished_window_is_no_campaign(campaign, tmp_path):
    write_campaign(tmp_path, campaign, suffix=".mcap")
    window = tmp_path / "windows" / "v01.mcap"
    window.write_bytes(window.read_bytes()[:-100])
    with pytest.raises(FileError, match=r"v01\.mcap stops after"):
        fidim_lab.data.load(tmp_path)


def test_importing_the_package_imports_no_library():
    code = "import sys, fidim_lab.data; sys.exit(any(name in sys.modules for name in ('numpy', 'pandas', 'pydantic')))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
