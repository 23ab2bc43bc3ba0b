"""The identification protocol without an operator: the winches excite the platform, calm it, and move it gently.

For each window: move (timed for the modes) – calm – settle – hold – read encoders – check tensions – strokes that leave
the wanted swing – record – check – see how it swung – accept, or learn from it and try once more. Nobody is asked
anything. What a window taught (damping, frequencies) goes into the next one's plan.
"""

from collections.abc import Callable, Generator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TypeVar

import numpy as np

from fidim_lab.data.records import PARAMETER_NAMES, Body, PlannedWindow
from fidim_lab.errors import InfeasibleError, OurBugError
from fidim_lab.identification.excitation.again import may_gain, missed, why_again
from fidim_lab.identification.excitation.bodies import Bodies
from fidim_lab.identification.excitation.knowledge import Knowledge
from fidim_lab.identification.excitation.place import ExcitationPlace, WinchLimits, wanted_amplitudes
from fidim_lab.identification.excitation.plan import Excitation, planned
from fidim_lab.identification.excitation.seen import taught
from fidim_lab.identification.excitation.travel import travel
from fidim_lab.model.mechanism import Mechanism
from procedures.control import Retried
from procedures.expected.limits import check_displacements
from procedures.outcomes import Outcome
from procedures.protocols.beginning import begin
from procedures.protocols.calming import Calmer, lengths_of, stroke_chain
from procedures.protocols.enough import windows_of
from procedures.protocols.experiment import Lab
from procedures.protocols.identify import WindowProtocol
from procedures.steps import CheckWindow, GiveUp, Lengths, Note, Result, Settle, Step, Steps, Stop
from procedures.steps.excitation import IdentifyBody, SeenSwing, SeeRecordedSwing, Strokes
from procedures.thinking import think

T = TypeVar("T")


REST = "Let it come to rest, or bring it to rest by hand once the winches hold; then continue with fidim resume."
TELLING = 4
"""windows from which the body to plan with is identified"""


def excite(lab: Lab) -> Steps:
    """The steps for a plan; see the module. Raises InfeasibleError as `identify`."""
    protocol = ExciteProtocol(lab)
    at = yield from begin(lab.robot.n, lab.settings, attended=False)
    yield from windows_of(lab.plan, protocol, at, lab.recorded, lab.swings)


