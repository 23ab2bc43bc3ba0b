"""`fidim design --after FILE`: what to record next, after an explanation or a result."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.table import Table

from fidim_lab.app.formats.explanation_file import ExplanationTable, claims_of, read_explanation
from fidim_lab.app.terminal import console
from fidim_lab.app.terminal.windows_table import windows_table
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.files.input_file import read_json
from fidim_lab.data.files.json_file import write_json
from fidim_lab.data.plan_file import write_plan
from fidim_lab.data.records import PARAMETER_NAMES, Campaign, Plan, PlannedWindow, Role
from fidim_lab.errors import FileError, SetupError
from fidim_lab.identification.design.next_window import NextWindow
from fidim_lab.identification.design.task import Criterion, DesignTask
from fidim_lab.identification.design.windows import place
from fidim_lab.identification.results.result_file import read_result
from fidim_lab.mismatch.conclusion.explanation import Verdict
from fidim_lab.mismatch.next_experiment.next_windows import to_know, to_separate
from fidim_lab.mismatch.next_experiment.proposal import Claim, Proposal

FORMAT = "fidim-next/1"
PLAN, ANSWER = "plan.toml", "next.json"


@dataclass(frozen=True)
class AfterOptions:
    """As on the command line."""

    after: Path
    """explanation.json or result.json"""
    campaign: Path | None
    """its folder; that of the file unless given"""
    criterion: Criterion | None
    """A unless given"""
    seed: int
    out: Path | None
    json_file: Path | None


@dataclass(frozen=True, eq=False)
class _Next:
    """What to record next, and what to say of it."""

    windows: tuple[np.ndarray, ...]
    """[lengths; displacement], m, of those worth recording"""
    notes: tuple[tuple[str, ...], ...]
    """for each window, as `proposed_table` shows them"""
    table: dict[str, object]
    lines: tuple[str, ...]
    code: int = 0


def after_command(options: AfterOptions) -> int:
    """Propose, write, print. 1 where nothing that can be recorded separates what is in question.

    Raises FileError for what is neither file, SetupError without a campaign, for that of another file or for a
    criterion that has no meaning here, or as the design does.
    """
    folder = options.campaign or options.after.parent
    if not (folder / "campaign.toml").exists():
        raise SetupError(
            f"{folder} is not a campaign; odds depend on what has been recorded.", hint="Say which: --campaign FOLDER."
        )
    if options.out is not None and options.out.is_dir() and any(options.out.iterdir()):
        raise SetupError(f"{options.out} is not empty; it was not changed.", hint="Choose another --out.")
    campaign = read_campaign(folder)
    known = _known_so_far(options.after)
    _require_its_campaign(options.after, known.campaign, folder, campaign)
    claims = [] if known.explained is None else claims_of(known.explained)
    _require_criterion(options, claims)
    with console.err.status("searching windows that could be recorded"):
        if known.explained is None or not claims:
            found = _for_the_body(campaign, known, options)
        else:
            found = _for_claims(campaign, known.explained, claims, known.body, options.seed)
    plan = _plan(campaign, found.windows)
    _write(options, plan, {"format": FORMAT, "campaign": campaign.name, **found.table})
    _print(found, plan, options)
    return found.code


def _require_its_campaign(file: Path, name: str, folder: Path, campaign: Campaign) -> None:
    """Odds of one campaign say nothing about another, whose robot and windows may be others."""
    if name != campaign.name:
        raise SetupError(
            f"{file} is about the campaign '{name}', and {folder} is '{campaign.name}'.",
            hint="Give the folder of the campaign that it was made from: --campaign FOLDER.",
        )


def _require_criterion(options: AfterOptions, claims: list[Claim]) -> None:
    if options.criterion is Criterion.C:
        raise SetupError(
            "--criterion C does not use a body, and --after asks what is still unknown about it.",
            hint="Give A or D, or leave it out (A).",
        )
    if options.criterion is not None and claims:
        which = ", ".join(sorted({claim.id for claim in claims}))
        raise SetupError(
            f"--criterion chooses a window for the body, and {options.after} leaves effects in question ({which}), "
            "for which the odds choose.",
            hint="Leave --criterion out.",
        )


def _for_the_body(campaign: Campaign, known: "_Known", options: AfterOptions) -> _Next:
    found = to_know(campaign, known.body, criterion=options.criterion or Criterion.A, seed=options.seed)
    lines = (*_question(known.explained), *_known_lines(found))
    return _Next((found.z,), ((),), _known_table(found), lines)


def _for_claims(
    campaign: Campaign, explained: ExplanationTable, claims: list[Claim], body: np.ndarray, seed: int
) -> _Next:
    noise = float(np.sqrt(max(1.0, explained.held_out.chi2_per_dof.after or 1.0)))
    found = to_separate(campaign, claims, body, noise=noise, seed=seed)
    rows = [
        (np.concatenate([window.lengths, window.displacement]), (one.claim.id, f"{100 * odds.probability:.0f} %"))
        for one in found
        if one.separates  # the others would cost a session for next to nothing
        for window, odds in zip(one.windows, one.after, strict=True)
    ]
    by_hand = explained.next_experiment if any(one.beyond or not one.separates for one in found) else None
    return _Next(
        tuple(z for z, _ in rows),
        tuple(note for _, note in rows),
        {"claims": [_claim_table(one) for one in found]},
        (*(one.says for one in found), *([by_hand] if by_hand else [])),
        int(not any(one.separates for one in found)),
    )


class _Known(NamedTuple):
    """What the file says."""

    campaign: str
    explained: ExplanationTable | None
    """None: the file is a result"""
    body: np.ndarray
    """nine base parameters as identified"""


def _known_so_far(path: Path) -> _Known:
    found = read_json(path)
    if not isinstance(found, dict):
        raise FileError(path, "", "is not a JSON object", hint="An explanation or a result is expected.")
    if found.get("format") == "fidim-explanation/1":
        explained = read_explanation(path)
        body = np.array([explained.parameters[name].value for name in PARAMETER_NAMES])
        return _Known(explained.campaign, explained, body)
    result = read_result(path)
    return _Known(result.campaign, None, result.body.vector)


def _question(explained: ExplanationTable | None) -> list[str]:
    """What is in question, where no effect is to be told from another."""
    if explained is None or explained.verdict in (Verdict.NOTHING_MISSING, Verdict.EXPLAINED):
        return ["No effect is in question; a window is chosen for the body."]
    said = (
        f"The verdict is {explained.verdict.value}: no window can be chosen to separate effects, since none is named."
    )
    return [said, *([explained.next_experiment] if explained.next_experiment else [])]


def _plan(campaign: Campaign, windows: Sequence[np.ndarray]) -> Plan:
    robot = campaign.robot
    task = DesignTask(robot, equilibria=1)
    mechanism, planned = task.mechanism(), list[PlannedWindow]()
    for number, z in enumerate(windows, start=1):
        at_rest, aside = place(mechanism, task, z).marker_at(robot.marker)
        planned.append(PlannedWindow(f"next{number:02d}", Role.IDENTIFY, z[: robot.n], aside, at_rest))
    return Plan(f"{campaign.name}-next", tuple(planned))


def _write(options: AfterOptions, plan: Plan, table: dict[str, object]) -> None:
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        write_json(options.out / ANSWER, table)
        if plan.windows:
            write_plan(options.out / PLAN, plan)
    if options.json_file is not None:  # may lie in the folder
        write_json(options.json_file, table)


def _print(found: _Next, plan: Plan, options: AfterOptions) -> None:
    console.out.print("\n".join(found.lines), markup=False)
    if plan.windows:
        console.out.print(proposed_table(plan, found.notes))
    for line in closing(plan, options.out):
        console.out.print(line, markup=False)


def _claim_table(found: Proposal) -> dict[str, object]:
    return {
        "effect": found.claim.id,
        "cable": found.claim.cable,
        "rivals": list(found.claim.rivals),
        "open": list(found.claim.open),
        "beyond": list(found.beyond),
        "markers": found.markers,
        "separates": found.separates,
        "odds_now": round(found.before.probability, 4),
        "windows": [
            {
                "lengths": [round(float(v), 5) for v in window.lengths],
                "displacement": [round(float(v), 5) for v in window.displacement],
                "odds": round(odds.probability, 4),
                "rival": odds.rival,
            }
            for window, odds in zip(found.windows, found.after, strict=True)
        ],
        "says": found.says,
    }


def _known_table(known: NextWindow) -> dict[str, object]:
    return {
        "window": [round(float(v), 5) for v in known.z],
        "sd_now": dict(zip(PARAMETER_NAMES, known.sd_before.tolist(), strict=True)),
        "sd_after": dict(zip(PARAMETER_NAMES, known.sd_after.tolist(), strict=True)),
    }


def _known_lines(known: NextWindow) -> list[str]:
    parts = ", ".join(
        f"{name} {before:.1e} → {after:.1e}"
        for name, before, after in zip(PARAMETER_NAMES, known.sd_before, known.sd_after, strict=True)
    )
    return ["The most informative window about the body:", f"predicted sd  {parts}"]


def proposed_table(plan: Plan, notes: Sequence[tuple[str, ...]]) -> Table:
    """The windows with their notes.

    notes: for each window the effect that it is for, and the odds once it and those before it are recorded; or nothing.
    """
    heads = ("window", *(("for", "odds") if notes[0] else ()))
    return windows_table("To record next", [window.id for window in plan.windows], plan.windows, notes, heads)


def closing(plan: Plan, out: Path | None) -> list[str]:
    """What was written, and what comes next. out: the folder, where one was asked for."""
    if not plan.windows:
        why = "no window that can be recorded is likely to separate the effects in question"
        return [f"written     {out / ANSWER}; no {PLAN}: {why}"] if out is not None else [f"plan        none: {why}"]
    if out is None:
        return [f"plan        not written: --out FOLDER makes {PLAN} of these windows, for fidim run"]
    return [f"written     {out / PLAN}, {ANSWER}", f"next        fidim run {out / PLAN} --rig RIG.toml"]
