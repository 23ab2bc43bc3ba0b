"""Cleaning before a fit: a campaign as recorded in, the campaign that may be fitted out.

    repeated       frames that repeat the one before become missing
    placeholders   (0, 0, 0) and other constants that stand for a blank become missing
    held           places that a marker keeps while the motion goes on become missing
    labels         markers whose names are exchanged get their own
    filled         samples that were computed from their neighbours become missing
    stamps         times of arrival become the even times of the samples
    clock jumps    only the longest part between jumps of a clock is used
    hands          what a hand holds for long is left out: where it lets go, samples look displaced
    screen         spikes, jumps, frozen and lost frames become missing; simple mistakes of files are refused in words
    knocked        markers that are not at their place on the body are missing in that window
    hands          what a hand pushes, catches or touches is left out

Nothing is repaired; what was taken out is listed (`Removed`) and told (`notes`). `identify` and `explain` begin here.
"""

from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.data.records import Campaign
from fidim_lab.errors import RefusedError
from fidim_lab.identification.cleaning.balance import balances_of
from fidim_lab.identification.cleaning.clock_jumps import without_clock_jumps
from fidim_lab.identification.cleaning.filled import without_filled
from fidim_lab.identification.cleaning.free_motion import hands, lasting, without_hands
from fidim_lab.identification.cleaning.gravity_clock import refuse_other_clock
from fidim_lab.identification.cleaning.knocked import without_knocked_markers
from fidim_lab.identification.cleaning.labels import with_right_labels
from fidim_lab.identification.cleaning.placeholders import without_placeholders
from fidim_lab.identification.cleaning.removed import CleanRecordings, Removed, stretches
from fidim_lab.identification.cleaning.repeated import without_held, without_repeated
from fidim_lab.identification.cleaning.stamps import retimed
from fidim_lab.identification.data_checks.screening import Screening, screen
from fidim_lab.identification.markers.finding import Finding

STEPS = (
    without_repeated,
    without_placeholders,
    without_held,
    with_right_labels,
    without_filled,
    retimed,
    without_clock_jumps,
)
"""what samples and the marker's shape alone show; each takes what the one before leaves"""


@dataclass(frozen=True, eq=False)
class Screened:
    """What cleaning left, and what screening saw on the way."""

    recordings: CleanRecordings
    screening: Screening


def clean_recordings(campaign: Campaign, *, kinematics: bool = False) -> Screened:
    """Clean a campaign; see the module.

    kinematics: also compare channels that measure the same thing twice (`screen`).
    Raises RefusedError where markers and lengths contradict the robot file grossly: nothing that is fitted then means
    anything.
    """
    done = without_bad_samples(campaign)
    balances = balances_of(done.campaign)
    cuts = hands(done.campaign, balances)
    done = done.then(without_hands(done.campaign, lasting(cuts)))
    seen = screen(done.campaign, kinematics=kinematics)
    possible = _refuse_mistakes(seen)
    _refuse_gravity(seen.campaign)
    refuse_other_clock(done.campaign, balances)
    told = len(done.removed)
    done = done.then(_taken_out(done.campaign, seen.campaign))
    done = done.then(without_knocked_markers(done.campaign))
    if len(done.removed) > told or cuts != lasting(cuts):
        done = done.then(without_hands(done.campaign, hands(done.campaign)))
    return Screened(replace(done, notes=(*possible, *faults_in_words(seen.faults), *done.notes)), seen)


def without_bad_samples(campaign: Campaign) -> CleanRecordings:
    """What samples and the shape of the markers show, without a look at cables or motion."""
    done = CleanRecordings(campaign)
    for step in STEPS:
        done = done.then(step(done.campaign))
    return done


def _refuse_mistakes(seen: Screening) -> tuple[str, ...]:
    """Notes of what may be a mistake, or a cause that is weighed against others after the fit."""
    if not seen.mistakes:
        return ()
    best, *others = seen.mistakes
    if best.doubtful:
        advice = "`fidim register` fits a frame, `fidim explain` weighs it against other errors of the geometry"
        return (f"Markers and cable lengths contradict the robot file. {best.says} ({advice}.)",)
    hint = "Correct the robot file, or what wrote the windows, and repeat the command."
    if others:
        hint += " Nearly as good: " + "; ".join(other.says.split(":")[0] for other in others) + "."
    raise RefusedError(f"The robot file and the recording do not belong together. {best.says}", hint=hint)


def _refuse_gravity(campaign: Campaign) -> None:
    """Raise RefusedError where every cable pulls the way that gravity pulls, in every window: nothing rests so."""
    robot = campaign.robot
    middles = [middle for w in campaign.windows if (middle := w.middle(robot.markers)) is not None]
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


def _taken_out(before: Campaign, after: Campaign) -> CleanRecordings:
    """What a look at samples took out of the same windows."""
    removed: list[Removed] = []
    for old, new in zip(before.windows, after.windows, strict=True):
        gone = np.asarray(np.isfinite(old.markers).all(axis=2) & ~np.isfinite(new.markers).all(axis=2))
        removed += stretches(old.id, old.t, gone, "displaced or frozen")
    return CleanRecordings(after, tuple(removed))


def faults_in_words(faults: tuple[Finding, ...]) -> tuple[str, ...]:
    """A sentence for each kind with the plainest example."""
    said: list[str] = []
    for kind in dict.fromkeys(fault.kind for fault in faults):
        ours = [fault for fault in faults if fault.kind is kind]
        worst = max(ours, key=lambda fault: fault.size)
        windows = len({fault.window for fault in ours})
        more = "" if len(ours) == 1 else f" ({len(ours)} times in {windows} windows; this is the largest)"
        said.append(f"{worst.says.rstrip('.')}{more}.")
    return tuple(said)
