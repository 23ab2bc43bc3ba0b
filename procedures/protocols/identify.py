"""The identification protocol (paper §5; spec/model.md §2): free motion about each planned equilibrium by turns.

For each window: move – settle (measured) – hold – read encoders – check tensions – ask to displace and release – wait
until the hand is away – record – check – accept, or record again. A rejected window is kept aside and recorded anew.
"""

from collections.abc import Generator
from contextlib import suppress
from functools import partial

from drivers.ports import Prompt, PromptKind
from fidim_lab.data.records import PlannedWindow
from fidim_lab.errors import InfeasibleError
from procedures.control import Intervention, Retried, Skipped
from procedures.outcomes import Outcome
from procedures.protocols.beginning import begin, compared, settling
from procedures.protocols.displacing import displace, free
from procedures.protocols.enough import windows_of
from procedures.protocols.experiment import Lab
from procedures.steps import (
    SLIPPED,
    Accept,
    Ask,
    AwaitHandsOff,
    CheckTension,
    CheckWindow,
    GiveUp,
    Hold,
    Lengths,
    MoveTo,
    ReadEncoders,
    Record,
    Reject,
    Result,
    Step,
    Steps,
    Stop,
    WindowLimits,
)

NOISE_JUMP = 15.0
"""standard deviations of a marker's noise: its second differences have √6 of them, for each coordinate"""


def identify(lab: Lab) -> Steps:
    """The steps of the protocol for a plan.

    A person's skip or retry (`Skipped`, `Retried`) concerns the present window.
    Raises InfeasibleError (from `Lab.route`) where no safe way to an equilibrium is known.
    """
    at = yield from begin(lab.robot.n, lab.settings)
    yield from windows_of(lab.plan, WindowProtocol(lab), at, lab.recorded, lab.swings)


