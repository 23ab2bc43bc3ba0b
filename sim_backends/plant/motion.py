"""The platform's motion through time: steps of the compiled integrator, and when cables go slack or taut.

A step is kept only if no cable pushed and no slack cable became too long in it; otherwise the moment is found by
bisection and the set of pulling cables decided anew (`unilateral`), with an inelastic impact where a cable snaps taut.
"""

import math
from collections import deque
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fidim_lab.arrays import PerCable
from fidim_lab.errors import InfeasibleError
from sim_backends.plant.mechanics.dynamics import rigid_cables
from sim_backends.plant.mechanics.kinematics import HAND_SIZE, TWIST
from sim_backends.plant.mechanics.stepper import (
    Buffered,
    compile_contact,
    compile_derivative,
    compile_energy,
    compile_step,
    longest_step,
)
from sim_backends.plant.mechanics.unilateral import SLACKENING, STICKING, impact, taut
from sim_backends.plant.world import World

BISECTIONS = 12
MOST_EVENTS = 200
"""in one `run`; after that a chattering cable is left as it is until the next"""
REMEMBERED = 512
"""states: some 0.1 s and more of looking back, also where devices in real time ask every few hundred microseconds"""
DEPENDENT = 1e-12
"""ratio of the smallest to the largest eigenvalue of J M⁻¹ Jᵀ"""
UNSEEN = 2e-5
"""s"""
PUSHING = 1e-6
"""N, a tension below minus this is a push"""


@dataclass(frozen=True)
class SlackInterval:
    """A time during which a cable did not pull."""

    cable: int
    """1-based"""
    start: float
    """s, plant time"""
    stop: float | None
    """None while it lasts"""


class SlackLog:
    """Which cables do not pull, and since when."""

    def __init__(self) -> None:
        self._open: dict[int, float] = {}
        self._closed: list[SlackInterval] = []

    def note(self, t: float, slack: np.ndarray) -> None:
        """At time t these cables (n,) are slack."""
        for i in np.flatnonzero(slack):
            self._open.setdefault(int(i), t)
        for i in [i for i in self._open if not slack[i]]:
            self._closed.append(SlackInterval(i + 1, self._open.pop(i), t))

    def intervals(self) -> tuple[SlackInterval, ...]:
        """All of them, in order of time."""
        lasting = [SlackInterval(cable + 1, start, None) for cable, start in self._open.items()]
        return tuple(sorted([*self._closed, *lasting], key=lambda interval: (interval.start, interval.cable)))


class Compiled:
    """The functions of one world, each compiled when it is first needed (some 20 ms)."""

    def __init__(self, world: World) -> None:
        self._world = world

    @cached_property
    def step_free(self) -> Buffered:
        """A step without a hand."""
        return compile_step(self._world, with_hand=False)

    @cached_property
    def step_held(self) -> Buffered:
        """A step with a hand."""
        return compile_step(self._world, with_hand=True)

    @cached_property
    def derivative(self) -> Buffered:
        """Of the state, with tensions."""
        return compile_derivative(self._world)

    @cached_property
    def contact(self) -> Buffered:
        """For deciding which cables pull."""
        return compile_contact(self._world)

    @cached_property
    def energy(self) -> Buffered:
        """J."""
        return compile_energy(self._world)


@dataclass(frozen=True, eq=False)
class DrumMotion:
    """What moves the platform during a run: values at its start."""

    lengths: PerCable
    """true unstretched, m"""
    rates: PerCable
    accelerations: PerCable
    """constant during the run"""
    hand: np.ndarray
    """(HAND_SIZE,)"""
    window_start: float = 0.0
    """s, plant time"""
    window: float = 0.0
    """number of the window"""


