"""Rig: each winch, motion capture, the bus, the guards."""

from fidim_lab.app.service.messages import GuardState, MocapState, Status, WinchState
from fidim_lab.app.tui.paint import EMPTY, Line, Span, Style, block, folded, left, line, milli, number, right
from fidim_lab.app.tui.view import ScreenState
from fidim_lab.units import percent

OLD = 0.5
"""s after which a device's own value is called old"""
BAR = 12
WHOLE = 78
"""columns of a winch's row; a narrower terminal shows drive, length and tension"""
NARROW = 20
"""columns of the drive's state there"""
DRIVES: dict[str, tuple[str, Style]] = {
    "operation enabled": ("● operation enabled", "good"),
    "quick stop active": ("■ quick stop active", "warn"),
    "fault": ("✗ fault", "bad"),
    "fault reaction active": ("✗ fault reaction", "bad"),
    "unknown": ("? unknown", "bad"),
    "never reported": ("? never reported", "bad"),
}
GUARDS: dict[str, tuple[str, Style]] = {
    "armed": ("● armed", "good"),
    "disarmed": ("○ disarmed", "dim"),
    "warning": ("! WARNING", "warn"),
    "tripped": ("✗ TRIPPED", "bad"),
}


def rig_lines(view: ScreenState, width: int) -> list[Line]:
    """The whole screen."""
    status = view.status
    if status is None:
        return [line(Span("No state of the rig has arrived yet.", "dim"))]
    since = view.age or 0.0
    rows: list[Line] = [line(Span(_winch_head(width), "dim"))]
    for winch in status.winches:
        rows += _winch(winch, since, width)
    return [
        *rows,
        EMPTY,
        *_mocap(status.mocap, since, width),
        *folded(_bus(status), width),
        EMPTY,
        *_guards(status.guards, width),
    ]


def tension_bar(tension: float | None, limits: tuple[float, float]) -> Span:
    """Where a tension lies between its limits; beyond them it says so."""
    low, high = limits
    if tension is None or high <= low:
        return Span("?" * BAR, "dim")
    if tension < low:
        return Span(left("◀ TOO LOW", BAR), "bad")
    if tension > high:
        return Span(right("TOO HIGH ▶", BAR), "bad")
    place = (tension - low) / (high - low)
    near = min(place, 1 - place) < 0.05
    at = min(int(place * BAR), BAR - 1)
    return Span("─" * at + "┃" + "─" * (BAR - at - 1), "warn" if near else "good")


def _winch_head(width: int) -> str:
    if width < WHOLE:
        return left("winch", 9) + left("drive", NARROW) + right("length m", 9) + right("N", 7)
    cells = (right("length m", 9), right("mm/s", 6), right("N", 7), left("  low … high", BAR + 3))
    return left("winch", 9) + left("drive", 20) + "".join(cells) + right("°C", 4) + right("err mm", 8)


def _winch(winch: WinchState, since: float, width: int) -> list[Line]:
    age = None if winch.age is None else winch.age + since
    old = age is None or age > OLD
    drive, style = DRIVES.get(winch.drive, (f"○ {winch.drive}", ""))
    whole = width >= WHOLE
    length = Span(right(number(winch.length, 4), 9), _beyond(winch.length, winch.length_limits))
    row = line(left(winch.name, 9), Span(left(drive, 20 if whole else NARROW), style), length)
    tension = right(number(winch.tension, 1), 7)
    if whole:
        between = tension_bar(winch.tension, winch.tension_limits)
        last = right(number(winch.temperature, 0), 4), right(milli(winch.following_error, 2), 8)
        row = (*row, *line(right(milli(winch.speed, 0), 6), tension, "  ", between, " ", *last))
    else:
        row = (*row, Span(tension, _beyond(winch.tension, winch.tension_limits)))
    further: list[Line] = []
    if old:
        says = "no values yet" if age is None else f"OLD VALUES: {age:.1f} s"
        row = tuple(Span(span.text, "old") for span in row)
        further.append(line(Span(f"         ✗ {winch.name}: {says}", "bad")))
    if winch.fault:
        further += block(f"✗ {winch.fault}", width, "bad", "         ")
    if width >= 90 and not old:
        row = (*row, Span(f"  {1e3 * (age or 0.0):4.0f} ms old", "dim"))
    return [row, *further]


def _beyond(value: float | None, limits: tuple[float, float] | None) -> Style:
    """The style of a value that has limits."""
    return "" if value is None or limits is None or limits[0] <= value <= limits[1] else "bad"


def _mocap(mocap: MocapState, since: float, width: int) -> list[Line]:
    age = None if mocap.age is None else mocap.age + since
    slow = mocap.measured_rate < 0.9 * mocap.rate
    rate = Span(f"{mocap.measured_rate:.0f} of {mocap.rate:.0f} Hz", "warn" if slow else "good")
    latency, newest = milli(mocap.latency, 0, "ms"), milli(age, 0, "ms")
    more = f"  latency {latency}", f"  newest {newest} ago", f"  {mocap.markers_seen} markers seen"
    rows = folded(line(Span("motion capture  ", "head"), rate, *more), width)
    old = age is None or age > OLD
    if mocap.position is None:
        rows.append(line(Span("  main marker not seen", "bad")))
    else:
        x, y, z = mocap.position
        place = f"  main marker  x {x:+.4f}  y {y:+.4f}  z {z:+.4f} m"
        rows.append(line(Span(f"{place}  OLD" if old else place, "old" if old else "")))
    counted = ", ".join(f"{count} {name}" for name, count in mocap.counters.items())
    rows += block(f"frames: {counted}" if counted else "", width, "dim", "  ")
    return rows


def _bus(status: Status) -> Line:
    bus = status.bus
    load = number(None if bus.load is None else percent(bus.load), 0, "%")
    busy: Style = "warn" if bus.load is not None and bus.load > 0.7 else ""
    return line(
        Span("bus  ", "head"),
        Span(f"load {load}", busy),
        f"  {number(bus.frames, 0, 'frames/s')}",
        f"  control loop late by {milli(status.loop_late, 0, 'ms')}",
    )


def _guards(guards: tuple[GuardState, ...], width: int) -> list[Line]:
    """Those that say something first, the others side by side."""
    rows: list[Line] = []
    for guard in guards:
        mark, style = GUARDS[guard.state]
        if guard.state in ("tripped", "warning"):
            says = f"guard {guard.name}: {mark} ({guard.reaction}) {guard.why}"
            rows += block(says, width, style)
    quiet = [guard for guard in guards if guard.state in ("armed", "disarmed")]
    columns = max(width // 38, 1)
    for begin in range(0, len(quiet), columns):
        cells: list[Span] = []
        for guard in quiet[begin : begin + columns]:
            mark, style = GUARDS[guard.state]
            cells += [Span(left(mark, 11), style), Span(left(f"{guard.name} → {guard.reaction}", 27))]
        rows.append(tuple(cells))
    return [line(Span("guards", "head")), *rows]
