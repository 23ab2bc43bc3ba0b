"""Touched ends: a hand that lets go late or brakes early leaves a start or an end that free motion cannot follow.

Whatever else a model lacks, it lacks in the middle of a window too; so an end that is missed by far more than the rest
of its window is no free motion. Held-out windows are never cut: that would flatter the model.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fidim_lab.data.records import Window
from fidim_lab.identification.mle.judge import Remainder

PART = 1 / 6
"""of a window, at its start and at its end, that is compared with the rest"""
FAR_MORE = 2.0
"""times the rms of the rest"""


def untouched(windows: Sequence[Window], left: Sequence[Remainder], noise: float) -> tuple[list[Window], list[str]]:
    """The windows without touched ends, and a sentence for each end that was cut.

    left: what a fit left of each window, in their order. noise: m; ends missed by less than twice that are kept.
    """
    kept: list[Window] = []
    said: list[str] = []
    for window, remainder in zip(windows, left, strict=True):
        begin, end = float(window.t[0]), float(window.t[-1])
        span = PART * (end - begin)
        if _stands_out(remainder, early=True, noise=noise):
            begin += span
            said.append(f"The first {span:.2f} s of window {window.id} {_WHY}")
        if _stands_out(remainder, early=False, noise=noise):
            end -= span
            said.append(f"The last {span:.2f} s of window {window.id} {_WHY}")
        kept.append(_between(window, begin, end))
    return kept, said


_WHY = "are missed by more than twice as much as the rest of it, as if a hand still touched: they were left out."


def _stands_out(left: Remainder, *, early: bool, noise: float) -> bool:
    t = left.t - left.t[0]
    part = t < PART * t[-1] if early else t > (1 - PART) * t[-1]
    there, rest = _rms(left.residuals[part]), _rms(left.residuals[~part])
    return there > FAR_MORE * max(rest, noise)


def _rms(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else 0.0


def _between(window: Window, begin: float, end: float) -> Window:
    use = (window.t >= begin) & (window.t <= end)
    if use.all():
        return window
    return replace(
        window,
        t=window.t[use],
        markers=window.markers[use],
        lengths=None if window.lengths is None else window.lengths[use],
        currents=None if window.currents is None else window.currents[use],
        further={name: column[use] for name, column in window.further.items()},
    )