class PlatformMotion:
    """State, time and pulling cables of one platform."""

    def __init__(self, world: World) -> None:
        self._functions = Compiled(world)
        self._rigid = np.array(rigid_cables(world), dtype=int)
        self._longest = longest_step(world)
        self.slack = SlackLog()
        self.t = 0.0
        self.x = np.zeros(0)
        self.active = np.ones(world.n)
        self.tensions = np.zeros(world.n)
        self.history: deque[tuple[float, np.ndarray]] = deque(maxlen=REMEMBERED)
        """the last states, oldest first, the present one included"""

    def start(self, x: np.ndarray, t: float, drive: DrumMotion) -> None:
        """Begin at a state with every cable taut; the twist is made to agree with the lengths' rates.

        Raises:
            InfeasibleError: the pose is singular.
        """
        self.x, self.t = x.copy(), t
        self.active[:] = 1.0
        self.slack = SlackLog()
        if self._rigid.size:
            spread, condensed, _, too_fast, _ = self._touch(drive)
            self.x[TWIST] -= spread @ np.linalg.solve(condensed, too_fast)
        self.tensions = self.tensions_now(drive)
        self.history.clear()
        self.history.append((t, self.x))

    def tensions_now(self, drive: DrumMotion) -> PerCable:
        """Tensions at the present state, N."""
        function = self._functions.derivative
        self._fill(function, drive, drive.lengths, drive.rates)
        function()
        return function.outputs[1].copy()

    def energy_now(self, drive: DrumMotion) -> float:
        """Kinetic and potential energy of the present state, J."""
        function = self._functions.energy
        self._fill(function, drive, drive.lengths, drive.rates)
        function()
        return function.outputs[0].item()

    def run(self, t_end: float, drive: DrumMotion) -> None:
        """Let time pass until t_end (s).

        Raises:
            InfeasibleError: the pose became singular (an attachment on a swivel axis or in a pulley, dependent cables).
        """
        begin, events = self.t, 0
        step = self._functions.step_held if np.any(drive.hand) else self._functions.step_free
        while t_end - self.t > 1e-12:
            remaining = t_end - self.t
            h = remaining / math.ceil(remaining / self._longest - 1e-9)
            broken = self._try(step, begin, h, drive)
            if broken and events < MOST_EVENTS:
                events += 1
                reached = self._locate(step, begin, h, drive)
                if reached > 0.0:
                    self._try(step, begin, reached, drive)
                    self._accept(step, reached)
                self._switch(_later(drive, self.t - begin))
                # A tiny step is taken without looking, so that time always goes on.
                h = min(h, UNSEEN, t_end - self.t)
                self._try(step, begin, h, drive)
            self._accept(step, h)
        self.t = t_end
        self._note_slack()

    def _try(self, step: Buffered, begin: float, h: float, drive: DrumMotion) -> bool:
        """Compute a step; True where in it a cable pushed, or a slack one got too long."""
        elapsed = self.t - begin
        rates = drive.rates + drive.accelerations * elapsed
        self._fill(step, drive, drive.lengths + (drive.rates + rates) / 2 * elapsed, rates)
        step.inputs[7][0] = h
        step()
        _, tension, beyond, faster = step.outputs
        if not self._rigid.size:
            return False
        active = self.active[self._rigid] > 0
        pushing = tension[self._rigid][active] < -PUSHING
        # One that has just gone slack may be too long by a rounding error, and be on its way back.
        too_long = (beyond > SLACKENING) & (faster > SLACKENING)
        return bool(pushing.any() or too_long[self._rigid][~active].any())

    def _locate(self, step: Buffered, begin: float, h: float, drive: DrumMotion) -> float:
        """The part of a broken step up to which nothing breaks, s."""
        good, bad = 0.0, h
        for _ in range(BISECTIONS):
            middle = (good + bad) / 2
            if self._try(step, begin, middle, drive):
                bad = middle
            else:
                good = middle
        return good

    def _accept(self, step: Buffered, h: float) -> None:
        self.x = step.outputs[0].copy()
        self.tensions = step.outputs[1].copy()
        if not np.isfinite(self.x).all():
            raise _singular(self.t)
        self.t += h
        self.history.append((self.t, self.x))
        if self.active.min() < 1.0 or self.tensions.min() <= 0.0:
            self._note_slack()

    def _switch(self, drive: DrumMotion) -> None:
        """Decide anew which cables pull, after an inelastic impact where one has just become taut."""
        spread, condensed, _, too_fast, beyond = self._touch(drive)
        touching = beyond > -10 * SLACKENING
        self.x = self.x.copy()
        self.x[TWIST] -= spread @ impact(condensed, too_fast, touching)
        spread, condensed, excess, too_fast, _ = self._touch(drive)
        pulling = taut(condensed, excess, touching & (too_fast > -STICKING))
        # Two cables would hand ever smaller impacts to and fro: what is left of their rates is taken at once.
        at = np.flatnonzero(pulling)
        self.x[TWIST] -= spread[:, at] @ np.linalg.solve(condensed[np.ix_(at, at)], too_fast[at])
        self.active[self._rigid] = pulling
        self._note_slack()

    def _touch(self, drive: DrumMotion) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """What `dynamics.contact` says of the present state."""
        m, function = len(self._rigid), self._functions.contact
        self._fill(function, drive, drive.lengths, drive.rates)
        function()
        spread, condensed, excess, too_fast, beyond = (part.copy() for part in function.outputs)
        if m and not _independent(condensed.reshape(m, m)):
            raise _singular(self.t)
        # CasADi counts by columns; `condensed` is symmetric.
        return spread.reshape(m, 6).T, condensed.reshape(m, m), excess, too_fast, beyond

    def _fill(self, function: Buffered, drive: DrumMotion, lengths: PerCable, rates: PerCable) -> None:
        x, now, *rest = function.inputs[:7]
        x[:] = self.x
        now[0], now[1], now[2] = self.t, self.t - drive.window_start, drive.window
        values = (lengths, rates, drive.accelerations, self.active, drive.hand)
        for given, value in zip(rest, values, strict=True):
            given[:] = value

    def _note_slack(self) -> None:
        self.slack.note(self.t, (self.active < 1.0) | (self.tensions <= 0.0))


def _independent(condensed: np.ndarray) -> bool:
    """Whether J M⁻¹ Jᵀ of the rigid cables can be inverted."""
    if not np.isfinite(condensed).all():
        return False
    values = np.linalg.eigvalsh(condensed)
    return bool(values[0] > DEPENDENT * values[-1])


def _singular(t: float) -> InfeasibleError:
    return InfeasibleError(
        f"The simulated platform came into a singular pose at t = {t:.3f} s: an attachment reached a swivel axis or a "
        "pulley, or the cables became dependent."
    )


def _later(drive: DrumMotion, elapsed: float) -> DrumMotion:
    """The same drive as seen `elapsed` seconds later."""
    rates = drive.rates + drive.accelerations * elapsed
    return DrumMotion(
        lengths=drive.lengths + (drive.rates + rates) / 2 * elapsed,
        rates=rates,
        accelerations=drive.accelerations,
        hand=drive.hand,
        window_start=drive.window_start,
        window=drive.window,
    )


NO_HAND = np.zeros(HAND_SIZE)
NO_HAND.setflags(write=False)
