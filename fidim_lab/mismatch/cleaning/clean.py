"""What comes before physics is named: a campaign in, the campaign without faulty samples out, and what was found.

    cleaned = clean(campaign)           before any fit: samples, kinematics, the robot file
    cleaned = audit(cleaned, baseline)  after the first fit (`audit`): hands, single windows, samples off the motion

Faulty samples become missing, nothing is repaired. Whether they were all that was wrong is decided by what a fit of
the cleaned campaign leaves (`cleaned_up`, in `aftermath`).
"""

from dataclasses import dataclass

import numpy as np

from fidim_lab.data.records import Campaign, Role, Window
from fidim_lab.errors import RefusedError
from fidim_lab.identification.data_checks.screening import Screening, screen
from fidim_lab.identification.markers.clock_check import even_grid
from fidim_lab.identification.markers.finding import Finding
from fidim_lab.identification.markers.neighbours import noise_of
from fidim_lab.mismatch.cleaning.contacts import Contact
from fidim_lab.mismatch.cleaning.thresholds import CLEANING
from fidim_lab.say import Say


@dataclass(frozen=True, eq=False)
class Cleaned:
    """A campaign that may be fitted, and why it is not the recorded one."""

    campaign: Campaign
    """faulty samples missing, contacts and bad windows cut out"""
    screening: Screening
    faults: tuple[Finding, ...] = ()
    """of sensors, encoders and time stamps: those of the screening, and those that only a fit shows"""
    contacts: tuple[Contact, ...] = ()

    @property
    def kinematics(self) -> str | None:
        """Whether geometry or force is at stake, with the plainest figure; None where nothing is redundant."""
        compared = [one for one in self.screening.redundancy if one.name != "currents-statics"]
        if not compared:
            return None
        worst = max(compared, key=lambda one: one.ratio)
        meaning = (
            "Geometry, stretch or the sensors' frames are involved: no force does that."
            if worst.contradicts
            else "What is missing acts as a force, an inertia or a clock, not as geometry."
        )
        return f"{worst.says} {meaning}"

    @property
    def says(self) -> tuple[str, ...]:
        """Faults and contacts, a sentence for each kind with the plainest example."""
        kinds = dict.fromkeys(fault.kind for fault in self.faults)
        said: list[str] = []
        for kind in kinds:
            ours = [fault for fault in self.faults if fault.kind is kind]
            worst = max(ours, key=lambda fault: fault.size)
            windows = len({fault.window for fault in ours})
            more = "" if len(ours) == 1 else f" ({len(ours)} times in {windows} windows; this is the largest)"
            said.append(f"{worst.says.rstrip('.')}{more}.")
        return (*said, *(contact.says for contact in self.contacts))


def clean(campaign: Campaign, *, say: Say = lambda _: None) -> Cleaned:
    """Take out what samples and kinematics alone show to be wrong.

    Raises RefusedError where markers and lengths contradict the robot file grossly and a simple mistake explains it
    (swapped cables, other units, a mirrored or turned frame), or where no marker moves beyond its noise: nothing that
    is fitted then means anything.
    """
    say("looking at samples and kinematics")
    seen = screen(campaign)
    if seen.mistakes:
        best, *others = seen.mistakes
        hint = "Correct the robot file, or what wrote the windows, and explain again."
        if others:
            hint += " Nearly as good: " + "; ".join(other.says.split(":")[0] for other in others) + "."
        raise RefusedError(f"The robot file and the recording do not belong together. {best.says}", hint=hint)
    _refuse_gravity(seen.campaign)
    _refuse_stillness(seen.campaign)
    for fault in seen.faults[:3]:
        say(fault.says)
    return Cleaned(seen.campaign, seen, seen.faults)


def _refuse_gravity(campaign: Campaign) -> None:
    """Raise RefusedError where every cable pulls the way that gravity pulls, in every window: nothing rests so."""
    robot = campaign.robot
    middles = [np.nanmean(w.markers[:, 0], axis=0) for w in campaign.windows if np.isfinite(w.markers[:, 0]).any()]
    if not middles:
        return
    up = -robot.gravity / np.linalg.norm(robot.gravity)
    heights = np.array([[(cable.d - middle) @ up for cable in robot.cables] for middle in middles])
    if heights.max() >= 0:
        return
    raise RefusedError(
        f"The robot file and the recording do not belong together. All anchors are {-heights.max():.2g} m or more "
        f"below the marker, as gravity {robot.gravity.tolist()} m/s² goes: cables cannot hold a platform so.",
        hint="Check gravity's sign in the robot file, and that anchors and markers have the same z axis.",
    )


def _refuse_stillness(campaign: Campaign) -> None:
    """Raise RefusedError where no window of role `identify` shows more motion than scatter."""
    windows = campaign.of_role(Role.IDENTIFY)
    ratios = {window.id: ratio for window in windows if (ratio := _motion_over_noise(window)) is not None}
    if not ratios or max(ratios.values()) > CLEANING.clean_moves or len(ratios) < len(windows):
        return
    best = max(ratios, key=lambda id: ratios[id])
    raise RefusedError(
        f"Nothing swings in the {len(windows)} windows of role identify: markers move at most {ratios[best]:.2g} times "
        f"their own scatter from sample to sample (window {best}); more than {CLEANING.clean_moves:g} times is needed.",
        hint="Record windows in which the platform swings freely, and check that the markers are those of this rig.",
    )


def _motion_over_noise(window: Window) -> float | None:
    """rms of all marker coordinates about their means over their noise by fourth differences; None if unknown."""
    if len(window.t) <= CLEANING.clean_fewest:
        return None
    columns = even_grid(window.t).spread(window.markers.reshape(len(window.t), -1))
    noise = noise_of(columns)
    seen = np.isfinite(noise) & np.isfinite(columns).any(axis=0)
    if not seen.any():
        return None
    moves = np.nanvar(columns[:, seen], axis=0)
    return float(np.sqrt(moves.sum() / max(float((noise[seen] ** 2).sum()), 1e-300)))
