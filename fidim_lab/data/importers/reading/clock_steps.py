"""A clock that was set while samples continued evenly: stamps that step by a part of a sample's time, and stay so.

A computer that is told the time (NTP) sets its clock forwards or back. Over the whole take the rate of the stamps is
then wrong, and with it every force: by 4 ms in 11 s an inertia was wrong by 50 stated standard deviations.
"""

import numpy as np

from fidim_lab.arrays import Series

MOST = 3
"""times that a clock is set within one take; it is told once in 64 s at the most"""
MAIN = 0.5
"""of what stamps are off even steps (their squares), that one step of the clock explains: it is the main cause then"""


def without_steps(t: Series, slots: Series, least: float) -> tuple[Series, tuple[str, ...]]:
    """Stamps (s) as if the clock had never been set by a part of a step, and where it was, a sentence each.

    slots: (N,) whole steps since the first stamp. least: s, below which a step of the clock is none.
    """
    rows: list[int] = []
    even = t
    for _ in range(MOST):
        at, by = _step(even, slots)
        if abs(by) < least or at in rows:
            break
        rows.append(at)
        later = np.arange(len(t))[:, np.newaxis] >= rows
        line = np.column_stack([np.ones(len(t)), slots, later])
        even = t - later @ np.linalg.lstsq(line, t, rcond=None)[0][2:]
    usual = float(np.median(np.diff(t)))
    return even, tuple(
        f"stamps step by {1e3 * (t[at] - t[at - 1] - usual):+.3g} ms at {t[at] - t[0]:.2f} s and stay so, which is not "
        "a whole number of samples: a clock was set there, and the samples are taken as even"
        for at in sorted(rows)
    )


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
    return at, float(shared[at] / own[at])
