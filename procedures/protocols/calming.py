"""Bringing the platform to rest with the winches: measure the swing, strokes in opposite phase, measure again.

What each chain of strokes did tells how strongly they really act on a mode here, and how fast it swings: a centre of
mass that is off CAD can halve or treble that, and strokes too strong by two never end. It serves the next chain, and
the first excitation at the same place.
"""

from collections.abc import Generator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import PlannedWindow
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.excitation.bodies import Bodies
from fidim_lab.identification.excitation.calm import Calming, calmed
from fidim_lab.identification.excitation.gains import OFF, Gains, Look
from fidim_lab.identification.excitation.knowledge import GAINS, RATIOS, Knowledge
from fidim_lab.identification.excitation.place import ExcitationPlace, WinchLimits
from fidim_lab.identification.excitation.strokes import Chain
from fidim_lab.model.swing import Swing
from procedures.settings import Settings
from procedures.steps import Lengths, Note, Result, Step
from procedures.steps.excitation import SeenSwing, StrokeChain, Strokes, WatchSwing
from procedures.thinking import think

MARGIN = 1.08
"""speed that a drive is given over the one that its stroke reaches, so that it never limits"""
UNMOVED = 2e-5
"""m: a winch with less way in a chain stands"""
LEAD = 0.5
"""s from having seen a swing to the first stroke that calms it: planning, and telling the drives their speeds"""
CORNERS = 8
"""bodies that CAD may have meant whose tensions are looked at before a swing is calmed: there is little time"""
PLAIN = 1e-3
"""m of the marker: a swing that is large enough for its frequency to be believed"""
KNOWN = 0.2
"""part by which a gain may be off where the body is known"""
MOST_DAMPING = 0.2
"""that is believed of a swing seen for some seconds"""


@dataclass(eq=False)
class _Here:
    """What is learnt at one place."""

    place: ExcitationPlace
    gains: Gains
    acted: Float[np.ndarray, " modes"]
    """gain over the model's, along the last chain for each mode; NaN before there was one"""
    frequencies: Float[np.ndarray, " modes"]
    """Hz; NaN where no swing was plain enough"""

    @staticmethod
    def at(place: ExcitationPlace, bodies: Bodies) -> "_Here":
        """The state before any measurement: only the body is known."""
        unknown = np.full(len(place.swing.frequencies), np.nan)
        return _Here(place, Gains.by(place.swing, KNOWN if bodies.sure else OFF), unknown, unknown)

    def swing(self, seen: SeenSwing) -> Swing:
        """As seen, and as strokes were found to act."""
        damping = np.clip(seen.damping, 0.0, MOST_DAMPING)
        return replace(self.place.swing, frequencies=seen.frequencies, damping=damping, gain=self.gains.mean)

    def saw(self, seen: SeenSwing) -> None:
        """Takes a measured swing over."""
        self.frequencies = np.where(seen.amplitudes > PLAIN, seen.frequencies, self.frequencies)

    def learn(self, done: Calming, before: SeenSwing, after: SeenSwing) -> None:
        """The effect of strokes between two measurements."""
        looks = (Look(one.states, one.t, one.frequencies) for one in (before, after))
        self.gains = self.gains.after(done.chain, done.end, self.swing(before), *looks)
        found, thought = (gain[done.mode] @ done.chain.direction for gain in (self.gains.mean, self.place.swing.gain))
        self.acted = self.acted.copy()
        self.acted[done.mode] = found / thought

    def told(self, knowledge: Knowledge) -> Knowledge:
        """With gain and frequencies as calming has shown them."""
        gain, ratio = np.abs(self.acted), self.frequencies / self.place.swing.frequencies
        return replace(
            knowledge,
            gain=np.where(np.isnan(gain), knowledge.gain, np.clip(gain, *GAINS)),
            ratio=np.where(np.isnan(ratio), knowledge.ratio, np.clip(ratio, *RATIOS)),
        )


class Calmer:
    """Takes swings away; what it learns holds for one place."""

    def __init__(self, settings: Settings, limits: WinchLimits) -> None:
        self._settings = settings
        self._limits = limits
        self._here: _Here | None = None

    def calm(
        self, window: PlannedWindow, place: ExcitationPlace, bodies: Bodies, enough: float = 0.0
    ) -> Generator[Step, Result, None]:
        """Calm until the marker swings less than `enough` (m; a fifth of the limit of rest) or the tries are used up.

        Where strokes would break tension limits that the swing alone keeps, a note says so and nothing is moved.
        """
        if self._here is None or self._here.place is not place:
            self._here = _Here.at(place, bodies)
        here, settings = self._here, self._settings
        enough = enough or 0.2 * settings.motion.settle_tolerance
        last: tuple[Calming, SeenSwing] | None = None
        for _ in range(len(place.swing.frequencies) + 1):
            result = yield WatchSwing(window=window.id, swing=place.swing, over=settings.excite.watch)
            if not result.outcome.usable or not result.values:
                return
            seen = SeenSwing.of(result.values)
            here.saw(seen)
            if last is not None:
                here.learn(*last, seen)
            if float(np.linalg.norm(seen.amplitudes)) <= enough:
                return
            others = bodies.others[:CORNERS]
            job = partial(calmed, place, here.swing(seen), seen.states, seen.t, seen.t + LEAD, self._limits, others)
            try:
                calming = yield from think(window, "plan strokes that calm it", job)
            except InfeasibleError as refusal:
                yield Note(window=window.id, remark=f"{window.id}: {refusal.message}")
                return
            done = yield Strokes(
                window=window.id,
                lengths=lengths_of(place),
                chains=(stroke_chain(calming.chain, 0.0, place, self._limits),),
                why="calm",
                begin=calming.begin,
                tolerance=settings.motion.position_tolerance,
            )
            last = (calming, seen) if done.outcome.usable else None

    def told(self, place: ExcitationPlace, knowledge: Knowledge) -> Knowledge:
        """The knowledge for a first excitation, including what calming at this place has shown."""
        return knowledge if self._here is None or self._here.place is not place else self._here.told(knowledge)


def stroke_chain(chain: Chain, begin: float, place: ExcitationPlace, limits: WinchLimits) -> StrokeChain:
    """A chain as drives are told it, never beyond the limits."""
    pattern, held = chain.pattern, place.equilibrium.lengths
    ways = np.where(np.abs(chain.direction) > UNMOVED, np.abs(chain.direction), 0.0)
    targets = held + np.outer(pattern.targets, np.where(ways > 0, chain.direction, 0.0))
    return StrokeChain(
        begin=begin,
        starts=tuple(float(start) for start in pattern.starts),
        targets=tuple(tuple(float(v) for v in target) for target in targets),
        speeds=tuple(float(v) for v in np.minimum(MARGIN * pattern.speed * ways, limits.speed)),
        accelerations=tuple(float(v) for v in np.minimum(pattern.acceleration * ways, limits.acceleration)),
        seconds=pattern.seconds,
    )


def lengths_of(place: ExcitationPlace) -> Lengths:
    """m, of its equilibrium."""
    return tuple(float(length) for length in place.equilibrium.lengths)
