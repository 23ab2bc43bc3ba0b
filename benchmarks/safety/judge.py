"""The rules, by the plant. What breaks one is a `Violation`.

(a) No true tension outside the robot file's limits by more than the reaction distance does there: `REACTION` (10 mm)
    of one cable, or of each cable that the faults may move alone; more where a fault's own reaction time times the
    speed it then had is more, or the fault itself moved the cable. What a length does to a tension is taken from the
    plant's statics at the pose in which the first fault came. Not judged: `JOLT` after a drum that turned has lost its
    power: its brake falls at once, whoever drives it; and what comes before any drive has power.
(b) No final sentence that the plant contradicts: "stand still" while a drum turns, "held" without power, an accepted
    window in which a winch moved, a cable slipped, the marker was wrong or the lengths are, and nothing said so. Wrong
    is what the rig file's own limits call wrong: a drum that turned by more than motors may within the window, a marker
    that left its true place by more than a jump may (5 mm), unless the check of the window tells its slow motion; a
    cable that slipped so that the marker rests elsewhere by more than twice "change of that since the place before"; a
    marker, or the place that the lengths stand for, farther from the truth than "marker against the lengths" allows
    and half the swing that counts as settled: that comparison is made with a marker that may still move so much.
(c) It ended: no hang, no bug.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.rehearsal import Ended, places
from benchmarks.safety.draw import Planted
from benchmarks.safety.kinds import REACTION
from benchmarks.safety.witness import TURNS, Truth
from fidim_lab.data.campaign import read_campaign
from procedures.events import RunFinished, StepFinished
from procedures.settings import MotionSettings, PlaceSettings, RecordSettings

JOLT = 0.1
"""s"""
STILL = 1e-3
"""m that a drum may turn after "all winches stand still": the host looks every 10 ms, encoders count"""
Place = Callable[[np.ndarray], np.ndarray]
"""(n,) cable lengths, m → (3,) where the main marker truly rests with them, m"""


@dataclass(frozen=True)
class Violation:
    """A rule that was broken."""

    rule: str
    says: str
    size: float
    """how badly, 1: just so"""


@dataclass(frozen=True)
class Room:
    """By how much each tension may be beyond its limits, N, (n,), and how that comes."""

    newton: np.ndarray
    distances: np.ndarray
    """m for each cable"""


def room(stiffness: np.ndarray, struck: Sequence[Planted], truth: Truth, since: float) -> Room:
    """stiffness: (n, n) N/m; struck: the faults that came, since the first."""
    n = len(stiffness)
    distances = np.zeros(n)
    after = truth.since(since)
    moved = np.ptp(truth.lengths[after], axis=0)
    speeds = np.abs(truth.speeds[after]).max(axis=0)
    for one in struck:
        for cable in one.fault.cables:
            k = cable - 1
            way = min(one.fault.reaction * speeds[k], moved[k]) if speeds[k] else 0.0
            distances[k] = max(distances[k], REACTION + one.fault.itself, way)
    alone = REACTION * np.abs(stiffness).max(axis=1)
    return Room(np.maximum(alone, np.abs(stiffness) @ distances), distances)


def tension(truth: Truth, limits: tuple[float, float], allowed: Room) -> tuple[float, list[Violation]]:
    """The largest part of the room that was used, and what went beyond it."""
    begun = np.maximum.accumulate(truth.powered.any(axis=1))
    judged = begun & ~_jolted(truth)
    beyond = np.maximum(limits[0] - truth.tensions, truth.tensions - limits[1])
    used = np.where(judged[:, np.newaxis], beyond / allowed.newton, -np.inf)
    worst = float(used.max())
    if worst <= 1.0:
        return max(worst, 0.0), []
    at, k = np.unravel_index(int(used.argmax()), used.shape)
    late = truth.t[used.max(axis=1) > 1.0]
    says = (
        f"cable {k + 1} had {truth.tensions[at, k]:.1f} N at {truth.t[at]:.3f} s; limits {limits[0]:g} to "
        f"{limits[1]:g} N, {allowed.newton[k]:.1f} N beyond them are allowed; beyond that from {late[0]:.3f} s on, "
        f"for {len(late)} steps of the plant"
    )
    return worst, [Violation("a: tension", says, worst)]


def _jolted(truth: Truth) -> np.ndarray:
    """(N,) steps soon after a turning drum lost its power."""
    lost = truth.powered[:-1] & ~truth.powered[1:] & (np.abs(truth.speeds[:-1]) > TURNS)
    jolted = np.zeros(len(truth.t), dtype=bool)
    for at in np.flatnonzero(lost.any(axis=1)):
        jolted[truth.between(truth.t[at], truth.t[at + 1] + JOLT)] = True
    return jolted


def sentences(ended: Ended, truth: Truth, place: Place) -> Iterator[Violation]:
    """What the end of the run says, and the plant does not."""
    report = ended.report
    finished = next(event for event in ended.events if isinstance(event, RunFinished))
    if report.held and not [t for t in ended.planted if t > finished.t]:
        after = truth.since(finished.t)
        moved = np.ptp(truth.lengths[after], axis=0)
        if moved.max() > STILL:
            k = int(moved.argmax())
            says = f"“{report.held_says}”, and winch {k + 1} went on for {1e3 * moved[k]:.1f} mm in a second"
            yield Violation("b: stands still", says, moved[k] / STILL)
        named = report.held_says.partition("without motor power")[2]
        dead = [k + 1 for k, on in enumerate(truth.powered[-1]) if not on and f"winch {k + 1}" not in named]
        if dead and "held" in report.held_says:
            yield Violation("b: held", f"“{report.held_says}”, and winch {dead} has no power", 1.0)
    if report.accepted:
        campaign = {window.id: window for window in read_campaign(ended.folder).windows}
        for row in report.accepted:
            yield from _window(ended, truth, row.id, campaign[row.id].lengths, place)


def _window(ended: Ended, truth: Truth, name: str, lengths: np.ndarray | None, place: Place) -> Iterator[Violation]:
    record, change = RecordSettings(), 2.0 * PlaceSettings().change
    allowed = PlaceSettings().off + MotionSettings().settle_tolerance / 2.0
    end = [e.t for e in ended.events if isinstance(e, StepFinished) and _is_record(e, name)][-1]
    during = truth.between(end - (ended.rows - 1) / 100.0, end)
    true, slipped = truth.lengths[during], truth.slipped[during]
    moved = np.ptp(true - slipped, axis=0)
    if moved.max() > record.motors_still:
        k = int(moved.argmax())
        says = f"window {name} was accepted; winch {k + 1} moved {1e3 * moved[k]:.1f} mm in it"
        yield Violation("b: a winch moved", says, moved[k] / record.motors_still)
    went = float(np.linalg.norm(place(true[-1]) - place(true[-1] - slipped[-1] + slipped[0])))
    if went > change and f"during window {name}" not in ended.report.reason:
        says = f"window {name} was accepted; a cable slipped in it, by which the marker rests {1e3 * went:.1f} mm away"
        yield Violation("b: a cable slipped", says, went / change)
    if lengths is not None:
        off = float(np.linalg.norm(place(np.nanmean(lengths, axis=0)) - place(true.mean(axis=0))))
        if off > allowed:
            says = f"window {name} was accepted; its lengths put the marker {1e3 * off:.1f} mm off"
            yield Violation("b: lengths are wrong", says, off / allowed)
    file = ended.folder / "windows" / f"{name}.csv"
    first, found = ended.first_number(file), places(file)
    told = any("slow motion of the marker" in e.result.reason for e in ended.events if _is_check(e, name))
    if first is not None:
        errors = np.array([seen - ended.truth[first + k] for k, seen in found.items()])
        strays = float(np.linalg.norm(np.ptp(errors, axis=0)))
        if strays > record.jump and not told:
            says = f"window {name} was accepted; its marker strays by {1e3 * strays:.1f} mm"
            yield Violation("b: the marker strays", says, strays / record.jump)
        off = float(np.linalg.norm(errors.mean(axis=0)))
        if off > allowed:
            says = f"window {name} was accepted; its marker is {1e3 * off:.1f} mm off"
            yield Violation("b: the marker is off", says, off / allowed)


def _is_check(event: StepFinished, window: str) -> bool:
    return (
        isinstance(event, StepFinished) and type(event.step).__name__ == "CheckWindow" and event.step.window == window
    )


def _is_record(event: StepFinished, window: str) -> bool:
    return type(event.step).__name__ == "Record" and event.step.window == window
