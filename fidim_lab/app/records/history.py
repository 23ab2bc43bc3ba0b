"""`fidim ls`: the runs of a folder, who recorded them and when, how they ended, and what failed over all of them.

Only what lies in the folders is read; a run that cannot be read is listed with the reason.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.table import Table

from fidim_lab.app.formats.answer_file import write_answer
from fidim_lab.app.formats.dry_run_spec import FORMAT as DRY_RUN
from fidim_lab.app.formats.run_spec import NAME as RUN
from fidim_lab.app.formats.run_spec import RIG
from fidim_lab.app.terminal import console
from fidim_lab.data.campaign import INDEX
from fidim_lab.data.files.input_file import read_json
from fidim_lab.data.files.toml_file import read_toml_table
from fidim_lab.data.robot_file import read_robot
from fidim_lab.errors import FidimError, FileError
from procedures.outcomes import Outcome
from procedures.recording.journal import Entry, LineKind, read_journal
from procedures.steps import Accept, CheckWindow, GiveUp, GiveUpWithoutPower, Record

FORMAT = "fidim-history/1"
JOURNAL, RESULT, EXPLANATION, ROBOT = "journal.jsonl", "result.json", "explanation.json", "robot.toml"
FAILED = (Outcome.FAIL, Outcome.ERROR)
ACCEPT = Accept.__name__
CHECK = CheckWindow.__name__
RECORDING = (Record.__name__, CHECK, ACCEPT)
VERDICTS = (ACCEPT, GiveUp.__name__, GiveUpWithoutPower.__name__, "Verdict")
"""steps, as the journal calls them; the last as journals before 27 November 2026 called the one before it"""
SHOWN = 10
"""lines of each failure statistic"""


@dataclass(frozen=True)
class Run:
    """One folder."""

    folder: str
    when: str = ""
    """day and time at which it began, UTC"""
    who: str = ""
    robot: str = ""
    """the rig's name, or what the robot file holds"""
    verdict: str = ""
    """how the run ended; "cut off" where it did not say; "imported" or "simulated" where nothing was run"""
    windows: str = ""
    """accepted of planned; done of planned where the procedure records nothing"""
    found: str = ""
    """what identify and explain said, where they wrote it down"""
    note: str = ""
    problem: str = ""
    """why it cannot be read"""
    steps: dict[str, tuple[int, int]] = field(default_factory=dict[str, tuple[int, int]])
    """step → how often it failed, of how often it was done"""
    rejected: dict[str, tuple[int, int]] = field(default_factory=dict[str, tuple[int, int]])
    """window → how often its check rejected it, of how often it was recorded"""


def ls_command(folder: Path, json_file: Path | None, *, failures: bool) -> int:
    """List the runs in a folder (or the one that it is); returns 0. Raises FileError where there is no such folder."""
    runs = runs_of(folder)
    if not runs:
        console.out.print(f"No run in {folder}: fidim run and fidim dry-run leave a folder each.", markup=False)
    else:
        console.out.print(_table(runs))
    if failures and runs:
        for title, key in (("Steps that failed, over all runs", "steps"), ("Windows that were rejected", "rejected")):
            console.out.print(_statistic(title, _summed(runs, key)))
    write_answer(
        json_file, FORMAT, {"runs": runs, "failures": {key: _summed(runs, key) for key in ("steps", "rejected")}}
    )
    return 0


def runs_of(folder: Path) -> list[Run]:
    """The runs and campaigns in a folder, or the one that it is itself, the oldest first. Raises FileError."""
    if not folder.is_dir():
        raise FileError(folder, "", "no such folder.", hint="Give the folder in which runs are, such as runs.")
    places = [folder] if _is_run(folder) else sorted(one for one in folder.iterdir() if one.is_dir() and _is_run(one))
    return sorted((_read(place) for place in places), key=lambda run: (run.when, run.folder))


def _is_run(folder: Path) -> bool:
    return (folder / JOURNAL).exists() or (folder / INDEX).exists()


def _read(folder: Path) -> Run:
    try:
        told = _json(folder / RUN)
        facts: dict[str, Any] = {
            "folder": folder.name,
            "who": str(told.get("operator") or told.get("by") or ""),
            "note": str(told.get("note") or ""),
            "robot": _robot(folder),
            "found": _found(folder),
        }
        if not (folder / JOURNAL).exists():
            kind = "simulated" if (folder / "truth.json").exists() else "imported"
            return Run(**facts, verdict=kind, windows=_listed(folder))
        run = Run(**facts, **_journal(read_journal(folder / JOURNAL)))
        dry = told.get("format") == DRY_RUN
        if dry or told.get("embedded"):
            run = replace(run, verdict=f"{run.verdict}, rehearsal")
        if not dry:
            return run
        begun = datetime.fromtimestamp((folder / RUN).stat().st_mtime, UTC)  # its journal has the simulated time
        return replace(run, when=f"{begun:%Y-%m-%d %H:%M}")
    except (FidimError, OSError, ValueError) as error:
        return Run(folder.name, problem=str(error))


