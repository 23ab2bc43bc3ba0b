"""How long one whole explanation takes, and each of its parts; and a look after a window of a session.

    python -m benchmarks.explain_pace                        all kinds, and a session
    python -m benchmarks.explain_pace null one --warm        some kinds, with kernels in the cache from before

Campaigns of 12 + 6 windows come from `fidim simulate`; each is explained in a process of its own that begins with an
empty cache of kernels (but for --warm), from the start of Python to the explanation. The targets are wall seconds on
two idle cores; where others compute too, CPU seconds (of the compiler's, too) tell more.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

from benchmarks.page import ROOT, table, write_section

KINDS: Mapping[str, tuple[float, tuple[str, ...]]] = {
    "null": (7.0, ()),
    "one": (15.0, ("air-drag-linear:c=0.4",)),
    "elastic": (40.0, ("cable-elasticity:EA=4e4",)),
    "two": (40.0, ("anchor-offset:cable=2,dx=0.004", "rotational-drag:c=0.02")),
    "unknown": (40.0, ("unknown-eddy",)),
}
"""wall seconds allowed, and what is hidden"""
PARTS: Mapping[str, tuple[str, ...]] = {
    "clean": ("fidim_lab.mismatch.explain.clean",),
    "baseline": ("fidim_lab.mismatch.rounds.fit_baseline",),
    "audit": ("fidim_lab.mismatch.rounds.audit",),
    "scores": ("fidim_lab.mismatch.selection.trials.view", "fidim_lab.mismatch.selection.trials.tones"),
    "refits": tuple(
        f"fidim_lab.mismatch.selection.{place}.refit"
        for place in ("search", "whole_windows", "trials", "additions", "generalise", "confounders")
    ),
    "held-out": ("fidim_lab.mismatch.selection.trials.predict", "fidim_lab.mismatch.fitting.baseline.predict"),
    "restored": ("fidim_lab.mismatch.rounds.restored",),
    "told": ("fidim_lab.mismatch.explain.tell",),
    "no name": ("fidim_lab.mismatch.explain.with_unknown",),
}
"""functions by where they are called from; the time of an inner one is its own alone"""
ALLOWED = 2.0
"""s for a look after a window"""
LOOKS = (3, 8, 12)


class Shares:
    """Wall seconds of each part, without those of the parts inside it."""

    def __init__(self) -> None:
        self.seconds = dict.fromkeys(PARTS, 0.0)
        self._inside: list[float] = []

    def timed(self, part: str, work: Callable[..., Any]) -> Callable[..., Any]:
        def wrapped(*args: Any, **kwargs: Any) -> Any:
            begin = perf_counter()
            self._inside.append(0.0)
            try:
                return work(*args, **kwargs)
            finally:
                whole = perf_counter() - begin
                self.seconds[part] += whole - self._inside.pop()
                if self._inside:
                    self._inside[-1] += whole

        return wrapped


def child(folder: Path) -> None:
    """Explain one campaign; figures as JSON on standard output."""
    import importlib

    from fidim_lab.data.campaign import read_campaign
    from fidim_lab.mismatch.explain import explain

    shares = Shares()
    for part, places in PARTS.items():
        for place in places:
            name, function = place.rsplit(".", 1)
            module = importlib.import_module(name)
            setattr(module, function, shares.timed(part, getattr(module, function)))
    imported = process_time()
    campaign = read_campaign(folder)
    found = explain(campaign)
    compiler = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(
        json.dumps(
            {
                "verdict": found.verdict.value,
                "effects": [cause.id for cause in found.effects],
                "cpu": process_time(),
                "compiler": compiler.ru_utime + compiler.ru_stime,
                "imported": imported,
                "parts": shares.seconds,
            }
        )
    )


def looks(folder: Path) -> None:
    """A session window by window; seconds of each look as JSON."""
    from fidim_lab.data.campaign import read_campaign
    from fidim_lab.mismatch.online_monitor import Watch

    campaign = read_campaign(folder)
    watch = Watch(campaign.robot)
    told: list[tuple[int, float, float, str]] = []
    for number, window in enumerate(campaign.windows[: max(LOOKS)], start=1):
        begin, cpu = perf_counter(), process_time()
        found = watch.look([window])
        told.append((number, perf_counter() - begin, process_time() - cpu, found.says))
    print(json.dumps([one for one in told if one[0] in LOOKS]))


def run(work: str, folder: Path, cache: Path) -> tuple[Any, float]:
    """What a child says, and its wall seconds from the start of Python."""
    begin = perf_counter()
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.explain_pace", work, str(folder)],
        env={**os.environ, "XDG_CACHE_HOME": str(cache), "OPENBLAS_NUM_THREADS": "1"},
        cwd=ROOT,
        stdout=subprocess.PIPE,
        check=True,
    )
    return json.loads(done.stdout.splitlines()[-1]), perf_counter() - begin


def simulated(kind: str, folder: Path, robot: Path, seed: int) -> Path:
    """A campaign of this kind, once."""
    campaign = folder / f"{kind}-{seed}"
    if not campaign.exists():
        hide = [word for text in KINDS[kind][1] for word in ("--hide", text)]
        command = "import sys; from fidim_lab.app.cli import run; sys.exit(run(sys.argv[1:]))"
        arguments = ["simulate", "--robot", str(robot), "--out", str(campaign), "--seed", str(seed), *hide]
        subprocess.run([sys.executable, "-c", command, *arguments], check=True, stdout=subprocess.DEVNULL)
    return campaign


def explained(kinds: Sequence[str], folder: Path, robot: Path, options: argparse.Namespace) -> str:
    rows: list[Sequence[object]] = []
    shares: list[Sequence[object]] = []
    for kind in kinds:
        campaign = simulated(kind, folder, robot, options.seed)
        with tempfile.TemporaryDirectory() as empty:
            cache = folder / "cache" if options.warm else Path(empty)
            if options.warm:
                run("child", campaign, cache)
            found, wall = run("child", campaign, cache)
        named = " + ".join(found["effects"]) or found["verdict"]
        cpu, compiler, allowed = found["cpu"], found["compiler"], KINDS[kind][0]
        hidden = " + ".join(KINDS[kind][1]) or "nothing"
        rows.append((kind, hidden, named, f"{wall:.1f}", f"{allowed:g}", f"{cpu:.1f}", f"{compiler:.1f}"))
        parts = [f"{found['parts'][part]:.1f}" for part in PARTS]
        shares.append((kind, f"{found['imported']:.1f}", *parts))
    head = ["", "hidden", "named", "wall s", "allowed", "CPU s", "compiler's CPU s"]
    text = table(head, rows) + "\n\nWall seconds of each part (of imports: CPU):\n\n"
    return text + table(["", "imports", *PARTS], shares)


def watched(folder: Path, robot: Path, options: argparse.Namespace) -> str:
    rows: list[Sequence[object]] = []
    for kind in ("null", "one"):
        campaign = simulated(kind, folder, robot, options.seed)
        with tempfile.TemporaryDirectory() as empty:
            found, _ = run("looks", campaign, folder / "cache" if options.warm else Path(empty))
        rows += [(kind, number, f"{wall:.2f}", f"{cpu:.2f}", says) for number, wall, cpu, says in found]
    head = ["", "after window", "wall s", "CPU s", "what is told"]
    return f"Allowed: {ALLOWED:g} s wall.\n\n" + table(head, rows)


def main() -> None:
    if len(sys.argv) == 3 and sys.argv[1] in ("child", "looks"):
        {"child": child, "looks": looks}[sys.argv[1]](Path(sys.argv[2]))
        return
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kinds", nargs="*", choices=[*KINDS, "session", []], metavar="KIND")
    parser.add_argument("--robot", type=Path, default=None, help="robot file; default the paper's")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", type=Path, default=None, help="where campaigns are kept for the next time")
    parser.add_argument("--warm", action="store_true", help="kernels in the cache from a run before")
    parser.add_argument("--no-page", action="store_true", help="print only")
    options = parser.parse_args()
    from fidim_lab.data.robot_file import PAPERS_ROBOT

    robot, kinds = options.robot or PAPERS_ROBOT, options.kinds or [*KINDS, "session"]
    command = "python -m benchmarks.explain_pace " + " ".join(sys.argv[1:])
    busy = f"Load of the machine before: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores."
    with tempfile.TemporaryDirectory() as made:
        folder = options.folder or Path(made)
        folder.mkdir(parents=True, exist_ok=True)
        sections: list[tuple[str, str]] = []
        if timed := [kind for kind in kinds if kind in KINDS]:
            title = "One explanation" + (", kernels in the cache" if options.warm else ", nothing in the cache")
            sections.append((title, f"{busy}\n\n{explained(timed, folder, robot, options)}"))
        if "session" in kinds:
            sections.append(("A look after a window", f"{busy}\n\n{watched(folder, robot, options)}"))
    for title, text in sections:
        print(f"{title}\n\n{text}\n")
        if not options.no_page:
            write_section("explain-pace", title, command.strip(), text)


if __name__ == "__main__":
    main()