class ExciteProtocol(WindowProtocol):
    """The identification protocol with strokes in place of a hand."""

    attended: bool = False

    def __init__(self, lab: Lab) -> None:
        check_displacements(lab.plan, lab.robot)
        super().__init__(lab)
        self._memory = lab.memory
        self._mechanism = self._memory.once("mechanism", lambda: Mechanism(lab.robot, native=True))
        excite = lab.settings.excite
        lengths = lab.settings.motion.length_limits or ()
        self._limits = WinchLimits(excite.speed, excite.acceleration, excite.offset, excite.seconds, tuple(lengths))
        self._calmer = Calmer(lab.settings, self._limits)
        self._knowledge: Knowledge | None = None
        self._bodies = Bodies.around(lab.robot.nominal)
        self._place: ExcitationPlace | None = None
        self._plan: Excitation | None = None
        self._again: Excitation | None = None
        """the plan of the next try, where it is made already"""
        self._tries = 0
        self._good = lab.recorded
        """windows accepted, with those of an earlier process"""
        self._new = lab.recorded > 0
        """what these tell of the body was not asked for yet"""

    def window(
        self, planned: PlannedWindow, at: Lengths, swinging: bool
    ) -> Generator[Step, Result, tuple[Lengths, bool]]:
        """With the body from windows of an earlier process; a platform that swings at the start is calmed first."""
        if self._new:
            yield from self._see_body(planned)
        if swinging and self._place is None:
            yield from self._see_modes(planned, at)
        return (yield from super().window(planned, at, swinging))

    def pace(
        self, window: PlannedWindow, start: Lengths | None, goal: Lengths
    ) -> Generator[Step, Result, tuple[float, float]]:
        """As fast as leaves the platform still, by the model."""
        speed, acceleration = self._limits.speed, self._limits.acceleration
        if start is None or start == goal:
            return (yield from super().pace(window, start, goal))

        def job() -> tuple[float, float]:
            found = travel(self._at(start), self._at(goal), speed, acceleration, self.settings.excite.left)
            return min(found.speed, speed), min(found.acceleration, acceleration)  # equal but for rounding

        try:
            return (
                yield from self._think(
                    window, "plan a move that does not excite the platform", job, (start, goal, self._who)
                )
            )
        except InfeasibleError:  # where no rest is known, or fast moves pull too much: as slowly as by hand
            slow, soft = yield from super().pace(window, start, goal)
            return min(slow, speed), min(soft, acceleration)

    def settle(self, planned: PlannedWindow) -> Generator[Step, Result, Result | None]:
        """The measured rest, calmed by the winches where it does not come by itself."""
        try:
            goal = tuple(float(length) for length in planned.lengths)
            self._place = yield from self._think(
                planned, "find the modes here", lambda: self._at(goal), (goal, self._who)
            )
        except InfeasibleError as refusal:
            yield GiveUp(window=planned.id, outcome=Outcome.FAIL, reason=refusal.message)
            return None
        result = yield from self._rest(planned, self.settings.motion.settle_tolerance)
        if result.outcome.usable:
            return result
        yield GiveUp(window=planned.id, outcome=Outcome.FAIL, reason=f"The winches cannot calm it. {result.reason}")
        return None

    def _rest(self, planned: PlannedWindow, tolerance: float, enough: float = 0.0) -> Generator[Step, Result, Result]:
        """Settled to a tolerance (m, peak to peak), calmed in between until it swings less than `enough` (m)."""
        motion, excite = self.settings.motion, self.settings.excite
        patience = motion.settle_over + excite.patience
        settle = Settle(window=planned.id, tolerance=tolerance, over=motion.settle_over, timeout=patience)
        result = yield settle
        for _ in range(excite.calms):
            if result.outcome.usable:
                break
            yield from self._calm(planned, enough)
            result = yield settle
        return result

    def steady(self, planned: PlannedWindow, text: str) -> Generator[Step, Result, str]:
        """Calmed by the winches before the next move, where it swings much; no move while it does."""
        small = self.settings.excite.small
        yield from self._calm(planned, enough=small)
        result = yield from self._rest(planned, 2 * small, small)
        if not result.outcome.usable:
            reason = f"No move begins while the platform swings, and the winches cannot calm it. {result.reason} {REST}"
            yield Stop(window=planned.id, outcome=Outcome.FAIL, reason=reason)
        return "done"

    def held(self, planned: PlannedWindow) -> Generator[Step, Result, Lengths]:
        """Also the modes there, for the next move to begin calmly."""
        at = yield from super().held(planned)
        self._place = None
        yield from self._see_modes(planned, at)
        return at

    def go(self, planned: PlannedWindow, at: Lengths) -> Generator[Step, Result, Lengths]:
        """As by hand; there are no modes known on the way."""
        self._place = None
        return (yield from super().go(planned, at))

    def record(self, planned: PlannedWindow, rest: tuple[float, ...]) -> Generator[Step, Result, bool]:
        """Excite and record until a window is good, or given up; returns whether the platform swings."""
        attempts = self.settings.record.repeats + self.settings.excite.tries
        self._tries, self._again, reasons, moved = 0, None, list[str](), False
        for _ in range(attempts):
            try:
                if reasons:
                    yield from self._calm(planned)
                    settled = yield from self.settle(planned)
                    if settled is None:
                        return True
                    rest = settled.values
                if moved:
                    yield from self.check_at_rest(planned, rest)
                    moved = False
                self._plan = self._again or (yield from self._planned(planned))
                self._again = None
                if self._plan.why_less:
                    yield Note(window=planned.id, remark=f"{planned.id}: {self._plan.why_less}")
                reason = yield from self.attempt(planned, rest)
            except Retried as word:
                reason, moved = word.reason, True
                at = yield from self.held(planned)
                yield from self.steady(planned, reason)
                yield from self.go(planned, at)
            except InfeasibleError as refusal:
                yield GiveUp(window=planned.id, outcome=Outcome.FAIL, reason=refusal.message)
                return bool(reasons)
            if reason is None:
                yield from self._identified(planned)
                return True
            reasons.append(reason)
        reason = f"rejected {attempts} times, the last time: {reasons[-1]}"
        yield GiveUp(window=planned.id, outcome=Outcome.FAIL, reason=reason)
        return True

    def set_free(self, planned: PlannedWindow) -> Generator[Step, Result, str | None]:
        """Strokes, and hold."""
        place, plan = self._now(planned)
        chains = tuple(
            stroke_chain(chain, begin, place, self._limits)
            for chain, begin in zip(plan.chains, plan.begins, strict=True)
        )
        swing = " and ".join(f"{1e3 * value:.0f}" for value in plan.reached)
        step = Strokes(
            window=planned.id,
            lengths=lengths_of(place),
            chains=chains,
            why=f"excite, for a swing of {swing} mm in its modes",
            displacement=tuple(float(way) for way in planned.displacement),
            tolerance=self.settings.motion.position_tolerance,
        )
        result = yield step
        return None if result.outcome.usable else result.reason

    def judged(self, planned: PlannedWindow, check: CheckWindow, verdict: Result) -> Generator[Step, Result, Result]:
        """The measured swing against the planned one, and the knowledge from it."""
        if not verdict.outcome.usable:
            return verdict
        place, plan = self._now(planned)
        self._tries += 1
        result = yield SeeRecordedSwing(
            window=planned.id, attempt=check.attempt, swing=place.swing, rest=check.equilibrium
        )
        if not result.outcome.usable or not result.values:
            return verdict
        seen = SeenSwing.of(result.values)
        before = (self._knowledge or Knowledge.none(len(seen.damping))).fitting(len(seen.damping))
        job = partial(taught, place, self._bodies, plan, seen, before)
        lesson = yield from self._think(planned, "learn from the measured swing", job)
        self._place, self._bodies, self._knowledge = lesson.place, lesson.bodies, lesson.knowledge
        close = self.settings.excite.close
        if self._tries < self.settings.excite.tries and may_gain(seen.amplitudes, plan, close):
            again = yield from self._planned_again(planned, plan)
            reason = why_again(seen.amplitudes, plan, again, close)
            if reason:
                self._again = again
                return replace(verdict, outcome=Outcome.FAIL, reason=reason)
        amiss = missed(seen.amplitudes, plan, close)
        if not amiss:
            return verdict
        return replace(verdict, outcome=Outcome.MARGINAL, reason="; ".join(filter(None, (verdict.reason, amiss))))

    def _identified(self, planned: PlannedWindow) -> Generator[Step, Result, None]:
        """Plan with the body that the recordings show, until it is known well; the first ones tell nearly all of it."""
        self._good += 1
        if self._good <= TELLING and not self._bodies.sure:
            yield from self._see_body(planned)

    def _see_body(self, planned: PlannedWindow) -> Generator[Step, Result, None]:
        self._new = False
        result = yield IdentifyBody(window=planned.id)
        if not result.values:
            return
        body, *off = np.array(result.values).reshape(-1, len(PARAMETER_NAMES))
        self._bodies = Bodies.within(Body.from_vector(body), np.array(off))
        if self._knowledge is not None:
            self._knowledge = self._knowledge.by_identified_body()

    def _planned(self, window: PlannedWindow, before: Excitation | None = None) -> Generator[Step, Result, Excitation]:
        """before: what was carried out last, of a window that is done again."""
        place = self._place or self._at(tuple(float(length) for length in window.lengths))
        wanted = wanted_amplitudes(place, np.asarray(window.displacement))
        knowledge = (self._knowledge or Knowledge.none(len(wanted))).fitting(len(wanted))
        if not self._tries:
            sure = self._bodies.sure
            knowledge = knowledge.by_identified_body() if sure else self._calmer.told(place, knowledge.elsewhere())
        job = partial(planned, place, wanted, knowledge, self._limits, self._bodies.others, before=before)
        # what is the same in every reading of the procedure is planned once
        key = (window.id, self._tries, self._who, *np.concatenate([knowledge.gain, knowledge.ratio, knowledge.damping]))
        return (yield from self._think(window, "plan the strokes", job, key))

    def _planned_again(self, window: PlannedWindow, before: Excitation) -> Generator[Step, Result, Excitation | None]:
        """None where nothing can be planned: then what there is is the best."""
        try:
            return (yield from self._planned(window, before))
        except InfeasibleError:
            return None

    def _calm(self, window: PlannedWindow, enough: float = 0.0) -> Generator[Step, Result, None]:
        if self._place is not None:
            yield from self._calmer.calm(window, self._place, self._bodies, enough)

    def _at(self, lengths: Lengths) -> ExcitationPlace:
        body = self._bodies.likely
        return self._memory.once(
            ("place", lengths, self._who), lambda: ExcitationPlace.at(self._mechanism, np.array(lengths), body)
        )

    @property
    def _who(self) -> tuple[float, ...]:
        """What is likely to hang there: answers that depend on it are kept beside it."""
        return tuple(self._bodies.likely.vector)

    def _now(self, window: PlannedWindow) -> tuple[ExcitationPlace, Excitation]:
        if self._place is None or self._plan is None:
            raise OurBugError(f"Window {window.id}: strokes before their plan.")
        return self._place, self._plan

    def _see_modes(self, window: PlannedWindow, at: Lengths) -> Generator[Step, Result, None]:
        """Wherever the winches hold; nothing is calmed where no rest is known."""
        if at:
            with suppress(InfeasibleError):
                self._place = yield from self._think(window, "find the modes here", lambda: self._at(at))

    def _think(
        self, window: PlannedWindow, what: str, job: Callable[[], T], key: object = None
    ) -> Generator[Step, Result, T]:
        """`think`, with answers kept under a key for all readings of the procedure."""
        work = job if key is None else partial(self._memory.once, (what, key), job)
        return (yield from think(window, what, work))
