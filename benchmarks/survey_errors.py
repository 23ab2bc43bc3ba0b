"""What `explain` says where the robot file is off by ordinary survey errors, alone and beside one loud effect.

python -m benchmarks.survey_errors --runs 20                nothing is left out: any cause that is named is false
python -m benchmarks.survey_errors --runs 20 --effects      one loud effect is: right, right by class, or wrong

Each run draws how far the file is off (anchors 0.2 to 2 mm a coordinate, log-uniform; attachments half of it), records
a campaign of 6 + 3 windows of 6 s of the true robot in the independent simulator, and explains it with the wrong file,
which states no survey. Runs are kept in --rows: the same command goes on with what is missing. --write puts the table
into docs/benchmarks/survey-errors.md.
"""

import argparse
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from benchmarks.page import table, write_section
from benchmarks.sealed.scoring import Marked, grade, grade_without, named
from benchmarks.sealed.sizes import EFFECTS
from benchmarks.surveyed import ATTACHMENTS, LARGEST, SMALLEST, with_survey_errors
from fidim_lab.data.records import Campaign, Robot
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.effects.equivalences import GEOMETRY, SHARED
from fidim_lab.errors import FidimError
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.mismatch.conclusion.explanation import finite
from fidim_lab.mismatch.explain import explain
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign

IDENTIFY, VALIDATE, SECONDS = 6, 3, 6.0
LOUD = ("rotational-drag", "swivel-friction", "attachment-friction", "air-drag-quadratic", "loose-mass", "cable-mass",
        "periodic-force", "umbilical", "swivel-inertia", "anchor-offset")  # fmt: skip
"""hidden in turn: what dissipates, pulls, adds mass, oscillates, and a blunder of the survey itself"""
SHARE = 0.5
"""of the largest size of the sealed benchmark"""
BLUNDER = 15.0
"""times the survey's error: a blunder of one anchor"""


@dataclass(frozen=True)
class Row:
    """One run."""

    seed: int
    scale_mm: float
    hidden: str
    verdict: str
    said: str
    grade: str
    held_out: float | None
    cpu: float


def campaign(seed: int, effect: str) -> tuple[Campaign, float, tuple[str, ...], int | None]:
    """The campaign with the wrong file, how far that is off (m), what is hidden, on which cable."""
    rng = np.random.default_rng([seed, 40])
    scale = float(np.exp(rng.uniform(np.log(SMALLEST), np.log(LARGEST))))
    robot = read_robot(PAPERS_ROBOT)
    hide, cable = _hidden(effect, scale, robot, rng)
    for attempt in range(12):
        plan = random_plan(robot, "survey", IDENTIFY, VALIDATE, seed + 1000 * attempt)
        effects = tuple(parse_effect(text, robot.n) for text in hide)
        world = make_world(robot, np.random.default_rng(seed), effects)
        try:
            made = simulate_campaign(robot, plan, world, np.random.default_rng(seed + 1), recording=Sampling(SECONDS))
        except FidimError:
            continue
        return replace(made[0], robot=with_survey_errors(robot, scale, ATTACHMENTS * scale, rng)), scale, hide, cable
    raise SystemExit(f"seed {seed}: no plan can be swung with {hide}")


def _hidden(effect: str, scale: float, robot: Robot, rng: np.random.Generator) -> tuple[tuple[str, ...], int | None]:
    if not effect:
        return (), None
    size = EFFECTS[effect]
    cable = int(rng.integers(robot.n)) + 1 if size.one_cable else None
    largest = BLUNDER * scale if effect == "anchor-offset" else SHARE * size.high
    keys: Mapping[str, float] = size.keys(rng, largest) | ({} if cable is None else {"cable": cable})
    return (effect + ":" + ",".join(f"{key}={float(value)!r}" for key, value in keys.items()),), cable


def run(seed: int, effect: str) -> Row:
    """Record, explain, judge."""
    made, scale, hide, cable = campaign(seed, effect)
    begin = process_time()
    answer = finite(explain(made).table)
    judged = judge(answer, effect, cable)
    held = answer["held_out"]["chi2_per_dof"]["after"]
    cpu = process_time() - begin
    return Row(
        seed, round(1e3 * scale, 3), " ".join(hide), answer["verdict"], named(answer), judged.value, held, round(cpu, 1)
    )


def judge(answer: dict[str, Any], effect: str, cable: int | None) -> Marked:
    """As sealed campaigns are judged; by class, too, what is of the geometry, and not the only name for it.

    That is off in all of them. A hidden piece of it may also be told without a name, as clearly off.
    """
    judged = grade(answer, [effect] if effect else [], cable)
    if judged is not Marked.WRONG:
        return judged
    beside = [one for one in answer["effects"] if one["id"] not in SHARED[GEOMETRY] or one["single"]]
    if effect and effect not in SHARED[GEOMETRY]:
        named_too = grade({**answer, "effects": beside}, [effect], cable)
        return Marked.WRONG if named_too is Marked.WRONG else Marked.CLASS
    told = answer["effects"] if not effect else grade_without(answer, effect, cable) is Marked.CLASS
    return Marked.CLASS if told and not beside else Marked.WRONG


def report(rows: list[Row]) -> str:
    """What they come to, and each of them."""
    good = sum(row.grade != "wrong" for row in rows)
    head = ("seed", "file off, mm", "hidden", "said", "judged", "held-out χ²/dof", "CPU s")
    lines = [
        (row.seed, row.scale_mm, row.hidden.split(":")[0] or "nothing", row.said, row.grade, row.held_out, row.cpu)
        for row in rows
    ]
    return f"{good} of {len(rows)} right, or right by class.\n\n{table(head, lines)}"


def main() -> None:
    """As the module says."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--effects", action="store_true")
    parser.add_argument("--rows", type=Path, default=Path("build/survey_errors.jsonl"))
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    options.rows.parent.mkdir(parents=True, exist_ok=True)
    kept = [Row(**json.loads(line)) for line in options.rows.read_text().splitlines()] if options.rows.exists() else []
    known = {(row.seed, row.hidden.split(":")[0]): row for row in kept}
    rows: list[Row] = []
    for seed in range(options.first, options.first + options.runs):
        effect = LOUD[seed % len(LOUD)] if options.effects else ""
        row = known.get((seed, effect)) or run(seed, effect)
        if (seed, effect) not in known:
            with options.rows.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(row), ensure_ascii=False) + "\n")
        print(row, flush=True)
        rows.append(row)
    print(report(rows))
    if options.write:
        kind = " --effects" if options.effects else ""
        title = f"Survey errors{', one loud effect beside them' if options.effects else ' alone'}"
        command = f"python -m benchmarks.survey_errors --runs {options.runs} --first {options.first}{kind}"
        write_section("survey-errors", title, command, report(rows))


if __name__ == "__main__":
    main()
