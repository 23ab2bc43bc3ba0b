"""Faults of one window that only a fit shows: lost frames in slow motion, an encoder that slipped before it began.

Each is demonstrated, not guessed: with the frames put back, or without that encoder, the window must be as good as
the others. What cannot be made good so is not a fault of this kind.
"""

from dataclasses import replace

import numpy as np

from fidim_lab.arrays import mean_of_seen, motion_rms
from fidim_lab.data.records import Window
from fidim_lab.identification.markers.finding import DefectKind, Finding, marker_channel, marker_name
from fidim_lab.identification.markers.thresholds import MARKERS
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.mismatch.cleaning.contacts import Contact
from fidim_lab.mismatch.cleaning.thresholds import CLEANING
from fidim_lab.mismatch.fitting.held_body import followed, left_of
from fidim_lab.mismatch.thresholds import SHARED


def stumble(found: Fit, window: Window, contact: Contact) -> Finding | None:
    """The sensor's fault that looks like a contact: frames lost, or a marker displaced from there on; None if neither.

    The motion before is carried on over the contact. After a hand it is another motion; after lost frames it is the
    same some frames later, after a jump the same elsewhere.
    """
    if contact.end - contact.begin < CLEANING.odd_windows_instant and (
        contact.begin <= window.t[0] or contact.end >= window.t[-1]
    ):
        t = (contact.begin, contact.end)
        says = f"Window {window.id}: samples between {t[0]:.2f} and {t[1]:.2f} s, at its edge, are off the motion."
        return Finding(DefectKind.SPIKE, window.id, marker_channel(0, 0), t, 0.0, "m", says)
    step = float(np.median(np.diff(window.t)))
    near = (window.t > contact.begin - CLEANING.segment) & (window.t < contact.end + CLEANING.segment)
    rows = np.flatnonzero(near)
    before = window.t[rows] < contact.begin
    if before.sum() < 20 or (window.t[rows] > contact.end).sum() < 20:
        return None
    predicted = _carried_on(found, window, rows, before, step)
    if predicted is None:
        return None
    # what stands in the file at row k may have been seen up to MARKERS.most_lost frames later
    later = np.flatnonzero(window.t[rows] > contact.end)
    seen, noise = window.markers[rows[later]], found.likelihood.noise
    off = np.stack([seen - predicted[later + k] for k in range(MARKERS.most_lost + 1)]) / noise
    chi2 = np.nanmean(off**2, axis=(1, 2, 3))
    still = motion_rms(off[0]) ** 2
    t, best = (contact.begin, contact.end), int(np.argmin(chi2))
    if (
        best
        and chi2[best] < CLEANING.odd_windows_carried
        and CLEANING.odd_windows_better * chi2[best] < chi2[0]
        and chi2[best] < still
    ):
        says = (
            f"Window {window.id}: {best} frames ({best * step * 1e3:.0f} ms) are lost between {t[0]:.2f} and "
            f"{t[1]:.2f} s, though the time stamps are continuous: with these frames inserted the motion is free."
        )
        return Finding(DefectKind.SKIP, window.id, "t", t, float(best), "samples", says)
    if still < CLEANING.odd_windows_carried and CLEANING.odd_windows_better * still < chi2[0]:
        by = noise * np.nan_to_num(mean_of_seen(off[0]))
        marker = int(np.argmax(np.linalg.norm(by, axis=1)))
        axis, size = int(np.argmax(np.abs(by[marker]))), float(np.linalg.norm(by[marker]))
        says = (
            f"Window {window.id}: between {t[0]:.2f} and {t[1]:.2f} s {marker_name(marker)} jumps by {size * 1e3:.3g} "
            f"mm (mostly {'xyz'[axis]}) and stays there; the motion continues unchanged."
        )
        return Finding(DefectKind.JUMP, window.id, marker_channel(marker, axis), t, size, "m", says)
    return None


def _carried_on(found: Fit, window: Window, rows: np.ndarray, before: np.ndarray, step: float) -> np.ndarray | None:
    """Markers (rows + MARKERS.most_lost, M, 3) predicted from what is `before`, and some frames beyond the last row."""
    beyond = window.t[rows[-1]] + step * np.arange(1, MARKERS.most_lost + 1)
    markers = window.markers[rows].copy()
    # only times are needed of what is not fitted: any place will do there
    markers[~before] = mean_of_seen(markers[before])
    filled = np.concatenate([markers, np.repeat(markers[-1:], MARKERS.most_lost, axis=0)])
    filled = np.where(np.isfinite(filled), filled, mean_of_seen(markers))
    t = np.concatenate([window.t[rows], beyond])
    lengths = None if window.lengths is None else np.tile(np.nanmean(window.lengths, axis=0), (len(t), 1))
    ours = replace(window, t=t, markers=filled, lengths=lengths, currents=None, further={})
    left = followed(found, ours, float(window.t[rows][before][-1] - t[0]))
    return None if left is None or len(left[0].t) != len(t) else left[0].predicted


def slipped_encoder(found: Fit, window: Window, level: float) -> Finding | None:
    """The encoder without which the window is as good as the others, and by how much it is off; None where none is."""
    if window.lengths is None:
        return None
    count = window.lengths.shape[1]
    tried: list[Window] = []
    for cable in range(count):
        lengths = window.lengths.copy()
        lengths[:, cable] = np.nan
        tried.append(replace(window, lengths=lengths))
    left = left_of(found, tried)
    if left is None:
        return None
    chi2 = np.array([one.chi2_per_dof for one in left])
    best = int(np.argmin(chi2))
    others = np.delete(chi2, best)
    if chi2[best] > SHARED.usual * max(1.0, level) or others.min() < SHARED.usual * chi2[best]:
        return None
    t = (float(window.t[0]), float(window.t[-1]))
    says = (
        f"Window {window.id}: the encoder of cable {best + 1} does not read this cable's length, as after a slip "
        f"before the window: without it χ²/dof is {chi2[best]:.2f}."
    )
    return Finding(DefectKind.JUMP, window.id, f"l{best + 1}", t, float(others.min() / chi2[best]), "times", says)
