"""Robots with one direction that cables hardly hold: the fit that replaces rigid cables (spec/model.md §6).

Stretch decides how such a platform moves, so every cable is a spring; and its slow rotation meets whatever rubs. Terms
that any such robot has are fitted along with the body, within what is physically possible: one compliance for all
cables, friction at the attachments, drag about each body axis, the encoders' zeros, and the frames of cameras and
markers (`frames`). They are there so that the body does not carry them; which of them is real, `fidim explain` asks.
How soft cables are, statics says where it can (`stretch`): the motion hardly does. Where the recordings ask for it,
friction goes with tension and gives way before it slips (`AttachmentFrictionGivingWay`).

What such a model misses even at its best is no white noise: it is common to all markers of the body and stays the same
for a good part of an oscillation. Fits count that share of the motion as noise, as large as makes its information true
(`working_noise`); otherwise model error outweighs every prior and bends tensions, zeros and frames beyond belief. Where
little more than the stated noise is left, that is used after all. Such fits have several optima: they begin from
several sizes of what dissipates, and the best is kept. Touched ends of windows are left out (`touched`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import motion_rms
from fidim_lab.data.records import Campaign, Robot, Role, Sensors, Window
from fidim_lab.effects.cables.cable_elasticity import CableStiffness
from fidim_lab.effects.dissipation.attachment_friction import AttachmentFriction, AttachmentFrictionGivingWay
from fidim_lab.effects.dissipation.drag import RotationalDragPerAxis
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.effects.geometry.cable_geometry import CableLengthBias
from fidim_lab.effects.plausibility import Context
from fidim_lab.errors import RefusedError
from fidim_lab.identification.calibration.stretch import ElasticStretch, seen_stretch
from fidim_lab.identification.mle import held_out
from fidim_lab.identification.mle.fit import Fit, fit
from fidim_lab.identification.mle.frames import REGISTERED, free_frames
from fidim_lab.identification.mle.judge import Remainder, remainder
from fidim_lab.identification.mle.odd_windows.touched import LEFT_OUT, left_by_window, untouched
from fidim_lab.identification.mle.trajectories.recordings import prepare
from fidim_lab.identification.mle.warm_start import Newcomer, exchanged
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.model.slots import Effect

SOFTNESS = (2e-5, 2e-6)
"""m/N of a cable where no load cell tells it, and how far that is trusted: motion alone tells it to a factor of 2"""
ZERO = 5e-3
"""m, of an encoder's zero"""
POSSIBLE = 0.5
"""of the largest possible friction or drag: standard deviation about none"""
BEGINNINGS = (0.1, 0.3, 0.03)
"""of that: sizes of everything that dissipates at which a fit begins"""
GIVE = 0.03
"""rad, over which friction gives way: where it begins, and standard deviation about that"""
ASKED_FOR = 10.0
"""nats by which friction that gives way must fit better than friction that slips at once, for two more parameters"""
SHARE = 0.05
"""of the markers' motion (rms) that such a model misses even at its best"""
LASTING = 0.15
"""s, for which that stays about the same: a sixth of an oscillation of 1 Hz"""
RIGID = 6
"""numbers that all markers of a rigid body hold at one time"""
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
    at_once: Fit | None
    """the same with friction that slips at once, where `found` has friction that gives way"""
    stretch: ElasticStretch | None
    """what statics says of the cables; None where there are no load cells"""
    costs: tuple[float, ...]
    """sums of squares reached from `BEGINNINGS`, in their order; infinite where a beginning led nowhere"""
    cut: tuple[str, ...]
    """a sentence for each end of a window that was left out"""

    def predict(self, window: Window) -> held_out.HeldOutPrediction:
        """A window that was not fitted. Raises RefusedError as `held_out.predict`."""
        likelihood = self.found.likelihood
        recording = prepare(window, likelihood.mechanism.robot)
        seen = held_out.predict(likelihood.mechanism, self.found.values, recording, self.working)
        return replace(seen, remainder=_restated(seen.remainder, self.working.marker_noise / likelihood.noise))

    @property
    def not_dissipating(self) -> tuple[Effect, ...]:
        """What was fitted along with the body, less the terms that dissipate."""
        effects = self.found.likelihood.mechanism.effects
        return tuple(one for one in effects if one not in (self.friction, RotationalDragPerAxis()))

    @property
    def by_working_noise(self) -> Fit:
        """The fit with its residuals whitened by the noise that it was made with."""
        return replace(self.found, likelihood=replace(self.found.likelihood, noise=self.working.marker_noise))

    @property
    def friction(self) -> NamedEffect:
        """The friction at the attachments in `found`."""
        return AttachmentFriction() if self.at_once is None else AttachmentFrictionGivingWay()

    @property
    def springs(self) -> str:
        """How soft the cables are, what tells so, and what is free beside them."""
        softness = self.found.values[BODY]
        source = f"by the motion, from {1e6 * SOFTNESS[0]:.0f} ± {1e6 * SOFTNESS[1]:.0f} without usable load cells"
        if self.stretch is not None and self.stretch.clear:
            lag = f"which {'lag' if self.stretch.delay >= 0 else 'lead'} by {1e3 * abs(self.stretch.delay):.0f} ms"
            source = f"{1e6 * self.stretch.softness:.0f} by statics of lengths and load cells, {lag}"
        mechanism = self.found.likelihood.mechanism
        frames = ", frames of cameras and markers" if len(mechanism.effects) > 3 + mechanism.n else ""
        return f"Cables were fitted as springs ({1e6 * softness:.0f} µm/N, {source}) with free encoder zeros{frames}."

    @property
    def sentences(self) -> tuple[str, ...]:
        """The further parameters fitted, how their start was found, and the parts left out."""
        viscous, dry, *giving = self.found.values[self.found.place_of(self.friction)]
        drag = self.found.values[self.found.place_of(RotationalDragPerAxis())]
        by_tension, more = "", ""
        if giving:
            by_tension = " at usual tension"
            more = f", {giving[0]:.2g} N m more about the body's z axis, giving way over {giving[1]:.2g} rad"
        best = min(self.costs)
        alike = sum(cost < SAME * best for cost in self.costs)
        return (
            f"{self.springs} Friction at the attachments ({dry:.2g} N m dry{by_tension}, {viscous:.2g} N m s viscous "
            f"for each cable{more}) and drag about the body's axes ({', '.join(f'{value:.2g}' for value in drag)} N m "
            "s) take up what dissipates; they do not prove where. "
            f"{alike} of {len(self.costs)} beginnings led to this optimum.",
            *self.cut,
        )


