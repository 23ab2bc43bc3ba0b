"""Robots whose cables hold one direction hardly at all: what is fitted there instead of rigid cables (MODEL.md §6).

Stretch decides how such a platform moves, so every cable is a spring; and its slow rotation meets whatever rubs. Terms
that any such robot has are fitted along with the body, within what is physically possible: one compliance for all
cables, friction at the attachments, drag about each body axis, the encoders' zeros. They are there so that the body
does not carry them; which of them is real, `fidim explain` asks.

Fits count a share of the motion as noise (`SHARE`): otherwise model error, taken for information, outweighs every prior
and bends tensions and zeros beyond belief. Where little more than the stated noise is left, that is used after all.
"""

from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.data.records import Campaign, Role, Sensors, Window
from fidim_lab.effects.attachment_friction import AttachmentFriction
from fidim_lab.effects.cable_elasticity import CableStiffness
from fidim_lab.effects.cable_length_bias import CableLengthBias
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.effects.plausibility import Context
from fidim_lab.effects.rotational_drag import RotationalDragPerAxis
from fidim_lab.identification.mle import held_out
from fidim_lab.identification.mle.fit import Fit, fit
from fidim_lab.identification.mle.judge import Remainder, remainder
from fidim_lab.identification.mle.recordings import prepare
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import BODY

SOFTNESS = (2e-5, 2e-6)
"""m/N of a cable, and how far that is trusted: motion alone tells it to no better than a factor 2 (REAL.md §3.3)"""
ZERO = 5e-3
"""m, of an encoder's zero"""
POSSIBLE = 0.5
"""of the largest possible friction or drag: standard deviation about none"""
SHARE = 0.05
"""of the markers' motion (rms) that such a model misses even at its best"""
ALL_NOISE = 2.0
"""times the stated noise: a fit that leaves less has found the physics"""
LOWEST = 1e-6
"""m/N, of a cable that is a spring"""


@dataclass(frozen=True, eq=False)
class SoftFit:
    """A fit with elastic cables."""

    found: Fit
    """its residuals whitened by the stated noise, its tables by the working one"""
    working: Sensors
    """with the noise that fits were made with"""
    effects: tuple[NamedEffect, ...]

    def predict(self, window: Window) -> held_out.Prediction:
        """A window that was not fitted. Raises RefusedError as `held_out.predict`."""
        likelihood = self.found.likelihood
        recording = prepare(window, likelihood.mechanism.robot)
        seen = held_out.predict(likelihood.mechanism, self.found.values, recording, self.working)
        return replace(seen, remainder=_restated(seen.remainder, self.working.marker_noise / likelihood.noise))

    @property
    def sentence(self) -> str:
        """What was fitted beside the body."""
        softness, viscous, dry, *drag = self.found.values[BODY : BODY + 6]
        return (
            f"Cables were fitted as springs ({1e6 * softness:.0f} µm/N) with friction at the attachments "
            f"({dry:.2g} N m dry, {viscous:.2g} N m s viscous for each cable), drag about the body's axes "
            f"({', '.join(f'{value:.2g}' for value in drag)} N m s) and free encoder zeros; these terms take up what "
            "dissipates, they do not prove where."
        )


def fit_soft(campaign: Campaign, *, native: bool = False) -> SoftFit:
    """Fit the `identify` windows with elastic cables. Raises RefusedError as `fit`."""
    robot = campaign.robot
    zeros = tuple(CableLengthBias(cable=number) for number in range(1, robot.n + 1))
    effects = (CableStiffness(), AttachmentFriction(), RotationalDragPerAxis(), *zeros)
    low, high = (np.concatenate(side) for side in zip(*(e.bounds(Context.of(robot)) for e in effects), strict=True))
    low[0] = LOWEST
    scale = POSSIBLE * high[1:6]
    sd = np.concatenate([[SOFTNESS[1]], scale, np.full(robot.n, ZERO)])
    theta = np.concatenate([[SOFTNESS[0]], 0.1 * scale, np.zeros(robot.n)])
    windows = campaign.of_role(Role.IDENTIFY)

    def once(sensors: Sensors) -> Fit:
        seen = Mechanism(replace(robot, sensors=sensors), effects, theta.tolist(), native=native)
        return fit(seen, windows, theta_sd=sd, bounds=(low, high))

    share = SHARE * float(np.sqrt(np.mean([_motion(window) ** 2 for window in windows])))
    working = replace(robot.sensors, marker_noise=max(share, robot.sensors.marker_noise))
    found = once(working)
    left = float(np.sqrt(np.mean([each.rms**2 for each in found.remainders])))
    if left < ALL_NOISE * robot.sensors.marker_noise < working.marker_noise:
        working = robot.sensors
        found = once(working)
    likelihood = replace(found.likelihood, noise=robot.sensors.marker_noise)
    ratio = working.marker_noise / robot.sensors.marker_noise
    simulation = found.journey.optimum.simulation
    remainders = tuple(
        _restated(remainder(found.likelihood, simulation, w), ratio) for w in range(len(found.remainders))
    )
    return SoftFit(replace(found, likelihood=likelihood, remainders=remainders), working, effects)


def _restated(left: Remainder, ratio: float) -> Remainder:
    """By the stated noise instead of one that is `ratio` times as large."""
    return replace(left, chi2=left.chi2 * ratio**2)


def _motion(window: Window) -> float:
    """rms of the markers about their means, m."""
    return float(np.sqrt(np.nanmean((window.markers - np.nanmean(window.markers, axis=0)) ** 2)))
