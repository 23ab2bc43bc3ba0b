"""Effects that a short campaign cannot tell apart, and whether the windows that are proposed do, in sealed trials.

python -m benchmarks.separate --trials 20 --jobs 2        all pairs of `effects.equivalences`; 10–90 CPU s a trial
python -m benchmarks.separate --pair anchor-offset cable-length-bias --trials 5

In each trial one of the two is hidden at random, in a robot whose body nobody knows, so small that three windows to
identify from should not tell it from the other (by information), where that is possible. The campaign is explained; if
its verdict leaves them or others open, `to_separate` proposes up to four windows, which are recorded in the same world,
and all is explained again, at most twice. Trials are kept in --rows: the same command goes on with what is missing.
"""

import argparse
import json
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, replace
from functools import partial
from itertools import combinations
from pathlib import Path
from time import process_time

import numpy as np
from pydantic import TypeAdapter

from benchmarks.page import write_section
from benchmarks.sealed.sizes import EFFECTS
from benchmarks.separate_page import EVIDENT, IDENTIFY, MORE, VALIDATE, Pair, Row, report
from fidim_lab.app.compose import simulated_world
from fidim_lab.app.formats.explanation_file import as_file, claims_of
from fidim_lab.app.judging.judgement import HOPEFUL
from fidim_lab.data.records import Campaign, Plan, PlannedWindow, Robot, Role
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.effects.catalogue import catalogue
from fidim_lab.effects.equivalences import EQUIVALENCES
from fidim_lab.errors import FidimError, InfeasibleError
from fidim_lab.identification.design.task import DesignTask
from fidim_lab.identification.design.windows import place
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.mismatch.conclusion.explanation import Explanation
from fidim_lab.mismatch.explain import explain
from fidim_lab.mismatch.next_experiment.next_windows import to_separate
from fidim_lab.mismatch.next_experiment.proposal import Claim, Proposal, ProposedTrial
from fidim_lab.mismatch.next_experiment.separate import KnownRobot, evidence, separating
from sim_backends.plant.plant import Plant
from sim_backends.simulate import RecordedWindow, simulate_campaign

FAINT = (1.0, 6.0)
"""non-centrality between the two that the first campaign is to have; a clear verdict takes 10"""
MILD = 0.7
"""of the displacement, where a cable would go slack"""
MILDER = 4
ROUNDS = 2
"""of proposals that are recorded, MORE windows in all"""
SOFTNESS = {"cable-elasticity": "EA", "winch-hold-compliance": "k"}
"""the key that is the inverse of the effect's parameter"""


_ROW = TypeAdapter(Row)


def pairs() -> tuple[Pair, ...]:
    """Every two effects that the catalogue's list of equivalences names together."""
    return tuple(pair for one in EQUIVALENCES for pair in combinations(one.ids, 2))


def run(pair: Pair, trial: int, seed: int) -> Row:
    """One trial; the same for the same numbers."""
    begin = process_time()
    rng = np.random.default_rng([seed, trial, *(ord(letter) for letter in "".join(pair))])
    robot = read_robot(PAPERS_ROBOT)
    hidden, other = (pair, pair[::-1])[int(rng.integers(2))]
    world_seed = int(rng.integers(1 << 30))
    plan = random_plan(robot, "short", IDENTIFY, VALIDATE, world_seed)
    keys, size = hidden_keys(robot, hidden, other, plan.windows, rng)
    hide = f"{hidden}:" + ",".join(f"{key}={float(value)!r}" for key, value in keys.items())
    record = partial(recorded, robot, hide, world_seed)
    row = Row(pair, trial, hidden, size, "else")
    try:
        campaign = record(plan.windows)
        told = explain(campaign)
        row = replace(row, before=outcome(told, hidden, other), says=_named(told))
        row = separated(row, campaign, told, (hidden, other), record, plan.windows)
    except FidimError as refusal:
        row = replace(row, says=str(refusal).splitlines()[0])
    return replace(row, seconds=process_time() - begin)


