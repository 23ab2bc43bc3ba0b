"""An operator's hand within a window: found, timed, and cut out before any physics is named.

A hand acts in some windows and for some time only. Its segments (`segments`) stand far above both neighbours, which
are as good as the rest; physics that is missing changes smoothly from one segment to the next. What decays from every
release (a friction that ends the motion, a loose part) is told by its coming first in most windows alike; and what
grows steeply with the motion (a drag of the cube of the speed, 64 times χ² for twice the swing), by its standing no
farther out than segments of other windows that swing as far. When it comes and goes is told by `hand_times`.

Whoever pushes at the same time of every window is found by all of them together, however softly: before and after it
they are noise, as no physics leaves them that is at work there.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.stats import theilslopes

from fidim_lab.arrays import runs
from fidim_lab.data.records import Campaign, Window
from fidim_lab.identification.cleaning.free_motion import parts
from fidim_lab.identification.markers.thresholds import MARKERS
from fidim_lab.identification.motion.rigid import distances_off
from fidim_lab.mismatch.cleaning.hand_times import hand_times
from fidim_lab.mismatch.cleaning.segments import Segmented, Segments
from fidim_lab.mismatch.cleaning.thresholds import CLEANING
from fidim_lab.mismatch.thresholds import SHARED


@dataclass(frozen=True)
class Contact:
    """One contact."""

    window: str
    begin: float
    """s on the window's own clock"""
    end: float
    ratio: float
    """χ²/dof there over that of the free parts"""
    sd: float
    """of begin and end, s"""
    gain: float | None = None
    """χ² that a new start after the contact takes off, where that is how it was found (`restarts`)"""

    def overlaps(self, other: "Contact") -> bool:
        """Whether both have a time in common."""
        return self.begin <= other.end and other.begin <= self.end

    @property
    def says(self) -> str:
        """For people."""
        shown = (
            f"χ²/dof {self.ratio:.3g} times that before and after"
            if self.gain is None
            else f"afterwards the platform moves as from a new start, which lowers χ² by {self.gain:.0f}"
        )
        return (
            f"Window {self.window}: from {self.begin:.2f} to {self.end:.2f} s the motion is not free, as if a hand "
            f"touched the platform ({shown}); this time is not used."
        )


def find_contacts(segments: Segments, *, strict: bool = False) -> tuple[Contact, ...]:
    """Every contact, in the order of windows and times.

    strict: where the kinematics are contradicted already (wrong geometry, soft cables) segments differ more, and some
    poses lie on the wrong side of a fold; then only what stands far above free motion on both sides counts.
    """
    above = CLEANING.contacts_far_above if strict else CLEANING.contacts_above
    foreseen = _foreseen(segments)
    runs = [
        (one, run)
        for one, usual in zip(segments.windows, foreseen, strict=True)
        for run in _runs(one, above)
        if np.nanmax((one.chi2_per_dof / usual)[slice(*run)]) > 1
    ]
    if strict:
        runs = [(one, run) for one, run in runs if run[0] > 0 and run[1] < len(one.chi2_per_dof)]
    else:
        runs += _lasting(segments, {one.window.id for one, _ in runs})
    begins = [float(one.chi2_per_dof[0]) / one.level for one in segments.windows]
    if np.nanmean(np.array(begins) > SHARED.usual) > SHARED.few:
        runs = [(one, run) for one, run in runs if run[0] > 0]
    common = {contact.window: contact for contact in at_the_same_time(segments.windows)}
    found = [_timed(segments, one, first, end) for one, (first, end) in runs]
    common = _sharper(common, found)
    found = [one for one in found if one.window not in common or not one.overlaps(common[one.window])]
    found += common.values()
    order = {one.window.id: k for k, one in enumerate(segments.windows)}
    return tuple(sorted(found, key=lambda contact: (order[contact.window], contact.begin)))


def without(campaign: Campaign, contacts: Sequence[Contact]) -> Campaign:
    """The campaign with the contacts cut out: what is free before and after each becomes a window of its own.

    All keep their window's clock and lengths. The first part keeps its id, the others are called "i03, part 2".
    """
    windows: list[Window] = []
    for window in campaign.windows:
        ours = [contact for contact in contacts if contact.window == window.id]
        cuts = [(contact.begin, contact.end) for contact in ours]
        windows.extend(parts(window, cuts, CLEANING.free) if ours else [window])
    return replace(campaign, windows=tuple(windows))


def deforms(window: Window, places: Float[np.ndarray, "M 3"], contact: Contact) -> bool:
    """Whether marker distances are off the robot file's during a contact by more than before and after it.

    places: of the markers on the platform (m). No hand does that: a marker that is seen then alone, and elsewhere.
    """
    off = distances_off(window.markers, places) ** 2
    during = (window.t >= contact.begin) & (window.t <= contact.end)
    inside, outside = off[during], off[~during]
    if not (np.isfinite(inside).any() and np.isfinite(outside).any()):
        return False
    return bool(np.nanmean(inside) > CLEANING.contacts_above * np.nanmean(outside))


def _runs(one: Segmented, above: float) -> list[tuple[int, int]]:
    """Runs of segments (first, end) that stand above their neighbours; one without samples counts as usual."""
    level = one.level
    chi2 = np.nan_to_num(one.chi2_per_dof, nan=level)
    if not np.isfinite(level) or len(chi2) < 3:
        return []
    spread = CLEANING.contacts_certain * np.sqrt(2 / np.nan_to_num(one.dof, nan=1.0))
    high = (chi2 > max(1.0, level) * (1 + spread)) & (chi2 > above * level)
    if high.mean() > CLEANING.contacts_most:
        return []
    return [run for run in runs(high) if _stands_out(chi2, *run, above)]


