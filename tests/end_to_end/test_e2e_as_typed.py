"""The command as it is typed, wrongly: exit code, one sentence, no traceback, and nothing left behind."""

import subprocess
import sys

import pytest

from fidim_lab.app import cli

ROBOT = "fidim_lab/data/robots/irma4.toml"


@pytest.fixture
def here(tmp_path, monkeypatch, irma4_file):
    """A folder with a robot file that has a mistake, one that no plan fits, and a run folder that is taken."""
    good = irma4_file.read_text()
    (tmp_path / "bad.toml").write_text(good.replace("\nmass", "\nmasss"))
    limits = next(line for line in good.splitlines() if line.startswith("tension ="))
    (tmp_path / "tight.toml").write_text(good.replace(limits, "tension = [90.0, 95.0]"))
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe")
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "notes.txt").write_text("mine")
    monkeypatch.chdir(tmp_path)
    return tmp_path


WRONG = {
    "option": (["--equilibria-count", "3"], 2, "No such option '--equilibria-count'"),
    "value": (["--seed", "one"], 2, "Invalid value for '--seed'"),
    "missing file": (["--robot", "none.toml"], 2, "fidim: none.toml: no such file"),
    "wrong key": (["--robot", "bad.toml"], 2, "platform, masss: unknown key"),
    "no text": (["--robot", "binary.toml"], 2, "fidim: binary.toml: byte 0: is not UTF-8 text"),
    "taken folder": (["--out", "taken"], 2, "fidim: taken: the folder is not empty."),
    "file as folder": (
        ["--out", "taken/notes.txt"],
        2,
        "fidim: --out taken/notes.txt exists already and is a file; it was not changed.",
    ),
    "impossible folder": (
        ["--out", "taken/notes.txt/run", "--equilibria", "1", "--validate", "0"],
        2,
        "fidim: --out taken/notes.txt/run: cannot be written: Not a directory.",
    ),
    "effect": (["--hide", "gremlins"], 2, "fidim: --hide gremlins: no effect is called 'gremlins'. Known: "),
    "effect's value": (["--hide", "air-drag-linear:c=x"], 2, "c is 'x', which is not a finite number"),
    "limits": (["--robot", "tight.toml"], 1, "fidim: Only 0 of 15 equilibria were found"),
}


@pytest.mark.parametrize("case", WRONG)
@pytest.mark.sampled(2)
def test_what_is_typed_wrongly_is_a_sentence(here, capsys, case):
    arguments, code, says = WRONG[case]
    before = sorted(here.rglob("*"))
    assert cli.run(["dry-run", *arguments]) == code
    said = capsys.readouterr()
    assert says in said.err
    assert "Traceback" not in said.err + said.out
    assert len([line for line in said.err.splitlines() if line.startswith(("fidim:", "Error:"))]) == 1
    assert sorted(here.rglob("*")) == before


def test_a_taken_folder_is_found_before_any_planning(here, monkeypatch):
    monkeypatch.setattr("fidim_lab.app.session.dry_run_plan.random_plan", lambda *_: pytest.fail("planned for nothing"))
    assert cli.run(["dry-run", "--out", "taken"]) == 2


@pytest.mark.parametrize("debug", [False, True])
def test_a_process_shows_a_traceback_only_when_asked(here, debug):
    command = [sys.executable, "-c", "from fidim_lab.app.cli import main; main()", "dry-run", "--robot", "bad.toml"]
    ended = subprocess.run([*command, *["--debug"] * debug], capture_output=True, text=True, timeout=60)
    assert ended.returncode == 2
    assert ("Traceback" in ended.stderr) == debug
    assert ended.stderr.splitlines()[-1].startswith("fidim: bad.toml: ")
    assert ended.stdout == ""


@pytest.mark.slow
def test_two_processes_with_the_same_seed_write_the_same_bytes(tmp_path):
    """Also where Python hashes differently in each."""
    folders = [tmp_path / "a", tmp_path / "b"]
    script = "from fidim_lab.app.cli import main; main()"
    for folder, hashes in zip(folders, ("1", "2"), strict=True):
        command = ["dry-run", "--seed", "3", "--equilibria", "1", "--validate", "0", "--out", str(folder)]
        environment = {"PATH": "/usr/bin:/bin", "PYTHONHASHSEED": hashes, "HOME": str(tmp_path)}
        ended = subprocess.run(
            [sys.executable, "-c", script, *command], capture_output=True, text=True, timeout=120, env=environment
        )
        assert ended.returncode == 0, ended.stderr
    for name in ("windows/i01.csv", "campaign.toml", "plan.toml", "truth.json", "journal.jsonl", "raw/can.log"):
        assert (folders[0] / name).read_bytes() == (folders[1] / name).read_bytes(), name
