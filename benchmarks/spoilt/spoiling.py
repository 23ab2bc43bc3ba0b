"""What every way of spoiling recordings is made of."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.data.records import Campaign, Window

Draw = np.random.Generator
Spoil = Callable[[Campaign, Draw], Campaign]


def same(campaign: Campaign, rng: Draw) -> Campaign:
    """Nothing."""
    return campaign


@dataclass(frozen=True)
class Kind:
    """One way; sizes are drawn by the generator that it is given."""

    name: str
    clean: Spoil = same
    """before marker noise"""
    noisy: Spoil = same
    """after it: what happens to the numbers that cameras gave"""
    words: tuple[str, ...] = ()
    """one of them stands in a refusal that names the true cause; none where nothing may be refused"""
    several: bool = False
    """needs four markers"""
    one: bool = False
    """needs one marker"""
    yaw: bool = False
    """of a bifilar pendulum that only yaws"""
    alone: bool = False
    """goes with no other kind"""


def each(change: Callable[[Window, Draw], Window], share: float = 1.0) -> Spoil:
    """In every window, or in a share of them, at least one."""

    def spoil(campaign: Campaign, rng: Draw) -> Campaign:
        chosen = rng.random(len(campaign.windows)) < share
        chosen[rng.integers(len(chosen))] = True
        windows = [change(w, rng) if use else w for w, use in zip(campaign.windows, chosen, strict=True)]
        return replace(campaign, windows=tuple(windows))

    return spoil


def rows(window: Window, markers: np.ndarray) -> Window:
    """The window with other markers, its clock going on; lengths are held."""
    n = len(markers)
    step = float(np.median(np.diff(window.t)))
    lengths = None if window.lengths is None else window.lengths[np.arange(n) % len(window.lengths)]
    t = window.t[0] + step * np.arange(n)
    return replace(window, t=t, markers=markers, lengths=lengths, currents=None, further={})
