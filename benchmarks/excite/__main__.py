"""Winch-driven excitation on hidden true bodies: amplitude, tensions, accuracy.

    python -m benchmarks.excite swings --runs 1000      amplitude after one and two tries, tensions
    python -m benchmarks.excite designed --runs 1000    the same for plans of `fidim design --by-winches`
    python -m benchmarks.excite gentle --runs 480       the same where parts of a hand's swing are wanted
    python -m benchmarks.excite possible --runs 480     of `gentle`, what winches could give were nothing hidden
    python -m benchmarks.excite learning --runs 60      sessions of six windows: what earlier ones teach, and tensions
    python -m benchmarks.excite driven --runs 12        what the strokes themselves tell of the body
    python -m benchmarks.excite session --runs 6        whole sessions by hand and by winches: windows an hour, accuracy
    python -m benchmarks.excite travel --runs 24        moves between equilibria: the swing they leave, time to settle

Runs of `swings` and `gentle` take two CPU seconds each, of `learning` 20, and are kept in --rows: the same command goes
on with what is missing.
"""

import argparse
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import TypeVar

import numpy as np
from pydantic import TypeAdapter

from benchmarks.excite.runs import CLOSE, MOST_TRIES, Tries, Try
from benchmarks.excite.session import session
from benchmarks.excite.strokes import LIMITS, driven
from benchmarks.excite.travel import travels
from benchmarks.excite.windows import (
    DESIGN,
    PARTS_WANTED,
    SEEDS,
    SESSION,
    WINDOWS,
    designed_numbered,
    numbered,
    part_numbered,
    planned_by_winches,
    possible_of,
    session_numbered,
)
from benchmarks.page import table, write_section
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot

HIDDEN = (
    f"winches up to {LIMITS.speed:g} m/s and {LIMITS.acceleration:g} m/s². Hidden: a body and a mass 5 % off CAD, "
    "rotational drag or friction at the attachments that damps up to 8 %, set-points up to 4 ms late, 0.1 mm noise. "
    "Each run is the first window of a session: nothing is known of the damping."
)
T = TypeVar("T")


def kept(path: Path, kind: TypeAdapter[tuple[int, T]]) -> dict[int, T]:
    """Runs that were made before."""
    if not path.exists():
        return {}
    return dict(kind.validate_json(line) for line in path.read_text(encoding="utf-8").splitlines())


def made(options: argparse.Namespace, run_of: Callable[[int], T], kind: TypeAdapter[tuple[int, T]]) -> list[T]:
    """All runs; those that are missing are made, and kept as soon as they are."""
    known = kept(options.rows, kind)
    left = [] if options.as_it_is else [run for run in range(options.runs) if run not in known]
    with ProcessPoolExecutor(options.jobs) as processes, options.rows.open("a", encoding="utf-8") as file:
        for run, found in zip(left, processes.map(run_of, left), strict=True):
            file.write(kind.dump_json((run, found)).decode() + "\n")
            file.flush()
    known = kept(options.rows, kind)
    return [known[run] for run in sorted(known) if run < options.runs]


def gentle(options: argparse.Namespace) -> str:
    """How much of a hand's swing may be wanted so that it is reached."""
    runs = made(options, part_numbered, TypeAdapter(tuple[int, Tries]))
    rows: list[list[object]] = []
    for which, part in enumerate(PARTS_WANTED):
        of_part = runs[which :: len(PARTS_WANTED)]
        done = [tries for tries in of_part if not isinstance(tries, str)]
        first, last = [tries[0] for tries in done], [tries[-1] for tries in done]
        able = [t for t in last if not t.why_less]
        rows.append(
            [
                f"{part:g}",
                f"{len(of_part) - len(done)} of {len(of_part)}",
                share(_as_wanted(first)),
                share(_as_wanted(last)),
                f"{len(able)} of {len(last)}",
                share(_as_wanted(able)),
                _low([1 + t.off for t in last]),
                _outside([t for tries in done for t in tries], read_robot(PAPERS_ROBOT).limits.tension),
            ]
        )
    head = [
        "wanted, of a hand's swing",
        "refused",
        "within 15 % of the wanted one, first try",
        "after at most two",
        "the plan says that it can",
        "these, after at most two",
        "swing over wanted: median, least 5 %",
        "tensions outside",
    ]
    return (
        "The windows, bodies, masses and damping of “The swing that winches give”, the displacement in the plan made "
        "smaller. Each run is the first window of a session.\n\n" + table(head, rows)
    )