def _journal(entries: Sequence[Entry]) -> dict[str, Any]:
    begun = [entry for entry in entries if entry.kind == LineKind.RUN_STARTED]
    ended = [entry for entry in entries if entry.kind == LineKind.RUN_FINISHED]
    done = [entry for entry in entries if entry.kind == LineKind.STEP_FINISHED]
    planned = begun[0].data.get("windows", ()) if begun else ()
    return {
        "when": entries[0].wall.removesuffix("Z").replace("T", " ")[:16] if entries else "",
        "verdict": ended[-1].outcome.value if ended else "cut off",
        "windows": _counted_windows(done, len(planned)),
        "steps": _counted((entry.step, entry) for entry in done),
        "rejected": _counted((entry.window, entry) for entry in done if entry.step == CHECK),
    }


def _counted_windows(done: Sequence[Entry], planned: int) -> str:
    """How many of the planned windows were accepted. Where nothing was recorded: at how many the procedure did all."""
    judged = {entry.window: entry for entry in done if entry.step in VERDICTS}
    if judged and not any(entry.step in RECORDING for entry in done):
        well = [entry for entry in judged.values() if entry.outcome in (Outcome.PASS, Outcome.MARGINAL)]
        return f"{len(well)} of {planned} places done"
    return f"{sum(entry.step == ACCEPT for entry in judged.values())} of {planned}"


def _counted(entries: Iterable[tuple[str, Entry]]) -> dict[str, tuple[int, int]]:
    found = list(entries)
    every = Counter(name for name, _ in found)
    failed = Counter(name for name, entry in found if entry.outcome in FAILED)
    return {name: (failed[name], count) for name, count in every.items()}


def _summed(runs: Sequence[Run], key: str) -> dict[str, tuple[int, int]]:
    """Failures over all runs, the most frequent first; what never failed is left out."""
    failed: Counter[str] = Counter()
    every: Counter[str] = Counter()
    for run in runs:
        for name, (bad, count) in getattr(run, key).items():
            failed[name] += bad
            every[name] += count
    return {name: (bad, every[name]) for name, bad in failed.most_common() if bad}


def _robot(folder: Path) -> str:
    """The rig's name where there is one, else what the robot file holds."""
    if (folder / RIG).exists():
        return str(read_toml_table(folder / RIG).get("name", ""))
    if not (folder / ROBOT).exists():
        return ""
    robot = read_robot(folder / ROBOT)
    return f"{robot.n} cables, {robot.mass:g} kg"


def _found(folder: Path) -> str:
    result, explanation = _json(folder / RESULT), _json(folder / EXPLANATION)
    named = ", ".join(str(one.get("id")) for one in explanation.get("effects", ()) if isinstance(one, dict))
    verdict = str(explanation.get("verdict", ""))
    parts = [str(result.get("outcome", "")), f"{verdict}: {named}" if named else verdict]
    return "; ".join(part for part in parts if part)


def _listed(folder: Path) -> str:
    return str(len(read_toml_table(folder / INDEX).get("window", ())))


def _json(path: Path) -> dict[str, Any]:
    found = read_json(path) if path.exists() else {}
    return found if isinstance(found, dict) else {}


def _table(runs: Sequence[Run]) -> Table:
    table = Table(box=None, pad_edge=False)
    for name in ("run", "began, UTC", "who", "robot", "verdict", "windows", "found", "note"):
        table.add_column(name, overflow="fold")
    for run in runs:
        if run.problem:
            table.add_row(run.folder, "", "", "", "cannot be read", "", "", run.problem)
        else:
            table.add_row(run.folder, run.when, run.who, run.robot, run.verdict, run.windows, run.found, run.note)
    return table


def _statistic(title: str, counted: dict[str, tuple[int, int]]) -> Table:
    rows = [(name, str(bad), str(count)) for name, (bad, count) in list(counted.items())[:SHOWN]]
    none = ("none", "", "")
    return console.table(title, ("", "failed", "of"), rows or [none], box=None, pad_edge=False, title_justify="left")
