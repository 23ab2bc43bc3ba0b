"""A claim about a campaign, the recordings that could test it, and their odds: `separate` makes proposals."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Pose
from fidim_lab.mismatch.next_experiment.thresholds import NEXT_EXPERIMENT


@dataclass(frozen=True)
class Claim:
    """An effect that was named, and what may stand in its place."""

    id: str
    cable: int | None
    theta: tuple[float, ...]
    """as found, in the order of the effect's parameters"""
    rivals: tuple[str, ...]
    """ids, as named"""
    open: tuple[str, ...] = ()
    """further ids that what was recorded leaves in its place"""


@dataclass(frozen=True, eq=False)
class ProposedTrial:
    """One window that could be recorded: let go at `start` with the motors locked at `lengths`."""

    lengths: Float[np.ndarray, " n"]
    """m"""
    displacement: Float[np.ndarray, " free"]
    """m, of the marker"""
    start: Pose


@dataclass(frozen=True)
class Odds:
    """The odds that a set of windows separates a claim from its closest rival."""

    rival: str
    non_centrality: float
    probability: float

    @property
    def clear(self) -> bool:
        """Whether that is often enough."""
        return self.probability >= NEXT_EXPERIMENT.proposal_clear


@dataclass(frozen=True, eq=False)
class Proposal:
    """What to record next for one claim."""

    claim: Claim
    windows: tuple[ProposedTrial, ...]
    """in order; the first tells most"""
    before: Odds
    """with what has been recorded"""
    after: tuple[Odds, ...]
    """with the first, the first two, … of the windows beside it"""
    markers: int
    """that the platform must carry"""
    beyond: tuple[str, ...] = ()
    """rivals that no such windows are likely to exclude: these are chosen for the others"""
    refusal: str = ""
    """why there are no odds"""

    @property
    def separates(self) -> bool:
        """Whether it is likely to give a clear verdict."""
        return self.after[-1].clear if self.after else self.before.clear

    @property
    def says(self) -> str:
        """A sentence or two for a person."""
        if self.refusal:
            return self.refusal
        last = self.after[-1] if self.after else self.before
        what = f"{self.claim.id} and {last.rival}"
        now = f"{100 * self.before.probability:.0f} %"
        then = f"{100 * last.probability:.0f} %"
        sensors = f" with {self.markers} markers on the platform" if self.markers > 1 else ""
        if not self.separates:
            return (
                f"{what} are told apart in {then} of cases even after {len(self.windows)} more windows{sensors} "
                f"(now: {now}): free motion can hardly separate them."
            )
        count = f"{len(self.windows)} more window{'s' * (len(self.windows) != 1)}"
        said = f"{what} are told apart in {then} of cases after {count}{sensors} (now: {now})."
        return f"{said} Free motion can hardly separate it from {' or '.join(self.beyond)}." if self.beyond else said
