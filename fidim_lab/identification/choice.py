"""The method for a campaign when none was asked for, and whether rigid cables can hold at all.

Where cables meet nearly in one point, Ξ has a singular value far below the next (a soft mode: spec/irma4u.md §1),
stretch moves the platform, and rigid cables are those of another robot: maximum likelihood then fits elastic ones
(`mle.soft`).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Campaign, Role, Window
from fidim_lab.data.rigid_body import fit_pose
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.equations.estimators import Method
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.modes import scaled_singular_values

SOFT = 0.1
"""a singular value of Ξ below this part of the next one: that direction is held by stretch, not by length"""
LOOKS = 20
"""samples of a window at which Ξ is looked at"""
FULL_POSE = 3
"""markers that show the whole pose"""


@dataclass(frozen=True)
class Choice:
    """A method, and why where it is not the usual one."""

    method: Method
    why: str = ""


def suited_method(campaign: Campaign) -> Choice:
    """Maximum likelihood; a sentence says where a soft mode needs elastic cables or makes the answer unreliable."""
    found = soft_singular_values(campaign)
    if found is None:
        return Choice(Method.MLE)
    said = f"The cables hardly hold one direction ({found})"
    if len(campaign.robot.markers) < FULL_POSE:
        why = (
            f"{said}, and the markers do not show the whole pose: the result assumes rigid cables, which is wrong here."
        )
        return Choice(Method.MLE, why)
    why = (
        f"{said}: rigid cables are the wrong model here. Elastic cables are fitted, each window with its own initial "
        "pose, twist and tensions."
    )
    return Choice(Method.MLE, why)


def soft_mode(campaign: Campaign) -> str | None:
    """Why cables must be elastic here, as the singular values that say so; None where rigid ones hold.

    None too where the markers do not show the whole pose: the twelve freedoms could not be told.
    """
    return soft_singular_values(campaign) if len(campaign.robot.markers) >= FULL_POSE else None


def soft_singular_values(campaign: Campaign) -> str | None:
    """The last two scaled singular values of Ξ in words where the last is SOFT; None where it is not."""
    values = _softest(campaign)
    if values is None or values[-1] >= SOFT * values[-2]:
        return None
    return f"singular values of Ξ {values[-1]:.3f} and {values[-2]:.2f}"


def _softest(campaign: Campaign) -> Float[np.ndarray, " n"] | None:
    """The singular values of Ξ (descending) where the last is smallest beside the one before; None where unknown."""
    if campaign.robot.n < 2:
        return None
    mechanism = Mechanism(campaign.robot)
    looks = [found for window in campaign.of_role(Role.IDENTIFY) if (found := _looks(mechanism, window)) is not None]
    if not looks:
        return None
    middle = [np.median(values, axis=0) for values in looks]
    return min(middle, key=lambda values: values[-1] / values[-2])


def _looks(mechanism: Mechanism, window: Window) -> Float[np.ndarray, "N n"] | None:
    """Scaled singular values at some poses of a window; None where its pose cannot be known beforehand."""
    robot = mechanism.robot
    try:
        if window.markers.shape[1] >= FULL_POSE:
            some = window.markers[:: max(1, len(window.t) // LOOKS)]
            positions, rotations, _ = fit_pose(some, robot.markers[: window.markers.shape[1]])
            seen = np.isfinite(positions).all(axis=1)
            positions, rotations = positions[seen], rotations[seen]
        elif window.lengths is not None:
            pose = pose_from_lengths(mechanism, robot.nominal, np.nanmean(window.lengths, axis=0)).pose
            positions, rotations = pose.position[np.newaxis], pose.rotation[np.newaxis]
        else:
            return None
        return scaled_singular_values(mechanism.structure_matrix(positions, rotations)) if len(positions) else None
    except InfeasibleError:
        return None
