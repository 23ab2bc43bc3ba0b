"""What lies in the run's folder for the screens Result and Why: read anew when a file changes.

`read_result_files` is pure but for the files; `ResultFiles` is what it found. An unreadable file is said, not hidden.
`ResultFilesWatch` reads aside from the event loop: the keys do not wait for a file.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from drivers.ports import Clock
from fidim_lab.app.formats.explanation_parts import EffectTable, ExplanationPart, WhereTable
from fidim_lab.app.tui.aside import Aside, StalledError
from fidim_lab.data.files.mistakes import read_json_as
from fidim_lab.errors import FileError
from fidim_lab.identification.results.result_file import ResultTable, read_result
from fidim_lab.mismatch.conclusion.parts import Before, HeldOutFigures, Ranked

RESULT = "result.json"
EXPLANATION = "explanation.json"
EVERY = 1.0
"""s between two looks at the files"""


_UNKNOWN = Before(before=None, after=None)


class ShownExplanation(ExplanationPart):
    """As much of "fidim-explanation/1" as the screen shows."""

    format: Literal["fidim-explanation/1"]
    verdict: str
    message: str
    effects: tuple[EffectTable, ...] = ()
    where: tuple[WhereTable, ...] = ()
    held_out: HeldOutFigures = HeldOutFigures(chi2_per_dof=_UNKNOWN, rms_mm=_UNKNOWN)
    ranking: tuple[Ranked, ...] = ()
    next_experiment: str | None = None


@dataclass(frozen=True)
class ResultFiles:
    """What was found, and what could not be read."""

    folder: Path | None = None
    result: ResultTable | None = None
    last: ResultTable | None = None
    last_folder: str = ""
    explanation: ShownExplanation | None = None
    problems: tuple[str, ...] = ()


def stamp(folder: Path | None) -> tuple[float, ...]:
    """Changes when one of the files does."""
    if folder is None:
        return ()
    return tuple(_changed(folder / name) for name in (RESULT, EXPLANATION))


def read_result_files(folder: Path | None) -> ResultFiles:
    """The run's result, that of the session before it beside it, the explanation. Raises nothing."""
    if folder is None:
        return ResultFiles()
    problems: list[str] = []
    result = _result(folder, problems)
    explanation = _explanation(folder / EXPLANATION, problems)
    before = _session_before(folder)
    last = None if before is None else _result(before, problems)
    return ResultFiles(folder, result, last, "" if before is None else before.name, explanation, tuple(problems))


class ResultFilesWatch:
    """Keeps `found` as new as the files are. `run` is a task for as long as the screen lives."""

    def __init__(self, clock: Clock) -> None:
        self.found = ResultFiles()
        self._clock = clock
        self._aside = Aside(clock)
        self._stamp: tuple[float, ...] | None = None

    async def run(self, folder: Callable[[], Path | None]) -> None:
        """Look at the files of what is the run's folder by then, until cancelled."""
        while True:
            await self._look(folder())
            await self._clock.sleep(EVERY)

    async def _look(self, folder: Path | None) -> None:
        if folder != self.found.folder:  # another run: a share that stalls there is no reason not to read here
            self.found, self._stamp, self._aside = ResultFiles(folder), None, Aside(self._clock)
        before = self._stamp
        try:
            told = await self._aside.run(lambda: _newer(folder, before))
        except Exception as error:  # whatever is in those files, this screen goes on
            says = str(error) if isinstance(error, StalledError) else f"cannot be read: {type(error).__name__}: {error}"
            self._stamp, self.found = None, replace(self.found, problems=(f"{folder}: {says}",))
            return
        if told is not None:
            self._stamp, self.found = told


def _newer(folder: Path | None, before: tuple[float, ...] | None) -> tuple[tuple[float, ...], ResultFiles] | None:
    """The files and their stamp; None where they are as before."""
    now = stamp(folder)
    return None if now == before else (now, read_result_files(folder))


def _changed(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


def _result(folder: Path, problems: list[str]) -> ResultTable | None:
    try:
        return read_result(folder / RESULT) if (folder / RESULT).exists() else None
    except FileError as error:
        problems.append(str(error))
        return None


def _explanation(path: Path, problems: list[str]) -> ShownExplanation | None:
    try:
        return read_json_as(path, ShownExplanation.model_validate) if path.exists() else None
    except FileError as error:
        problems.append(str(error))
        return None


def _session_before(folder: Path) -> Path | None:
    """The run folder beside this one with the newest result that is not newer than this run."""
    own = _changed(folder / RESULT) or float("inf")
    try:
        others = [path for path in folder.parent.iterdir() if path != folder and (path / RESULT).exists()]
    except OSError:
        return None
    older = [(when, path) for path in others if 0.0 < (when := _changed(path / RESULT)) < own]
    return max(older)[1] if older else None
