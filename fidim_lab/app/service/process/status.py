"""What is told ten times a second: one `Status` from what the devices say and what the run has told.

`Watcher` listens to the run and keeps what a screen shows of it; `Gauges` has what the devices say, as messages.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from drivers.canbus.load import frame_bits
from drivers.canbus.transport import CanFrame
from drivers.ports import MarkerFrame, Rig, WinchSample
from fidim_lab.app.service.messages import (
    BusState,
    EquilibriumState,
    GuardState,
    MocapState,
    Samples,
    StepState,
    WinchState,
)
from fidim_lab.data.records import Robot
from procedures.events import (
    Event,
    Paused,
    Resumed,
    RunFinished,
    RunStarted,
    StepFinished,
    StepProgress,
    StepStarted,
    Tripped,
    Warned,
    WindowFinished,
)
from procedures.guards.guard import Guard
from procedures.outcomes import Outcome
from procedures.report import RunReport, WindowRow
from procedures.steps import CheckTension, CheckWindow, Phase, Record

SECOND = 1.0
BATCH = 500
"""marker frames that wait for the next batch at most"""
RunPhase = Literal["idle", "running", "paused", "stopping", "ended"]


@dataclass(frozen=True)
class _Row:
    """What a screen shows of one window."""

    row: WindowRow
    margin: float | None = None
    amplitude: float | None = None


class Watcher:
    """A listener of the run that keeps its present state."""

    def __init__(self, rows: Sequence[WindowRow], limits: tuple[float, float]) -> None:
        self._rows = {row.id: _Row(row) for row in rows}
        self._limits = limits
        self._warnings: dict[str, str] = {}
        self._tripped: tuple[str, str] = ("", "")
        self.step: StepState | None = None
        self.phase: RunPhase = "idle"
        self.recording: tuple[str, int] = ("", 0)
        """window and attempt"""
        self.report: RunReport | None = None

    def __call__(self, event: Event) -> None:
        """Take one event."""
        match event:
            case RunStarted():
                self.phase, self.report = "running", None
            case StepStarted() | StepProgress():
                self._stepped(event)
            case StepFinished():
                self._finished(event)
            case WindowFinished():
                added = _Row(WindowRow(event.window, event.role, attempts=event.attempts))  # by the procedure
                row = self._rows.get(event.window, added)
                known = replace(row.row, outcome=event.outcome, reason=event.reason)
                self._rows[event.window] = replace(row, row=known)
            case Tripped(trip=trip):
                self.phase, self._tripped = "stopping", (trip.guard, trip.says)
            case Warned(trip=trip):
                self._warnings[trip.guard] = trip.says
            case Paused():
                self.phase = "paused"
            case Resumed():
                self.phase = "running"
            case RunFinished(report=report):
                self.phase, self.report, self.recording = "ended", report, ("", 0)
            case _:
                pass

    def equilibria(self) -> tuple[EquilibriumState, ...]:
        """The table of windows."""
        return tuple(self._equilibrium(row) for row in self._rows.values())

    def guards(self, guards: Sequence[Guard]) -> tuple[GuardState, ...]:
        """Each guard: armed while there may be power, tripped, or with a warning."""
        armed = self.phase in ("running", "paused") and self.step is not None and Phase(self.step.phase).powered
        found: list[GuardState] = []
        for guard in guards:
            state, why = ("armed" if armed else "disarmed"), ""
            if guard.name == self._tripped[0]:
                state, why = "tripped", self._tripped[1]
            elif guard.name in self._warnings:
                state, why = "warning", self._warnings[guard.name]
            found.append(GuardState(name=guard.name, state=state, reaction=guard.reaction.value, why=why))
        return tuple(found)

    def _stepped(self, event: StepStarted | StepProgress) -> None:
        step = event.step
        self.step = StepState(
            number=event.number,
            step=type(step).__name__,
            window=step.window,
            text=step.text,
            phase=step.phase.value,
            fraction=event.fraction if isinstance(event, StepProgress) else 0.0,
            left=event.left,
        )
        self.recording = (step.window, step.attempt) if isinstance(step, Record) else ("", 0)
        if isinstance(event, StepStarted) and isinstance(step, Record) and step.window in self._rows:
            row = self._rows[step.window]
            self._rows[step.window] = replace(row, row=replace(row.row, attempts=step.attempt))

    def _finished(self, event: StepFinished) -> None:
        row = self._rows.get(event.step.window)
        if row is None:
            return
        if isinstance(event.step, CheckTension) and event.result.values:
            low, high = self._limits
            margin = min(min(tension - low, high - tension) for tension in event.result.values)
            self._rows[row.row.id] = replace(row, margin=margin)
        elif isinstance(event.step, CheckWindow):
            amplitudes = [m.value for m in event.result.measurements if m.name.startswith("amplitude")]
            self._rows[row.row.id] = replace(row, amplitude=next(iter(amplitudes), None))

    def _equilibrium(self, row: _Row) -> EquilibriumState:
        done = row.row.outcome is not Outcome.UNSET
        current = self.step is not None and self.step.window == row.row.id and not done
        return EquilibriumState(
            window=row.row.id,
            role=row.row.role.value,
            state="done" if done else "current" if current else "waiting",
            verdict=row.row.outcome.value if done else "",
            reason=row.row.reason,
            attempts=row.row.attempts,
            margin=row.margin,
            amplitude=row.amplitude,
        )


class Gauges:
    """What the devices say, as messages. Counts frames of markers and bus, which it is told of."""

    def __init__(
        self,
        rig: Rig,
        robot: Robot,
        newton_per_ampere: Sequence[float],
        length_limits: Sequence[tuple[float, float]] | None,
        bitrate: float,
    ) -> None:
        """bitrate: of the bus, bit/s; 0 where nothing limits it."""
        self._rig = rig
        self._robot = robot
        self._factors = tuple(newton_per_ampere)
        self._length_limits = length_limits
        self._bitrate = bitrate
        self._marker_times: deque[float] = deque(maxlen=4000)
        self._frames = self._bits = 0
        """that have passed on the bus"""
        self._bus_counts: deque[tuple[float, int, int]] = deque(maxlen=12)
        self._batch: list[tuple[MarkerFrame, tuple[WinchSample | None, ...]]] = []

    def bus_frame(self, frame: CanFrame) -> None:
        """A frame has passed on the bus; told by the bus's thread."""
        self._frames += 1
        self._bits += frame_bits(len(frame.data))

    def frame(self, frame: MarkerFrame) -> None:
        """A marker frame has come."""
        self._marker_times.append(frame.t)
        if len(self._batch) < BATCH:
            self._batch.append((frame, tuple(winch.latest() for winch in self._rig.winches)))

    def samples(self, recording: tuple[str, int]) -> Samples | None:
        """What has come since this was last asked; None where nothing has."""
        batch, self._batch = self._batch, []
        if not batch:
            return None
        return Samples(
            window=recording[0],
            attempt=recording[1],
            t=tuple(round(frame.t, 5) for frame, _ in batch),
            positions=tuple(frame.main for frame, _ in batch),
            tensions=tuple(
                tuple(None if s is None else round(k * s.current, 3) for k, s in zip(self._factors, row, strict=True))
                for _, row in batch
            ),
            lengths=tuple(tuple(None if s is None else round(s.length, 6) for s in row) for _, row in batch),
        )

    def winches(self) -> tuple[WinchState, ...]:
        """All winches now."""
        now = self._rig.clock.now()
        return tuple(self._winch(index, now) for index in range(len(self._rig.winches)))

    def _winch(self, index: int, now: float) -> WinchState:
        winch = self._rig.winches[index]
        sample = winch.latest()
        limits = None if self._length_limits is None else self._length_limits[index]
        known = WinchState(
            name=winch.name, drive="never reported", length_limits=limits, tension_limits=self._robot.limits.tension
        )
        if sample is None:
            return known
        return known.model_copy(
            update={
                "drive": sample.state.value,
                "fault": sample.fault,
                "length": round(sample.length, 6),
                "speed": round(sample.velocity, 6),
                "tension": round(self._factors[index] * sample.current, 3),
                "temperature": sample.temperature,
                "following_error": None if sample.following_error is None else round(sample.following_error, 6),
                "heartbeat_age": None if sample.heartbeat_age is None else round(sample.heartbeat_age, 4),
                "emergencies": sample.emergencies,
                "lost": sample.lost,
                "age": round(max(now - sample.t, 0.0), 4),
            }
        )

    def mocap(self) -> MocapState:
        """Motion capture now."""
        now, source = self._rig.clock.now(), self._rig.markers
        while self._marker_times and self._marker_times[0] < now - SECOND:
            self._marker_times.popleft()
        frame = source.latest()
        return MocapState(
            rate=source.rate,
            measured_rate=len(self._marker_times) / SECOND,
            age=None if frame is None else round(max(now - frame.t, 0.0), 4),
            position=None if frame is None else frame.main,
            markers_seen=0 if frame is None else sum(p is not None for p in frame.positions),
            counters=source.counters(),
        )

    def bus(self) -> BusState:
        """The bus during the last second."""
        frames, bits = self._frames, self._bits
        now = self._rig.clock.now()
        self._bus_counts.append((now, frames, bits))
        then, before, bits_before = self._bus_counts[0]
        passed = now - then
        if passed <= 0.0:
            return BusState()
        load = (bits - bits_before) / passed / self._bitrate if self._bitrate else None
        return BusState(load=load, frames=(frames - before) / passed)
