"""Cleaning before effects are named: a campaign in, the campaign without faulty samples and the findings out.

    cleaned = clean(campaign)           before any fit: samples, kinematics, the robot file
    cleaned = audit(cleaned, baseline)  after the first fit (`audit`): hands, single windows, samples off the motion

Faulty samples become missing, nothing is repaired. Whether they were all that was wrong is decided by what a fit of
the cleaned campaign leaves (`cleaned_up`, in `aftermath`).
"""

from dataclasses import dataclass

import numpy as np

from fidim_lab.data.records import Campaign, Role, Window
from fidim_lab.errors import RefusedError
from fidim_lab.identification.cleaning.clean import clean_recordings, faults_in_words
from fidim_lab.identification.cleaning.free_motion import RULE, whole_id
from fidim_lab.identification.cleaning.free_motion import WHY as HANDS
from fidim_lab.identification.cleaning.removed import CleanRecordings
from fidim_lab.identification.data_checks.screening import Screening
from fidim_lab.identification.markers.clock_check import even_grid
from fidim_lab.identification.markers.finding import Finding
from fidim_lab.identification.markers.neighbours import noise_of
from fidim_lab.mismatch.cleaning.contacts import Contact
from fidim_lab.mismatch.cleaning.thresholds import CLEANING
from fidim_lab.say import Say

MOVES = 1.5
"""times their noise by fourth differences, up to which markers do not move: 1 is noise alone"""
FEWEST = 5
"""samples, without more of which fourth differences say nothing"""


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
            "The cause is geometry, stretch or the sensors' frames; no force can cause this."
            if worst.contradicts
            else "What is missing is a force, an inertia or a clock error, not geometry."
        )
        return f"{worst.says} {meaning}"

    @property
    def says(self) -> tuple[str, ...]:
        """Faults and contacts, a sentence for each kind with the plainest example."""
        return (*faults_in_words(self.faults), *(contact.says for contact in self.contacts))


def clean(campaign: Campaign, *, say: Say = lambda _: None) -> Cleaned:
    """Take out what samples and kinematics alone show to be wrong.

    Raises RefusedError where markers and lengths contradict the robot file grossly and a simple mistake explains it
    (swapped cables, other units, a mirrored or turned frame), or where no marker moves beyond its noise: nothing that
    is fitted then means anything.
    """
    say("checking samples and kinematics")
    _refuse_stillness(campaign)  # of what is still, nothing tells frames and files apart
    screened = clean_recordings(campaign, kinematics=True)
    seen, recordings = screened.screening, screened.recordings
    _refuse_stillness(recordings.campaign)
    for note in recordings.notes[:3]:
        say(note)
    return Cleaned(recordings.campaign, seen, seen.faults, _contacts(campaign, recordings))


def _contacts(campaign: Campaign, recordings: CleanRecordings) -> tuple[Contact, ...]:
    """Hands within windows; letting go and catching belong to every recording."""
    ends = {window.id: (float(window.t[0]), float(window.t[-1])) for window in campaign.windows}
    hands = [one for one in recordings.removed if one.why == HANDS]
    return tuple(
        Contact(window, *one.t, RULE.above**2, CLEANING.timed)
        for one in hands
        for window in (whole_id(one.window),)  # a second hand may lie in what the first one left: "i03, part 2"
        if one.t[0] > ends[window][0] and one.t[1] < ends[window][1]
    )


def _refuse_stillness(campaign: Campaign) -> None:
    """Raise RefusedError where no window of role `identify` shows more motion than scatter."""
    windows = campaign.of_role(Role.IDENTIFY)
    ratios = {window.id: ratio for window in windows if (ratio := _motion_over_noise(window)) is not None}
    if not ratios or max(ratios.values()) > MOVES or len(ratios) < len(windows):
        return
    best = max(ratios, key=lambda id: ratios[id])
    raise RefusedError(
        f"Nothing swings in the {len(windows)} windows of role identify: markers move at most {ratios[best]:.2g} times "
        f"their own scatter from sample to sample (window {best}); more than {MOVES:g} times is needed.",
        hint="Record windows in which the platform swings freely, and check that the markers are those of this rig.",
    )


def _motion_over_noise(window: Window) -> float | None:
    """rms of all marker coordinates about their means over their noise by fourth differences; None if unknown."""
    if len(window.t) <= FEWEST:
        return None
    columns = even_grid(window.t).spread(window.markers.reshape(len(window.t), -1))
    noise = noise_of(columns)
    seen = np.isfinite(noise) & np.isfinite(columns).any(axis=0)
    if not seen.any():
        return None
    moves = np.nanvar(columns[:, seen], axis=0)
    return float(np.sqrt(moves.sum() / max(float((noise[seen] ** 2).sum()), 1e-300)))
