"""Plot: what the service has told of winches, marker and bus during the last two minutes, one quantity at a time."""

from collections.abc import Callable
from dataclasses import dataclass

from fidim_lab.app.service.messages import Status
from fidim_lab.app.tui.paint import Line, Span, left, line, number
from fidim_lab.app.tui.view import ScreenState
from fidim_lab.app.tui.widgets.plot import Curve, canvas, limits

LABEL = 18
LEAST_ROWS = 2
SPAN = 10.0
"""s: a shorter past is not stretched"""

Values = dict[str, float | None]


@dataclass(frozen=True)
class Quantity:
    """What can be plotted: one curve for each name."""

    name: str
    unit: str
    decimals: int
    least: float
    """in the unit: a smaller range is not magnified"""
    of: Callable[[Status], Values]


def _winches(key: str, factor: float = 1.0) -> Callable[[Status], Values]:
    def values(status: Status) -> Values:
        found = ((winch.name, getattr(winch, key)) for winch in status.winches)
        return {name: None if value is None else factor * value for name, value in found}

    return values


def _marker(status: Status) -> Values:
    place = status.mocap.position
    return dict.fromkeys("xyz") if place is None else dict(zip("xyz", place, strict=True))


def _computer(status: Status) -> Values:
    load = None if status.bus.load is None else 100 * status.bus.load
    return {"bus load, %": load, "loop late, ms": 1e3 * status.loop_late, "cameras, Hz": status.mocap.measured_rate}


QUANTITIES = (
    Quantity("tension", "N", 1, 2.0, _winches("tension")),
    Quantity("cable length", "m", 4, 2e-3, _winches("length")),
    Quantity("speed, positive pays out", "mm/s", 0, 10.0, _winches("speed", 1e3)),
    Quantity("following error", "mm", 2, 0.2, _winches("following_error", 1e3)),
    Quantity("temperature", "°C", 1, 2.0, _winches("temperature")),
    Quantity("main marker", "m", 4, 2e-3, _marker),
    Quantity("bus, control loop, cameras", "", 1, 1.0, _computer),
)


def plot_lines(view: ScreenState, width: int, height: int, which: int) -> list[Line]:
    """The whole screen in this many lines; which: of `QUANTITIES`, counted round."""
    quantity = QUANTITIES[which % len(QUANTITIES)]
    head = f"{quantity.name}{f', {quantity.unit}' if quantity.unit else ''}"
    rows = [line(Span(left(head, width - 18), "head"), Span("7: next quantity", "key", "screen.turn(6)"))]
    if not view.states:
        return [*rows, line(Span("No state of the rig has arrived yet.", "dim"))]
    told = [quantity.of(status) for status in view.states]
    t = [status.t for status in view.states]
    span = (min(t[0], t[-1] - SPAN), t[-1])
    names = list(told[-1])
    each = max((height - 2) // max(len(names), 1), LEAST_ROWS)
    for name in names:
        rows += _strip(name, t, [one.get(name) for one in told], span, quantity, width, each)
    ago = f"−{span[1] - span[0]:.0f} s"
    rows.append(line(Span(f"{'':{LABEL}}{ago}{'now':>{max(width - LABEL - len(ago), 4)}}", "dim")))
    return rows


def _strip(
    name: str,
    t: list[float],
    values: list[float | None],
    span: tuple[float, float],
    quantity: Quantity,
    width: int,
    rows: int,
) -> list[Line]:
    """One curve with its name, its value now, and its range."""
    if all(value is None for value in values):
        return [line(Span(f"{left(name, LABEL)}not reported", "dim"))]
    y = limits(values, quantity.least)
    drawn = canvas([Curve(t, values)], span, y, max(width - LABEL, 4), rows)
    high, low = (f"{value:.{quantity.decimals}f}" for value in (y[1], y[0]))
    now = number(values[-1], quantity.decimals)
    room = LABEL - 1
    labels = [
        f"{left(name, room - len(high) - 1)} {high}",
        *[""] * (rows - 2),
        f"{left(f'now {now}', room - len(low) - 1)} {low}",
    ]
    return [(Span(f"{label:>{room}} ", "dim"), *row) for label, row in zip(labels, drawn, strict=True)]
