"""Answers of `explain` and `identify` to small seeded campaigns, kept: a change of structure must change none.

    python -m benchmarks.golden                  compare all with what is kept; exit code 1 where one differs
    python -m benchmarks.golden null hand        compare some
    python -m benchmarks.golden --write [NAME]   keep today's answers; say in the commit why they changed

Each campaign is simulated from its seed and explained without a limit of its work. A result of
maximum likelihood is kept beside each explanation, and one of total least squares. The same machine gives the same
bits; on another one numbers may differ in their last digits, which `differences` allows for.
"""

import argparse
import json
import math
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fidim_lab.data.files.json_file import as_json
from fidim_lab.data.records import Campaign
from fidim_lab.data.robot_file import read_robot
from fidim_lab.identification.equations.estimators import Method
from fidim_lab.identification.identify import identify
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.mismatch.explain import explain
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "tests" / "fidim_lab" / "mismatch" / "golden"
ROBOT = ROOT / "fidim_lab" / "data" / "robots" / "irma4.toml"
DIGITS = 9
"""significant digits that are kept"""
LONG, THIN = 100, 20
"""entries of a list that is drawn, of which every so many-th is kept"""
NUMBER = re.compile(r"[-−+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@dataclass(frozen=True)
class Small:
    """One campaign: what is hidden in it, from which seed, how many windows of how many seconds."""

    hidden: tuple[str, ...]
    seed: int
    identify: int = 5
    validate: int = 2
    seconds: float = 5.0

    def simulated(self) -> Campaign:
        """The campaign, recorded by the other simulator."""
        robot = read_robot(ROBOT)
        plan = random_plan(robot, "golden", self.identify, self.validate, self.seed)
        effects = tuple(parse_effect(text, robot.n) for text in self.hidden)
        world = make_world(robot, np.random.default_rng(self.seed), effects)
        rng = np.random.default_rng(self.seed + 1)
        return simulate_campaign(robot, plan, world, rng, recording=Sampling(self.seconds))[0]


CASES: Mapping[str, Small] = {
    "null": Small((), 40),
    "swivel": Small(("swivel-friction:c=0.01",), 5),
    "two": Small(("rotational-drag:c=0.05", "cable-length-bias:cable=2,bias=0.004"), 61),
    "three": Small(("anchor-offset:cable=2,dx=0.004", "rotational-drag:c=0.02", "gravity-tilt"), 63, 6),
    "unknown": Small(("unknown:k=-60",), 62),
    "gradient": Small(("unknown-gradient:k=-6,x=1.2,y=-0.1,z=-0.3",), 71, 6),
    "cubic": Small(("unknown-cubic:c=2",), 71, 6),
    "knock": Small(("unknown-knock",), 64),
    "hand": Small(("hand-contact:fx=1,fy=-1.5,start=3,stop=4,window=2",), 21, 3, 1, 6.0),
    "hands": Small(("hand-contact:fx=0.4,fy=-0.32,start=2.3,stop=3.5,window=0",), 21, 3, 1, 8.0),
    "fault": Small(("sensor-fault:jump=0.01",), 65, 4),
    "clocks": Small(("clock-rate:rate=0.002",), 66),
    "elastic": Small(("cable-elasticity:EA=4e4",), 67),
    "sway": Small(("pulley-radius:dr=-0.0027", "frame-sway:ax=1.2e-4,ay=0.8e-4,az=0,f=1.145"), 71, 6),
    "loose": Small(("loose-mass:m=0.4,f=2.4,zeta=0.1,bx=0.02,by=-0.09,bz=-0.04",), 71, 6),
    "force": Small(("periodic-force",), 68),
}
FAST = ("null",)


def answers(case: Small) -> dict[str, Any]:
    """The explanation and the results of a campaign, without times and work, numbers to so many digits."""
    campaign = case.simulated()
    explained = explain(campaign, effort=math.inf).table
    found = {method.value: identify(campaign, method, native=True).to_json() for method in (Method.MLE, Method.TLS)}
    for table in (explained, *found.values()):
        del table["seconds"]
    del explained["work"]
    for row in explained["ranking"]:
        del row["forms"], row["lost"]  # of the same effects and figures, for people
    whole = as_json({"explanation": explained, "results": found})
    return _rounded(whole)


def kept_file(name: str) -> Path:
    """Where an answer is kept."""
    return KEPT / f"{name}.json"


def differences(kept: Any, now: Any, tolerance: float = 0.0, where: str = "") -> Iterator[str]:
    """Each place where two answers differ by more than a relative tolerance; numbers in sentences are numbers too."""
    if isinstance(kept, dict) and isinstance(now, dict) and kept.keys() == now.keys():
        for key, value in kept.items():
            yield from differences(value, now[key], tolerance, f"{where}/{key}")
    elif isinstance(kept, list) and isinstance(now, list) and len(kept) == len(now):
        for k, (one, other) in enumerate(zip(kept, now, strict=True)):
            yield from differences(one, other, tolerance, f"{where}/{k}")
    elif not _alike(kept, now, tolerance):
        yield f"{where}: {kept!r} is kept, now {now!r}"


def _alike(kept: Any, now: Any, tolerance: float) -> bool:
    if isinstance(kept, float) and isinstance(now, float | int):
        return math.isclose(kept, now, rel_tol=tolerance, abs_tol=tolerance * 1e-3)
    if tolerance > 0 and isinstance(kept, str) and isinstance(now, str):
        numbers = [[float(x.replace("−", "-")) for x in NUMBER.findall(text)] for text in (kept, now)]
        same = NUMBER.sub("#", kept) == NUMBER.sub("#", now)
        return same and np.allclose(*numbers, rtol=0.05, atol=0.05)  # they were rounded for a reader
    return kept == now


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}")
    if isinstance(value, dict):
        return {key: _rounded(entry) for key, entry in value.items()}
    return (
        [_rounded(entry) for entry in value[:: 1 if len(value) < LONG else THIN]] if isinstance(value, list) else value
    )


def main(arguments: Sequence[str]) -> int:
    """Compare, or keep."""
    parser = argparse.ArgumentParser(description="answers to small seeded campaigns, kept")
    parser.add_argument("names", nargs="*", choices=[*CASES, []], help="default: all")
    parser.add_argument("--write", action="store_true", help="keep today's answers")
    chosen = parser.parse_args(arguments)
    differ = 0
    for name in chosen.names or CASES:
        now, file = answers(CASES[name]), kept_file(name)
        if chosen.write:
            KEPT.mkdir(exist_ok=True)
            file.write_text(json.dumps(now, ensure_ascii=False, separators=(",", ":")) + "\n", encoding="utf-8")
            print(f"{name}: {now['explanation']['verdict']}, kept", flush=True)
            continue
        places = list(differences(json.loads(file.read_text(encoding="utf-8")), now))
        print(f"{name}: " + ("the same" if not places else f"{len(places)} places differ"), flush=True)
        for place in places[:5]:
            print(f"  {place[:300]}", flush=True)
        differ += bool(places)
    return 1 if differ else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
