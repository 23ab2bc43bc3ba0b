"""`fidim identify --pose-from …`: poses from the robot's own sensors, and what the cameras say beside them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table

from fidim_lab.app.terminal import console
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Campaign
from fidim_lab.identification.motion.pose_sources import PoseSource
from fidim_lab.identification.motion.virtual_markers import PoseDifference, Sensed, with_poses_from
from fidim_lab.identification.results.result import IdentificationResult, InertialParameter
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


def comparison(posed: PosedCampaign, here: IdentificationResult, mocap: IdentificationResult) -> RenderableType:
    """Pose differences by window, and parameters from both sources side by side."""
    poses = Table(title="Poses against those of the motion capture (rms of one coordinate)")
    console.columns(poses, "window", "samples", "position, mm", "rotation, mrad")
    for one in posed.differences:
        poses.add_row(one.window, str(one.samples), f"{one.position * 1e3:.2f}", f"{one.rotation * 1e3:.1f}")
    both = Table(title=f"Parameters by {here.method.value} (± spread between windows; s in mm, I in 1e-3 m²)")
    console.columns(both, "parameter", "CAD", "this source", "motion capture")
    for name, parameter in here.parameters.items():
        other = mocap.parameters[name]
        both.add_row(name, f"{millimetres(parameter.nominal):.2f}", _shown(parameter), _shown(other))
    return Group(poses, both)


def _shown(parameter: InertialParameter) -> str:
    spread = parameter.sd if parameter.spread is None else parameter.spread
    return f"{millimetres(parameter.value):.2f} ± {millimetres(spread):.2f}"


def _notes(sensed: Sensed, source: PoseSource) -> tuple[str, ...]:
    zeros, sensors = sensed.zeros, "swivel angles, lengths and inclination"
    what = sensors if source is PoseSource.SWIVEL else f"{sensors} together with the markers"
    notes = [
        f"Poses come from {what}; the marker columns of the windows stand for four virtual markers with "
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
