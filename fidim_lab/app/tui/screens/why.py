"""Why: what the model leaves out, as `fidim explain` found it: where, what, the ranking, before and after.

`check_lines`: what the service's look at the model after each window has said, for Session, too.
"""

from collections.abc import Sequence

from fidim_lab.app.formats.explanation_parts import EffectTable
from fidim_lab.app.service.messages import Happening
from fidim_lab.app.tui.paint import EMPTY, Line, Span, Style, block, left, line, right
from fidim_lab.app.tui.result_files import ResultFiles, ShownExplanation
from fidim_lab.app.tui.screens.result import job_lines
from fidim_lab.mismatch.conclusion.parts import Before

KIND = "model-checked"
HOLDS = "holds"
NEWEST = 3
"""looks that Why shows"""
SHORT = 2
"""lines of the newest on Session"""

VERDICTS: dict[str, tuple[str, Style]] = {
    "nothing-missing": ("✓ nothing is missing", "good"),
    "explained": ("✓ explained", "good"),
    "partly-explained": ("~ partly explained", "warn"),
    "unknown-physics": ("✗ unknown physics", "bad"),
    "sensor-fault": ("✗ a sensor is at fault", "bad"),
}
BEST = 12
"""rows of the ranking"""


def why_lines(result_files: ResultFiles, width: int, job: str = "", checked: Sequence[Line] = ()) -> list[Line]:
    """The whole screen; job: what is being computed; checked: what was said after each window."""
    rows = job_lines(result_files, width, job)
    if result_files.explanation is None:
        says = "Nothing is explained yet. Press e to find what the model leaves out; it takes minutes."
        return [*rows, *block(says, width, "dim"), EMPTY, *checked]
    found = result_files.explanation
    verdict, style = VERDICTS.get(found.verdict, (found.verdict, ""))
    rows += [line(Span(verdict, style)), EMPTY, *_effects(found, width), EMPTY, *_before_after(found)]
    if found.where:
        rows += [EMPTY, line(Span("Where", "head"))]
        for place in found.where:
            rows += block(place.says, width, indent="  ")
    rows += [EMPTY, *_ranking(found, width)]
    if found.next_experiment:
        rows += [EMPTY, *block(f"Next: {found.next_experiment}", width, "key")]
    rows += [EMPTY, *checked] if checked else []
    return [*rows, EMPTY, line(Span("In full", "head")), *block(found.message, width, indent="  ")]


def _before_after(found: ShownExplanation) -> list[Line]:
    held = found.held_out
    return [
        line(Span(f"{'held-out windows':20}{'before':>12}{'after':>12}", "dim")),
        _pair("χ²/dof", held.chi2_per_dof),
        _pair("rms, mm", held.rms_mm),
    ]


def _pair(name: str, pair: Before) -> Line:
    better = pair.before is not None and pair.after is not None and pair.after < pair.before
    return line(f"{name:20}{_short(pair.before):>12}", Span(f"{_short(pair.after):>12}", "good" if better else ""))


def _short(value: float | None, digits: int = 4) -> str:
    return "–" if value is None else f"{value:.{digits}g}"


def _effects(found: ShownExplanation, width: int) -> list[Line]:
    rows: list[Line] = [line(Span("What", "head"))]
    if not found.effects:
        rows.append(line(Span("  no effect is named", "dim")))
    for effect in found.effects:
        rows += _effect(effect, width)
    return rows


def _effect(effect: EffectTable, width: int) -> list[Line]:
    place = "" if effect.cable is None else f" of cable {effect.cable}"
    alike = f" (cannot be separated from {', '.join(effect.alike)})" if effect.alike else ""
    rows = block(f"{effect.id}{place}: {effect.says}{alike}", width, "head", "  ")
    for name, parameter in effect.parameters.items():
        sd = "held" if parameter.sd is None else f"± {parameter.sd:.2g}"
        rows.append(line(f"    {left(name, 12)} {_short(parameter.value, 5)} {sd} {parameter.unit}"))
    return rows


def _ranking(found: ShownExplanation, width: int) -> list[Line]:
    rows: list[Line] = [line(Span(f"{left('What was tried', 40)}{right('χ²/dof', 10)}  possible", "head"))]
    for tried in found.ranking[:BEST]:
        begin = f"  {left(tried.name, 38)}{right(_short(tried.held_out_chi2_per_dof), 10)}  "
        mark = Span("✓ yes" if tried.plausible else "✗ no ", "good" if tried.plausible else "dim")
        rest = max(width - len(begin) - 7, 0)
        rows.append(line(begin, mark, Span(f"  {left(tried.told, rest).rstrip()}" if rest > 8 else "", "dim")))
    return rows


def checks(events: Sequence[Happening]) -> tuple[Happening, ...]:
    """All looks, oldest first."""
    return tuple(event for event in events if event.kind == KIND)


def newest_check(events: Sequence[Happening], width: int) -> list[Line]:
    """Two lines at most: what is suspected, or that the model holds; nothing before the first look."""
    found = checks(events)
    if not found:
        return []
    rows = _said(found[-1], width)
    if len(rows) <= SHORT:
        return rows
    *shown, (last,) = rows[:SHORT]
    return [*shown, line(Span(left(f"{last.text} …", width).rstrip(), last.style))]


def check_lines(events: Sequence[Happening], width: int) -> list[Line]:
    """The newest looks in full, with a heading."""
    found = checks(events)[-NEWEST:]
    if not found:
        return []
    return [line(Span("After each window", "head")), *(row for one in reversed(found) for row in _said(one, width))]


def check_style(event: Happening) -> Style:
    """A doubt is orange; what only tells that there is no answer yet is faint."""
    if event.outcome == HOLDS:
        return ""
    return "warn" if event.outcome else "dim"


def check_mark(event: Happening) -> str:
    """Before a doubt."""
    return "! " if check_style(event) == "warn" else ""


def _said(event: Happening, width: int) -> list[Line]:
    style = check_style(event)
    begin = f"{event.window}: " if event.window else ""
    mark = f"{check_mark(event)}model "
    return block(f"{mark}{begin}{event.text}", width, style)