def bound(options: argparse.Namespace) -> str:
    """How many of the runs of `gentle` could be as wanted at all."""
    runs = made(options, possible_of, TypeAdapter(tuple[int, tuple[float, str]]))
    rows: list[list[object]] = []
    for which, part in enumerate(PARTS_WANTED):
        of_part = runs[which :: len(PARTS_WANTED)]
        shares = np.array([share for share, _ in of_part])
        short = [why for share, why in of_part if share < 1 - CLOSE]
        winches = sum("winches" in why for why in short)
        rows.append(
            [
                f"{part:g}",
                share(shares >= 1 - CLOSE),
                f"{winches} of {len(short)}",
                f"{np.median(shares):.2f}",
            ]
        )
    head = [
        "wanted, of a hand's swing",
        "within 15 % of it is possible",
        "where not, for the winches' speed, acceleration and time",
        "possible over wanted: median",
    ]
    return (
        "The runs of “When less than a hand's swing is wanted”, planned with the body, mass and damping hidden "
        "there: what the best plan of this kind could give at the first try.\n\n" + table(head, rows)
    )


def learning(options: argparse.Namespace) -> str:
    """What the windows of a session teach the later ones, and whether these keep the tensions."""
    sessions = made(options, session_numbered, TypeAdapter(tuple[int, list[Tries]]))
    low, high = read_robot(PAPERS_ROBOT).limits.tension
    rows: list[list[object]] = []
    for number in range(SESSION):
        done = [tries for tries in (session[number] for session in sessions) if not isinstance(tries, str)]
        first, last = [tries[0] for tries in done], [tries[-1] for tries in done]
        rows.append(
            [
                number + 1,
                f"{len(sessions) - len(done)} of {len(sessions)}",
                share(_good(first)),
                share(_good(last)),
                share(_as_wanted(last)),
                f"{np.median([t.share for t in first]):.2f}",
                f"{np.median([1 + t.off for t in last]):.2f}",
                _outside([t for tries in done for t in tries], (low, high)),
            ]
        )
    head = [
        "window",
        "refused",
        "first try as planned or wanted",
        "after at most two",
        "… as wanted",
        "planned over wanted, median",
        "swing over wanted",
        f"outside {low:g}–{high:g} N",
    ]
    return (
        f"Sessions of {SESSION} of the windows above, in different orders; the same hidden bodies, masses and damping. "
        "What a window taught (frequencies, damping, the body) goes into the plans of the next.\n\n" + table(head, rows)
    )


def swings(options: argparse.Namespace) -> str:
    """Amplitude after one and two tries, and tensions, of windows that are a hand's."""
    runs = made(options, numbered, TypeAdapter(tuple[int, Tries]))
    return (
        f"The paper's robot, {WINDOWS} windows that obey all limits when let go by hand; {HIDDEN} Wanted is the "
        "swing that a hand may give with the same care: tensions of all bodies that CAD may mean, 5 % off in mass, "
        "within the limits.\n\n" + _swung(runs)
    )


def designed(options: argparse.Namespace) -> str:
    """The same of windows that are designed for winches."""
    windows = [window for seed in SEEDS for window in planned_by_winches(seed)]  # before processes look for them
    runs = made(options, designed_numbered, TypeAdapter(tuple[int, Tries]))
    ways = [1e3 * float(np.linalg.norm(window.displacement)) for window in windows]
    return (
        f"The paper's robot, the {len(windows)} windows of {len(SEEDS)} plans of `fidim design {' '.join(DESIGN)} "
        f"--seed N`, displacements of {min(ways):.0f} to {max(ways):.0f} mm; {HIDDEN} Wanted is what the plan says.\n\n"
        + _swung(runs)
    )


