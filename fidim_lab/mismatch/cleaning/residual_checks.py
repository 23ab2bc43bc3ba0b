"""Checks that need a first fit: samples off the motion, hands within windows, single faulty windows.

Nothing is done where the fit leaves white noise. Otherwise

    samples    off a motion which their neighbours follow, and steps in it, too small or too well hidden for screening
    contacts   of a hand, by segments (`contacts`), cut out
    windows    one whose χ² is several times the median: left out, and looked at again. It is given up only if the rest
               is then white, and a fault that it may have (an encoder that slipped before it, lost frames) makes it
               white too; physics that only one window shows stays in, to be found
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fidim_lab.data.records import Role
from fidim_lab.errors import RefusedError
from fidim_lab.identification.cleaning.free_motion import whole_id
from fidim_lab.identification.markers.finding import DefectKind, Finding, marker_channel
from fidim_lab.identification.mle.fit import Fit, fit
from fidim_lab.mismatch.cleaning.clean import Cleaned
from fidim_lab.mismatch.cleaning.contacts import Contact, deforms, find_contacts, without
from fidim_lab.mismatch.cleaning.odd_windows import slipped_encoder, stumble
from fidim_lab.mismatch.cleaning.off_motion import without_breaks
from fidim_lab.mismatch.cleaning.segments import Segmented, Segments, fit_segments
from fidim_lab.mismatch.cleaning.thresholds import CLEANING
from fidim_lab.mismatch.fitting.baseline import Baseline
from fidim_lab.mismatch.fitting.fit_data import short_fit
from fidim_lab.mismatch.fitting.holdout import HeldOut, predict
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.residuals.residual import of_fit
from fidim_lab.mismatch.residuals.whiteness import whiteness
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.say import Say

NOT_PREDICTED = HeldOut(chi2=0.0, dof=0, rms=float("nan"), refused={})
"""what a model that not even follows the windows it is fitted to says of others: nothing that would show a fault"""


def audit(cleaned: Cleaned, baseline: Baseline, *, say: Say = lambda _: None) -> Cleaned | None:
    """Look again with the first fit of `cleaned.campaign`; None where nothing is changed.

    Held-out windows are looked at as well: a hand on one of them alone would pass for physics that does not predict.
    """
    found, held = baseline.fit, NOT_PREDICTED if baseline.whole is None else baseline.predicted
    if whiteness((*of_fit(found), *held.leftovers)).is_white and not held.refused:
        return None
    left = (*baseline.as_it_is.leftovers, *held.leftovers)
    astray = not baseline.follows
    after = without_breaks(cleaned, left, astray=astray) or cleaned
    say("looking for hands and single bad windows")
    for _ in range(SHARED.rounds):
        try:
            segments = fit_segments(found.likelihood.mechanism, after.campaign.windows, hasty=astray)
        except RefusedError:
            break  # no two seconds hold enough of any marker
        further = without_breaks(after, segments.leftovers, astray=astray)
        further = further or _cut(after, segments, find_contacts(segments), say)
        if further is None:
            break
        after = further
    if len(after.faults) > len(cleaned.faults):
        after = _looked_again(after, found) or after
    after = _without_encoders(after, found, held, say) or after
    more = len(after.faults) + len(after.contacts) > len(cleaned.faults) + len(cleaned.contacts)
    return after if more else None


def _looked_again(cleaned: Cleaned, found: Fit) -> Cleaned | None:
    """Without what only a fit shows that is not bent by faults any more, most of all in the held-out windows.

    Where something else bends it, even over the first seconds, it shows nothing more than the segments did.
    """
    mechanism, identify = found.likelihood.mechanism, cleaned.campaign.of_role(Role.IDENTIFY)
    geometry = found.plausible[BODY:]
    if short_fit(mechanism, identify, geometry).excess >= SHARED.near:
        return None
    again = fit(mechanism, identify, start=found.body, theta_sd=geometry)
    model = Completed((), again, whole=True)
    held = predict(model, cleaned.campaign.of_role(Role.VALIDATE))
    return without_breaks(cleaned, (*model.leftovers, *held.leftovers))


def _cut(cleaned: Cleaned, segments: Segments, contacts: Sequence[Contact], say: Say) -> Cleaned | None:
    """Without these contacts; a sensor that stumbles is a fault, and cut in the same way.

    Where the kinematics are contradicted, what is neither far above free motion nor shown to be a stumble stays in, and
    so does what goes with markers that are off each other: no hand bends the platform.
    """
    sure, windows = contacts, {one.window.id: one for one in segments.windows}
    if cleaned.screening.contradicts_kinematics:
        places = cleaned.campaign.robot.markers
        found = find_contacts(segments, strict=True)
        sure = [one for one in found if not deforms(windows[one.window].window, places, one)]
    faults: list[Finding] = []
    hands: list[Contact] = []
    cut: list[Contact] = []
    for contact in contacts:
        window = windows[contact.window].window
        fault = stumble(segments.fit, window, contact) or _gone(cleaned, windows[contact.window], contact)
        shown = fault is not None and fault.kind is not DefectKind.SPIKE
        if not (shown or any(one.window == contact.window and one.overlaps(contact) for one in sure)):
            continue
        say(contact.says if fault is None else fault.says)
        if fault is None:
            hands.append(replace(contact, window=whole_id(contact.window)))
        else:
            faults.append(fault)
        jumped = fault is not None and fault.kind is DefectKind.JUMP
        cut.append(replace(contact, end=float(window.t[-1])) if jumped else contact)
    if not cut:
        return None
    return replace(
        cleaned,
        campaign=without(cleaned.campaign, cut),
        faults=(*cleaned.faults, *faults),
        contacts=(*cleaned.contacts, *hands),
    )


def _gone(cleaned: Cleaned, one: Segmented, contact: Contact) -> Finding | None:
    """A marker that is elsewhere up to the window's end, where sensors are known to be faulty; None for a hand."""
    window, chi2 = one.window, one.chi2_per_dof
    later, sooner = one.edges[:-1] >= contact.begin, one.edges[1:] <= contact.end
    before, after = chi2[~later & sooner & np.isfinite(chi2)], chi2[later & np.isfinite(chi2)]
    lasting = (
        len(before) and len(after) and after.min() > CLEANING.contacts_far_above * max(1.0, float(np.median(before)))
    )
    end = float(window.t[-1])
    if not cleaned.faults or not (lasting or contact.end >= end):
        return None
    says = (
        f"Window {window.id}: from {contact.begin:.2f} s to its end the markers are not where cables and motion put "
        f"them (χ²/dof {contact.ratio:.3g} times that before); it is left out."
    )
    return Finding(DefectKind.JUMP, window.id, marker_channel(0, 0), (contact.begin, end), contact.ratio, "times", says)


