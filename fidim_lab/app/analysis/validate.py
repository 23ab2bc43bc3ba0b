"""`fidim validate`: do identified parameters predict windows that they were not found from? Fig. 3, and more."""

from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np
from rich.table import Table

from fidim_lab.app.formats.answer_file import write_answer
from fidim_lab.app.formats.explanation_file import ExplanationTable
from fidim_lab.app.report.contents.found_model import Found, found_model, read_found, with_own_bodies
from fidim_lab.app.report.sections.numerals import short
from fidim_lab.app.terminal import console
from fidim_lab.app.terminal.working import Working, windows_of
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import PARAMETER_NAMES, Campaign, Role
from fidim_lab.errors import SetupError
from fidim_lab.identification.cross_validation import CrossValidation, JudgedWindow, Rule, cross_validate
from fidim_lab.identification.equations.refusals import no_sigma
from fidim_lab.identification.motion.recipe import BEST, PAPER
from fidim_lab.identification.results.result_file import ResultTable
from fidim_lab.mismatch.conclusion.explanation import Verdict
from fidim_lab.units import millimetres

FORMAT = "fidim-validation/1"
LIMIT = 2.0
"""χ²/dof up to which a window counts as predicted"""
BAR = 12
"""characters of the bar at σ⊥ as expected"""
LONGEST = 30


@dataclass(frozen=True)
class ValidateOptions:
    """As on the command line."""

    campaign: Path
    parameters: Path
    everything: bool
    paper: bool
    limit: float
    json_file: Path | None


def validate_command(options: ValidateOptions) -> int:
    """Judge, print, write; returns 0 where the parameters predict, 1 where they do not.

    Raises FileError for a wrong campaign or result file, SetupError when there is nothing to judge, RefusedError when
    nothing can be judged.
    """
    begin = perf_counter()
    given = read_found(options.parameters)
    campaign = read_campaign(options.campaign)
    how = {"everything": options.everything, "paper": options.paper}
    with Working("predicting each window from its initial state", windows_of(options.campaign)):
        found = run_validate(campaign, given, limit=options.limit, **how)
    console.warn(_doubts(campaign, given))
    write_answer(options.json_file, FORMAT, to_json(campaign, given, found, perf_counter() - begin))
    console.out.print(table(found, sigma_of(given)))
    console.out.print(f"{found.message} Rule: {found.rule.sentence}.", markup=False)
    return 0 if found.predicts else 1


def run_validate(
    campaign: Campaign,
    given: Found,
    *,
    everything: bool = False,
    paper: bool = False,
    limit: float = LIMIT,
) -> CrossValidation:
    """Judge the held-out windows of a campaign, or all of `everything`, with nothing but their initial states fitted.

    given: body, geometry and effects that were found with it, and σ_W of that fit (Eq. 31), by the paper's form where
    `paper` is set. limit: largest χ²/dof. Raises SetupError without a window to judge, and where what was found has no
    model with a name; RefusedError where none can be judged.
    """
    if isinstance(given, ExplanationTable) and given.verdict is Verdict.UNKNOWN_PHYSICS:
        raise SetupError(
            f"{given.campaign}: the explanation names no physics, so its file has no model that could predict.",
            hint="Its own held-out windows are judged in its answer; fidim validate takes a result of identify too.",
        )
    roles = (Role.IDENTIFY, Role.VALIDATE) if everything else (Role.VALIDATE,)
    recipe = PAPER if paper else BEST
    model = found_model(given, campaign.robot, native=True)
    return cross_validate(
        with_own_bodies(given, campaign),
        model.body,
        sigma_of(given),
        roles=roles,
        rule=Rule(chi2_per_dof=limit),
        recipe=recipe,
        mechanism=model.mechanism,
        equations=not isinstance(given, ExplanationTable),
    )


def sigma_of(given: Found) -> float | None:
    """Explain forms no equations of motion."""
    return None if isinstance(given, ExplanationTable) else given.sigma_W


def table(found: CrossValidation, sigma_W: float | None) -> Table:
    """Each window with σ⊥ against what is expected (a bar, as Fig. 3), rms and χ²/dof."""
    source = "from marker noise" if sigma_W is None else f"√λ ‖χ‖ σ_W, σ_W = {sigma_W:.3g}"
    rows = [
        (
            window.id,
            window.role.value,
            *(short(value) for value in (window.sigma_perp, window.expected)),
            _bar(window),
            *(short(value) for value in (None if window.rms is None else millimetres(window.rms), window.chi2_per_dof)),
            _verdict(window),
        )
        for window in found.windows
    ]
    names = ("window", "role", "σ⊥", "expected", "σ⊥ as Fig. 3, │ is the expected", "rms, mm", "χ²/dof", "verdict")
    title = f"Parameters held, only each window's initial state fitted (σ⊥ of Eq. 50; expected: {source})"
    return console.table(title, names, rows, left=len(names), caption=found.no_sigma or None, caption_justify="left")


def to_json(
    campaign: Campaign, given: ResultTable | ExplanationTable, found: CrossValidation, seconds: float
) -> dict[str, object]:
    """What --json writes, "fidim-validation/1" (docs/validate.md)."""
    return {
        "campaign": campaign.name,
        "parameters_from": given.campaign,
        "method": None if isinstance(given, ExplanationTable) else given.method,
        "predicts": found.predicts,
        "message": found.message,
        "rule": {"chi2_per_dof": found.rule.chi2_per_dof, "sigma_perp_ratio": found.rule.ratio},
        "sigma_W": sigma_of(given),
        "windows": [
            {
                "id": w.id,
                "role": w.role.value,
                "predicted": w.predicted,
                "sigma_perp": w.sigma_perp,
                "sigma_perp_expected": w.expected,
                "chi2_per_dof": w.chi2_per_dof,
                "rms_mm": None if w.rms is None else millimetres(w.rms),
                "why": "; ".join(part for part in (w.why, w.no_sigma and no_sigma({w.id: w.no_sigma})) if part),
            }
            for w in found.windows
        ],
        "seconds": round(seconds, 3),
    }


def _doubts(campaign: Campaign, given: ResultTable | ExplanationTable) -> list[str]:
    """What speaks against these parameters belonging to this robot."""
    nominal = [given.parameters[name].nominal for name in PARAMETER_NAMES]
    known = np.array([np.nan if v is None else v for v in nominal])
    off = np.abs(known - campaign.robot.nominal.vector) > 1e-9
    if not off.any():
        return []
    names = ", ".join(name for name, differs in zip(PARAMETER_NAMES, off, strict=True) if differs)
    return [f"the parameters were identified with other nominal values ({names}): is it the same robot?"]


def _bar(window: JudgedWindow) -> str:
    if window.sigma_perp is None or window.expected is None:
        return ""
    length = min(LONGEST, round(BAR * window.sigma_perp / window.expected))
    full = "█" * length
    return full.ljust(BAR) + "│" if length <= BAR else full[:BAR] + "│" + full[BAR:]


def _verdict(window: JudgedWindow) -> str:
    match window.predicted:
        case True:
            return f"predicted ({window.why})" if window.why else "predicted"
        case False:
            return f"not predicted: {window.why}"
        case None:
            return f"not judged: {window.why}"