def _lasting(segments: Segments, seen: set[str]) -> list[tuple[Segmented, tuple[int, int]]]:
    """Of windows without a run, those whose motion is as usual up to a segment and never again: (window, run)."""
    usual = float(np.nanmedian([one.level for one in segments.windows]))
    found: list[tuple[Segmented, tuple[int, int]]] = []
    for one in segments.windows:
        known = np.flatnonzero(np.isfinite(one.chi2_per_dof))
        high = one.chi2_per_dof[known] > CLEANING.contacts_at_an_end * max(1.0, usual)
        first = int(np.argmax(high)) if high.any() else 0
        free = one.chi2_per_dof[known[:first]]
        if (
            one.window.id not in seen
            and first
            and high[first:].all()
            and (free < CLEANING.contacts_above * max(1.0, usual)).all()
        ):
            found.append((one, (int(known[first]), len(one.chi2_per_dof))))
    return found if len(found) <= max(1.0, SHARED.few * len(segments.windows)) else []


def at_the_same_time(windows: Sequence[Segmented]) -> tuple[Contact, ...]:
    """One contact in every window, where the median over all of them is noise before and after one time, not then."""
    alike = max(([one for one in windows if _cut_alike(one, other)] for other in windows), key=len)
    if len(alike) < max(CLEANING.contacts_pooled, len(windows) / 2) or len(alike[0].dof) < 3:
        return ()
    chi2, dof = np.array([one.chi2_per_dof for one in alike]), np.array([one.dof for one in alike])
    if np.isnan(chi2).all(axis=0).any():
        return ()
    pooled, of_all = np.nanmedian(chi2, axis=0), np.nansum(dof, axis=0)
    level = max(1.0, float(np.quantile(pooled, 0.4)))
    beyond = (pooled / level - 1) / (np.sqrt(np.pi / 2) * np.sqrt(2 / of_all))
    high = beyond > SHARED.certain
    first, end = int(np.argmax(high)), len(high) - int(np.argmax(high[::-1]))
    if not beyond.max() > CLEANING.contacts_certain or first == 0 or end == len(high) or not high[first:end].all():
        return ()
    ratio = float(pooled[first:end].max() / level)
    if ratio < level:
        return ()  # more is left at all other times: physics that is a little more at work here
    return tuple(
        Contact(
            one.window.id,
            round(float(one.edges[first]), 2),
            round(float(one.edges[end]), 2),
            ratio,
            CLEANING.timed,
        )
        for one in alike
    )


def _cut_alike(one: Segmented, other: Segmented) -> bool:
    """Whether the segments of both begin and end at the same times since their first."""
    if len(one.edges) != len(other.edges):
        return False
    return bool(np.abs(one.edges - one.edges[0] - (other.edges - other.edges[0])).max() < SHARED.at_once)


def _sharper(common: dict[str, Contact], timed: Sequence[Contact]) -> dict[str, Contact]:
    """The push of all windows at the time that most of them show by themselves, where it is strong enough for that.

    A weaker one shows only while it has moved the platform far, later than it begins.
    """
    wide = [(one, common[one.window]) for one in timed if one.window in common]
    within = [
        (one, all_of)
        for one, all_of in wide
        if all_of.begin - CLEANING.timed <= one.begin and one.end <= all_of.end + CLEANING.timed
    ]
    if len(within) <= len(common) / 2 or np.median([one.ratio for one, _ in within]) < CLEANING.contacts_far_above:
        return common
    later = round(float(np.median([one.begin - all_of.begin for one, all_of in within])), 2)
    sooner = round(float(np.median([all_of.end - one.end for one, all_of in within])), 2)
    return {id: replace(one, begin=one.begin + later, end=one.end - sooner) for id, one in common.items()}


def _foreseen(segments: Segments) -> list[np.ndarray]:
    """χ²/dof up to which each segment is as those that swing as far, by a robust power law over all windows."""
    excess = [
        np.log(np.maximum(one.chi2_per_dof - 1, CLEANING.contacts_certain * np.sqrt(2 / one.dof)))
        for one in segments.windows
    ]
    lively = [np.log(one.liveliness) for one in segments.windows]
    x, y = np.concatenate(lively), np.concatenate(excess)
    known = np.isfinite(x) & np.isfinite(y)
    if known.sum() < 3 or np.ptp(x[known]) < 1e-9:
        return [np.ones(len(one)) for one in lively]
    law = theilslopes(y[known], x[known])
    power = float(max(law.slope, 0.0))
    level = float(np.median(y[known] - power * x[known]))
    scatter = float(np.median(np.abs(y[known] - power * x[known] - level))) / MARKERS.neighbours_mad
    return [1 + np.exp(level + power * one + CLEANING.contacts_foreseen * scatter) for one in lively]


def _stands_out(chi2: np.ndarray, first: int, end: int, above: float) -> bool:
    """Whether every segment of the run is far above both its neighbours."""
    beside = [chi2[k] for k in (first - 1, end) if 0 <= k < len(chi2)]
    factor = above if len(beside) == 2 else CLEANING.contacts_at_an_end
    return bool(chi2[first:end].max() > factor * max(beside) and chi2[first:end].min() > above * min(beside))


def _timed(segments: Segments, one: Segmented, first: int, end: int) -> Contact:
    chi2 = one.chi2_per_dof
    ratio = float(np.nanmax(chi2[first:end]) / np.nanmedian(np.delete(chi2, slice(first, end))))
    begin, finish = hand_times(segments, one, first, end, ratio)
    return Contact(one.window.id, round(begin, 2), round(finish, 2), ratio, CLEANING.timed)