def separated(
    row: Row,
    campaign: Campaign,
    told: Explanation,
    ids: Pair,
    record: Callable[[Sequence[PlannedWindow]], Campaign],
    windows: Sequence[PlannedWindow],
) -> Row:
    """What is proposed, recorded where it promises anything, and explained; as `compare`, while something is open."""
    for number in range(1, ROUNDS + 1):
        claims = claims_of(as_file(told))
        pair = [c for c in claims if {c.id, *c.rivals} >= set(ids)]  # a third effect may be named, for both
        more = MORE - row.windows
        if not claims or outcome(told, *ids) in ("right", "wrong") or more <= 0:
            return row
        noise = float(np.sqrt(max(1.0, told.chi2_per_dof.after or 1.0)))
        body = np.array([p.value for p in told.parameters.values()])
        seed = 100 * (number - 1) + row.trial + 1
        proposals = to_separate(campaign, pair or claims, body, noise=noise, seed=seed, more=more, more_markers=False)
        found = max(proposals, key=_odds)
        excluded = not set(ids) & set(found.beyond)  # else these windows are for other rivals
        row = replace(row, promised=_odds(found) if excluded else 0.0, says=found.says)
        if _odds(found) < HOPEFUL:  # `compare` ends here
            return row
        further = [planned(campaign.robot, k, one) for k, one in enumerate(found.windows, start=1 + len(windows))]
        windows = (*windows, *further)
        campaign = record(windows)
        told = explain(campaign)
        count = row.windows + len(further)
        says = f"{found.says} {_named(told)}"
        row = replace(row, windows=count, recorded=True, after=outcome(told, *ids), says=says)
    return row


def _odds(found: Proposal) -> float:
    return found.after[-1].probability if found.after else 0.0


def hidden_keys(
    robot: Robot, hidden: str, other: str, windows: Sequence[PlannedWindow], rng: np.random.Generator
) -> tuple[dict[str, float], float]:
    """Keys of `--hide` and the size, so faint that the windows should leave the two open, within the usual sizes."""
    spec = EFFECTS[hidden]
    middle = float(np.sqrt(spec.low * spec.high))
    state = rng.bit_generator.state
    cable = int(rng.integers(1, robot.n + 1)) if spec.one_cable else None

    def keys_of(size: float) -> dict[str, float]:
        keys = spec.keys(np.random.default_rng(state["state"]["state"] % (1 << 60)), size)
        return {**keys, **({} if cable is None else {"cable": cable})}

    known, seen = non_centrality(robot, hidden, other, keys_of(middle), windows)
    wanted = float(np.exp(rng.uniform(*np.log(FAINT))))
    size = spec.high / 3 if not known else middle * float(np.sqrt(wanted / known))
    if seen:
        size = max(size, middle * float(np.sqrt(EVIDENT / seen)))
    size = float(np.clip(size, spec.low, spec.high))
    return keys_of(size), size


def non_centrality(
    robot: Robot, hidden: str, other: str, keys: dict[str, float], windows: Sequence[PlannedWindow]
) -> tuple[float, float]:
    """Between the two with these windows, and against none; 0 where neither information nor score says anything."""
    cable = None if "cable" not in keys else int(keys["cable"])
    effect = next(e for e in catalogue(robot) if e.id == hidden and e.cable == cable)
    key = SOFTNESS.get(hidden)
    theta = tuple(1 / keys[key] if key else keys.get(p.name, 0.0) for p in effect.parameters)
    try:
        trials = [_trial(robot, window) for window in windows if window.role is Role.IDENTIFY]
        claim = Claim(hidden, cable, theta, (other,))
        known = KnownRobot(robot, trials)
        return separating(known, claim, []).before.non_centrality, evidence(known, claim)
    except InfeasibleError:
        return 0.0, 0.0


def _trial(robot: Robot, window: PlannedWindow) -> ProposedTrial:
    task = DesignTask(robot, equilibria=1)
    aside = np.asarray(window.displacement)[: len(task.axes)]
    return ProposedTrial(
        window.lengths, aside, place(task.mechanism(), task, np.concatenate([window.lengths, aside])).start
    )