SAME = 1.05
"""times the lowest sum of squares, up to which beginnings led to one optimum"""


@dataclass(frozen=True, eq=False)
class _Task:
    """What is fitted, and how far it is known beforehand."""

    robot: Robot
    effects: tuple[NamedEffect, ...]
    softness: float
    sd: Float[np.ndarray, " theta"]
    low: Float[np.ndarray, " theta"]
    high: Float[np.ndarray, " theta"]
    native: bool

    @staticmethod
    def of(robot: Robot, windows: Sequence[Window], stretch: ElasticStretch | None, native: bool) -> "_Task":
        zeros = tuple(CableLengthBias(cable=number) for number in range(1, robot.n + 1))
        frames = free_frames(robot, windows)
        effects = (CableStiffness(), AttachmentFriction(), RotationalDragPerAxis(), *zeros, *frames)
        bounds = zip(*(effect.bounds(Context.of(robot)) for effect in effects), strict=True)
        low, high = (np.concatenate(side) for side in bounds)
        low[0] = LOWEST
        softness, known = SOFTNESS
        if stretch is not None and stretch.clear:
            softness, known = stretch.softness, stretch.doubt
        of_frames = sum(len(frame.parameters) for frame in frames)
        sd = np.concatenate([[known], POSSIBLE * high[1:6], np.full(robot.n, ZERO), np.full(of_frames, REGISTERED)])
        return _Task(robot, effects, softness, sd, low, high, native)

    def fit(self, windows: Sequence[Window], sensors: Sensors, beginning: float) -> Fit:
        """From one beginning. Raises RefusedError as `fit`."""
        theta = np.concatenate([[self.softness], beginning * self.sd[1:6], np.zeros(len(self.sd) - 6)])
        robot = replace(self.robot, sensors=sensors)
        mechanism = Mechanism(robot, self.effects, theta.tolist(), native=self.native)
        return fit(mechanism, windows, theta_sd=self.sd, bounds=(self.low, self.high))


