"""A clock that was set while samples continued evenly: stamps that step by a part of a sample's time, and stay so.

A computer that is told the time (NTP) sets its clock forwards or back. Over the whole take the rate of the stamps is
then wrong, and with it every force: by 4 ms in 11 s an inertia was wrong by 50 stated standard deviations.
"""

from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.arrays import Series

MOST = 3
"""times that a clock is set within one take; it is told once in 64 s at the most"""
PART = 0.05
"""of a step, by which a clock is set at least: 0.5 ms at 100 Hz change the rate of a take of 10 s by 1e-4 at most"""
MAIN = 0.5
"""of what stamps are off even steps (their squares), that one step of the clock explains: then it is the main cause. Of
300 takes whose stamps jitter by 5 % of a step none is told; 1 ms in stamps of whole ms explains three quarters"""
NEAR = 10
"""samples on either side, between which a clock that is set has stepped: one that is sped up for seconds has hardly"""


@dataclass(frozen=True)
class SetClock:
    """Where a clock was set."""

    says: tuple[str, ...] = ()
    """a sentence each"""
    breaks: tuple[float, ...] = ()
    """s since the first stamp, half a step before a sample from which on it may be off by whole samples, too"""

    def saying(self, sentence: str) -> "SetClock":
        """With one sentence more."""
        return replace(self, says=(*self.says, sentence))


def without_steps(t: Series, slots: Series) -> tuple[Series, SetClock]:
    """Stamps (s) as if the clock had never been set by a part of a step, and where it was.

    slots: (N,) whole steps since the first stamp.
    """
    rows: list[int] = []
    steps = np.zeros(0)
    even, usual = t, float(np.median(np.diff(t)))
    for _ in range(MOST):
        at, by = _step(even, slots)
        if abs(by) < PART * usual or at in rows:
            break
        rows.append(at)
        later = np.arange(len(t))[:, np.newaxis] >= rows
        line = np.column_stack([np.ones(len(t)), slots, later])
        steps = np.linalg.lstsq(line, t, rcond=None)[0][2:]
        even = t - later @ steps
    gaps = [usual * float(slots[at] - slots[at - 1] - 1.0) for at in rows]  # which count as samples that are missing
    said = tuple(
        f"stamps step by {1e3 * (gap + by):+.3g} ms at {t[at] - t[0]:.2f} s and stay so, which is not "
        "a whole number of samples: a clock was set there, and the samples are taken as even"
        for at, by, gap in sorted(zip(rows, steps.tolist(), gaps, strict=True))
    )
    unsure = tuple(float(even[at] - even[0] - 0.5 * usual) for at in sorted(rows) if slots[at] - slots[at - 1] > 1.0)
    return even, SetClock(said, unsure)


def _step(t: Series, slots: Series) -> tuple[int, float]:
    """The row from which on stamps are off by a constant, and that constant (s); 0 where none stands out."""
    k = slots - slots.mean()
    off = t - t.mean() - k * float(k @ t) / float(k @ k)
    later = np.arange(len(t), 0, -1)
    along = np.cumsum(k[::-1])[::-1]
    own = later - later**2 / len(t) - along**2 / float(k @ k)  # of a step, what no line takes up
    shared = np.cumsum(off[::-1])[::-1]
    inside = np.flatnonzero(own > 1.0)
    if not len(inside):
        return 0, 0.0
    gain = shared[inside] ** 2 / own[inside]
    at = int(inside[np.argmax(gain)])
    if gain.max() < MAIN * float(off @ off) or not off.any():
        return 0, 0.0
    by = float(shared[at] / own[at])
    within = float(off[at : at + NEAR].mean() - off[max(0, at - NEAR) : at].mean())
    return (at, by) if within / by > MAIN else (0, 0.0)
