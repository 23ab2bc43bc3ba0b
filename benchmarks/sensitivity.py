"""How many answers of `explain` change when a threshold is halved or doubled.

    python -m benchmarks.sensitivity                             every threshold; goes on where it was cut off
    python -m benchmarks.sensitivity --of Shared --cases null two    some thresholds, some campaigns
    python -m benchmarks.sensitivity --page                      what is known so far, as a page of docs

The campaigns are those of `benchmarks.golden`. An answer is the verdict with the names and cables of what is told; what
takes more than so many times its usual CPU time has changed, too. A threshold that a campaign never reads cannot change
its answer, and is not tried on it. A share, and a chance near 1, is halved and doubled as what it lacks to 1.
"""

import argparse
import json
import math
import resource
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from importlib import import_module
from time import process_time
from typing import Any

from benchmarks.page import ROOT, table, write_section

ANSWERS = ROOT / "build" / "sensitivity.json"
STAGES = {
    "Shared": "fidim_lab.mismatch.thresholds",
    "Cleaning": "fidim_lab.mismatch.cleaning.thresholds",
    "Conclusion": "fidim_lab.mismatch.conclusion.thresholds",
    "Residual": "fidim_lab.mismatch.residuals.thresholds",
    "Score": "fidim_lab.mismatch.scores.thresholds",
    "Selection": "fidim_lab.mismatch.selection.thresholds",
    "UnknownForce": "fidim_lab.mismatch.unknown_force.thresholds",
}
FACTORS = (0.5, 2.0)
LONGEST = 6.0
"""times the usual CPU time"""
NEAR_ONE = 0.8
"""a share beyond it is changed as what it lacks to 1"""


@dataclass(frozen=True)
class ThresholdChange:
    """One threshold, changed by a factor."""

    stage: str
    name: str
    factor: float

    @property
    def key(self) -> str:
        return f"{self.stage}.{self.name} × {self.factor:g}"


UNCHANGED = ThresholdChange("Shared", "enough", 1.0)


def changed(value: Any, factor: float) -> Any:
    """A threshold by a factor; whole numbers stay whole, and at least 1."""
    if isinstance(value, tuple):
        return tuple(changed(one, factor) for one in value)
    if isinstance(value, int):
        return max(1, round(value * factor))
    return 1 - (1 - value) * factor if NEAR_ONE < value < 1 else value * factor


def in_child(change: ThresholdChange, cases: Sequence[str], cap: float) -> dict[str, Any]:
    """Answers to these campaigns with one threshold changed, each with its CPU time and the thresholds it read."""
    found: dict[str, Any] = {}
    command = [sys.executable, "-m", "benchmarks.sensitivity", "--child", json.dumps(vars(change)), "--cap", str(cap)]
    while left := [one for one in cases if one not in found]:
        done = subprocess.run([*command, "--cases", *left], cwd=ROOT, capture_output=True, text=True, check=False)
        found |= {line.pop("case"): line for line in map(json.loads, done.stdout.splitlines())}
        ended = next((one for one in left if one not in found), None)
        if ended is not None:
            found[ended] = {"answer": "none", "cpu": cap, "read": []}
    return found


def child(change: ThresholdChange, cases: Sequence[str], cap: float) -> None:
    """Change it before anything else is imported, and print each answer as a line."""
    read: set[str] = set()
    for stage in STAGES:
        one = _instance(stage)
        if stage == change.stage:
            object.__setattr__(one, change.name, changed(getattr(one, change.name), change.factor))
        type(one).__getattribute__ = _watching(stage, read)
    golden, explain = import_module("benchmarks.golden"), import_module("fidim_lab.mismatch.explain").explain
    import_module("fidim_lab.mismatch")
    at_import = set(read)
    for case in cases:
        begin = process_time()
        resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(begin + cap), resource.RLIM_INFINITY))
        read.clear()
        told = explain(golden.CASES[case].simulated(), effort=math.inf)
        names = sorted(f"{one.id} {one.cable or ''}".strip() for one in told.effects)
        line = {"case": case, "answer": " + ".join([told.verdict.value, *names]), "cpu": process_time() - begin}
        print(json.dumps(line | {"read": sorted(read | at_import)}), flush=True)


