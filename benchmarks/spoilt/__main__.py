"""`python -m benchmarks.spoilt --runs 200`: each kind in turn, sizes and bodies by seed, a table for each kind.

`--page` writes the table into docs/benchmarks/spoilt.md. `--kind NAME` runs one kind, `--first N` begins at run N.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from benchmarks.identification.campaigns import Known, simulated
from benchmarks.page import table, write_section
from benchmarks.spoilt.judge import Judged, Verdict, judge
from benchmarks.spoilt.kinds import KINDS, Kind
from fidim_lab.data.records import Campaign

BODIES = 6
"""campaigns that are spoilt: bodies, places and swings; half with one marker, half with four"""
IDENTIFY, VALIDATE = 5, 1
FURTHER = ((0.15, 0.1, 0.05), (-0.1, 0.15, 0.0), (-0.12, -0.14, 0.1))
"""m, body frame, of three more markers"""


@cache
def base(number: int) -> Known:
    """A campaign without marker noise."""
    return simulated(900 + number, IDENTIFY, VALIDATE, noisy=False, further=FURTHER if number % 2 else ())


def spoilt(kind: Kind, seed: int) -> tuple[Campaign, Known]:
    """One campaign of a kind, and what is true of it."""
    rng = np.random.default_rng([seed, 4711])
    number = int(rng.integers(BODIES))
    number += (number % 2 == 0) if kind.several else -(number % 2) if kind.one else 0
    known = base(number)
    campaign = kind.clean(known.campaign, rng)
    noise = campaign.robot.sensors.marker_noise
    windows = (
        replace(w, markers=np.round(w.markers + noise * rng.normal(size=w.markers.shape), 6)) for w in campaign.windows
    )
    return kind.noisy(replace(campaign, windows=tuple(windows)), rng), known


def run(runs: Sequence[int], kinds: Sequence[Kind] = KINDS) -> list[Judged]:
    """Run k is of kind k modulo their number."""
    found: list[Judged] = []
    for k in runs:
        kind = kinds[k % len(kinds)]
        campaign, known = spoilt(kind, k)
        found.append(judge(kind, k, campaign, known.body))
        one = found[-1]
        short = "" if one.verdict is Verdict.RIGHT else f" | {one.says[:160]}"
        print(f"{k:4d} {one.kind:24s} {one.verdict:26s} {one.worst:6.2f}± {one.seconds:5.1f} s{short}", flush=True)
    return found


def page(found: Sequence[Judged]) -> str:
    """One row for each kind, and their sum."""
    names = [*dict.fromkeys(one.kind for one in found), "all"]
    rows = []
    for name in names:
        ours = [one for one in found if name in (one.kind, "all")]
        counts = [sum(one.verdict is verdict for one in ours) for verdict in Verdict]
        given = [one.worst for one in ours if one.verdict in (Verdict.RIGHT, Verdict.SILENT)]
        rows.append((name, len(ours), *counts, f"{np.median(given):.1f}" if given else "–"))
    return table(("kind", "runs", *Verdict, "largest error, median, ±"), rows)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.spoilt")
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--kind")
    parser.add_argument("--page", action="store_true")
    asked = parser.parse_args()
    kinds = [kind for kind in KINDS if asked.kind in (None, kind.name)]
    found = run(range(asked.first, asked.first + asked.runs), kinds)
    text = page(found)
    print(text)
    if asked.page:
        command = f"python -m benchmarks.spoilt --runs {asked.runs} --page"
        write_section("spoilt", "Spoilt recordings", command, text)


if __name__ == "__main__":
    main()
