"""The model as it is, fitted: where every explanation starts."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fidim_lab.data.records import Campaign, Motion, Role, Window
from fidim_lab.effects.plausibility import Context
from fidim_lab.identification.mle.fit import Fit, fit
from fidim_lab.mismatch.hypotheses import Hypotheses, hypotheses
from fidim_lab.model.mechanism import Mechanism

Say = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Baseline:
    """A campaign with the fit of the model as it is, and what can be tried beside it."""

    campaign: Campaign
    fit: Fit
    context: Context
    """what is physically possible, from the fitted motion"""
    tried: Hypotheses

    @property
    def held_out(self) -> tuple[Window, ...]:
        """Windows that no fit may see."""
        return tuple(self.campaign.of_role(Role.VALIDATE))


def fit_baseline(campaign: Campaign, *, native: bool, say: Say) -> Baseline:
    """Fit the windows of role `identify` with nothing beside the rigid model.

    Raises RefusedError where no window can be fitted at all.
    """
    say("fitting the baseline")
    found = fit(Mechanism(campaign.robot, native=native), campaign.of_role(Role.IDENTIFY))
    return Baseline(campaign, found, context_of(found), hypotheses(campaign.robot))


def context_of(base: Fit) -> Context:
    """Tensions and rates of the fitted motion, for what is physically possible."""
    mechanism, simulation = base.likelihood.mechanism, base.journey.optimum.simulation
    parts = [batch.trajectories for batch in simulation.batches]
    nodes = [np.isfinite(part.tensions).all(axis=2) for part in parts]

    def stacked(name: str) -> np.ndarray:
        return np.concatenate([getattr(part, name)[good] for part, good in zip(parts, nodes, strict=True)])

    positions = stacked("positions")
    motion = Motion(
        np.arange(len(positions), dtype=float),
        positions,
        stacked("rotations"),
        stacked("twists"),
        stacked("accelerations"),
    )
    return Context.of_motion(mechanism, motion, mechanism.robot.mass * stacked("tensions"))
