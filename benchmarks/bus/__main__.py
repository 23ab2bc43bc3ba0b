"""What the drivers do on a bus.

    python -m benchmarks.bus rates --minutes 10 --sync 100 250 500 --over inprocess tcp slcan      (90 minutes)
    python -m benchmarks.bus saturated --minutes 1 --over tcp slcan                                 (2 minutes)
    python -m benchmarks.bus time --seeds 40                                                        (2 minutes)
    python -m benchmarks.bus kills --rounds 100                                                     (6 minutes)
    python -m benchmarks.bus gaps                                                                   (6 minutes)

Buses: inprocess (drives in the host's own process), tcp (SLCAN over a socket, as `fidim simulators` serves it), slcan
(an adapter on a pseudo terminal). The computer runs the simulated devices, too; times are of the monotonic clock, which
all processes share.
"""

import argparse

from benchmarks.bus.alignment import alignment
from benchmarks.bus.gaps import STRAINS, gaps
from benchmarks.bus.kills import kills
from benchmarks.bus.rates import rates
from benchmarks.bus.saturated import saturated
from benchmarks.page import meanwhile, spent, write_section

BUSES = ("inprocess", "tcp", "slcan")


def main(arguments: "list[str] | None" = None) -> None:
    """Measure one thing, and write its section of docs/benchmarks/bus.md."""
    options = _parser().parse_args(arguments)
    before = spent()
    told = f"--minutes {options.minutes:g}" if options.what in ("rates", "saturated") else ""
    match options.what:
        case "rates":
            title, text = "Four drives, 200 Hz markers", rates(options.over, options.sync, options.minutes)
            told += f" --sync {' '.join(f'{rate:g}' for rate in options.sync)} --over {' '.join(options.over)}"
        case "saturated":
            over = [kind for kind in options.over if kind != "inprocess"]
            title, text = "A full bus of 1 Mbit/s", saturated(over, options.minutes)
            told += f" --over {' '.join(over)}"
        case "time":
            title, text = "Time", alignment(options.seeds)
            told = f"--seeds {options.seeds}"
        case "gaps":
            title, text = "What keeps SYNC back", gaps(options.strains)
            told = f"--strains {' '.join(options.strains)}"
        case _:
            title, text = "Master killed or stopped", kills(options.rounds, options.seed)
            told = f"--rounds {options.rounds} --seed {options.seed}"
    text += f"\n\n{meanwhile(before, idle=options.idle)}"
    if options.printed:
        print(text)
        return
    write_section("bus", title, f"python -m benchmarks.bus {options.what} {told}", text)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.bus", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=("rates", "saturated", "time", "kills", "gaps"))
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--sync", type=float, nargs="+", default=[100.0, 250.0, 500.0], help="Hz")
    parser.add_argument("--over", nargs="+", choices=BUSES, default=list(BUSES))
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--rounds", type=int, default=100)
    parser.add_argument("--strains", nargs="+", choices=tuple(STRAINS), default=list(STRAINS))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--others-idle", dest="idle", action="store_true", help="whatever else runs is SCHED_IDLE")
    parser.add_argument("--print", dest="printed", action="store_true", help="do not write the page")
    return parser


if __name__ == "__main__":
    main()
