"""One computation on one campaign in a process of its own, which may be stopped.

A computation that hangs, eats the memory or crashes the interpreter costs one campaign, not the benchmark. The time cap
counts CPU time, so that a busy machine is no slower judge; waiting without end is capped as well.
"""

import faulthandler
import signal
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

from benchmarks.sealed.folder import read_json, write_json
from benchmarks.sealed.sizes import EFFECTS
from fidim_lab.data.campaign import read_campaign, write_campaign
from fidim_lab.data.records import Campaign
from fidim_lab.errors import FidimError
from fidim_lab.model.sensitivity.work import work_done

WAITING = 6.0
"""times the cap, plus a minute, by the clock on the wall: how long anything may take"""
NO_LIMITS = 0.0


class ChildTask(StrEnum):
    """What a child can do."""

    EXPLAIN = "explain"
    LOUDNESS = "loudness"


@dataclass(frozen=True)
class ChildOutcome:
    """What came of it."""

    answer: dict[str, Any] | None
    """None where there is none, and then `why`"""
    why: str
    cpu: float
    """s"""
    seconds: float
    nodes: int = 0
    """integrated: its work, the same on every computer"""

    @property
    def table(self) -> dict[str, Any]:
        """For a file."""
        cpu, seconds = round(self.cpu, 2), round(self.seconds, 2)
        return {"answer": self.answer, "why": self.why, "cpu": cpu, "seconds": seconds, "nodes": self.nodes}


def in_child(verb: ChildTask, campaign: Campaign, cap: float, without: str = "") -> ChildOutcome:
    """Do it to this campaign within `cap` seconds of CPU time; without: an effect that the catalogue is to lack."""
    begin = perf_counter()
    with tempfile.TemporaryDirectory(prefix="fidim-benchmark-") as scratch:
        folder, out = Path(scratch) / campaign.name, Path(scratch) / "out.json"
        write_campaign(folder, campaign)
        command = [sys.executable, "-m", __name__, verb.value, str(folder), str(out), str(cap), without]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=WAITING * cap + 60.0, check=False)
        except subprocess.TimeoutExpired:
            return ChildOutcome(None, f"no answer within {WAITING * cap + 60.0:.0f} s", cap, perf_counter() - begin)
        seconds = perf_counter() - begin
        if out.exists():
            said = read_json(out)
            return ChildOutcome(said["answer"], said["why"], said["cpu"], seconds, said["nodes"])
        if done.returncode >= 0:
            last = (done.stderr.strip().splitlines() or ["nothing was said"])[-1]
            return ChildOutcome(None, f"failed with exit code {done.returncode}: {last}", min(cap, seconds), seconds)
        name = signal.Signals(-done.returncode).name
        if name == "SIGXCPU":
            return ChildOutcome(None, f"stopped: the {cap:.0f} s of CPU time were used up", cap, seconds)
        return ChildOutcome(None, f"crashed with {name}: {_place(done.stderr)}", min(cap, seconds), seconds)


def _place(said: str) -> str:
    """What `faulthandler` says of a crash, in one line: tables have room for no more."""
    _, fatal, calls = said.partition("Fatal Python error")
    lines = (fatal + calls.partition("Extension modules")[0]).splitlines()
    return "; ".join(line.strip() for line in lines if line.strip()) or "nothing was said"


def main(arguments: list[str]) -> int:
    """`VERB CAMPAIGN OUT CAP WITHOUT`: what the child runs."""
    verb, folder, out, cap, without = arguments
    faulthandler.enable()
    _limit(float(cap))
    campaign = read_campaign(Path(folder))
    answer, why = None, ""
    try:
        answer = _explained(campaign, without) if ChildTask(verb) is ChildTask.EXPLAIN else _loud(campaign)
    except FidimError as error:
        why = f"{type(error).__name__}: {error}"
    write_json(Path(out), ChildOutcome(answer, why, process_time(), NO_LIMITS, work_done().nodes).table)
    return 0


def _explained(campaign: Campaign, without: str) -> dict[str, Any]:
    from fidim_lab.mismatch.conclusion.explanation import write_explanation
    from fidim_lab.mismatch.explain import explain

    with tempfile.TemporaryDirectory() as scratch:
        file = Path(scratch) / "explanation.json"
        write_explanation(file, explain(campaign, without=[without] if without in EFFECTS else []))
        return read_json(file)


def _loud(campaign: Campaign) -> dict[str, Any]:
    from benchmarks.sealed.loudness import loudness

    return vars(loudness(campaign))


def _limit(cap: float) -> None:
    """CPU time of this process, where the system can limit it."""
    try:
        import resource
    except ImportError:  # Windows: the wall-clock cap must do
        return
    seconds = max(1, round(cap))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
