"""The second look, with a first fit at hand: samples off the motion, hands within windows, single windows.

Nothing is done where the fit leaves white noise. Otherwise

    samples    that are off a motion which their neighbours follow: spikes too small, or too many, for screening
    contacts   of a hand, by segments (`contacts`), cut out
    windows    one whose χ² is several times the median: left out, and looked at again. It is given up only if the rest
               is then white, and a fault that it may have (an encoder that slipped before it, lost frames) makes it
               white too; physics that only one window shows stays in, to be found
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from fidim_lab.data.records import Role, Window
from fidim_lab.identification.mle.fit import Fit, fit
from fidim_lab.identification.mle.judge import Remainder
from fidim_lab.mismatch.clean import Cleaned
from fidim_lab.mismatch.contacts import Contact, find_contacts, without
from fidim_lab.mismatch.finding import Finding, Kind, marker_channel, marker_name
from fidim_lab.mismatch.leftover import of_fit
from fidim_lab.mismatch.odd_windows import slipped_encoder, stumble
from fidim_lab.mismatch.segments import Segments, fit_segments
from fidim_lab.mismatch.whiteness import whiteness

Say = Callable[[str], None]

OFF = 6.0
"""standard deviations of the noise that a sample is off"""
QUIET = 2.5
"""rms of its neighbours' residuals, up to which they follow the motion"""
BESIDE = 4
"""samples on either side"""
MOST_OFF = 0.2
"""of a window's samples"""
ROUNDS = 2
"""of looking for contacts: a weak one shows only when stronger ones are gone"""
ODD = 4.0
"""times the median χ²/dof of the windows"""
MOST_ODD = 0.25
"""of the windows: more are not odd"""


def audit(cleaned: Cleaned, found: Fit, *, say: Say = lambda _: None) -> Cleaned:
    """Look again with the first fit of `cleaned.campaign`; the same object where nothing is changed.

    found: of the windows of role `identify`, without effects. Raises RefusedError where no segment can be used.
    """
    if whiteness(of_fit(found)).is_white:
        return cleaned
    after = _without_samples(cleaned, found)
    say("looking for hands and single bad windows")
    for _ in range(ROUNDS):
        segments = fit_segments(found.likelihood.mechanism, after.campaign.windows)
        further = _cut(after, segments, find_contacts(segments), say)
        if further is after:
            break
        after = further
    return _without_encoders(after, found, say)


def _cut(cleaned: Cleaned, segments: Segments, contacts: Sequence[Contact], say: Say) -> Cleaned:
    """Without these contacts; a sensor that stumbles is a fault, and cut in the same way.

    Where the kinematics are contradicted, what is neither far above free motion nor shown to be a stumble stays in.
    """
    strict = cleaned.screening.contradicts_kinematics
    sure = {(one.window, one.begin) for one in find_contacts(segments, strict=strict)}
    windows = {one.window.id: one.window for one in segments.windows}
    faults: list[Finding] = []
    hands: list[Contact] = []
    cut: list[Contact] = []
    for contact in contacts:
        window = windows[contact.window]
        fault = stumble(segments.fit, window, contact)
        shown = fault is not None and fault.kind is not Kind.SPIKE
        if not shown and (contact.window, contact.begin) not in sure:
            continue
        say(contact.says if fault is None else fault.says)
        if fault is None:
            hands.append(contact)
        else:
            faults.append(fault)
        jumped = fault is not None and fault.kind is Kind.JUMP
        cut.append(replace(contact, end=float(window.t[-1])) if jumped else contact)
    if not cut:
        return cleaned
    return replace(
        cleaned,
        campaign=without(cleaned.campaign, cut),
        faults=(*cleaned.faults, *faults),
        contacts=(*cleaned.contacts, *hands),
    )


def _without_samples(cleaned: Cleaned, found: Fit) -> Cleaned:
    """Samples off the fitted motion made missing, where their neighbours follow it."""
    off = {
        recording.window.id: _off(left, found.likelihood.noise)
        for recording, left in zip(found.likelihood.recordings, found.remainders, strict=True)
    }
    windows: list[Window] = []
    faults: list[Finding] = []
    for window in cleaned.campaign.windows:
        here = off.get(window.id, ())
        if not here:
            windows.append(window)
            continue
        markers = window.markers.copy()
        for time, marker, _ in here:
            markers[int(np.argmin(np.abs(window.t - time))), marker] = np.nan
        windows.append(replace(window, markers=markers))
        faults += [_spike(window, *one) for one in here]
    if not faults:
        return cleaned
    campaign = replace(cleaned.campaign, windows=tuple(windows))
    return replace(cleaned, campaign=campaign, faults=(*cleaned.faults, *faults))


def _off(left: Remainder, noise: float) -> tuple[tuple[float, int, float], ...]:
    """(time, marker, m): samples far off a motion that their neighbours follow; none where too many are."""
    size = np.abs(left.residuals).max(axis=2) / noise
    found: list[tuple[float, int, float]] = []
    for row, marker in np.argwhere(size > OFF):
        first, last = max(0, row - BESIDE), row + BESIDE + 1
        beside = np.delete(size[first:last, marker], row - first)
        if np.isfinite(beside).sum() >= BESIDE and np.nanmedian(beside) < QUIET:
            found.append((float(left.t[row]), int(marker), float(size[row, marker] * noise)))
    return tuple(found) if len(found) < MOST_OFF * len(size) else ()


def _spike(window: Window, time: float, marker: int, size: float) -> Finding:
    says = f"Window {window.id}: {marker_name(marker)} is {size * 1e3:.3g} mm off the motion at {time:.3f} s."
    return Finding(Kind.SPIKE, window.id, marker_channel(marker, 0), (time, time), size, "m", says)


def _without_encoders(cleaned: Cleaned, found: Fit, say: Say) -> Cleaned:
    """A window much worse than the others, made good by leaving one encoder unread."""
    odd = _odd(found)
    identify = cleaned.campaign.of_role(Role.IDENTIFY)
    rest = [window for window in identify if window.id not in odd]
    if not odd or len(odd) > MOST_ODD * len(identify) or not rest:
        return cleaned
    again = fit(found.likelihood.mechanism, rest, start=found.body)
    if not whiteness(of_fit(again)).is_white:
        return cleaned
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
        return cleaned
    return replace(cleaned, campaign=replace(cleaned.campaign, windows=tuple(windows)), faults=tuple(faults))


def _odd(found: Fit) -> set[str]:
    chi2 = np.array([left.chi2_per_dof for left in found.remainders])
    high = chi2 > ODD * np.median(chi2)
    return {recording.window.id for recording, is_odd in zip(found.likelihood.recordings, high, strict=True) if is_odd}
