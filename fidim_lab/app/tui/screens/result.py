"""Result: the nine parameters against CAD and the last session, each window's σ⊥, and what to measure next."""

import math

from fidim_lab.app.tui.paint import EMPTY, Line, Span, Style, block, left, line, milli, right
from fidim_lab.app.tui.result_files import ResultFiles
from fidim_lab.identification.results.result_file import ParameterTable, ResultTable
from fidim_lab.units import percent, plain

GOOD, WRONG = "converged", ("impossible", "misfit", "not-converged")
INTERVAL = 1.96
"""standard deviations of a 95 % interval"""
WEAK = 0.1
"""of what it is held against; a wider sd is "weak" """


def result_lines(result_files: ResultFiles, width: int, job: str = "") -> list[Line]:
    """The whole screen; job: what is being computed."""
    rows = job_lines(result_files, width, job)
    if result_files.result is None:
        says = "Nothing is identified yet. Press i to identify from the windows recorded so far."
        return [*rows, *block(says, width, "dim")]
    result = result_files.result
    style: Style = "good" if result.outcome == GOOD else "bad" if result.outcome in WRONG else "warn"
    mark = "✓" if style == "good" else "✗" if style == "bad" else "~"
    says = f"{mark} {result.outcome}: {result.message}"
    rows += block(says, width, style)
    rows += block(f"Next: {_next(result_files)}", width, "key")
    return [*rows, EMPTY, *_parameters(result, result_files), EMPTY, *_windows(result, width)]


def job_lines(result_files: ResultFiles, width: int, job: str) -> list[Line]:
    """What is being computed, and which files could not be read."""
    rows: list[Line] = [line(Span(job, "key"))] if job else []
    for problem in result_files.problems:
        rows += block(problem, width, "bad")
    return rows


def _parameters(result: ResultTable, result_files: ResultFiles) -> list[Line]:
    last = f"last: {result_files.last_folder}" if result_files.last else "last session"
    heads = (right("value", 10), right("± 95 %", 9), right("CAD", 10), right("off CAD, sd", 13), right(last, 19))
    rows: list[Line] = [line(Span(f"{'s mm, I 1e-3 m²':16}{''.join(heads)}", "dim"))]
    for name, found in result.parameters.items():
        before = result_files.last.parameters.get(name) if result_files.last else None
        rows.append(_parameter(name, found, before, weak=_weak(result, name)))
    return rows


def _sd(found: ParameterTable) -> float | None:
    known = [sd for sd in (found.sd, found.sd_bootstrap) if sd is not None]
    return max(known) if known else None


def _weak(result: ResultTable, name: str) -> bool:
    sd = _sd(result.parameters[name])
    return name in result.non_essential or (sd is not None and sd > WEAK * _scale(result, name))


def _scale(result: ResultTable, name: str) -> float:
    """What an uncertainty is held against, SI: a component of s against |s|, a product of inertia against its moments.

    A symmetrical platform has some that are zero, however well they are known.
    """
    kind, _, axes = name.partition("_")
    if kind == "s":
        return math.hypot(*(result.parameters[f"s_{axis}"].best for axis in "xyz"))
    moments = [abs(result.parameters[f"I_{axis}{axis}"].best) for axis in axes]
    return math.sqrt(math.prod(moments))


def _parameter(name: str, found: ParameterTable, before: ParameterTable | None, *, weak: bool) -> Line:
    sd = _sd(found)
    off = None if found.nominal is None or found.value is None or not sd else (found.value - found.nominal) / sd
    far: Style = "warn" if off is not None and abs(off) > 3 else ""
    return line(
        Span(left(f"{name}{' ~ weak' if weak else ''}", 16), "warn" if weak else "head"),
        Span(right("not known" if found.value is None else milli(found.value, 3), 10), "head"),
        right(milli(None if sd is None else INTERVAL * sd, 3), 9),
        right(milli(found.nominal, 3), 10),
        Span(right("–" if off is None else f"{off:+.1f}{' !' if far else '  '}", 13), far),
        right(milli(None if before is None else before.value, 3), 19),
    )


def _windows(result: ResultTable, width: int) -> list[Line]:
    """Several beside each other: id, σ⊥, rms and χ²/dof."""
    size = 39
    columns = max(width // size, 1)
    head = left("window   σ⊥ m/s²  rms mm  χ²/dof", size)
    rows: list[Line] = [line(Span(head * columns, "dim"))]
    cells: list[Span] = []
    for window in result.windows:
        numbers = (_short(window.sigma_perp, 9), _short(window.rms_mm, 8), _short(window.chi2_per_dof, 8))
        note = "" if window.used else " unused" if window.role != "validate" else " held out"
        text = f"{left(window.id, 7)}{''.join(numbers)}{note}"
        bad = window.chi2_per_dof is not None and window.chi2_per_dof > 2.0
        cells.append(Span(left(text, size), "warn" if bad else ""))
    return [*rows, *(tuple(cells[begin : begin + columns]) for begin in range(0, len(cells), columns))]


def _short(value: float | None, width: int) -> str:
    return right("–" if value is None else plain(value), width)


def _next(result_files: ResultFiles) -> str:
    result = result_files.result
    if result_files.explanation is not None and result_files.explanation.next_experiment:
        return result_files.explanation.next_experiment
    if result is None:
        return "record windows."
    if result.outcome in WRONG:
        return "the model does not explain the recordings; press e to find what it leaves out (screen Why)."
    weak = [name for name in result.parameters if _weak(result, name)]
    if not weak:
        return "nothing is missing; check with fidim validate on held-out windows."
    share = ", ".join(
        f"{name} (± {percent((_sd(result.parameters[name]) or 0.0) / _scale(result, name)):.0f} %)" for name in weak
    )
    return f"weakly known: {share}. fidim design plans equilibria whose motion depends more on these."
