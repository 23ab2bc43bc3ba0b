"""`fidim design --study`: C over the numbers of equilibria and samples, as a table, JSON and a plot."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.table import Table

from fidim_lab.app.terminal import console
from fidim_lab.app.terminal.spread_out import workers
from fidim_lab.app.terminal.working import Working
from fidim_lab.data.files.json_file import write_json
from fidim_lab.identification.design.study import Cell, study
from fidim_lab.identification.design.task import DesignTask

PICTURE = "study.svg"


def study_command(
    task: DesignTask,
    *,
    starts: int,
    seed: int,
    out: Path | None,
    json_file: Path | None,
    processes: int | None,
    scheduler: str | None,
) -> int:
    """Compute, write and print the study; returns the exit code. Raises as `identification.design.study.study`."""
    with Working("study", starts) as shown, workers(processes, scheduler) as run:
        cells = study(task, starts, seed, run, lambda text: shown.update(f"study: {text}"))
    told = _as_json(cells)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        write_json(out / "study.json", told)
        write_study(cells, out / PICTURE)
    if json_file is not None:  # may lie in the folder
        write_json(json_file, told)
    console.out.print(_table(cells))
    console.out.print(f"{starts} starts each, not polished; {np.median([c.seconds for c in cells]):.2f} s a start")
    return 0


def write_study(cells: Sequence[Cell], path: Path) -> None:
    """Best C and its spread over n_e, a line for each n_s; beside it the time of a start."""
    import matplotlib as mpl

    mpl.use("Agg")
    mpl.rcParams["svg.hashsalt"] = "fidim"
    from matplotlib import pyplot

    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10, 4), layout="constrained")
    for k, n_s in enumerate(sorted({cell.samples for cell in cells})):
        some = sorted((cell for cell in cells if cell.samples == n_s), key=lambda cell: cell.equilibria)
        n_e, best = [cell.equilibria for cell in some], [cell.best for cell in some]
        left.plot(n_e, best, ".-", color=f"C{k}", label=f"{n_s} samples")
        right.plot(n_e, [cell.seconds for cell in some], ".-", color=f"C{k}")
    left.set(xlabel="equilibria", ylabel="best C of the starts")
    left.legend()
    right.set(xlabel="equilibria", ylabel="time of a start / s", ylim=(0, None))
    figure.savefig(path, format="svg", metadata={"Date": None})
    pyplot.close(figure)


def _as_json(cells: Sequence[Cell]) -> dict[str, object]:
    rows = [
        {
            "equilibria": cell.equilibria,
            "samples": cell.samples,
            "C": cell.values,
            "seconds": round(cell.seconds, 3),
        }
        for cell in cells
    ]
    return {"format": "fidim-design-study/1", "cells": rows}


def _table(cells: Sequence[Cell]) -> Table:
    n_e, n_s = (sorted({getattr(cell, name) for cell in cells}) for name in ("equilibria", "samples"))
    at = {(cell.equilibria, cell.samples): cell for cell in cells}
    rows = [
        (str(samples), *(f"{at[n, samples].best:.2f}  {np.median(at[n, samples].values):.2f}" for n in n_e))
        for samples in n_s
    ]
    names = ("samples", *(f"{count} equilibria" for count in n_e))
    return console.table("C: best and median of the starts", names, rows, left=0)
