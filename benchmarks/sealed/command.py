"""`fidim benchmark explain`: seal, commit, explain, open, score. What is done already is not done again."""

import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from rich.markdown import Markdown

from benchmarks.sealed.campaigns import SealedRecipe, quiet_campaign
from benchmarks.sealed.cases import SecretKind, lacking
from benchmarks.sealed.child import ChildOutcome, ChildTask, in_child
from benchmarks.sealed.folder import (
    BenchmarkFolder,
    commit,
    keep_settings,
    opened,
    read_json,
    verify,
    write_json,
)
from benchmarks.sealed.loudness import QUIET
from benchmarks.sealed.seal import SealTask, recipe_of, seal
from benchmarks.sealed.tally import ScoredCampaign, Tally, judged
from benchmarks.sealed.words import page
from fidim_lab.app.terminal import console
from fidim_lab.app.terminal.spread_out import workers
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Campaign
from fidim_lab.errors import FidimError, SetupError
from fidim_lab.mapping import Map

Action = Callable[[Campaign], ChildOutcome]
BENCHMARKS = {"explain": "names of physics that was left out, on sealed campaigns of the independent simulators"}


@dataclass(frozen=True)
class BenchmarkOptions:
    """As on the command line."""

    out: Path
    campaigns: int
    only: tuple[int, ...]
    """numbers; empty: 1 to `campaigns`"""
    seed: int
    equilibria: int
    validation: int
    cap: float
    """s of CPU time for one campaign"""
    processes: int | None
    scheduler: str | None
    json_file: Path | None
    page: Path | None
    without: str = ""
    """an effect that every campaign hides and the catalogue lacks, or a key of `cases.TURNS`"""
    kind: str | None = None
    """name of a `SecretKind` in small letters, of all campaigns; None: what the deck deals"""
    surveyed: bool = False
    """whether every robot file is off by survey errors"""

    @property
    def numbers(self) -> tuple[int, ...]:
        """Which campaigns."""
        return tuple(sorted(set(self.only))) or tuple(range(1, self.campaigns + 1))

    @property
    def tasks(self) -> list[SealTask]:
        """What to make."""
        windows = (self.equilibria, self.validation)
        kind = None if self.kind is None else SecretKind[self.kind.upper()]
        return [
            SealTask(self.out, self.seed, number, windows, lacking(self.without, number), kind, self.surveyed)
            for number in self.numbers
        ]

    @property
    def text(self) -> str:
        """As it is typed, without what changes nothing of the result."""
        which = "".join(f" --only {n}" for n in self.only) or f" --campaigns {self.campaigns}"
        which += f" --without {self.without}" if self.without else ""
        which += (f" --kind {self.kind}" if self.kind else "") + " --surveyed" * self.surveyed
        return (
            f"fidim benchmark explain{which} --seed {self.seed} --equilibria {self.equilibria} "
            f"--validate {self.validation} --cap {self.cap:g}"
        )


def benchmark_command(options: BenchmarkOptions, *, explainer: Action | None = None) -> int:
    """Do it all, print, write; returns 0: a result is a result.

    explainer: instead of `explain` in a child process. Raises SetupError for an --out that holds another benchmark,
    RefusedError where a sealed truth was changed.
    """
    tally, commitment = run_benchmark(options, explainer or partial(_explained, options))
    text = page(tally, options.text, commitment, options.without)
    if options.json_file is not None:
        write_json(options.json_file, {**tally.table, "commitment": commitment, "command": options.text})
    if options.page is not None:
        _write_page(options.page, text)
    if sys.stdout.isatty():
        console.out.print(Markdown(text))
    else:
        console.out.print(text, markup=False)
    return 0


def run_benchmark(options: BenchmarkOptions, explainer: Action) -> tuple[Tally, str]:
    """The result, and the hash that was committed to. Goes on where an earlier call was cut off."""
    folder, tasks = BenchmarkFolder(options.out), options.tasks
    names = [task.name for task in tasks]
    keep_settings(folder, {"command": options.text})
    with workers(options.processes, None) as spread:  # sealing and opening need this machine's disk
        _told(spread(seal, tasks), len(tasks), "sealed")
    commitment = commit(folder, names)
    console.out.print(f"truth sealed: SHA-256 {commitment} of {len(names)} files ({folder.commitment})", markup=False)
    with workers(options.processes, options.scheduler) as spread:
        _explain_all(folder, names, explainer, spread)
    verify(folder, names)
    with workers(options.processes, None) as spread:
        left = [task for task in tasks if not folder.loudness(task.name).exists()]
        _told(spread(partial(measure, cap=options.cap), left), len(left), "measured")
    return Tally(tuple(_judged(folder, name, options.without) for name in names)), commitment


def _explained(options: BenchmarkOptions, campaign: Campaign) -> ChildOutcome:
    (task,) = (task for task in options.tasks if task.name == campaign.name)
    return in_child(ChildTask.EXPLAIN, campaign, options.cap, task.without)


def _explain_all(folder: BenchmarkFolder, names: list[str], explainer: Action, spread: Map) -> None:
    """Each answer is written as it comes."""
    left = [name for name in names if not folder.answer(name).exists()]
    outcomes = spread(explainer, (read_campaign(folder.campaign(name)) for name in left))
    for done, (name, outcome) in enumerate(zip(left, outcomes, strict=True), start=1):
        write_json(folder.answer(name), outcome.table)
        took = f"{outcome.cpu:.0f} s, {1e-6 * outcome.nodes:.2f} million nodes"
        console.err.print(f"explained {done}/{len(left)}: {name} in {took} {outcome.why}", markup=False)


def measure(task: SealTask, cap: float) -> str:
    """Open one campaign, measure how loud its secret is, and write that; a failure is written as well.

    Of several effects each is measured alone, too: one that nobody could see is hidden behind a loud one.
    """
    folder = BenchmarkFolder(task.out)
    recipe: SealedRecipe = recipe_of(task, opened(folder, task.name))
    whole = _loud(recipe, cap)
    parts = [_loud(replace(recipe, hide=(hide,)), cap) for hide in recipe.hide] if len(recipe.hide) > 1 else [whole]
    write_json(folder.loudness(task.name), whole.table | {"each": [part.answer for part in parts]})
    return task.name


def _loud(recipe: SealedRecipe, cap: float) -> ChildOutcome:
    try:
        quiet = quiet_campaign(recipe, QUIET)
    except FidimError as error:
        return ChildOutcome(None, str(error), 0.0, 0.0)
    return in_child(ChildTask.LOUDNESS, quiet, cap)


def _judged(folder: BenchmarkFolder, name: str, without: str) -> ScoredCampaign:
    files = opened(folder, name), read_json(folder.answer(name)), read_json(folder.loudness(name))
    return judged(name, *files, without=bool(without))


def _told(done: Iterable[str], count: int, what: str) -> None:
    for k, name in enumerate(done):
        console.err.print(f"{what} {k + 1}/{count}: {name}", markup=False)


def _write_page(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise SetupError(f"--page {path}: cannot be written ({error.strerror}).") from error
