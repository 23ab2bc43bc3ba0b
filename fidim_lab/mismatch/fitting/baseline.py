"""The fit of the model without effects, from which every explanation starts.

To the first seconds of each window always; to the whole windows where it follows those.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fidim_lab.data.records import Campaign, Motion, Robot, Role, Window
from fidim_lab.effects.plausibility import Context
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.geometry import with_geometry
from fidim_lab.identification.survey import Nuisance, prior_sd, stated
from fidim_lab.mismatch.fitting.fit_data import Ground, ground_of, settle, short_fit, whole_ground
from fidim_lab.mismatch.fitting.holdout import HeldOut, predict
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.linearised.columns import Scorer
from fidim_lab.mismatch.linearised.hypotheses import Hypotheses, hypotheses
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import derivatives
from fidim_lab.model.sensitivity.integrate import step_of
from fidim_lab.say import Say


@dataclass(frozen=True, eq=False)
class Baseline:
    """A campaign with the fits of the model as it is, and what can be tried beside it."""

    campaign: Campaign
    short: Fit
    """of the first seconds of each window"""
    whole: Fit | None
    """of whole windows; None where the first seconds already say that it cannot follow them"""
    short_ground: Ground
    whole_ground: Ground
    context: Context
    """what is physically possible, from the fitted motion"""
    tried: Hypotheses
    geometry: tuple[Nuisance, ...] = ()
    """what the survey leaves open: in every model, under its prior"""
    without: frozenset[str] = frozenset()
    """ids of effects that are not tried"""

    @property
    def fit(self) -> Fit:
        """The longest."""
        return self.short if self.whole is None else self.whole

    @property
    def follows(self) -> bool:
        """Whether whole windows are followed, so that first-order statements about them hold."""
        return self.whole is not None and self.whole.excess < SHARED.near and not self.whole.journey.lost

    @property
    def held_out(self) -> tuple[Window, ...]:
        """Held-out windows."""
        return self.campaign.of_role(Role.VALIDATE)

    @property
    def as_it_is(self) -> Completed:
        """The model without any effect."""
        return Completed((), self.fit, self.whole is not None)

    def ground(self, model: Completed) -> Ground:
        """What a model was fitted to."""
        return self.whole_ground if model.whole else self.short_ground

    @cached_property
    def predicted(self) -> HeldOut:
        """The held-out windows by the model without any effect."""
        return predict(self.as_it_is, self.held_out)


def ready(robot: Robot, *, native: bool) -> Mechanism:
    """The model as it is; for a native one the machine code of its fits and first scores is being built meanwhile."""
    mechanism = Mechanism(robot, native=native)
    if native:
        step_of(mechanism)
        derivatives(mechanism)
        Scorer(mechanism, hypotheses(robot)).prepare()
    return mechanism


def fit_baseline(
    campaign: Campaign,
    *,
    native: bool,
    say: Say,
    mechanism: Mechanism | None = None,
    hopeless: float = SHARED.near,
    geometry: tuple[Nuisance, ...] | None = None,
    without: frozenset[str] = frozenset(),
) -> Baseline:
    """Fit the windows of role `identify` with nothing beside the rigid model.

    mechanism: of this robot, where `ready` has made one; what it has compiled is used again. hopeless:
    χ²/dof of the first seconds, for the noise that they show, from which on whole windows are not tried. geometry: what
    is left open of it; what the robot file's survey leaves open, unless given. without: ids of effects not tried.
    Raises RefusedError where no window can be fitted at all.
    """
    say("fitting the model without effects")
    windows = campaign.of_role(Role.IDENTIFY)
    mechanism = Mechanism(campaign.robot, native=native) if mechanism is None else mechanism
    geometry = stated(campaign.robot) if geometry is None else geometry
    if geometry:
        mechanism = with_geometry(mechanism, geometry)
    short = short_fit(mechanism, windows, prior_sd(geometry))
    near = ground_of(short)
    far = whole_ground(near, windows)
    whole = None
    if short.excess < hopeless:
        everything = np.ones(len(short.values), dtype=bool)
        prior = far.prior(np.zeros(0), np.zeros(0))
        whole = settle(far, short, mechanism, short.journey.optimum.point, prior, everything)
    reached = "" if whole is None else f", over whole windows {whole.chi2_per_dof:.3f}"
    say(f"the model without effects: χ²/dof over 3 s {short.chi2_per_dof:.3f}{reached}")
    tried = hypotheses(campaign.robot, without)
    return Baseline(campaign, short, whole, near, far, context_of(short), tried, geometry, without)


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
