"""What is answered before anything is sent to a drive."""

import io
import sys
from pathlib import Path

import pytest

from fidim_lab.app.cli import run

SIMULATED = Path(__file__).parents[4] / "examples" / "rigs" / "simulated.toml"


@pytest.mark.parametrize(("typed", "says"), [("n\n", "nothing was sent"), ("", "nobody can answer: --yes confirms it")])
@pytest.mark.parametrize("command", [("brake", str(SIMULATED), "winch 1", "--release"), ("power-off", str(SIMULATED))])
def test_nothing_is_sent_where_nobody_says_that_the_load_is_secured(
    tmp_path, monkeypatch, capsys, command, typed, says
):
    monkeypatch.setenv("FIDIM_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr(sys, "stdin", io.StringIO(typed))
    assert run(command) == 1
    told = capsys.readouterr().err
    assert "othing was sent" in told
    assert says.lower() in told.lower()


def test_trials_are_listed_without_a_name_and_not_begun_without_one(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("FIDIM_RUNTIME_DIR", str(tmp_path))
    assert run(["commission", str(SIMULATED), "--list"]) == 0
    assert "quick stop" in capsys.readouterr().out
    assert run(["commission", str(SIMULATED)]) == 2
    assert "--by is missing" in capsys.readouterr().err