class WindowProtocol:
    """The parts of the protocol, for one robot and its settings. Each is a generator of steps."""

    attended: bool = True

    def __init__(self, lab: Lab) -> None:
        self.robot = lab.robot
        self.settings = lab.settings
        self._route = lab.route
        self.made = dict(lab.attempts)
        """recordings made so far, by window"""

    def window(
        self, planned: PlannedWindow, at: Lengths, swinging: bool
    ) -> Generator[Step, Result, tuple[Lengths, bool]]:
        """One planned window, with the operator's requests; returns where the robot is, and whether it swings."""
        for _ in range(1 + self.settings.record.repeats):
            try:
                if swinging:
                    yield from self.steady(planned, "The platform still swings. Bring it to rest before the next move.")
                at = yield from self.go(planned, at)
                return at, (yield from self.visit(planned))
            except Skipped as word:
                at = yield from self._held_anyhow(planned)
                yield GiveUp(window=planned.id, outcome=Outcome.SKIPPED, reason=word.reason)
                return at, True
            except Retried:
                at, swinging = (yield from self._held_anyhow(planned)), True
        reason = f"begun {1 + self.settings.record.repeats} times without a recording"
        yield GiveUp(window=planned.id, outcome=Outcome.FAIL, reason=reason)
        return at, True

    def _held_anyhow(self, planned: PlannedWindow) -> Generator[Step, Result, Lengths]:
        """The same, whatever is said meanwhile: a key that is pressed twice must not end the run."""
        while True:
            with suppress(Intervention):
                return (yield from self.held(planned))

    def held(self, planned: PlannedWindow) -> Generator[Step, Result, Lengths]:
        """Where the winches hold after a person's command, with no hand or device at the platform."""
        yield from free(self.settings, planned.id)
        return (yield Hold(window=planned.id)).values

    def go(self, planned: PlannedWindow, at: Lengths) -> Generator[Step, Result, Lengths]:
        """Move to the planned lengths; returns them."""
        motion = self.settings.motion
        goal = tuple(float(length) for length in planned.lengths)
        start = at or None
        for lengths in self._way(planned.id, at, goal) if at else (goal,):
            speed, acceleration = yield from self.pace(planned, start, lengths)
            yield MoveTo(
                window=planned.id,
                lengths=lengths,
                start=start,
                speed=speed,
                acceleration=acceleration,
                tolerance=motion.position_tolerance,
                way_point=lengths != goal,
            )
            start = lengths
        return goal

    def pace(
        self, _planned: PlannedWindow, _start: Lengths | None, _goal: Lengths
    ) -> Generator[Step, Result, tuple[float, float]]:
        """Speed (m/s) and acceleration (m/s²) of a move."""
        yield from ()
        return self.settings.motion.speed, self.settings.motion.acceleration

    def _way(self, window: str, at: Lengths, goal: Lengths) -> tuple[Lengths, ...]:
        try:
            return self._route(at, goal)
        except InfeasibleError as error:
            raise InfeasibleError(f"Window {window}: {error.message}", hint=error.hint) from error

    def visit(self, planned: PlannedWindow) -> Generator[Step, Result, bool]:
        """Everything at one equilibrium; returns whether the platform swings: was set to, or has come to no rest."""
        rest = yield from self.settle(planned)
        if rest is None:
            return True
        yield from self.check_at_rest(planned, rest.values)
        return (yield from self.record(planned, rest.values))

    def steady(self, planned: PlannedWindow, text: str) -> Generator[Step, Result, str]:
        """Have the platform brought to rest; returns the answer."""
        return (yield from self._ask(planned, Prompt(PromptKind.STEADY, text)))

    def _ask(self, planned: PlannedWindow, prompt: Prompt) -> Generator[Step, Result, str]:
        asked = Ask(window=planned.id, prompt=prompt, estimate=self.settings.estimate(prompt))
        answer = (yield asked).answer
        if answer == "abort":
            yield Stop(window=planned.id, outcome=Outcome.ABORTED, reason=f"The operator aborted at “{prompt.text}”.")
        return answer

    def settle(self, planned: PlannedWindow) -> Generator[Step, Result, Result | None]:
        """The measured rest, or None where the window is given up."""
        step = settling(planned.id, self.settings, steadied=self.settings.steady_estimate)
        result = yield step
        for _ in range(self.settings.motion.settle_tries - 1):
            if result.outcome.usable:
                return result
            answer = yield from self.steady(planned, f"{result.reason} Bring the platform to rest.")
            if answer == "skip":
                yield GiveUp(window=planned.id, outcome=Outcome.SKIPPED, reason="skipped by the operator")
                return None
            result = yield step
        if result.outcome.usable:
            return result
        yield GiveUp(window=planned.id, outcome=Outcome.FAIL, reason=result.reason)
        return None

    def check_at_rest(self, planned: PlannedWindow, rest: tuple[float, ...]) -> Generator[Step, Result, None]:
        """Check hold, encoders, tensions and marker place; a failure here is the robot's, so the run ends."""
        motion, tension = self.settings.motion, self.settings.tension
        checks = (
            Hold(window=planned.id),
            ReadEncoders(
                window=planned.id,
                lengths=tuple(float(length) for length in planned.lengths),
                tolerance=motion.position_tolerance,
                over=tension.over,
            ),
            CheckTension(
                window=planned.id,
                limits=self.robot.limits.tension,
                tolerance=tension.tolerance,
                over=tension.over,
            ),
        )
        for check in checks:
            result = yield check
            if not result.outcome.usable:
                yield Stop(window=planned.id, outcome=Outcome.FAIL, reason=f"Window {planned.id}: {result.reason}.")
        yield from compared(planned.id, rest, self.settings)

    def record(self, planned: PlannedWindow, rest: tuple[float, ...]) -> Generator[Step, Result, bool]:
        """Record until a window is good, or given up; returns whether the platform was set swinging."""
        attempts = 1 + self.settings.record.repeats
        reasons: list[str] = []
        ask = partial(self._ask, planned)
        for _ in range(attempts):
            try:
                answer, reason = yield from displace(planned, self.robot, self.settings, rest, reasons, ask)
                if answer == "skip":
                    yield GiveUp(window=planned.id, outcome=Outcome.SKIPPED, reason="skipped by the operator")
                    return bool(reasons)
                reason = reason or (yield from self.attempt(planned, rest))
            except Retried as word:
                reason = word.reason
            if reason is None:
                return True
            reasons.append(reason)
        reason = f"rejected {attempts} times, the last time: {reasons[-1]}"
        yield GiveUp(window=planned.id, outcome=Outcome.FAIL, reason=reason)
        return True

    def attempt(self, planned: PlannedWindow, rest: tuple[float, ...]) -> Generator[Step, Result, str | None]:
        """One recording; returns None when accepted, else why not."""
        reason = yield from self.set_free(planned)
        if reason is not None:
            return reason
        attempt = self.made[planned.id] = self.made.get(planned.id, 0) + 1
        yield Record(window=planned.id, attempt=attempt, duration=self.settings.record.seconds)
        check = CheckWindow(
            window=planned.id,
            attempt=attempt,
            lengths=tuple(float(length) for length in planned.lengths),
            equilibrium=rest,
            limits=self.window_limits(),
        )
        verdict = yield from self.judged(planned, check, (yield check))
        if not verdict.outcome.usable:
            yield Reject(window=planned.id, attempt=attempt, reason=verdict.reason)
            if verdict.answer == SLIPPED:
                yield Stop(window=planned.id, outcome=Outcome.FAIL, reason=f"Window {planned.id}: {verdict.reason}.")
            return verdict.reason
        yield Accept(
            window=planned.id,
            attempt=attempt,
            role=planned.role,
            equilibrium=rest,
            outcome=verdict.outcome,
            reason=verdict.reason,
        )
        return None

    def set_free(self, planned: PlannedWindow) -> Generator[Step, Result, str | None]:
        """The platform swings by itself from here on; returns why not."""
        away = yield self._hands_off(planned)
        return None if away.outcome.usable else away.reason

    def judged(self, _planned: PlannedWindow, _check: CheckWindow, verdict: Result) -> Generator[Step, Result, Result]:
        """Further checks of a recording."""
        yield from ()
        return verdict

    def _hands_off(self, planned: PlannedWindow) -> AwaitHandsOff:
        hand, (low, high) = self.settings.hand, self.robot.limits.tension
        return AwaitHandsOff(
            window=planned.id,
            moving=hand.moving,
            limits=(hand.tension[0] * low, hand.tension[1] * high),
            over=hand.over,
            timeout=hand.timeout,
        )

    def window_limits(self) -> WindowLimits:
        """The criteria for a recording."""
        record, limits = self.settings.record, self.robot.limits
        return WindowLimits(
            complete=record.complete,
            longest_gap=record.longest_gap,
            jump=max(record.jump, NOISE_JUMP * self.robot.sensors.marker_noise),
            drift=record.drift,
            amplitude=record.amplitude,
            displacement=limits.free_displacement,
            displacement_tolerance=record.displacement,
            motors_still=record.motors_still,
            encoder_error=self.settings.motion.position_tolerance,
            tension=limits.tension,
            overload=self.settings.hand.tension[1] * limits.tension[1],
            tension_over=record.tension_over,
        )
