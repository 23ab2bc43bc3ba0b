"""What is answered before anything is sent to a drive."""

import io
import sys
from pathlib import Path

from fidim_lab.app.cli import run

SIMULATED = Path(__file__).parents[4] / "examples" / "rigs" / "simulated.toml"


def test_a_brake_is_not_released_where_the_load_is_not_secured(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("FIDIM_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr(sys, "stdin", io.StringIO("n\n"))
    assert run(["brake", str(SIMULATED), "winch 1", "--release"]) == 1
    assert "nothing was sent" in capsys.readouterr().err


def test_trials_are_listed_without_a_name_and_not_begun_without_one(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("FIDIM_RUNTIME_DIR", str(tmp_path))
    assert run(["commission", str(SIMULATED), "--list"]) == 0
    assert "quick stop" in capsys.readouterr().out
    assert run(["commission", str(SIMULATED)]) == 2
    assert "--by is missing" in capsys.readouterr().err
