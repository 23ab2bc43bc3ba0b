"""`fidim ls`: runs with who, when, verdict and notes; what failed over all of them."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from fidim_lab.app.cli import run
from fidim_lab.app.formats.run_spec import RunSpec, write_spec
from fidim_lab.app.session.run import RunOptions, make_spec
from fidim_lab.data.robot_file import PAPERS_ROBOT


def _journal(folder: Path, day: str, *lines: dict[str, Any], ended: str | None = "pass") -> None:
    folder.mkdir(parents=True)
    start = {"kind": "run-started", "text": "plan", "data": {"format": "fidim-journal/1", "windows": ["i01", "v01"]}}
    end = [] if ended is None else [{"kind": "run-finished", "outcome": ended}]
    every = [start, *lines, *end]
    with (folder / "journal.jsonl").open("w") as file:
        for number, line in enumerate(every, start=1):
            file.write(json.dumps({"number": number, "t": float(number), "wall": f"{day}T08:00:00Z", **line}) + "\n")


def _step(step: str, outcome: str, window: str = "") -> dict[str, Any]:
    return {"kind": "step-finished", "step": step, "outcome": outcome, "window": window}


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    folder = tmp_path / "runs"
    checked = [_step("CheckWindow", "fail", "i01"), _step("CheckWindow", "pass", "i01"), _step("Accept", "pass", "i01")]
    _journal(folder / "b-later", "2026-03-02", *checked, _step("Settle", "error"), ended="error")
    _journal(folder / "a-first", "2026-03-01", *checked, _step("Settle", "pass"), _step("Accept", "pass", "v01"))
    _journal(folder / "cut", "2026-03-03", ended=None)
    spec = RunSpec(plan=Path("/p"), rig=Path("/r"), out=Path("/o"), operator="Ada", note="new cables")
    write_spec(folder / "a-first", spec)
    shutil.copy(PAPERS_ROBOT, folder / "a-first" / "robot.toml")
    (folder / "a-first" / "result.json").write_text('{"outcome": "converged"}')
    told = {"verdict": "explained", "effects": [{"id": "air-drag-linear"}]}
    (folder / "a-first" / "explanation.json").write_text(json.dumps(told))
    (folder / "damaged").mkdir()
    (folder / "damaged" / "journal.jsonl").write_text("{nonsense\n{}\n")
    (folder / "no run").mkdir()
    return folder


def test_runs_are_listed_by_time_with_who_and_what_came_of_them(runs: Path, tmp_path: Path) -> None:
    assert run(["ls", str(runs), "--json", str(tmp_path / "h.json")]) == 0
    told = json.loads((tmp_path / "h.json").read_text())
    assert [one["folder"] for one in told["runs"]] == ["damaged", "a-first", "b-later", "cut"]
    first = told["runs"][1]
    assert (first["when"], first["who"], first["note"]) == ("2026-03-01 08:00", "Ada", "new cables")
    assert (first["robot"], first["windows"], first["verdict"]) == ("4 cables, 11 kg", "2 of 2", "pass")
    assert first["found"] == "converged; explained: air-drag-linear"
    assert [one["verdict"] for one in told["runs"][2:]] == ["error", "cut off"]
    assert "journal.jsonl" in told["runs"][0]["problem"]


def test_a_run_on_embedded_devices_is_listed_as_a_rehearsal(runs: Path, tmp_path: Path) -> None:
    write_spec(runs / "b-later", RunSpec(plan=Path("/p"), rig=Path("/r"), out=Path("/o"), embedded=True))
    assert run(["ls", str(runs), "--json", str(tmp_path / "h.json")]) == 0
    told = {one["folder"]: one["verdict"] for one in json.loads((tmp_path / "h.json").read_text())["runs"]}
    assert (told["a-first"], told["b-later"]) == ("pass", "error, rehearsal")


def test_failures_are_counted_over_all_runs(runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["ls", str(runs), "--failures", "--json", str(tmp_path / "h.json")]) == 0
    told = json.loads((tmp_path / "h.json").read_text())["failures"]
    assert told == {"steps": {"CheckWindow": [2, 4], "Settle": [1, 2]}, "rejected": {"i01": [2, 4]}}
    said = capsys.readouterr().out
    assert "Steps that failed, over all runs" in said
    assert "new cables" in said


def test_a_folder_without_runs_and_none_at_all(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["ls", str(tmp_path)]) == 0
    assert "No run in" in capsys.readouterr().out
    assert run(["ls", str(tmp_path / "nowhere")]) == 2
    assert "no such folder" in capsys.readouterr().err


def test_who_and_why_are_kept_with_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LOGNAME", "grace")
    options = RunOptions(
        plan=tmp_path / "p.toml", rig=tmp_path / "r.toml", out=tmp_path / "o", listing=False, embedded=True,
        unattended=False, answers=(), settings=(), max_hours=None, quiet_hours=None, on_finish="", on_fault="", seed=1,
        hide=(), procedure="identify", stay=False, tcp=None, note="gusty",
    )  # fmt: skip
    spec = make_spec(options)
    assert (spec.operator, spec.note) == ("grace", "gusty")


def test_a_procedure_that_records_nothing_counts_what_it_did(tmp_path: Path) -> None:
    tried = [_step("Settle", "pass", "i01"), _step("GiveUp", "pass", "i01"), _step("GiveUp", "fail", "v01")]
    _journal(tmp_path / "check", "2026-03-01", *tried)
    left_out = [_step("Record", "pass", "i01"), _step("Accept", "pass", "i01"), _step("GiveUp", "skipped", "v01")]
    _journal(tmp_path / "run", "2026-03-02", *left_out)
    assert run(["ls", str(tmp_path), "--json", str(tmp_path / "h.json")]) == 0
    told = json.loads((tmp_path / "h.json").read_text())["runs"]
    assert [one["windows"] for one in told] == ["1 of 2 places done", "1 of 2"]