def _watching(stage: str, read: set[str]) -> Any:
    def get(self: object, name: str) -> Any:
        read.add(f"{stage}.{name}")
        return object.__getattribute__(self, name)

    return get


def changes(stages: Sequence[str]) -> Iterator[ThresholdChange]:
    """Each threshold of these stages, halved and doubled."""
    for stage in stages:
        for one in fields(_instance(stage)):
            yield from (ThresholdChange(stage, one.name, factor) for factor in FACTORS)


def measured(stages: Sequence[str], cases: Sequence[str], known: dict[str, Any]) -> None:
    """Answer what is not known yet, and keep it after each change."""
    usual = known.setdefault(UNCHANGED.key, {})
    usual |= in_child(UNCHANGED, [one for one in cases if one not in usual], 3600.0)
    for change in changes(stages):
        done = known.setdefault(change.key, {})
        asked = [one for one in cases if one not in done and f"{change.stage}.{change.name}" in usual[one]["read"]]
        if asked:
            cap = LONGEST * max(usual[one]["cpu"] for one in asked)
            for case, found in in_child(change, asked, cap).items():
                done[case] = {"answer": found["answer"], "cpu": found["cpu"]}
            differ = [f"{one}: {done[one]['answer']}" for one in asked if done[one]["answer"] != usual[one]["answer"]]
            print(f"{change.key}: {len(differ)} of {len(asked)} differ  {'; '.join(differ)}", flush=True)
        ANSWERS.parent.mkdir(exist_ok=True)
        ANSWERS.write_text(json.dumps(known, indent=1), encoding="utf-8")


def page(known: dict[str, Any]) -> str:
    """The table, and what differs."""
    usual = known[UNCHANGED.key]
    cases = len(usual)
    rows, told, differing = [], [], 0
    asked = [change for change in changes(tuple(STAGES)) if change.key in known]
    for change in asked:
        found = known[change.key]
        differ = {case: one["answer"] for case, one in found.items() if one["answer"] != usual[case]["answer"]}
        differing += len(differ)
        value = getattr(_instance(change.stage), change.name)
        name, other = f"{change.stage}.{change.name}", changed(value, change.factor)
        rows.append([name, value, other, len(found), f"{len(differ)}/{cases}"])
        told += [f"- {change.key}, {case}: {usual[case]['answer']} → {answer}" for case, answer in differ.items()]
    share = 100 * differing / max(1, len(asked) * cases)
    lines = [
        f"{len(asked)} changes of {len(asked) // len(FACTORS)} thresholds, {cases} campaigns ({', '.join(usual)}): "
        f"{differing} of {len(asked) * cases} answers differ, {share:.1f} %.",
        table(["threshold", "value", "changed to", "campaigns that read it", "answers that differ"], rows),
        "What differs:\n\n" + "\n".join(told or ["nothing"]),
    ]
    return "\n\n".join(lines)


def _instance(stage: str) -> Any:
    module = import_module(STAGES[stage])
    return next(one for one in vars(module).values() if isinstance(one, getattr(module, f"{stage}Thresholds")))


def main(arguments: Sequence[str]) -> None:
    """Measure, or write the page."""
    parser = argparse.ArgumentParser(description="answers that change with a threshold")
    parser.add_argument("--of", nargs="*", choices=[*STAGES], default=[*STAGES], help="stages; default: all")
    parser.add_argument("--cases", nargs="*", default=None, help="campaigns of benchmarks.golden; default: all")
    parser.add_argument("--page", action="store_true", help="write the page of docs")
    parser.add_argument("--child", default=None, help=argparse.SUPPRESS)
    parser.add_argument("--cap", type=float, default=3600.0, help=argparse.SUPPRESS)
    chosen = parser.parse_args(arguments)
    if chosen.child is not None:
        child(ThresholdChange(**json.loads(chosen.child)), chosen.cases, chosen.cap)
        return
    known = json.loads(ANSWERS.read_text(encoding="utf-8")) if ANSWERS.exists() else {}
    if not chosen.page:
        cases = chosen.cases or list(import_module("benchmarks.golden").CASES)
        measured(chosen.of, cases, known)
    write_section("sensitivity", "Thresholds halved and doubled", "python -m benchmarks.sensitivity", page(known))


if __name__ == "__main__":
    main(sys.argv[1:])
