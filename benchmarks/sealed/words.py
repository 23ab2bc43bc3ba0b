"""What a benchmark found, in Markdown: the terminal shows it, and `--page` puts it into the docs."""

import os
import platform
import subprocess
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import numpy as np

from benchmarks.sealed.cases import SecretKind
from benchmarks.sealed.scoring import Marked
from benchmarks.sealed.statistics import DetectionLimit
from benchmarks.sealed.tally import BAND_NAMES, ScoredCampaign, Tally

METHOD = """\
Each campaign is of another robot (size, weight, drums, attachments, body, 1 to 4 markers, noise, frame rate;
with or without encoders and currents), simulated by code that shares nothing with what explains, some in
MuJoCo, some with a robot file whose anchors are off by 0.2 to 2 mm and whose attachments by half of it, which does
not say so; sizes are log-uniform. `explain` sees the campaign folder alone, in a process with a limit of CPU time;
without an answer it is wrong."""

DEALT = """\
A fifth hides nothing, a tenth something outside the catalogue; of those with effects a third has two and a tenth
three. Right: exactly the hidden effects, with their cable. By class: through `equivalent_to`, or right names under the
verdict "partly-explained"; where the robot file is off, with pieces of its geometry beside, none of them as the only
name, and with what is hidden of the geometry told as clearly off."""

WITHOUT = """\
Every campaign hides {effect}, which the catalogue lacked: physics that nobody listed. Right: called unknown. By
class: neighbours are named, none of them as the only one, or it is one of the geometry, and that is reported to be
clearly off. Wrong: a name that claims odds over 20, or any other "nothing is missing"."""

TURN_BY_TURN = {
    "each": "one effect of the catalogue, each in its turn",
    "unlisted": "one force of those that no catalogue has, each in its turn",
}

COUNTS = ("campaigns", "right", "by class", "wrong", "right or by class (95 %)")


def page(tally: Tally, command: str, commitment: str, without: str = "") -> str:
    """The whole page; without: the effect that all hide and the catalogue lacked, or a key of `cases.TURNS`."""
    sections = (
        ("By loudness", _bands(tally)),
        *(
            (("By effect", _effects(tally)), ("Confusion", _confusion(tally)))
            if without
            else (
                ("By kind", _kinds(tally)),
                ("By world", _worlds(tally)),
                ("False alarms and the unknown", _alarms(tally)),
                ("Confusion", _confusion(tally)),
                ("Detection limits", _limits(tally)),
            )
        ),
        ("Parameters and time", _parameters(tally)),
        ("Not right", _failures(tally)),
    )
    text = "\n\n".join(f"## {title}\n{body}" for title, body in sections)
    committed = f"Truth committed to before the first campaign was explained: SHA-256 `{commitment}`."
    head = f"# Measured: explain, on sealed campaigns\n\n{provenance(command)}\n{committed}"
    hidden = TURN_BY_TURN.get(without, f"`{without}`")
    method = f"{METHOD}\n\n{WITHOUT.format(effect=hidden) if without else DEALT}"
    return f"{head}\n\n{method}\n\n{text}\n"


def provenance(command: str) -> str:
    """Who computed it, where and when."""
    here = Path(__file__).parent
    try:
        git = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=here, capture_output=True, text=True)
        commit = git.stdout.strip()
    except OSError:
        commit = ""
    libraries = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "casadi"))
    return (
        f"`{command}`, {datetime.now(UTC).date()}, commit {commit or 'unknown'}, fidim-lab {version('fidim-lab')}, "
        f"{os.cpu_count()} cores ({platform.machine()}), Python {platform.python_version()}, {libraries}."
    )


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)


def _bands(tally: Tally) -> str:
    """Right, class and wrong by how much χ² the secret costs."""
    rows = [_grades(name, tally.in_band(name)) for name in BAND_NAMES if tally.in_band(name)]
    return (
        "Campaigns with one effect, several, or a sensor fault, by the excess of χ² of the model as it is that the\n"
        "faintest of their effects brings alone (expected, from a recording with a tenth of the noise; windows to\n"
        "identify from).\n\n" + table(("χ² excess of the faintest", *COUNTS), rows)
    )


