"""What comes before physics is named: a campaign in, the campaign without faulty samples out, and what was found.

    cleaned = clean(campaign)           before any fit: samples, kinematics, the robot file
    cleaned = audit(cleaned, baseline)  after the first fit (`audit`): hands, single windows, samples off the motion

Faulty samples become missing, nothing is repaired. Whether they were all that was wrong is decided by what a fit of
the cleaned campaign leaves (`cleaned_up`, in `aftermath`).
"""

from collections.abc import Callable
from dataclasses import dataclass

from fidim_lab.data.records import Campaign
from fidim_lab.errors import RefusedError
from fidim_lab.mismatch.contacts import Contact
from fidim_lab.mismatch.finding import Finding
from fidim_lab.mismatch.screening import Screening, screen

Say = Callable[[str], None]


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
    (swapped cables, other units, a mirrored or turned frame): nothing that is fitted then means anything.
    """
    say("looking at samples and kinematics")
    seen = screen(campaign)
    if seen.mistakes:
        best, *others = seen.mistakes
        hint = "Correct the robot file, or what wrote the windows, and explain again."
        if others:
            hint += " Nearly as good: " + "; ".join(other.says.split(":")[0] for other in others) + "."
        raise RefusedError(f"The robot file and the recording do not belong together. {best.says}", hint=hint)
    for fault in seen.faults[:3]:
        say(fault.says)
    return Cleaned(seen.campaign, seen, seen.faults)