def fit_soft(campaign: Campaign, *, native: bool = False) -> SoftFit:
    """Fit the `identify` windows with elastic cables. Raises RefusedError as `fit`."""
    robot, windows = campaign.robot, list(campaign.of_role(Role.IDENTIFY))
    stretch = seen_stretch(robot, windows)
    task = _Task.of(robot, windows, stretch, native)
    working = replace(robot.sensors, marker_noise=working_noise(robot, windows))
    first = task.fit(windows, working, BEGINNINGS[0])
    left = left_by_window(first)
    windows = [window for window in windows if window.id in left]
    kept, cut = untouched(windows, left, ALL_NOISE * robot.sensors.marker_noise)
    fits = [first if not cut else _tried(task, kept, working, BEGINNINGS[0])]
    if _rms(first) < ALL_NOISE * robot.sensors.marker_noise < working.marker_noise:
        working = robot.sensors
        fits = [_tried(task, kept, working, BEGINNINGS[0])]
    else:
        fits += [_tried(task, kept, working, beginning) for beginning in BEGINNINGS[1:]]
    costs = tuple(np.inf if found is None else found.journey.optimum.cost for found in fits)
    found = fits[int(np.argmin(costs))]
    if found is None:
        raise RefusedError("No beginning led to a motion on elastic cables that can be simulated.")
    found, at_once = replace(found, unused=first.unused | found.unused), None
    if working.marker_noise > robot.sensors.marker_noise and (better := _giving_way(found)) is not None:
        found, at_once = better, _by_stated_noise(found, robot.sensors)
    return SoftFit(
        _by_stated_noise(found, robot.sensors),
        working,
        at_once,
        stretch,
        costs,
        tuple(f"{one.says}{LEFT_OUT}" for one in cut),
    )


def _giving_way(found: Fit) -> Fit | None:
    """The fit with friction that gives way before it slips; None where the recordings do not ask for that."""
    at_once, effect = AttachmentFriction(), AttachmentFrictionGivingWay()
    low, high = effect.bounds(Context.of(found.likelihood.mechanism.robot))
    viscous, dry = found.values[found.place_of(at_once)]
    possible = POSSIBLE * high[:3]
    newcomer = Newcomer(effect, [viscous, dry, dry, GIVE], [*possible, GIVE], low.tolist(), high.tolist())
    better = exchanged(found, at_once, newcomer)
    if better is None or better.journey.optimum.cost > found.journey.optimum.cost - 2 * ASKED_FOR:
        return None
    return better


def working_noise(robot: Robot, windows: Sequence[Window]) -> float:
    """m, for a coordinate: the share of the motion that is missed, made larger by how often it is counted.

    It is the same for `LASTING` seconds, and all coordinates of a rigid body's markers hold `RIGID` numbers.
    """
    rms = float(np.sqrt(np.mean([motion_rms(window.markers) ** 2 for window in windows])))
    rate = float(np.median([1 / np.median(np.diff(window.t)) for window in windows]))
    coordinates = float(np.median([window.markers[0].size for window in windows]))
    counted = max(1.0, rate * LASTING) * max(1.0, coordinates / RIGID)
    return max(SHARE * rms * float(np.sqrt(counted)), robot.sensors.marker_noise)


def _tried(task: _Task, windows: Sequence[Window], sensors: Sensors, beginning: float) -> Fit | None:
    try:
        return task.fit(windows, sensors, beginning)
    except RefusedError:
        return None


def _by_stated_noise(found: Fit, sensors: Sensors) -> Fit:
    """With residuals whitened by the stated noise."""
    ratio = found.likelihood.noise / sensors.marker_noise
    simulation = found.journey.optimum.simulation
    remainders = tuple(
        _restated(remainder(found.likelihood, simulation, w), ratio) for w in range(len(found.remainders))
    )
    return replace(found, likelihood=replace(found.likelihood, noise=sensors.marker_noise), remainders=remainders)


def _restated(left: Remainder, ratio: float) -> Remainder:
    """By the stated noise instead of one that is `ratio` times as large."""
    return replace(left, chi2=left.chi2 * ratio**2)


def _rms(found: Fit) -> float:
    return float(np.sqrt(np.mean([each.rms**2 for each in found.remainders])))
