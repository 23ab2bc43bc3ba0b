"""One section of the report for each recorded window: its numbers, notes, attempts and pictures."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.app.report.contents.folder import Contents
from fidim_lab.app.report.contents.story import WindowStory, not_passed
from fidim_lab.app.report.drawings import figures, spectra
from fidim_lab.app.report.drawings.drawing import Drawing
from fidim_lab.app.report.drawings.figures import Course
from fidim_lab.app.report.sections.numerals import duration, short
from fidim_lab.app.report.sections.tables import MARKS, ReportTable, attempt_table, check_table
from fidim_lab.arrays import CableSeries, Series, Vector3
from fidim_lab.data.records import Body, Robot, Window
from fidim_lab.identification.cleaning.removed import Removed
from fidim_lab.identification.motion.trajectory import Prediction
from fidim_lab.identification.results.result import WindowVerdict
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.statics import tensions

LISTED = 6
"""stretches of one kind that a note names"""
SHADED = 40
"""stretches that a picture shows, the longest ones: more are single samples"""


@dataclass(frozen=True)
class WindowSection:
    """What the page says of one window."""

    id: str
    role: str
    verdict: str
    facts: tuple[tuple[str, str], ...]
    origin: str
    """of an imported window; empty elsewhere"""
    notes: tuple[str, ...]
    tables: tuple[ReportTable, ...]
    drawings: tuple[Drawing, ...]


Model = tuple[Mechanism, Body]
"""the mechanism and the body found"""


def section(
    contents: Contents,
    window: Window,
    verdict: WindowVerdict | None,
    model: Model,
    points: int,
    removed: Sequence[Removed] = (),
) -> WindowSection:
    """Everything about one window; `verdict` is None where nothing was identified. points: of each line, at most.

    removed: what cleaning left out, of all windows.
    """
    ours = [one for one in removed if one.window == window.id]
    told = contents.story.of(window.id) if contents.story else None
    cut = contents.imported.of(window.id) if contents.imported else None
    return WindowSection(
        id=window.id,
        role=window.role.value,
        verdict=_verdict(told, verdict),
        facts=_facts(window, told, verdict),
        origin="" if cut is None else f"Cut out from {cut.t[0]:.2f} to {cut.t[1]:.2f} s: {cut.says}",
        notes=(*_left_out(ours), *(() if verdict is None else verdict.notes)),
        tables=() if told is None else _tables(told),
        drawings=tuple(_drawings(window, verdict, model, points, ours)),
    )


def _verdict(told: WindowStory | None, verdict: WindowVerdict | None) -> str:
    words = [] if told is None else [MARKS[told.outcome]]
    if verdict is not None and not verdict.used:
        words.append("✗ not used")
    return ", ".join(words)


def _facts(window: Window, told: WindowStory | None, verdict: WindowVerdict | None) -> tuple[tuple[str, str], ...]:
    seen = np.isfinite(window.markers[:, 0]).all(axis=1)
    facts = [
        ("length", duration(window.duration)),
        ("marker seen", f"{100 * seen.mean():.1f} %"),
        ("amplitude, peak to peak", _amplitude(window.markers[seen, 0])),
    ]
    if told is not None and told.tensions:
        facts.append(("tensions at rest", f"{min(told.tensions):.0f}–{max(told.tensions):.0f} N"))
    if verdict is not None and verdict.used:
        facts += [("σ⊥", f"{short(verdict.sigma_perp)} m/s²"), ("conditioning", short(verdict.conditioning))]
        missed = "no prediction" if verdict.rms_mm is None else f"{short(verdict.rms_mm)} mm rms"
        facts += [("recorded − model", missed), ("χ²/dof", short(verdict.chi2_per_dof))]
    return tuple(facts)


def _amplitude(path: np.ndarray) -> str:
    return f"{1e3 * float(np.ptp(path, axis=0).max()):.0f} mm" if len(path) else "–"


def _tables(told: WindowStory) -> tuple[ReportTable, ...]:
    """Attempts where there was more than one or the only one was not clean; checks that did not simply pass."""
    tables: list[ReportTable] = []
    plain = len(told.attempts) == 1 and not told.attempts[0].reason
    if told.attempts and not plain:
        tables.append(attempt_table(told.attempts))
    last = told.attempts[-1].measurements if told.attempts else ()
    if not_passed(last):
        tables.append(check_table(last))
    return tuple(tables)


def _left_out(removed: Sequence[Removed]) -> tuple[str, ...]:
    """One note for each kind of what was left out."""
    notes: list[str] = []
    for why in dict.fromkeys(one.why for one in removed):
        ours = [one for one in removed if one.why == why]
        times = ", ".join(f"{one.t[0]:.2f}–{one.t[1]:.2f}" for one in ours[:LISTED])
        more = f" and {len(ours) - LISTED} more" if len(ours) > LISTED else ""
        notes.append(f"left out ({why}): {times} s{more}")
    return tuple(notes)


def _drawings(
    window: Window, verdict: WindowVerdict | None, model: Model, points: int, removed: Sequence[Removed]
) -> list[Drawing]:
    prediction = None if verdict is None else verdict.prediction
    drawings = [_trajectory(window, prediction, points, removed)]
    residual = None if verdict is None else verdict.residual
    if residual is not None or prediction is not None:
        epsilon = None if residual is None else (residual.t, residual.epsilon)
        missed = None if prediction is None else Course(prediction.t, prediction.residuals[:, 0])
        svg = figures.residuals(window.t, epsilon, missed, points)
        parts = [
            *([] if missed is None else ["Δ = recorded − model of the trajectory"]),
            *([] if epsilon is None else ["ε = W χ of the equations"]),
        ]
        drawings.append(Drawing(svg, f"Residuals: {', '.join(parts)}.", f"{window.id}-residuals"))
    if prediction is not None and (left := _spectrum(prediction, model[0].robot, points)) is not None:
        drawings.append(replace(left, name=f"{window.id}-spectrum"))
    robot = model[0].robot
    tension = measured_tension(robot, window) or _predicted_tension(prediction, model)
    if tension is not None:
        t, values, source = tension
        svg = figures.tensions(t, values, robot.limits.tension, points)
        drawings.append(Drawing(svg, f"Tensions from {source}; dotted: the limits.", f"{window.id}-tensions"))
    return drawings


def _trajectory(window: Window, prediction: Prediction | None, points: int, removed: Sequence[Removed] = ()) -> Drawing:
    rest: Vector3 | None = window.equilibrium
    model = None if prediction is None else Course(prediction.t, prediction.markers[:, 0])
    shaded = sorted((one.t for one in removed), key=lambda t: t[0] - t[1])[:SHADED]
    svg = figures.trajectory(Course(window.t, window.markers[:, 0]), rest, model, points, shaded)
    origin = "its mean" if rest is None else "rest"
    over = "" if model is None else "; dashed: the model, from its fitted initial state"
    over += "; shaded: not used in any fit" if shaded else ""
    return Drawing(svg, f"Main marker from {origin}{over}.", f"{window.id}-trajectory")


def _spectrum(prediction: Prediction, robot: Robot, points: int) -> Drawing | None:
    """Of Δ, main marker, each axis by itself; None where too little was recorded."""
    left = prediction.residuals[:, 0]
    lines = [spectra.amplitudes(f"Δ{name}", prediction.t, left[:, k : k + 1]) for k, name in enumerate("xyz")]
    known = [line for line in lines if line is not None]
    if not known:
        return None
    noise = spectra.noise_level(robot.sensors.marker_noise, int(np.isfinite(left[:, 0]).sum()), 1)
    return Drawing(spectra.picture(known, noise, points), "Spectrum of Δ; dotted: marker noise alone.")


Tension = tuple[Series, CableSeries, str]
"""times (N,), s; tensions (N, n), N; their source in words"""


def measured_tension(robot: Robot, window: Window) -> Tension | None:
    """Each cable's tension from motor currents, else from load cells f1…fn that an import kept."""
    if window.currents is not None and robot.winches is not None:
        factors = np.array([winch.newton_per_ampere for winch in robot.winches])
        return window.t, window.currents * factors, "motor currents"
    cells = [window.further.get(f"f{cable}") for cable in range(1, robot.n + 1)]
    known = [cell for cell in cells if cell is not None]
    return (window.t, np.stack(known, axis=1), "load cells") if len(known) == robot.n else None


def _predicted_tension(prediction: Prediction | None, model: Model) -> Tension | None:
    """What the model needs of each cable, where nothing measures it (Eq. 8, with the robot file's mass)."""
    if prediction is None:
        return None
    mechanism, body = model
    per_mass, _ = tensions(mechanism, body, prediction.motion)
    return prediction.t, per_mass * mechanism.robot.mass, "the model, since there are no motor currents"
