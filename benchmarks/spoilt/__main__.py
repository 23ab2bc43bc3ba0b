"""`python -m benchmarks.spoilt --campaigns 200 --seed S`: each kind in turn, sizes and bodies by seed, one table.

One campaign in five has a second kind besides. `--page` writes the table into docs/benchmarks/spoilt.md.
`--kind NAME` draws one kind alone, `--first N` begins at campaign N.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from benchmarks.page import table, write_section
from benchmarks.spoilt.judge import Judged, Verdict, judge
from benchmarks.spoilt.kinds import KINDS
from benchmarks.spoilt.spoiling import Kind
from benchmarks.spoilt.worlds import Known, swung, yawed
from fidim_lab.data.records import Campaign

WORLDS = 12
"""that are spoilt, with each seed: robots, sizes and bodies"""
TWICE = 0.2
"""of the campaigns have a second kind"""


def spoilt(kind: Kind, second: Kind | None, rng: np.random.Generator, seed: int) -> tuple[Campaign, Known]:
    """One campaign, and what is true of it."""
    kinds = [one for one in KINDS if one in (kind, second)]
    if kind.yaw:
        known = yawed(rng, drag="dying" in kind.name, several="several" in kind.name)
    else:
        number = int(rng.integers(WORLDS))
        one = any(each.one for each in kinds) or (not any(each.several for each in kinds) and rng.random() < 0.5)
        known = swung(seed, number, one_marker=one)
    campaign = known.campaign
    if "another body" in kind.name and known.heavier is not None:
        at = int(rng.integers(len(campaign.windows)))
        windows = (*campaign.windows[:at], known.heavier.windows[at], *campaign.windows[at + 1 :])
        campaign = replace(campaign, windows=windows)
    for each in kinds:
        campaign = each.clean(campaign, rng)
    noise = campaign.robot.sensors.marker_noise
    windows = (
        replace(w, markers=np.round(w.markers + noise * rng.normal(size=w.markers.shape), 6)) for w in campaign.windows
    )
    campaign = replace(campaign, windows=tuple(windows))
    for each in kinds:
        campaign = each.noisy(campaign, rng)
    return campaign, known


def drawn(number: int, seed: int, kinds: Sequence[Kind]) -> tuple[Kind, Kind | None, np.random.Generator]:
    """Kind `number` modulo their count, and now and then one that goes with it."""
    rng = np.random.default_rng([seed, number, 4711])
    kind = kinds[number % len(kinds)]
    others = [other for other in KINDS if _together(kind, other)]
    twice = len(kinds) > 1 and not kind.alone and rng.random() < TWICE
    return kind, others[rng.integers(len(others))] if twice else None, rng


def _together(kind: Kind, other: Kind) -> bool:
    apart = (kind.one and other.several) or (kind.several and other.one)
    return kind is not other and not other.alone and not apart


def run(numbers: Sequence[int], seed: int, kinds: Sequence[Kind] = KINDS) -> list[Judged]:
    """Draw, identify, judge."""
    found: list[Judged] = []
    for number in numbers:
        kind, second, rng = drawn(number, seed, kinds)
        campaign, known = spoilt(kind, second, rng, seed)
        one = judge(kind, second, number, campaign, known.body)
        found.append(one)
        short = "" if one.verdict is Verdict.RIGHT else f" | {one.says[:400]}"
        print(
            f"{number:4d} {one.kind:24s} {len(campaign.robot.cables)} cables, {len(campaign.robot.markers)} markers "
            f"{one.verdict:26s} {one.worst:6.2f}± {one.seconds:5.1f} s{short}",
            flush=True,
        )
    return found


def page(found: Sequence[Judged]) -> str:
    """One row for each kind (with a second one: of the first), and their sum."""
    names = [*dict.fromkeys(one.first for one in found), "two kinds", "all"]
    rows = []
    for name in names:
        ours = [one for one in found if name in (one.first, "all") or (name == "two kinds" and one.first != one.kind)]
        if not ours:
            continue
        counts = [sum(one.verdict is verdict for one in ours) for verdict in Verdict]
        given = [one.worst for one in ours if one.verdict in (Verdict.RIGHT, Verdict.SILENT)]
        rows.append((name, len(ours), *counts, f"{np.median(given):.1f}" if given else "–"))
    return table(("kind", "campaigns", *Verdict, "largest error, median, ±"), rows)


def main() -> None:
    """As the module says."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.spoilt", description=__doc__)
    parser.add_argument("--campaigns", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--kind")
    parser.add_argument("--page", action="store_true")
    asked = parser.parse_args()
    kinds = [kind for kind in KINDS if asked.kind in (None, kind.name)]
    found = run(range(asked.first, asked.first + asked.campaigns), asked.seed, kinds)
    text = page(found)
    print(text)
    if asked.page:
        command = f"python -m benchmarks.spoilt --campaigns {asked.campaigns} --seed {asked.seed} --page"
        write_section("spoilt", "Spoilt recordings", command, text)


if __name__ == "__main__":
    main()