def _kinds(tally: Tally) -> str:
    rows = [_grades(kind.value, tally.of(lambda c, k=kind: c.kind is k)) for kind in SecretKind]
    return table(("hidden", *COUNTS), rows)


def _worlds(tally: Tally) -> str:
    worlds = sorted({c.world for c in tally.campaigns})
    rows = [_grades(world, tally.of(lambda c, w=world: c.world == w)) for world in worlds]
    return table(("recorded in", *COUNTS), rows)


def _effects(tally: Tally) -> str:
    ids = dict.fromkeys(c.hidden[0]["id"] for c in tally.campaigns)
    rows = [_grades(id, tally.of(lambda c, id=id: c.hidden[0]["id"] == id)) for id in sorted(ids)]
    return table(("hidden, not in the catalogue", *COUNTS), rows)


def _grades(name: str, campaigns: tuple[ScoredCampaign, ...]) -> tuple[object, ...]:
    counts = [sum(c.grade is grade for c in campaigns) for grade in Marked]
    return name, len(campaigns), *counts, Tally(campaigns).share(lambda _: True)


def _alarms(tally: Tally) -> str:
    rows = [
        (name, len(outside), Tally(outside).outside, Tally(outside).halved)
        for name in BAND_NAMES
        if (outside := tally.outside_in(name))
    ]
    return (
        f"False alarms on campaigns with nothing hidden: {tally.false_alarms} (exact 95 % interval, Clopper–Pearson). "
        f"Outside the catalogue, and called unknown: {tally.outside}; of these the generic model halves the held-out "
        f"excess of χ²/dof at least: {tally.halved}. Wrong and sure, a single name for what was not hidden: "
        f"{tally.wrong_and_sure}. Of campaigns with effects of which something is named, all hidden ones stand among "
        f"the names and what is not told from them: {tally.covered}.\n\n"
        + table(("χ² excess of what is outside", "campaigns", "called unknown (95 %)", "of these halved (95 %)"), rows)
    )


def _confusion(tally: Tally) -> str:
    rows = [(hidden, named, count) for (hidden, named), count in tally.confusion.items()]
    return table(("hidden (at most one)", "named", "campaigns"), rows)


def _limits(tally: Tally) -> str:
    """The size found nine times in ten."""
    rows = [(id, count, _limit(size), unit, _limit(mm)) for id, (count, size, mm, unit) in tally.limits().items()]
    return (
        "The smallest size that is found nine times in ten (logistic curve in the logarithm of the size; times or\n"
        "divided by one standard deviation), in the effect's unit, and in mm of trajectory: rms of a marker component\n"
        "that the model as it is cannot follow, its parameters fitted. ≤ and ≥: beyond the sizes that were tried.\n\n"
        + table(("effect", "campaigns", "limit", "unit", "limit, mm"), rows)
    )


def _limit(limit: DetectionLimit | None) -> str:
    if limit is None:
        return "–"
    sign = {"": "", "below": "≤ ", "above": "≥ "}[limit.beyond]
    return sign + f"{limit.size:.2g} ×/÷ {np.sqrt(limit.high / limit.low):.2g}"


def _parameters(tally: Tally) -> str:
    errors, times = tally.errors(), np.array([c.cpu for c in tally.campaigns])
    said = "No campaign with an effect was explained rightly."
    if errors is not None:
        said = (
            f"Error of the nine inertial parameters, rms in their own standard deviations, where an effect was rightly "
            f"named (median of campaigns): {errors[0]:.3g} before, {errors[1]:.3g} after."
        )
    if not len(times):
        return said
    return f"{said}\n\nCPU time of a campaign: median {np.median(times):.0f} s, longest {times.max():.0f} s."


def _failures(tally: Tally) -> str:
    rows = [
        (
            c.name,
            "<br>".join(hidden["hide"] for hidden in c.hidden) or "nothing",
            c.named + (f": {c.why}" if c.why else ""),
            _number(c.chi2_excess),
            _number(c.faintest),
            f"{_number(c.held_out[0])} → {_number(c.held_out[1])}",
            c.world,
        )
        for c in tally.of(lambda c: not c.grade.good)
    ]
    return table(("campaign", "hidden", "named", "χ² excess", "of the faintest", "held-out χ²/dof", "world"), rows)


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.4g}"
