"""`fidim identify --pose-from …`: poses from the robot's own sensors, and what the cameras say beside them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Campaign
from fidim_lab.identification.motion.pose_sources import PoseSource
from fidim_lab.identification.motion.virtual_markers import PoseDifference, Sensed, with_poses_from
from fidim_lab.units import millimetres

DISAGREE = 2.0
"""χ²/dof of a sample's readings beyond which sensors contradict each other or the geometry"""


@dataclass(frozen=True, eq=False)
class PosedCampaign:
    """A campaign to identify from, and what is to be said of its poses."""

    campaign: Campaign
    notes: tuple[str, ...] = ()
    differences: tuple[PoseDifference, ...] = ()
    """to the motion capture; empty where it is the source, or does not show the pose"""


def read_posed(folder: Path, source: PoseSource = PoseSource.MOCAP) -> PosedCampaign:
    """Read a campaign with its poses from `source`. Raises FileError, and SetupError or RefusedError without poses."""
    campaign = read_campaign(folder)
    if source is PoseSource.MOCAP:
        return PosedCampaign(campaign)
    sensed = with_poses_from(campaign, source)
    return PosedCampaign(sensed.campaign, _notes(sensed, source), sensed.differences)


def _notes(sensed: Sensed, source: PoseSource) -> tuple[str, ...]:
    zeros, sensors = sensed.zeros, "swivel angles, lengths and inclination"
    what = sensors if source is PoseSource.SWIVEL else f"{sensors} together with the markers"
    notes = [
        f"Poses come from {what}; the marker columns of the windows hold four virtual markers with "
        f"{millimetres(sensed.campaign.robot.sensors.marker_noise):.2g} mm of noise."
    ]
    if sensed.calibrated:
        notes.append(
            f"Zeros and delays of the sensors were calibrated against the markers: swivels stray by "
            f"{zeros.swivel_noise * 1e3:.1f} mrad (delay {zeros.swivel_delay * 1e3:.1f} ms), inclinations by "
            f"{np.mean(zeros.inclination_noise) * 1e3:.1f} mrad (delay {zeros.inclination_delay * 1e3:.1f} ms), "
            f"lengths by {millimetres(zeros.length_noise):.2f} mm."
        )
    else:
        notes.append(
            "The markers do not show the whole pose, so nothing calibrates the sensors: swivel encoders and "
            "inclinometer are taken as absolute (zero at the robot file's axes), without delay."
        )
    if sensed.chi2_per_dof > DISAGREE:
        notes.append(
            f"Lengths, swivel angles and inclination contradict each other (χ²/dof {sensed.chi2_per_dof:.1f}): zeros, "
            "signs, swivel axes or cable order are not as the robot file says."
        )
    return (*notes, *(f"Window {name} is not used: {why}" for name, why in sensed.unused.items()))
