"""What goes on while a command computes, on standard error: what, since when, and how long it took here before.

How far an identification is cannot be known, but how long the last one of as many windows took can: durations are kept
beside the built kernels, by what was done, for each unit of size. Without a terminal nothing is printed.
"""

from contextlib import suppress
from pathlib import Path
from time import perf_counter
from types import TracebackType

from rich.markup import escape
from rich.progress import Progress, ProgressColumn, SpinnerColumn, Task, TaskID, TextColumn, TimeElapsedColumn
from rich.text import Text

from fidim_lab.app.terminal import console
from fidim_lab.data.files.input_file import read_json
from fidim_lab.data.files.json_file import write_json
from fidim_lab.errors import FileError
from fidim_lab.model.native import cache_folder

DURATIONS = "durations.json"
NEWEST = 0.5
"""weight of the newest duration in what is kept"""


def windows_of(folder: Path) -> int:
    """The size of a campaign for estimates: its window files; at least one."""
    with suppress(OSError):
        return max(len({path.stem for path in (folder / "windows").iterdir()}), 1)
    return 1


class Working:
    """`with Working("identifying", windows_of(folder)):`; `update` says more than the first words."""

    def __init__(self, what: str, size: float = 1.0, *, durations: Path | None = None) -> None:
        """size: what the duration grows with. durations: the file of earlier ones; default in the user's cache."""
        self._what, self._size = what, size
        self._file = cache_folder() / DURATIONS if durations is None else durations
        self._known = _read(self._file)
        self.expected = self._known.get(what, 0.0) * size
        """s, as before; 0: never done here"""
        columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn(), _Left(self.expected))
        self._bar = Progress(*columns, console=console.err, transient=True, disable=not console.err.is_terminal)
        self._task = TaskID(0)
        self._begun = 0.0

    def __enter__(self) -> "Working":
        self._bar.start()
        self._task = self._bar.add_task(f"{escape(self._what)} …", total=None)
        self._begun = perf_counter()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()
        if kind is None:
            self._keep(perf_counter() - self._begun)

    def update(self, text: str) -> None:
        """What is being done now."""
        self._bar.update(self._task, description=escape(text))

    def _keep(self, seconds: float) -> None:
        """For the next time; a cache that cannot be written is no fault."""
        new, old = seconds / self._size, self._known.get(self._what)
        kept = new if old is None else NEWEST * new + (1 - NEWEST) * old
        with suppress(OSError):
            self._file.parent.mkdir(parents=True, exist_ok=True)
            write_json(self._file, {**_read(self._file), self._what: round(kept, 3)})


class _Left(ProgressColumn):
    """How much of the expected time is left; nothing where nothing is known, or it has passed."""

    def __init__(self, expected: float) -> None:
        super().__init__()
        self._expected = expected

    def render(self, task: Task) -> Text:
        """As "about 12 s left"."""
        left = self._expected - (task.elapsed or 0.0)
        return Text(left_words(left) if self._expected > 0 else "", style="cyan")


def left_words(seconds: float) -> str:
    """An estimate in words, no more exact than it is."""
    if seconds <= 0:
        return "longer than before"
    return f"about {seconds:.0f} s left" if seconds < 100 else f"about {seconds / 60:.0f} min left"


def _read(file: Path) -> dict[str, float]:
    try:
        found = read_json(file)
        return {str(name): float(value) for name, value in found.items()}
    except (FileError, ValueError, AttributeError, TypeError):
        return {}