def _swung(runs: Sequence[Tries]) -> str:
    robot = read_robot(PAPERS_ROBOT)
    done = [tries for tries in runs if not isinstance(tries, str)]
    low, high = robot.limits.tension
    every = [t for tries in done for t in tries]
    tensions = np.array([t.tension for t in every])
    first, last = [tries[0] for tries in done], [tries[-1] for tries in done]
    errors = np.abs([t.error for t in last])
    able = [t for t in last if not t.why_less]
    carried = [tries[-1] for tries in done if len(tries) == MOST_TRIES or _good(tries[-1:]).all()]
    marginal = len(last) - len(carried)
    rows = [
        ("runs, of them refused in words", f"{len(runs)}, {len(runs) - len(done)}"),
        ("swing within 15 % of the planned or of the wanted one, first try", share(_good(first))),
        ("… after at most two", share(_good(last))),
        (f"… but for {marginal} kept as marginal, no second plan being in reach", share(_good(carried))),
        ("swing within 15 % of the wanted one, first try", share(_as_wanted(first))),
        ("… after at most two", share(_as_wanted(last))),
        (f"… where the plan says that it can ({len(able)} of {len(last)})", share(_as_wanted(able))),
        ("swing over the wanted one: median, least 5 %", _low([1 + t.off for t in last])),
        (
            "each mode within 15 % of the whole swing that was planned, after at most two",
            share(np.array([t.mix_error <= CLOSE for t in last])),
        ),
        ("off the planned swing, last try: median, 95 %", f"{np.median(errors):.3f}, {np.quantile(errors, 0.95):.3f}"),
        (
            f"recordings with a tension outside {low:g}–{high:g} N",
            _outside([t for tries in done for t in tries], (low, high)),
        ),
        ("least and largest tension of all, N", f"{tensions[:, 0].min():.1f}, {tensions[:, 1].max():.1f}"),
        ("strokes take, median", f"{np.median([t.seconds for tries in done for t in tries]):.1f} s"),
    ]
    return table(["", ""], rows)


def _good(tries: Sequence[Try]) -> np.ndarray:
    return np.array([min(abs(t.error), abs(t.off)) <= CLOSE for t in tries])


def _as_wanted(tries: Sequence[Try]) -> np.ndarray:
    return np.array([abs(t.off) <= CLOSE for t in tries])


def _outside(tries: Sequence[Try], tension: tuple[float, float]) -> str:
    """How many recordings leave the tensions (N) that are allowed."""
    beyond = sum(t.tension[0] < tension[0] or t.tension[1] > tension[1] for t in tries)
    return f"{beyond} of {len(tries)}"


def _low(values: Sequence[float]) -> str:
    return f"{np.median(values):.2f}, {np.quantile(values, 0.05):.2f}"


def share(which: np.ndarray) -> str:
    return f"{100 * which.mean():.1f} %" if len(which) else "–"


PARTS = {
    "gentle": ("When less than a hand's swing is wanted", gentle),
    "possible": ("What winches could give", bound),
    "learning": ("What a session learns", learning),
    "designed": ("The swing that plans for winches want", designed),
    "driven": ("What the strokes themselves tell", driven),
    "swings": ("The swing that winches give", swings),
    "session": ("Sessions by hand and by winches", session),
    "travel": ("Moves between equilibria", travels),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", choices=PARTS)
    parser.add_argument("--runs", type=int, default=30)
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--rows", type=Path, default=Path("swings.jsonl"), help="runs as they are made")
    parser.add_argument("--as-it-is", action="store_true", help="no further runs: the page from those in --rows")
    options = parser.parse_args()
    title, measure = PARTS[options.part]
    text = measure(options)
    print(text)
    some = " --as-it-is" if options.as_it_is else ""
    write_section("excite", title, f"python -m benchmarks.excite {options.part}{some} --runs {options.runs}", text)


if __name__ == "__main__":
    main()
