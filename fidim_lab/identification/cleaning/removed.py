"""What cleaning leaves out of a campaign, and the campaign without it."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool

from fidim_lab.arrays import Series, runs
from fidim_lab.data.files.mistakes import STRICT
from fidim_lab.data.records import Campaign, Window


@dataclass(frozen=True)
class Removed:
    """A stretch of one window that is not used."""

    __pydantic_config__ = STRICT  # pyright: ignore[reportUnannotatedClassAttribute]

    window: str
    """its id"""
    t: tuple[float, float]
    """s on the window's own clock, first and last sample"""
    why: str
    """a few words, the same for all of one kind: "held or pushed", "straight line" """
    samples: int
    """marker samples that were taken out"""


@dataclass(frozen=True, eq=False)
class CleanRecordings:
    """A campaign that may be fitted, and why it is not the recorded one."""

    campaign: Campaign
    removed: tuple[Removed, ...] = ()
    notes: tuple[str, ...] = ()
    """sentences for people"""

    def then(self, further: "CleanRecordings") -> "CleanRecordings":
        """What a later step left, told after what the steps before it did."""
        return replace(further, removed=(*self.removed, *further.removed), notes=(*self.notes, *further.notes))


def without_samples(window: Window, bad: Bool[np.ndarray, "N M"], why: str) -> tuple[Window, tuple[Removed, ...]]:
    """The window with these marker samples missing, and each stretch of them; the window itself where none is bad."""
    if not bad.any():
        return window, ()
    markers = np.where(bad[..., np.newaxis], np.nan, window.markers)
    return replace(window, markers=markers), stretches(window.id, window.t, bad, why)


def without_each(
    campaign: Campaign, bad: Callable[[Window], Bool[np.ndarray, "N M"]], why: str, says: str
) -> CleanRecordings:
    """The campaign with the marker samples missing that are `bad` in their window; `says` as `counted` has it."""
    cleaned = [without_samples(window, bad(window), why) for window in campaign.windows]
    removed = tuple(one for _, out in cleaned for one in out)
    if not removed:
        return CleanRecordings(campaign)
    windows = tuple(window for window, _ in cleaned)
    return CleanRecordings(replace(campaign, windows=windows), removed, counted(removed, says))


def stretches(window: str, t: Series, bad: Bool[np.ndarray, "N M"], why: str) -> tuple[Removed, ...]:
    """Each run of rows in which a marker is taken out."""
    return tuple(
        Removed(window, (float(t[begin]), float(t[end - 1])), why, int(bad[begin:end].sum()))
        for begin, end in runs(np.asarray(bad.any(axis=1)))
    )


def counted(removed: tuple[Removed, ...], what: str) -> tuple[str, ...]:
    """One sentence about everything of one kind that was removed; empty where nothing was."""
    if not removed:
        return ()
    longest = max(removed, key=lambda one: one.t[1] - one.t[0])
    windows = list(dict.fromkeys(one.window for one in removed))
    where = f"window {windows[0]}" if len(windows) == 1 else f"{len(windows)} windows ({', '.join(windows)})"
    total = sum(one.samples for one in removed)
    return (
        f"{total} marker samples in {where} {what}: they count as missing. The longest stretch is "
        f"{longest.t[0]:.2f} to {longest.t[1]:.2f} s of window {longest.window}.",
    )
