"""Windows whose start or end a hand touched (late release, early catch), so that free motion cannot follow it.

Whatever else a model lacks, it lacks in the middle of a window too; so an end that is missed by far more than the rest
of its window is no free motion. Held-out windows are never cut: that would flatter the model.

Where a hand was found before (`cleaning.free_motion`), it may have begun gently: beside such a cut, an end counts as
touched as soon as it is missed by more than chance, if without it all that is left is noise. So it does where all
windows together look like noise already: a touch of a tenth of a second is lost among them, and not in the body.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.data.records import Window
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.judge import SURPRISE, Remainder

PART = 1 / 6
"""of a window, at its start and at its end, that is compared with the rest"""
FAR_MORE = 2.0
"""times the rms of the rest: 3 and 4.6 where a hand brakes the end, 1.4 where drag or friction is missing"""
LEFT_OUT = ": they were left out."
IN_VAIN = "; without them, too, something is left."


@dataclass(frozen=True)
class TouchedEnd:
    """An end of a window that is taken for touched."""

    window: str
    early: bool
    """its start; else its end"""
    seconds: float
    gently: bool = False
    """beside what was cut before; else missed by far more than the rest"""

    @property
    def says(self) -> str:
        """A sentence without its end (`LEFT_OUT`)."""
        kept, why = "", "twice as much as the rest of it, as if a hand still touched"
        if self.gently:
            kept, why = " that were kept", "noise, apart from a hand"
        part = f"The {'first' if self.early else 'last'} {self.seconds:.2f} s{kept} of window {self.window}"
        return f"{part} are missed by more than {why}"


def together(cuts: Sequence[TouchedEnd]) -> tuple[TouchedEnd, ...]:
    """What was cut in several rounds, once for each end and reason."""
    sums: dict[TouchedEnd, float] = {}
    for cut in cuts:
        end = replace(cut, seconds=0.0)
        sums[end] = sums.get(end, 0.0) + cut.seconds
    return tuple(replace(end, seconds=seconds) for end, seconds in sums.items())


def left_by_window(found: Fit) -> dict[str, Remainder]:
    """The residual of each window that a fit used, by id."""
    return {one.window.id: rest for one, rest in zip(found.likelihood.recordings, found.remainders, strict=True)}


def untouched(
    windows: Sequence[Window], left: Mapping[str, Remainder], noise: float
) -> tuple[list[Window], list[TouchedEnd]]:
    """The windows without touched ends, and what was cut.

    left: `left_by_window`; windows without are kept. noise: m; ends missed by less than twice that are kept.
    """
    kept: list[Window] = []
    cuts: list[TouchedEnd] = []
    for window in windows:
        remainder = left.get(window.id)
        if remainder is None:
            kept.append(window)
            continue
        begin, end = float(window.t[0]), float(window.t[-1])
        span = PART * (end - begin)
        if _stands_out(remainder, early=True, noise=noise):
            begin += span
            cuts.append(TouchedEnd(window.id, early=True, seconds=span))
        if _stands_out(remainder, early=False, noise=noise):
            end -= span
            cuts.append(TouchedEnd(window.id, early=False, seconds=span))
        kept.append(_between(window, begin, end))
    return kept, cuts


def beside_cuts(windows: Sequence[Window], found: Fit) -> tuple[list[Window], list[TouchedEnd]]:
    """The windows, shortened further where samples beside a cut are missed by more than chance; and what was cut."""
    left = left_by_window(found)
    kept: list[Window] = []
    cuts: list[TouchedEnd] = []
    for window in windows:
        shorter, of_window = _shorter(window, left[window.id]) if window.id in left else (window, [])
        kept.append(shorter)
        cuts += of_window
    return kept, cuts


def _shorter(window: Window, left: Remainder) -> tuple[Window, list[TouchedEnd]]:
    seen = np.flatnonzero(np.isfinite(window.markers).any(axis=(1, 2)))
    begin, end = float(window.t[seen[0]]), float(window.t[seen[-1]])
    span = PART * (end - begin)
    use = np.ones(len(window.t), dtype=bool)
    cuts: list[TouchedEnd] = []
    if seen[0] > 0 and _beyond_chance(left, early=True):
        use &= window.t >= begin + span
        cuts.append(TouchedEnd(window.id, early=True, seconds=span, gently=True))
    if seen[-1] < len(window.t) - 1 and _beyond_chance(left, early=False):
        use &= window.t <= end - span
        cuts.append(TouchedEnd(window.id, early=False, seconds=span, gently=True))
    return replace(window, markers=np.where(use[:, None, None], window.markers, np.nan)) if cuts else window, cuts


def _beyond_chance(left: Remainder, *, early: bool) -> bool:
    part = _end(left, early=early)
    there, rest = (values[np.isfinite(values)] for values in (left.residuals[part], left.residuals[~part]))
    if not there.size or not rest.size:
        return False
    chance = SURPRISE * np.sqrt(2 / there.size + 2 / rest.size)
    return float(np.mean(there**2)) > (1 + chance) * float(np.mean(rest**2))


def _stands_out(left: Remainder, *, early: bool, noise: float) -> bool:
    part = _end(left, early=early)
    there, rest = _rms(left.residuals[part]), _rms(left.residuals[~part])
    return there > FAR_MORE * max(rest, noise)


def _end(left: Remainder, *, early: bool) -> np.ndarray:
    t = left.t - left.t[0]
    return t < PART * t[-1] if early else t > (1 - PART) * t[-1]


def _rms(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else 0.0


def _between(window: Window, begin: float, end: float) -> Window:
    use = (window.t >= begin) & (window.t <= end)
    return window if use.all() else window.of_rows(use)
