"""Do parameters predict windows that were not used to identify them? σ⊥ (Eq. 50, Fig. 3) and the trajectory itself.

The parameters stay as they are; of a window only its own initial state is fitted, within the encoders' resolution for
the lengths that it holds. The rule, for each window: χ²/dof of the trajectory against the marker noise of the robot
file is at most 2 (`Rule.chi2_per_dof`). σ⊥ is shown beside what it is where the model holds: √λ ‖χ‖ σ_W for
parameters that came with a σ_W, √λ times what marker noise gives an equation for those that did not. It decides (at
most twice that) where a window has no lengths to be simulated with; elsewhere a trajectory that fits over all its
length says more than second derivatives, which can be off where little of the motion shows in the markers.

The parameters predict when every window that can be judged does.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fidim_lab.data.records import Body, Campaign, Role, Window
from fidim_lab.errors import FidimError, RefusedError, SetupError
from fidim_lab.identification.equations.consistency import can_move
from fidim_lab.identification.equations.problem import WindowEquations, window_equations
from fidim_lab.identification.equations.refusals import bare, no_sigma
from fidim_lab.identification.mle.held_out import predict
from fidim_lab.identification.mle.judge import Remainder
from fidim_lab.identification.mle.trajectories.recordings import prepare
from fidim_lab.identification.motion.recipe import BEST, Recipe
from fidim_lab.identification.results.validation import expected_sigma_perp, residual, sigma_perp
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.units import plain

WITH_EFFECTS = "the equations of motion are without the effects that were named"
LOST = 0.1
"""s before a window's end at which a prediction may end"""


@dataclass(frozen=True)
class Rule:
    """When a window counts as predicted."""

    chi2_per_dof: float = 2.0
    ratio: float = 2.0
    """of σ⊥ over its expected value, where σ⊥ decides or is worth a remark"""

    @property
    def sentence(self) -> str:
        """The rule for a person."""
        return (
            f"a window is predicted when χ²/dof of its trajectory is at most {self.chi2_per_dof:g} (without lengths: "
            f"σ⊥ at most {self.ratio:g} times its expected value); all windows must be"
        )


@dataclass(frozen=True)
class JudgedWindow:
    """One window, with nothing but its initial state fitted."""

    id: str
    role: Role
    predicted: bool | None
    """None: it cannot be judged, `why` says why"""
    sigma_perp: float | None
    """Eq. 50"""
    expected: float | None
    """σ⊥ where the model holds"""
    rms: float | None
    """m"""
    chi2_per_dof: float | None
    why: str = ""
    """what is wrong, or worth a remark"""
    no_sigma: str = ""
    """why there is no σ⊥"""


@dataclass(frozen=True, eq=False)
class CrossValidation:
    """The verdict on one set of parameters."""

    windows: tuple[JudgedWindow, ...]
    rule: Rule

    @property
    def judged(self) -> tuple[JudgedWindow, ...]:
        """Windows that could be judged."""
        return tuple(w for w in self.windows if w.predicted is not None)

    @property
    def failed(self) -> tuple[JudgedWindow, ...]:
        """Windows that the parameters do not predict."""
        return tuple(w for w in self.windows if w.predicted is False)

    @property
    def no_sigma(self) -> str:
        """Why windows that were judged have no σ⊥, for people; empty where each has one."""
        return no_sigma({w.id: w.no_sigma for w in self.judged if w.no_sigma})

    @property
    def predicts(self) -> bool:
        """Whether all judged windows are predicted."""
        return not self.failed

    @property
    def message(self) -> str:
        """The verdict for a person."""
        chi2 = [w.chi2_per_dof for w in self.judged if w.chi2_per_dof is not None]
        rms = [w.rms for w in self.judged if w.rms is not None]
        figures = f"; χ²/dof up to {plain(max(chi2))}, rms up to {max(rms) * 1e3:.3g} mm" if chi2 else ""
        count = len(self.judged)
        windows = "window" if count == 1 else "windows"
        if self.predicts:
            judged = "the one window that was judged" if count == 1 else f"all {count} windows that were judged"
            return f"The parameters predict {judged}{figures}."
        names = ", ".join(w.id for w in self.failed)
        return f"The parameters do not predict {len(self.failed)} of {count} {windows} ({names}){figures}."


