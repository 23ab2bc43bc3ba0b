"""Registration of a campaign: capture frame → robot frame, markers → body, zeros of the encoders.

Which of the three the recordings ask for is decided by the Bayesian information criterion; then each anchor and each
marker is freed in turn, to say which of them disagrees.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.data.records import Cable, Campaign, Robot
from fidim_lab.errors import FidimError, RefusedError
from fidim_lab.identification.data_checks.placed import aligned, resting
from fidim_lab.identification.data_checks.placement import Free, Placement, WindowPlacement, place
from fidim_lab.identification.data_checks.poses import PoseSamples, sampled
from fidim_lab.model.mechanism import Mechanism

EACH = 12
"""instants of each window; more change no standard deviation's first digit, for the lengths are the same in all"""
MODELS = (
    Free(),
    Free(frame=True),
    Free(markers=True),
    Free(frame=True, markers=True),
    Free(zeros=True),
    Free(frame=True, zeros=True),
    Free(markers=True, zeros=True),
    Free(frame=True, markers=True, zeros=True),
)
CURE = 0.5
"""of χ²: a single anchor whose move takes away so much disagrees"""


@dataclass(frozen=True, eq=False)
class Tried:
    """One choice of what is free."""

    free: Free
    placed: WindowPlacement
    criterion: float
    """−2 log likelihood + number of unknowns × log number of data, less the best one's"""


@dataclass(frozen=True, eq=False)
class Suspect:
    """The misfit that would go if this one anchor were fitted together with the registration."""

    cable: int
    """1-based"""
    by: np.ndarray
    """m"""
    chi2_per_dof: float


@dataclass(frozen=True, eq=False)
class Registered:
    """The answer."""

    tried: tuple[Tried, ...]
    """the best first"""
    suspects: tuple[Suspect, ...]
    """of all cables"""
    sample: PoseSamples

    @property
    def best(self) -> WindowPlacement:
        """The registration."""
        return self.tried[0].placed

    @property
    def free(self) -> Free:
        """What it left open."""
        return self.tried[0].free


def register_campaigns(campaigns: Sequence[Campaign]) -> Registered:
    """Register recordings of one robot, by the windows whose lengths were read.

    Raises RefusedError where no window's were, no pose fits, or no instant holds all markers.
    """
    robot = campaigns[0].robot
    every = [window for campaign in campaigns for window in campaign.windows]
    windows = tuple(window for window in every if not window.lengths_by_poses)
    if every and not windows:
        raise RefusedError(
            'The lengths of all windows come from the poses themselves (campaign.toml, lengths = "poses"): they agree '
            "with any capture frame, and show neither frame nor markers nor zeros.",
            hint="Register with a recording whose lengths are read by encoders with known zeros, at any equilibrium.",
        )
    sample = sampled(robot, windows, each=EACH, most_windows=len(windows))
    if sample is None:
        raise RefusedError(
            "No window holds the lengths of all cables and, at some instants, all markers that are seen in more than "
            "half of all samples: nothing can be registered."
        )
    robot = sample.robot
    noise = (robot.sensors.marker_noise, max(robot.sensors.encoder_resolution, robot.sensors.marker_noise))
    mechanism = Mechanism(robot)
    starts = _starts(mechanism, sample)
    tried = [one for free in MODELS if (one := _best(mechanism, sample, free, starts, noise)) is not None]
    if not tried:
        raise RefusedError("No pose has these cable lengths and these markers, wherever the capture frame is put.")
    near = min(tried, key=lambda one: one.criterion).placed
    tried = [
        one
        for free in MODELS
        if (one := _best(mechanism, sample, free, [*starts, _as_free(near, free, starts[0])], noise))
    ]
    lowest = min(one.criterion for one in tried)
    ranked = sorted((replace(one, criterion=one.criterion - lowest) for one in tried), key=lambda one: one.criterion)
    suspects = tuple(_suspect(mechanism, sample, ranked[0], cable, noise) for cable in range(robot.n))
    return Registered(tuple(ranked), suspects, sample)


def registered_robot(robot: Robot, found: Registered) -> Robot:
    """The robot file in the frame of the motion capture, with the markers where they are on the body.

    Recordings stay as they are; anchors, swivels and gravity are turned and shifted.
    """
    placement = found.best.placement
    back = placement.turn.T

    def seen(cable: Cable) -> Cable:
        d = back @ (cable.d - placement.shift)
        return replace(cable, d=d, x=back @ cable.x, y=back @ cable.y, z=back @ cable.z)

    cables = tuple(seen(cable) for cable in robot.cables)
    return replace(found.sample.with_markers(robot, placement.body), cables=cables, gravity=back @ robot.gravity)


def _starts(mechanism: Mechanism, sample: PoseSamples) -> list[Placement]:
    """As the file has it, and with the frame where the nominal body would hang."""
    start = Placement.of(mechanism.robot, sample.markers.shape[1])
    try:
        turn, shift = aligned(sample.markers, resting(mechanism, sample))
    except (FidimError, np.linalg.LinAlgError):
        return [start]
    return [start, replace(start, turn=turn, shift=shift)]


def _as_free(near: WindowPlacement, free: Free, file: Placement) -> WindowPlacement:
    """An answer's poses and what of its placement is free here; the rest as the robot file has it."""
    found = near.placement
    placement = Placement(
        turn=found.turn if free.frame else file.turn,
        shift=found.shift if free.frame else file.shift,
        body=found.body if free.markers else file.body,
        zeros=found.zeros if free.zeros else file.zeros,
    )
    return replace(near, placement=placement)


def _best(
    mechanism: Mechanism,
    sample: PoseSamples,
    free: Free,
    starts: Sequence[Placement | WindowPlacement],
    noise: tuple[float, float],
) -> Tried | None:
    found: list[WindowPlacement] = []
    for start in starts:
        if isinstance(start, Placement) and start is not starts[0] and not free.frame:
            continue
        try:
            found.append(place(mechanism, sample, free, start, noise))
        except (FidimError, np.linalg.LinAlgError):
            continue
    if not found:
        return None
    best = min(found, key=lambda one: one.chi2)
    return Tried(free, best, best.chi2 + best.unknowns * float(np.log(best.markers.size + best.lengths.size)))


def _suspect(mechanism: Mechanism, sample: PoseSamples, best: Tried, cable: int, noise: tuple[float, float]) -> Suspect:
    try:
        found = place(mechanism, sample, replace(best.free, anchor=cable), best.placed, noise)
    except (FidimError, np.linalg.LinAlgError):
        return Suspect(cable + 1, np.full(3, np.nan), best.placed.chi2_per_dof)
    return Suspect(cable + 1, found.placement.anchor, found.chi2_per_dof)
