"""The figures of a series of runs, and its worst runs told, as text in Markdown."""

from collections import Counter
from collections.abc import Sequence

from benchmarks.page import table
from benchmarks.safety.kinds import KINDS
from benchmarks.safety.one_run import Outcome

WORST = 5


def report(outcomes: Sequence[Outcome], seed: int) -> str:
    """Tables, then the worst runs."""
    broken = [outcome for outcome in outcomes if outcome.violations]
    rules = Counter(rule for outcome in outcomes for rule in {v.rule for v in outcome.violations})
    ends = Counter(outcome.ended for outcome in outcomes)
    guards = Counter(outcome.guard or "–" for outcome in outcomes)
    parts = [
        f"{len(outcomes)} runs of two windows, each with two or three faults out of {len(KINDS)} kinds; "
        f"{len(broken)} break a rule.",
        table(("rule", "runs that break it"), [(rule, rules[rule]) for rule in _rules(rules)]),
        table(("end of the run", "runs"), ends.most_common()),
        table(("guard that stopped it", "runs"), guards.most_common()),
        _by_kind(outcomes),
        "### The worst runs",
    ]
    worst = sorted(outcomes, key=lambda outcome: outcome.worst, reverse=True)[:WORST]
    return "\n\n".join([*parts, *(told(outcome, seed) for outcome in worst)])


RULES = (
    *("a: tension", "b: stands still", "b: held", "b: a winch moved", "b: a cable slipped", "b: lengths are wrong"),
    *("b: the marker strays", "b: the marker is off", "c: no end", "c: hang", "c: traceback", "c: bug", "c: no report"),
)


def _rules(found: Counter[str]) -> list[str]:
    return [*RULES, *sorted(set(found) - set(RULES))]


def _by_kind(outcomes: Sequence[Outcome]) -> str:
    rows: list[tuple[object, ...]] = []
    for kind in KINDS.values():
        of = [outcome for outcome in outcomes if kind.name in outcome.kinds]
        if of:
            bad = sum(bool(outcome.violations) for outcome in of)
            used = max(outcome.used for outcome in of)
            rows.append((kind.area, kind.name, len(of), bad, f"{used:.2f}"))
    return table(("area", "kind of fault", "runs", "break a rule", "largest part of the room used"), rows)


def told(outcome: Outcome, seed: int) -> str:
    """One run in full."""
    low, high = outcome.tension
    lines = [
        f"#### Run {outcome.number} (seed {seed})",
        "",
        *(f"- {fault}" for fault in outcome.faults),
        "",
        f"True tensions {low:.1f} to {high:.1f} N; {outcome.used:.2f} of the room beyond the limits was used. "
        f"Accepted: {', '.join(outcome.accepted) or 'none'}.",
        *(f"**{v.rule}**: {v.says}." for v in outcome.violations),
        "",
        "```",
        *outcome.story,
        *([f"{outcome.ended}: {outcome.reason}"] if not outcome.story else []),
        "```",
    ]
    return "\n".join(lines)
