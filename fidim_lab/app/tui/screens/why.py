"""Why: what the model leaves out, as `fidim explain` found it: where, what, the ranking, before and after."""

from collections.abc import Sequence

from fidim_lab.app.formats.explanation_parts import EffectTable
from fidim_lab.app.tui.paint import EMPTY, Line, Span, Style, left, line, right, wrapped
from fidim_lab.app.tui.result_files import ResultFiles, ShownExplanation
from fidim_lab.mismatch.conclusion.parts import Before

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
    rows: list[Line] = [line(Span(job, "key"))] if job else []
    rows += [line(Span(text, "bad")) for problem in result_files.problems for text in wrapped(problem, width)]
    if result_files.explanation is None:
        says = "Nothing is explained yet. Press e to find what the model leaves out; it takes minutes."
        return [*rows, *(line(Span(text, "dim")) for text in wrapped(says, width)), EMPTY, *checked]
    found = result_files.explanation
    verdict, style = VERDICTS.get(found.verdict, (found.verdict, ""))
    rows += [line(Span(verdict, style)), EMPTY, *_effects(found, width), EMPTY, *_before_after(found)]
    if found.where:
        rows += [EMPTY, line(Span("Where", "head"))]
        rows += [line(text) for place in found.where for text in wrapped(place.says, width, "  ")]
    rows += [EMPTY, *_ranking(found, width)]
    if found.next_experiment:
        rows += [EMPTY, *(line(Span(text, "key")) for text in wrapped(f"Next: {found.next_experiment}", width))]
    rows += [EMPTY, *checked] if checked else []
    return [*rows, EMPTY, line(Span("In full", "head")), *(line(text) for text in wrapped(found.message, width, "  "))]


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
    rows = [line(Span(text, "head")) for text in wrapped(f"{effect.id}{place}: {effect.says}{alike}", width, "  ")]
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
