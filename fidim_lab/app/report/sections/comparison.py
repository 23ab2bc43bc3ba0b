"""Two sessions set side by side: `compared` gives differences with their size in standard deviations, and a verdict."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from fidim_lab.app.report.sections.compared_session import ComparedSession
from fidim_lab.app.report.sections.explained import VERDICTS
from fidim_lab.app.report.sections.numerals import decimals, fixed, short
from fidim_lab.app.report.sections.tables import ReportTable
from fidim_lab.data.records import PARAMETER_NAMES, Robot
from fidim_lab.identification.results.result_file import ParameterTable, ResultTable, ResultWindow
from fidim_lab.units import millimetres

CHANCE = 0.01
"""of calling two sessions of one body different: shared evenly among the nine parameters (Bonferroni)"""
SAME_GEOMETRY = 1e-4
"""m; robot files that differ by more describe different robots"""
USABLE = frozenset({"converged", "partial", "doubtful"})
"""outcomes whose uncertainties mean what they say"""


@dataclass(frozen=True)
class Shift:
    """One parameter in both sessions, SI."""

    name: str
    a: float
    sd_a: float
    b: float
    sd_b: float

    @property
    def difference(self) -> float:
        """B − A."""
        return self.b - self.a

    @property
    def z(self) -> float | None:
        """The difference in standard deviations, the two sessions being independent; None where neither states any."""
        sd = float(np.hypot(self.sd_a, self.sd_b))
        return self.difference / sd if sd > 0 else None


@dataclass(frozen=True)
class WindowPair:
    """Windows of one name; None where a session has none."""

    id: str
    a: ResultWindow | None
    b: ResultWindow | None


@dataclass(frozen=True, eq=False)
class Comparison:
    """The whole answer."""

    a: ComparedSession
    b: ComparedSession
    shifts: tuple[Shift, ...]
    """empty where one of them has no result"""
    windows: tuple[WindowPair, ...]
    facts: tuple[tuple[str, str, str], ...]
    """what, A, B"""
    warnings: tuple[str, ...]
    agree: bool
    message: str

    @property
    def table(self) -> dict[str, object]:
        """As "fidim-comparison/1", without its format."""
        return {
            "a": _side(self.a),
            "b": _side(self.b),
            "parameters": {
                s.name: {"a": s.a, "sd_a": s.sd_a, "b": s.b, "sd_b": s.sd_b, "difference": s.difference, "z": s.z}
                for s in self.shifts
            },
            "windows": [
                {"id": w.id, **{side: _window(one) for side, one in (("a", w.a), ("b", w.b))}} for w in self.windows
            ],
            "agree": self.agree,
            "warnings": list(self.warnings),
            "message": self.message,
        }


def compared(a: ComparedSession, b: ComparedSession) -> Comparison:
    """Set two sessions side by side."""
    shifts = () if a.result is None or b.result is None else _shifts(a.result, b.result)
    agree, message = _judged(a, b, shifts)
    return Comparison(a, b, shifts, _windows(a, b), _facts(a, b), tuple(_warnings(a, b)), agree, message)


def limit() -> float:
    """|z| beyond which one of nine differences is more than chance."""
    return float(stats.norm.isf(CHANCE / (2 * len(PARAMETER_NAMES))))


def _shifts(a: ResultTable, b: ResultTable) -> tuple[Shift, ...]:
    pairs = [(name, a.parameters[name], b.parameters[name]) for name in PARAMETER_NAMES]
    return tuple(Shift(name, p.best, _stated(p), q.best, _stated(q)) for name, p, q in pairs)


def _stated(parameter: ParameterTable) -> float:
    """The larger of the nominal sd and the spread between windows; 0 where none is stated."""
    return max(parameter.sd or 0.0, parameter.sd_bootstrap or 0.0)


def _judged(a: ComparedSession, b: ComparedSession, shifts: Sequence[Shift]) -> tuple[bool, str]:
    if not shifts:
        without = " and ".join(name for name, one in (("A", a), ("B", b)) if one.result is None)
        return False, f"Parameters cannot be compared: {without} has none."
    known = [(s, abs(s.z)) for s in shifts if s.z is not None]
    if not known:
        return False, "Parameters cannot be judged: neither session states an uncertainty."
    worst, size = max(known, key=lambda pair: pair[1])
    most = limit()
    figures = f"{worst.name} differs most, by {size:.1f} sd"
    if size <= most:
        return (
            True,
            f"The two sessions agree: {figures}; chance alone exceeds {most:.1f} sd in {CHANCE:.0%} of cases.",
        )
    beyond = [s.name for s, z in known if z > most]
    return (
        False,
        f"The two sessions differ by more than chance explains ({most:.1f} sd) in {', '.join(beyond)}; {figures}.",
    )


def _windows(a: ComparedSession, b: ComparedSession) -> tuple[WindowPair, ...]:
    of_a, of_b = ({w.id: w for w in ([] if s.result is None else s.result.windows)} for s in (a, b))
    return tuple(WindowPair(id, of_a.get(id), of_b.get(id)) for id in dict.fromkeys([*of_a, *of_b]))


def _facts(a: ComparedSession, b: ComparedSession) -> tuple[tuple[str, str, str], ...]:
    rows = [
        ("campaign", a.name, b.name),
        ("recorded", _recorded(a), _recorded(b)),
        ("run", a.run or "–", b.run or "–"),
        ("identified", _outcome(a), _outcome(b)),
        ("left out", _left_out(a), _left_out(b)),
        ("windows used", _used(a), _used(b)),
        ("held-out χ²/dof, median", short(a.held_out), short(b.held_out)),
        ("tensions, 98 % of samples, N", _tension(a), _tension(b)),
    ]
    return tuple(row for row in rows if row[1:] != ("–", "–"))


def _recorded(session: ComparedSession) -> str:
    story = None if session.contents is None else session.contents.story
    return "–" if story is None else story.began


def _outcome(session: ComparedSession) -> str:
    if session.result is None:
        return f"✗ {session.origin}"
    sign = "✓" if session.result.outcome == "converged" else "✗"
    return f"{sign} {session.result.outcome} ({session.result.method})"


def _left_out(session: ComparedSession) -> str:
    found = session.explanation
    if found is None:
        return "–"
    return f"{VERDICTS[found.verdict]}: {', '.join(e.label for e in found.effects) or 'no effect'}"


def _used(session: ComparedSession) -> str:
    rows = () if session.result is None else session.result.windows
    return f"{sum(w.used for w in rows)} of {len(rows)}" if rows else "–"


def _tension(session: ComparedSession) -> str:
    found = session.tension
    if found is None or session.contents is None:
        return "–"
    low, high = session.contents.campaign.robot.limits.tension
    return f"{found[0]:.0f} to {found[1]:.0f} (allowed {low:.0f} to {high:.0f})"


def _warnings(a: ComparedSession, b: ComparedSession) -> list[str]:
    said: list[str] = []
    if a.contents is not None and b.contents is not None:
        said += _differing(a.contents.campaign.robot, b.contents.campaign.robot)
    for name, one in (("A", a), ("B", b)):
        if one.result is not None and one.result.outcome not in USABLE:
            said.append(f"{name} is “{one.result.outcome}”: its parameters are less certain than their sd say.")
    if a.result is not None and b.result is not None and a.result.method != b.result.method:
        said.append(f"A was identified by {a.result.method}, B by {b.result.method}: their sd cannot be compared.")
    return said


def _differing(a: Robot, b: Robot) -> list[str]:
    """What of the robot files is not the same."""
    if a.n != b.n:
        return [f"A's robot has {a.n} cables, B's {b.n}: these are different robots."]
    said: list[str] = []
    places = [np.array([[*c.d, *c.a] for c in robot.cables]) for robot in (a, b)]
    apart = float(np.abs(places[0] - places[1]).max())
    if apart > SAME_GEOMETRY:
        said.append(f"The robot files differ: anchors or attachments by up to {1e3 * apart:.2g} mm.")
    if abs(a.mass - b.mass) > 1e-3 * a.mass:
        said.append(f"The robot files differ: {a.mass:g} and {b.mass:g} kg.")
    if float(np.abs(np.asarray(a.marker) - np.asarray(b.marker)).max()) > SAME_GEOMETRY:
        said.append("The robot files differ in the position of the main marker.")
    return said


def _side(session: ComparedSession) -> dict[str, object]:
    result, tension = session.result, session.tension
    return {
        "name": session.name,
        "path": str(session.place),
        "origin": session.origin,
        "outcome": None if result is None else result.outcome,
        "method": None if result is None else result.method,
        "verdict": None if session.explanation is None else session.explanation.verdict.value,
        "effects": [] if session.explanation is None else [e.label for e in session.explanation.effects],
        "held_out_chi2_per_dof": session.held_out,
        "tension": None if tension is None else list(tension),
    }


def _window(one: ResultWindow | None) -> dict[str, object] | None:
    return None if one is None else one.model_dump(mode="json", exclude={"id"})


def comparison_tables(found: Comparison) -> tuple[ReportTable, ...]:
    """Sessions, parameters and windows side by side."""
    sessions = ReportTable("Sessions", ("", "A", "B"), found.facts, numbers=False)
    caption = "Parameters about P, per unit mass: s in mm, I in 10⁻³ m²; ±: the larger of sd and spread between windows"
    names = ("parameter", "A", "±", "B", "±", "B − A", "in sd")
    parameters = ReportTable(caption, names, tuple(_cells(shift) for shift in found.shifts))
    columns = ("window", "χ²/dof A", "χ²/dof B", "rms A, mm", "rms B, mm", "σ⊥ A", "σ⊥ B")
    windows = ReportTable("Windows of the same name", columns, tuple(_window_cells(pair) for pair in found.windows))
    return (sessions, *([parameters] if found.shifts else []), *([windows] if found.windows else []))


def _cells(shift: Shift) -> tuple[str, ...]:
    known = [sd for sd in (shift.sd_a, shift.sd_b) if sd > 0.0]
    places = decimals(millimetres(min(known, default=0.0)))  # so that the better session's interval is to be seen
    values = (shift.a, shift.sd_a, shift.b, shift.sd_b, shift.difference)
    z = "–" if shift.z is None else f"{shift.z:+.1f}"
    return (shift.name, *(fixed(millimetres(value), places) for value in values), z)


def _window_cells(pair: WindowPair) -> tuple[str, ...]:
    a, b = ((None,) * 3 if w is None else (w.chi2_per_dof, w.rms_mm, w.sigma_perp) for w in (pair.a, pair.b))
    return (pair.id, *(short(value) for both in zip(a, b, strict=True) for value in both))
