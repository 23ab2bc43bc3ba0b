"""Screening: what data and kinematics show without dynamics.

    seen = screen(campaign)
    seen.campaign          bad samples missing; what every later step should use
    seen.findings          time stamps, gaps, frozen runs, spikes, jumps, lost frames, noise
    seen.redundancy        channels that measure the same thing twice, and whether they contradict each other
    seen.mistakes          simple changes of the robot file that make a gross contradiction vanish

On campaigns without fault the chance of any fault finding is below 1 %. Whether faults explain the misfit of a *fit* is
decided by fitting the cleaned campaign: its remainder must be white.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Campaign, Window
from fidim_lab.identification.data_checks.encoder_check import check_encoders
from fidim_lab.identification.data_checks.noise_check import NoiseLevels, check_noise, noise_levels
from fidim_lab.identification.data_checks.redundancy import (
    PosedMarkers,
    Redundancy,
    currents_against_statics,
    markers_against_lengths,
    pose_against_lengths,
    pose_window,
    rigid_markers,
    smoothed,
)
from fidim_lab.identification.data_checks.robot_mistakes import Mistake, find_mistakes
from fidim_lab.identification.data_checks.thresholds import DATA_CHECKS
from fidim_lab.identification.markers.displaced import ScoreLimits
from fidim_lab.identification.markers.finding import Finding
from fidim_lab.identification.markers.rigid_steps import without_rigid_steps
from fidim_lab.identification.markers.samples import Inspected, inspect
from fidim_lab.identification.markers.thresholds import MARKERS
from fidim_lab.model.mechanism import Mechanism


@dataclass(frozen=True, eq=False)
class Screening:
    """All that was found; `campaign` is the one without the bad samples."""

    campaign: Campaign
    findings: tuple[Finding, ...]
    redundancy: tuple[Redundancy, ...]
    mistakes: tuple[Mistake, ...]
    unposed: tuple[str, ...]
    """windows whose lengths and markers give no pose, each a sentence"""
    noise: Float[np.ndarray, "M 3"]
    """of every marker coordinate as seen, m"""
    noise_ratio: float
    """seen over declared"""
    removed: dict[str, int]
    """window id → marker samples taken out"""

    @property
    def faults(self) -> tuple[Finding, ...]:
        """The findings whose samples bend a fit."""
        return tuple(finding for finding in self.findings if finding.is_fault)

    @property
    def contradicts_kinematics(self) -> bool:
        """True where markers, lengths and geometry disagree, cleaned of faults: no force can do that."""
        return any(one.contradicts and one.name != "currents-statics" for one in self.redundancy) or bool(self.mistakes)

    @property
    def says(self) -> tuple[str, ...]:
        """All sentences, the gravest first."""
        rest = [finding.says for finding in self.findings if not finding.is_fault]
        contradictions = [one.says for one in sorted(self.redundancy, key=lambda one: not one.contradicts)]
        return (
            *(mistake.says for mistake in self.mistakes),
            *(finding.says for finding in self.faults),
            *self.unposed,
            *contradictions,
            *rest,
        )


def screen(campaign: Campaign, *, kinematics: bool = True) -> Screening:
    """Check all windows of a campaign. Faults in the data are in the answer; they raise nothing.

    kinematics: also compare channels that measure the same thing twice, which takes most of the time.
    """
    declared = campaign.robot.sensors.marker_noise
    levels = noise_levels(campaign.windows, declared)
    samples = sum(window.markers.shape[0] * window.markers.shape[1] for window in campaign.windows)
    limits = ScoreLimits.for_tests(samples)
    inspected = [_inspected(campaign, window, levels, limits) for window in campaign.windows]
    chance = MARKERS.rigid_steps_chance / len(inspected)
    inspected = [without_rigid_steps(one, levels.declared, chance) for one in inspected]
    cleaned = replace(campaign, windows=tuple(one.window for one in inspected))
    levels = noise_levels(cleaned.windows, declared)
    findings = [finding for one in inspected for finding in one.findings]
    mistakes = find_mistakes(campaign.robot, cleaned.windows, DATA_CHECKS.screening_gross)
    posable = replace(cleaned, windows=cleaned.windows[: DATA_CHECKS.screening_few]) if mistakes else cleaned
    redundancy, unposed = _redundancy(posable, levels.by_channel) if kinematics else ((), ())
    return Screening(
        campaign=cleaned,
        findings=(*findings, *check_noise(cleaned.windows, levels)),
        redundancy=redundancy,
        mistakes=mistakes,
        unposed=unposed,
        noise=levels.by_channel,
        noise_ratio=levels.ratio,
        removed={one.window.id: int(one.bad.sum()) for one in inspected},
    )


def _inspected(campaign: Campaign, window: Window, levels: NoiseLevels, limits: ScoreLimits) -> Inspected:
    """Markers and encoders of one window."""
    sigma = levels.by_channel[: window.markers.shape[1]]
    found = inspect(window, campaign.sample_rate, levels.declared, sigma, limits)
    slips, bad = check_encoders(window, campaign.robot.sensors.encoder_resolution)
    if not slips or window.lengths is None:
        return found
    kept = replace(found.window, lengths=np.where(bad, np.nan, window.lengths))
    return replace(found, window=kept, findings=(*found.findings, *slips))


def _redundancy(campaign: Campaign, sigma: Float[np.ndarray, "M 3"]) -> tuple[tuple[Redundancy, ...], tuple[str, ...]]:
    mechanism = Mechanism(campaign.robot)
    tried = [pose_window(mechanism, window, sigma) for window in campaign.windows if window.lengths is not None]
    posed = [one for one in tried if isinstance(one, PosedMarkers)]
    several = [
        (window, *smoothed(window, sigma)[1:])
        for window in campaign.windows
        if window.markers.shape[1] > 1 and len(window.t) > 5
    ]
    compared = (
        markers_against_lengths(mechanism, posed),
        rigid_markers(campaign, several),
        pose_against_lengths(mechanism, posed),
        currents_against_statics(mechanism, posed),
    )
    unposed = tuple(one for one in tried if isinstance(one, str))
    return tuple(one for one in compared if one is not None), unposed
