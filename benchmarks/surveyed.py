"""Are the stated ± honest where the robot file is off by survey errors? rms of error over ± for every parameter.

python -m benchmarks.surveyed --campaigns 100 --seed S [--page]

Each campaign: the file's anchors are off by 0.2 to 2 mm a coordinate (normal, the size log-uniform), attachments by
half of it; the windows are those of the true robot. Every second file states its survey ([survey]), the others say
nothing of it. Robots with four, three and two cables (benchmarks.spoilt.worlds), marker noise of the robot file.
`--page` writes the table into docs/benchmarks/surveyed.md.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from time import process_time

import numpy as np

from benchmarks.page import table, write_section
from benchmarks.sealed.campaigns import ATTACHMENTS, with_survey_errors
from benchmarks.sealed.seal import SURVEY_ERRORS
from benchmarks.spoilt.worlds import swung
from fidim_lab.app.workflows.identify import PosedCampaign, identify_posed
from fidim_lab.data.records import PARAMETER_NAMES, Campaign, Survey
from fidim_lab.errors import FidimError

WORLDS = 20
"""that the files are perturbed of, with each seed"""
HONEST = (0.7, 1.5)
"""rms of error over ± that is allowed"""


@dataclass(frozen=True, eq=False)
class Row:
    """One campaign."""

    stated: bool
    ratios: np.ndarray
    """(9,) error over ±; nan where it is not given"""


def campaign(number: int, seed: int) -> tuple[Campaign, np.ndarray, bool]:
    """The campaign with the wrong file, the true parameters, and whether the file states its survey."""
    rng = np.random.default_rng([seed, number, 5])
    known = swung(seed, number % WORLDS, one_marker=False)
    scale = float(np.exp(rng.uniform(*np.log(SURVEY_ERRORS))))
    robot, stated = known.campaign.robot, number % 2 == 0
    wrong = with_survey_errors(robot, scale, ATTACHMENTS * scale, rng)
    survey = Survey.alike(robot.n, scale, ATTACHMENTS * scale) if stated else None
    noise = robot.sensors.marker_noise
    windows = tuple(
        replace(w, markers=w.markers + noise * rng.normal(size=w.markers.shape)) for w in known.campaign.windows
    )
    return replace(known.campaign, robot=replace(wrong, survey=survey), windows=windows), known.body.vector, stated


def run(numbers: Sequence[int], seed: int) -> list[Row]:
    """Perturb, identify, compare."""
    rows: list[Row] = []
    for number in numbers:
        made, truth, stated = campaign(number, seed)
        begin = process_time()
        says, ratios = "", np.full(9, np.nan)
        try:
            result = identify_posed(PosedCampaign(made))
            given = result.parameters.values()
            ratios = np.array([(p.value - t) / p.sd if p.seen else np.nan for p, t in zip(given, truth, strict=True)])
            says = "" if result.outcome.good else result.answer.message[:200]
        except FidimError as refusal:
            says = str(refusal)[:200]
        rows.append(Row(stated, ratios))
        line = " ".join(f"{ratio:6.2f}" for ratio in ratios)
        kind = f"{made.robot.n} cables {'stated' if stated else 'open':6s}"
        print(f"{number:4d} {kind} {line} {process_time() - begin:5.1f} s {says}", flush=True)
    return rows


def page(rows: Sequence[Row]) -> str:
    """rms for every parameter, by what the file states."""
    kinds = (
        ("stated", [r for r in rows if r.stated]),
        ("not stated", [r for r in rows if not r.stated]),
        ("all", rows),
    )
    lines = []
    for name, ours in kinds:
        ratios = np.array([row.ratios for row in ours]).reshape(-1, 9)
        given = np.isfinite(ratios)
        rms = np.sqrt(np.nansum(ratios**2, axis=0) / np.maximum(given.sum(axis=0), 1))
        worst = float(np.nanmax(np.abs(ratios))) if given.any() else np.nan
        count = int(given.any(axis=1).sum())
        lines.append((name, f"{count} of {len(ours)}", *(f"{value:.2f}" for value in rms), f"{worst:.1f}"))
    return f"rms of error over stated ±; {HONEST[0]} to {HONEST[1]} is honest.\n\n" + table(
        ("[survey]", "answered", *PARAMETER_NAMES, "largest, ±"), lines
    )


def main() -> None:
    """As the module says."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--campaigns", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--page", action="store_true")
    asked = parser.parse_args()
    text = page(run(range(asked.first, asked.first + asked.campaigns), asked.seed))
    print(text)
    if asked.page:
        command = f"python -m benchmarks.surveyed --campaigns {asked.campaigns} --seed {asked.seed} --page"
        write_section("surveyed", "Honest ± with a surveyed geometry", command, text)


if __name__ == "__main__":
    main()
