"""Cuts that the completed model does not need: undone once the physics is named.

The audit looks with the model as it is, the search with one that may lack a term. Where that one is wrong, most of all
in its geometry, a stretch of motion or a sample can stand out that the completed model follows like any other: then it
was no hand, no stumble, no spike.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fidim_lab.data.records import Campaign, Window
from fidim_lab.errors import RefusedError
from fidim_lab.identification.cleaning.free_motion import whole_id
from fidim_lab.identification.markers.finding import DefectKind, Finding
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.held_out import predict as predicted
from fidim_lab.identification.mle.trajectories.recordings import prepare
from fidim_lab.mismatch.cleaning.clean import Cleaned
from fidim_lab.mismatch.cleaning.contacts import Contact, without
from fidim_lab.mismatch.cleaning.thresholds import CLEANING
from fidim_lab.mismatch.fitting.holdout import predict
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.residuals.whiteness import whiteness
from fidim_lab.say import Say


def restored(cleaned: Cleaned, audited: Cleaned, model: Completed, say: Say = lambda _: None) -> Cleaned | None:
    """What stays cut out by the completed model; None where all of it does, or where nothing is named.

    cleaned, audited: before and after audit and search. Windows are predicted whole, only their starts fitted; a cut
    is needless where what is left is white without it.
    """
    before = set(cleaned.faults)
    found = [fault for fault in audited.faults if fault not in before]
    if not model.tried or not (found or audited.contacts):
        return None
    windows: list[Window] = []
    contacts: list[Contact] = []
    faults: list[Finding] = []
    for window in cleaned.campaign.windows:
        hands = [contact for contact in audited.contacts if contact.window == window.id]
        ours = [fault for fault in found if fault.window is not None and _of(fault.window, window.id)]
        if not (hands or ours) or _follows(model, [window]):
            windows.append(window)
            continue
        needed = hands if ours else _needed(cleaned.campaign, window, hands, model)
        contacts += needed
        faults += ours
        as_audited = [one for one in audited.campaign.windows if _of(one.id, window.id)]
        windows += as_audited if len(needed) == len(hands) else _cut(cleaned.campaign, window, needed)
    if (len(contacts), len(faults)) == (len(audited.contacts), len(found)):
        return None
    say("some samples that were cut out follow the completed model: they are used again")
    campaign = replace(audited.campaign, windows=tuple(windows))
    return replace(audited, campaign=campaign, contacts=tuple(contacts), faults=(*cleaned.faults, *faults))


def without_needless(recorded: Campaign, cleaned: Cleaned, model: Completed) -> Cleaned:
    """The result without contacts and displaced samples in windows that the model follows as they were recorded.

    Screening knows a sample's neighbours alone: in violent motion, seen a few times a swing, some look displaced
    through which the fitted motion passes. It looks for hands by the robot file, whose geometry may be wrong. model:
    one that leaves only noise.
    """
    seen = {window.id: window for window in recorded.windows}
    touched = {contact.window for contact in cleaned.contacts}
    another = bool(model.fit.likelihood.mechanism.effects)  # than the one by which hands were looked for
    never = {id for id in touched & set(seen) if another and _follows(model, [seen[id]])}
    displaced = [one for one in cleaned.faults if one.kind in (DefectKind.SPIKE, DefectKind.JUMP)]
    doubted = {one.window for one in displaced if one.window in seen} - touched
    as_seen = [replace(one, markers=seen[one.id].markers) for one in cleaned.campaign.windows if one.id in doubted]
    followed = never | {window.id for window in as_seen if _follows(model, [window])}
    needless = [one for one in displaced if one.window in followed]
    return replace(
        cleaned,
        faults=tuple(one for one in cleaned.faults if one not in needless),
        contacts=tuple(one for one in cleaned.contacts if one.window not in never),
    )


def without_needless_contacts(cleaned: Cleaned, audited: Cleaned, completed: Fit) -> Cleaned:
    """The audit's result without the contacts of windows that the completed model follows like all others.

    cleaned, audited: before and after the audit. completed: the fit, of windows without the contacts; it needs no
    whiteness, because a model of what has no name, or of a real robot, hardly ever leaves noise alone.
    """
    touched = {contact.window for contact in audited.contacts}
    likelihood = completed.likelihood
    usual = [
        left.chi2_per_dof
        for recording, left in zip(likelihood.recordings, completed.remainders, strict=True)
        if not any(_of(recording.window.id, id) for id in touched)
    ]
    if not usual:
        return audited
    allowed = CLEANING.restored_alike * max(1.0, *usual)
    robot = likelihood.mechanism.robot
    for window in cleaned.campaign.windows:
        if window.id not in touched:
            continue
        try:
            found = predicted(likelihood.mechanism, completed.values, prepare(window, robot), robot.sensors)
        except RefusedError:
            continue
        if not found.lost and found.remainder.chi2_per_dof < allowed:
            touched.remove(window.id)
    return replace(audited, contacts=tuple(contact for contact in audited.contacts if contact.window in touched))


def _needed(campaign: Campaign, window: Window, hands: Sequence[Contact], model: Completed) -> list[Contact]:
    """The contacts of a window without which it is not followed, each tried beside the others."""
    needed = list(hands)
    for contact in hands if len(hands) > 1 else ():
        others = [other for other in needed if other is not contact]
        if _follows(model, _cut(campaign, window, others)):
            needed = others
    return needed


def _cut(campaign: Campaign, window: Window, contacts: Sequence[Contact]) -> list[Window]:
    return list(without(replace(campaign, windows=(window,)), contacts).windows)


def _of(id: str, window: str) -> bool:
    """Whether a window with this id is the window (its id) or a part of it."""
    return whole_id(id) == window


def _follows(model: Completed, windows: Sequence[Window]) -> bool:
    """Whether all of these windows are predicted up to white noise, without any sample far off."""
    held = predict(model, windows)
    if held.refused or not held.leftovers:
        return False
    largest = max(float(np.nanmax(np.abs(one.values))) for one in held.leftovers)
    return largest < CLEANING.off_motion_off and whiteness(held.leftovers).is_white