def _without_encoders(cleaned: Cleaned, found: Fit, held: HeldOut, say: Say) -> Cleaned | None:
    """A window much worse than the others, made good by leaving one encoder unread."""
    odd = _odd(found, held)
    identify = cleaned.campaign.of_role(Role.IDENTIFY)
    rest = [window for window in identify if window.id not in odd]
    if not odd or len(odd) > max(1.0, SHARED.few * len(identify)) or not rest:
        return None
    again = fit(found.likelihood.mechanism, rest, start=found.body, theta_sd=found.plausible[BODY:])
    if not whiteness(of_fit(again)).is_white:
        return None
    windows, faults = list(cleaned.campaign.windows), list(cleaned.faults)
    for k, window in enumerate(windows):
        slip = slipped_encoder(again, window, again.excess) if window.id in odd else None
        if slip is not None and window.lengths is not None:
            lengths = window.lengths.copy()
            lengths[:, int(slip.channel[1:]) - 1] = np.nan
            windows[k] = replace(window, lengths=lengths)
            faults.append(slip)
            say(slip.says)
    if len(faults) == len(cleaned.faults):
        return None
    return replace(cleaned, campaign=replace(cleaned.campaign, windows=tuple(windows)), faults=tuple(faults))


def _odd(found: Fit, held: HeldOut) -> set[str]:
    fitted = zip(found.likelihood.recordings, found.remainders, strict=True)
    chi2 = {recording.window.id: left.chi2_per_dof for recording, left in fitted} | held.of_window
    usual = float(np.median(list(chi2.values())))
    return {window for window, one in chi2.items() if one > SHARED.usual * usual} if usual < SHARED.noise else set()