def cross_validate(
    campaign: Campaign,
    body: Body,
    sigma_W: float | None,
    *,
    roles: Sequence[Role] = (Role.VALIDATE,),
    rule: Rule | None = None,
    recipe: Recipe = BEST,
    mechanism: Mechanism | None = None,
    equations: bool = True,
) -> CrossValidation:
    """Judge the windows of these roles.

    sigma_W: of the identification, in the unit of the recipe's equations; None where the method has none. mechanism:
    with the geometry and the effects that were found with the body, the robot file's alone unless given.
    equations: also by σ⊥; without, where effects were found that the equations of motion do not have.
    Raises SetupError when the campaign has no such window, RefusedError when the body cannot move, or no window can be
    judged.
    """
    windows = [w for w in campaign.windows if w.role in roles]
    if not windows:
        raise SetupError(
            f"Campaign {campaign.name!r} has no window with the role {' or '.join(roles)}.",
            hint="--all judges the windows used for identification too.",
        )
    if not can_move(body):
        raise RefusedError(
            "With these parameters the kinetic energy is negative in some motion: nothing can be predicted."
        )
    mechanism = Mechanism(campaign.robot, native=True) if mechanism is None else mechanism
    judge = _Judge(campaign, mechanism, body, sigma_W, rule or Rule(), recipe, equations=equations)
    found = CrossValidation(tuple(judge.window(w) for w in windows), judge.rule)
    if not found.judged:
        raise RefusedError(f"No window can be judged: {'; '.join(f'{w.id}: {w.why}' for w in found.windows)}")
    return found


class _Judge:
    """Judges one window after the other with the same body."""

    def __init__(
        self,
        campaign: Campaign,
        mechanism: Mechanism,
        body: Body,
        sigma_W: float | None,
        rule: Rule,
        recipe: Recipe,
        *,
        equations: bool,
    ) -> None:
        self.rule = rule
        self._equations = equations
        self._campaign, self._body, self._sigma_W, self._recipe = campaign, body, sigma_W, recipe
        self._mechanism = mechanism
        self._shared = np.concatenate([body.vector, mechanism.theta])

    def window(self, window: Window) -> JudgedWindow:
        """The verdict on one window; one that cannot be used is not a failed one."""
        sigma, expected, none = self._by_equations(window)
        troubles: list[str] = []
        left: Remainder | None = None
        wrong: list[str] = []
        try:
            recording, sensors = prepare(window, self._campaign.robot), self._campaign.robot.sensors
            left = predict(self._mechanism, self._shared, recording, sensors).remainder
            wrong = self._about_trajectory(window, left)
        except FidimError as error:
            troubles.append(bare(window.id, str(error)))
        remarks = self._about_equations(sigma, expected)
        if left is not None:
            predicted = not wrong
        elif sigma is None:
            predicted, troubles = None, [*troubles, *([bare(window.id, none)] if none else [])]
        else:  # without lengths nothing can be simulated; with them, that it cannot be is the verdict
            predicted = window.lengths is None and not remarks
        return JudgedWindow(
            window.id,
            window.role,
            predicted,
            sigma,
            expected,
            None if left is None else left.rms,
            None if left is None else left.chi2_per_dof,
            "; ".join([*wrong, *remarks, *troubles]),
            none,
        )

    def _by_equations(self, window: Window) -> tuple[float | None, float | None, str]:
        """σ⊥ and what is expected of it, or why there is none."""
        if not self._equations:
            return None, None, WITH_EFFECTS
        try:
            equations = window_equations(self._mechanism, self._campaign, window, self._recipe)
            sigma = sigma_perp(residual(equations, self._body, self._body))
        except FidimError as error:
            return None, None, str(error)
        return sigma, self._expected(equations), ""

    def _expected(self, equations: WindowEquations) -> float | None:
        free = self._campaign.robot.freedoms
        if self._sigma_W is not None:
            return expected_sigma_perp(self._sigma_W, self._body, free)
        floor = equations.noise_floor
        return None if floor is None else float(np.sqrt(free)) * floor

    def _about_equations(self, sigma: float | None, expected: float | None) -> list[str]:
        if sigma is None or expected is None or sigma <= self.rule.ratio * expected:
            return []
        return [f"σ⊥ is {sigma / expected:.1f} times its expected value"]

    def _about_trajectory(self, window: Window, left: Remainder) -> list[str]:
        wrong: list[str] = []
        if left.t[-1] < window.t[-1] - LOST:
            wrong.append(f"the prediction loses the recorded motion after t = {left.t[-1]:.1f} s")
        if left.chi2_per_dof > self.rule.chi2_per_dof:
            wrong.append(f"χ²/dof is {plain(left.chi2_per_dof)}")
        return wrong