def planned(robot: Robot, number: int, trial: ProposedTrial) -> PlannedWindow:
    """As a plan has it."""
    task = DesignTask(robot, equilibria=1)
    rest = place(task.mechanism(), task, np.concatenate([trial.lengths, trial.displacement])).rest
    return PlannedWindow(
        f"more{number}", Role.IDENTIFY, trial.lengths, trial.displacement, rest.position + rest.rotation @ robot.marker
    )


def recorded(robot: Robot, hide: str, seed: int, windows: Sequence[PlannedWindow]) -> Campaign:
    """The windows in the world of this seed; displaced less where a cable goes slack, as one does."""
    for _ in range(MILDER):
        world = simulated_world(robot, seed, (hide,))
        plan, noise = Plan("short", tuple(windows)), np.random.default_rng([seed, 1])
        seen: list[RecordedWindow] = []
        campaign, _ = simulate_campaign(robot, plan, world, noise, platform=Plant(world), watch=seen.append)
        slack = {one.window.id for one in seen if one.slack}
        if not slack:
            return campaign
        windows = [replace(w, displacement=MILD * w.displacement) if w.id in slack else w for w in windows]
    raise InfeasibleError("A cable goes slack however little the platform is displaced.")


def _named(told: Explanation) -> str:
    names = [" or ".join((c.id, *c.equivalent_to)) + ("" if c.cable is None else f" ({c.cable})") for c in told.effects]
    return f"{told.verdict.value}: {', '.join(names)}"


def outcome(told: Explanation, hidden: str, other: str) -> str:
    """Which of the two was named, or may stand in the place of a third that was."""
    for cause in told.effects:
        named = {cause.id, *cause.equivalent_to}
        if {hidden, other} <= named:
            return "alike"
        if {hidden, other} & named:
            return "right" if hidden in named else "wrong"
    return "else"


def read(path: Path) -> list[Row]:
    """Trials that were made before."""
    if not path.exists():
        return []
    return [_ROW.validate_json(line) for line in path.read_text(encoding="utf-8").splitlines()]


def carry_out(wanted: Iterable[tuple[Pair, int]], rows: Path, seed: int, jobs: int) -> None:
    """Make the trials that are missing, each kept as soon as it is made."""
    made = {(row.pair, row.trial) for row in read(rows)}
    left = [one for one in wanted if one not in made]
    with ProcessPoolExecutor(jobs) as pool, rows.open("a", encoding="utf-8") as file:
        asked = {pool.submit(run, pair, trial, seed): (pair, trial) for pair, trial in left}
        for done in as_completed(asked):
            if (bug := done.exception()) is not None:  # the other trials go on; this one is made by the next command
                print(f"{asked[done]}: {type(bug).__name__}: {bug}")
                continue
            file.write(json.dumps(asdict(done.result())) + "\n")
            file.flush()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=20, help="of each pair")
    parser.add_argument("--pair", nargs=2, action="append", metavar="EFFECT", help="only this one; may be repeated")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--rows", type=Path, default=Path("separate.jsonl"), help="trials as they are made")
    parser.add_argument("--as-it-is", action="store_true", help="no further trials: the page from those in --rows")
    options = parser.parse_args()
    chosen: list[Pair] = [(a, b) for a, b in options.pair] if options.pair else list(pairs())
    wanted = [(pair, trial) for trial in range(options.trials) for pair in chosen]
    if not options.as_it_is:
        carry_out(wanted, options.rows, options.seed, options.jobs)
    text = report([row for row in read(options.rows) if (row.pair, row.trial) in set(wanted)])
    print(text)
    some = "".join(f" --pair {a} {b}" for a, b in options.pair or ())
    some += " --as-it-is" if options.as_it_is else ""
    write_section(
        "separate",
        "Effects told apart by the windows that are proposed",
        f"python -m benchmarks.separate{some} --trials {options.trials} --seed {options.seed}",
        text,
    )


if __name__ == "__main__":
    main()
