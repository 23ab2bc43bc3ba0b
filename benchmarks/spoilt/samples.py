"""What software did to samples: blanks written as numbers, gaps filled, filters, markers exchanged."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.signal import butter, filtfilt, lfilter, lfilter_zi

from benchmarks.spoilt.spoiling import Draw, Spoil, rows
from fidim_lab.data.records import Campaign, Robot, Window


def zeros(window: Window, rng: Draw) -> Window:
    gone = rng.random(len(window.t)) < rng.uniform(0.002, 0.1)
    return replace(window, markers=np.where(gone[:, np.newaxis, np.newaxis], 0.0, window.markers))


def sentinel(window: Window, rng: Draw) -> Window:
    value = rng.choice([-1.0, 99.999, -9.999, 9999.0])
    gone = rng.random(window.markers.shape[:2]) < rng.uniform(0.002, 0.05)
    return replace(window, markers=np.where(gone[..., np.newaxis], value, window.markers))


def gaps(fill: str) -> Callable[[Window, Draw], Window]:
    def filled(window: Window, rng: Draw) -> Window:
        markers, seen = window.markers.copy(), np.ones(len(window.t), dtype=bool)
        for _ in range(rng.integers(1, 5)):
            length = round(rng.uniform(0.1, 1.0) / float(np.median(np.diff(window.t))))
            begin = int(rng.integers(3, len(markers) - length - 3))
            end = begin + length
            if not seen[begin - 2 : end + 2].all():
                continue
            seen[begin:end] = False
            if fill == "held":
                markers[begin:end] = markers[begin - 1]
            else:
                share = np.linspace(0, 1, length + 2)[1:-1, np.newaxis, np.newaxis]
                if fill == "cubic":
                    share = 3 * share**2 - 2 * share**3
                markers[begin:end] = markers[begin - 1] + share * (markers[end] - markers[begin - 1])
        return replace(window, markers=np.round(markers, 6))

    return filled


def upsampled(campaign: Campaign, rng: Draw) -> Campaign:
    every = int(rng.integers(2, 5))

    def between(window: Window) -> Window:
        known = np.arange(0, len(window.t), every)
        flat = window.markers.reshape(len(window.t), -1)
        columns = [np.interp(np.arange(known[-1] + 1), known, column[known]) for column in flat.T]
        return rows(window, np.round(np.stack(columns, axis=1), 6).reshape(-1, *window.markers.shape[1:]))

    return replace(campaign, windows=tuple(between(w) for w in campaign.windows))


def repeated(campaign: Campaign, rng: Draw) -> Campaign:
    """Frames that a stream lost, or that a slow camera has not: the one before stands there again."""
    every = int(rng.integers(2, 4)) if rng.random() < 0.5 else None
    share = rng.uniform(0.005, 0.1)

    def again(window: Window) -> Window:
        n = len(window.t)
        known = np.arange(n) % every == 0 if every else rng.random(n) > share
        known[0] = True
        last = np.maximum.accumulate(np.where(known, np.arange(n), 0))
        return replace(window, markers=window.markers[last])

    return replace(campaign, windows=tuple(again(w) for w in campaign.windows))


def filtered(*, causal: bool) -> Spoil:
    def spoil(campaign: Campaign, rng: Draw) -> Campaign:
        b, a = butter(int(rng.choice([2, 4])), rng.uniform(4.0, 15.0), fs=campaign.sample_rate)
        start = lfilter_zi(b, a)[:, np.newaxis]

        def through(window: Window) -> Window:
            flat = window.markers.reshape(len(window.t), -1)
            blank, at = np.isnan(flat), np.arange(len(flat))
            # Over a blank a filter would give blanks to the end: gaps are bridged for it, and are gaps again.
            bridged = [np.interp(at, at[~gone], column[~gone]) for column, gone in zip(flat.T, blank.T, strict=True)]
            flat = np.stack(bridged, axis=1)
            out = lfilter(b, a, flat, axis=0, zi=start * flat[0])[0] if causal else filtfilt(b, a, flat, axis=0)
            out[blank] = np.nan
            return replace(window, markers=np.round(out, 6).reshape(window.markers.shape))

        return replace(campaign, windows=tuple(through(w) for w in campaign.windows))

    return spoil


def knocked(campaign: Campaign, rng: Draw) -> Campaign:
    """One marker from some time of some window on, to the end of the session."""
    marker = int(rng.integers(campaign.robot.markers.shape[0]))
    since, at = int(rng.integers(1, len(campaign.windows))), rng.uniform(0.1, 0.9)
    by = rng.normal(size=3)
    by *= rng.uniform(0.004, 0.03) / np.linalg.norm(by)
    windows = list(campaign.windows)
    for k in range(since, len(windows)):
        window = windows[k]
        poses = rotations(campaign.robot, window)
        late = window.t >= (at * window.t[-1] if k == since else -1.0)
        markers = window.markers.copy()
        markers[late, marker] += (poses @ by)[late]
        windows[k] = replace(window, markers=markers)
    return replace(campaign, windows=tuple(windows))


def rotations(robot: Robot, window: Window) -> np.ndarray:
    """(N, 3, 3) body → world, from four exact markers."""
    body = robot.markers - robot.markers.mean(axis=0)
    seen = window.markers - window.markers.mean(axis=1, keepdims=True)
    left, _, right = np.linalg.svd(np.einsum("nmi,mj->nij", seen, body))
    flip = np.ones((len(left), 3))
    flip[:, 2] = np.sign(np.linalg.det(left @ right))
    return (left * flip[:, np.newaxis]) @ right


def spikes(window: Window, rng: Draw) -> Window:
    hit = rng.random(window.markers.shape[:2]) < rng.uniform(0.001, 0.02)
    by = rng.normal(size=window.markers.shape) * rng.uniform(0.005, 0.2)
    return replace(window, markers=np.where(hit[..., np.newaxis], window.markers + by, window.markers))


def duplicated(window: Window, rng: Draw) -> Window:
    """Rows that were written twice, with their time."""
    again = np.where(rng.random(len(window.t)) < rng.uniform(0.002, 0.05), 2, 1)
    lengths = None if window.lengths is None else np.repeat(window.lengths, again, axis=0)
    return replace(
        window,
        t=np.repeat(window.t, again),
        markers=np.repeat(window.markers, again, axis=0),
        lengths=lengths,
        currents=None,
        further={},
    )


def exchanged(window: Window, rng: Draw) -> Window:
    """Two markers have each other's name for a while."""
    one, other = rng.choice(window.markers.shape[1], 2, replace=False)
    begin = int(rng.integers(0, len(window.t) - 20))
    end = begin + int(rng.integers(10, len(window.t) - begin))
    markers = window.markers.copy()
    markers[begin:end, [one, other]] = window.markers[begin:end, [other, one]]
    return replace(window, markers=markers)


def mislabelled(campaign: Campaign, rng: Draw) -> Campaign:
    """The markers stand in another order than in the robot file, in all windows."""
    order = rng.permutation(campaign.robot.markers.shape[0])
    windows = (replace(w, markers=w.markers[:, order]) for w in campaign.windows)
    return replace(campaign, windows=tuple(windows))


def unseen(window: Window, rng: Draw) -> Window:
    """Blanks, of single markers, for as long as something stands before the camera."""
    markers = window.markers.copy()
    for _ in range(rng.integers(1, 8)):
        begin = int(rng.integers(len(markers)))
        end = begin + round(rng.uniform(0.05, 1.5) / float(np.median(np.diff(window.t))))
        markers[begin:end, rng.integers(markers.shape[1])] = np.nan
    return replace(window, markers=markers)


def without_lengths(window: Window, rng: Draw) -> Window:
    """Nobody wrote the lengths down."""
    return replace(window, lengths=None)
