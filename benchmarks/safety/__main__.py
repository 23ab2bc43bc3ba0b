"""`python -m benchmarks.safety --runs 1000`: random fault combinations, judged by the plant; the page of docs.

`--run K` carries out one of them and tells it in full; `--seed` begins another series.
"""

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context

from benchmarks.page import write_section
from benchmarks.safety.one_run import Outcome, one_run
from benchmarks.safety.page import report, told


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.safety", description=__doc__)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--first", type=int, default=1, help="number of the first run")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--run", type=int, help="carry out this one alone, and tell it in full")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--print", dest="printed", action="store_true", help="do not write the page")
    options = parser.parse_args()
    if options.run is not None:
        outcome = one_run(options.seed, options.run)
        print(told(outcome, options.seed))
        return 1 if outcome.violations else 0
    numbers = range(options.first, options.first + options.runs)
    outcomes: list[Outcome] = []
    with ProcessPoolExecutor(options.processes, mp_context=get_context("spawn")) as pool:
        for outcome in pool.map(partial(one_run, options.seed), numbers):
            outcomes.append(outcome)
            for violation in outcome.violations:
                print(f"run {outcome.number}: {violation.rule}: {violation.says}", file=sys.stderr, flush=True)
            if len(outcomes) % 50 == 0:
                print(f"{len(outcomes)} of {options.runs}", file=sys.stderr, flush=True)
    text = report(outcomes, options.seed)
    if options.printed:
        print(text)
    else:
        seed = f" --seed {options.seed}" if options.seed != 1 else ""
        command = f"python -m benchmarks.safety --runs {options.runs}{seed}"
        write_section("safety", "Random fault combinations", command, text)
    return 1 if any(outcome.violations for outcome in outcomes) else 0


if __name__ == "__main__":
    sys.exit(main())
