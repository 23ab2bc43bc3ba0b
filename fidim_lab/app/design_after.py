"""`fidim design --after FILE`: what to record next, after an explanation or a result."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fidim_lab.app import console
from fidim_lab.app.report.explanation_file import ExplanationTable, read_explanation
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.plan_file import write_plan
from fidim_lab.data.records import PARAMETER_NAMES, Campaign, Plan, PlannedWindow, Role
from fidim_lab.data.toml_file import read_text
from fidim_lab.errors import FileError, SetupError
from fidim_lab.identification.design.next_window import NextWindow
from fidim_lab.identification.design.task import Criterion, DesignTask
from fidim_lab.identification.design.windows import place
from fidim_lab.identification.result_file import read_result
from fidim_lab.mismatch.explanation import Verdict
from fidim_lab.mismatch.next_windows import to_know, to_separate
from fidim_lab.mismatch.proposal import Claim, Proposal

FORMAT = "fidim-next/1"


@dataclass(frozen=True)
class AfterOptions:
    """As on the command line."""

    after: Path
    """explanation.json or result.json"""
    campaign: Path | None
    """its folder; that of the file unless given"""
    criterion: Criterion
    seed: int
    out: Path | None
    json_file: Path | None


def after_command(options: AfterOptions) -> int:
    """Propose, write, print. 1 where nothing that can be recorded separates what is in question.

    Raises FileError for what is neither file, SetupError without a campaign, or as the design does.
    """
    folder = options.campaign or options.after.parent
    if not (folder / "campaign.toml").exists():
        raise SetupError(
            f"{folder} is no campaign; odds depend on what has been recorded.", hint="Say which: --campaign FOLDER."
        )
    if options.out is not None and options.out.is_dir() and any(options.out.iterdir()):
        raise SetupError(f"{options.out} holds files already; nothing was touched.", hint="Choose another --out.")
    campaign = read_campaign(folder)
    explained, body = _known_so_far(options.after)
    claims = [] if explained is None else claims_of(explained)
    with console.err.status("looking at windows that could be recorded"):
        if explained is None or not claims:
            known = to_know(campaign, body, criterion=options.criterion, seed=options.seed)
            plan, table, code = _plan(campaign, [known.z]), _known_table(known), 0
            lines = [*_question(explained), *_known_lines(known)]
        else:
            noise = float(np.sqrt(max(1.0, explained.held_out.chi2_per_dof.after or 1.0)))
            found = to_separate(campaign, claims, body, noise=noise, seed=options.seed)
            windows = [np.concatenate([w.lengths, w.displacement]) for one in found for w in one.windows]
            plan, table = _plan(campaign, windows), {"claims": [_claim_table(one) for one in found]}
            lines, code = [one.says for one in found], int(not any(one.separates for one in found))
            by_hand = explained.next_experiment if any(one.beyond or not one.separates for one in found) else None
            lines += [by_hand] if by_hand else []
    _write(options, plan, {"format": FORMAT, "campaign": campaign.name, **table})
    console.out.print("\n".join(lines), markup=False)
    return code


def claims_of(explained: ExplanationTable) -> list[Claim]:
    """The effects that something else may stand for."""
    return [
        Claim(e.id, e.cable, tuple(float(p.value or 0.0) for p in e.parameters.values()), e.alike)
        for e in explained.effects
        if e.alike and e.parameters
    ]


def _known_so_far(path: Path) -> tuple[ExplanationTable | None, np.ndarray]:
    """An explanation (None: the file is a result), and the nine base parameters as identified."""
    try:
        format_ = json.loads(read_text(path)).get("format")
    except (ValueError, AttributeError):
        raise FileError(path, "", "is no JSON object", hint="An explanation or a result is expected.") from None
    if format_ == "fidim-explanation/1":
        explained = read_explanation(path)
        return explained, np.array([explained.parameters[name].value for name in PARAMETER_NAMES])
    return None, read_result(path).body.vector


def _question(explained: ExplanationTable | None) -> list[str]:
    """What is in question, where no effect is to be told from another."""
    if explained is None or explained.verdict in (Verdict.NOTHING_MISSING, Verdict.EXPLAINED):
        return ["Nothing is in question but the body."]
    said = f"The verdict is {explained.verdict.value}: no window can be chosen to tell apart what has no rival by name."
    return [said, *([explained.next_experiment] if explained.next_experiment else [])]


def _plan(campaign: Campaign, windows: list[np.ndarray]) -> Plan:
    robot = campaign.robot
    task = DesignTask(robot, equilibria=1)
    mechanism, planned = task.mechanism(), list[PlannedWindow]()
    for number, z in enumerate(windows, start=1):
        at_rest, aside = place(mechanism, task, z).marker_at(robot.marker)
        planned.append(PlannedWindow(f"next{number:02d}", Role.IDENTIFY, z[: robot.n], aside, at_rest))
    return Plan(f"{campaign.name}-next", tuple(planned))


def _write(options: AfterOptions, plan: Plan, table: dict[str, object]) -> None:
    if options.json_file is not None:
        options.json_file.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")
    if options.out is not None and plan.windows:
        options.out.mkdir(parents=True, exist_ok=True)
        write_plan(options.out / "plan.toml", plan)
        (options.out / "next.json").write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")


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
    return ["The window that tells most about the body:", f"predicted sd  {parts}"]
