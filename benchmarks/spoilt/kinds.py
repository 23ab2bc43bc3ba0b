"""Ways in which recordings of other laboratories are spoilt, each with sizes drawn at random.

A kind takes a campaign without marker noise, a random generator, and gives the campaign as somebody would have handed
it in. `words`: one of them must stand in a refusal that names the true cause; none where the tool is to cope.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import butter, filtfilt, lfilter, lfilter_zi
from scipy.spatial.transform import Rotation

from fidim_lab.data.records import Campaign, Robot, Window

Draw = np.random.Generator
Spoil = Callable[[Campaign, Draw], Campaign]


@dataclass(frozen=True)
class Kind:
    name: str
    clean: Spoil
    """before marker noise"""
    noisy: Spoil
    """after it: what happens to the numbers that cameras gave"""
    words: tuple[str, ...] = ()
    several: bool = False
    """needs four markers"""
    one: bool = False
    """needs one marker"""


def _same(campaign: Campaign, rng: Draw) -> Campaign:
    return campaign


def _each(change: Callable[[Window, Draw], Window], share: float = 1.0) -> Spoil:
    """In every window, or in a share of them, at least one."""

    def spoil(campaign: Campaign, rng: Draw) -> Campaign:
        chosen = rng.random(len(campaign.windows)) < share
        chosen[rng.integers(len(chosen))] = True
        windows = [change(w, rng) if use else w for w, use in zip(campaign.windows, chosen, strict=True)]
        return replace(campaign, windows=tuple(windows))

    return spoil


def _rows(window: Window, markers: np.ndarray) -> Window:
    """The window with other markers, its clock going on; lengths are held."""
    n = len(markers)
    step = window.t[1] - window.t[0]
    lengths = None if window.lengths is None else window.lengths[np.arange(n) % len(window.lengths)]
    t = window.t[0] + step * np.arange(n)
    return replace(window, t=t, markers=markers, lengths=lengths, currents=None, further={})


def _held_at_start(window: Window, rng: Draw) -> Window:
    count = round(rng.uniform(0.4, 3.0) / (window.t[1] - window.t[0]))
    return _rows(window, np.concatenate([np.repeat(window.markers[:1], count, axis=0), window.markers]))


def _caught(window: Window, rng: Draw) -> Window:
    at = round(rng.uniform(0.5, 0.92) * len(window.t))
    held = np.repeat(window.markers[at : at + 1], len(window.t) - at, axis=0)
    return _rows(window, np.concatenate([window.markers[:at], held]))


def _braked(window: Window, rng: Draw) -> Window:
    at = rng.uniform(0.5, 0.9) * window.t[-1]
    late = np.maximum(window.t - at, 0.0) / rng.uniform(0.2, 1.0)
    middle = window.markers.mean(axis=0)
    return replace(window, markers=middle + (window.markers - middle) * np.exp(-late)[:, np.newaxis, np.newaxis])


def _second_release(window: Window, rng: Draw) -> Window:
    step = window.t[1] - window.t[0]
    at, carried, held = (round(x / step) for x in rng.uniform([3.0, 0.5, 0.3], [6.0, 1.5, 2.0]))
    ease = 0.5 - 0.5 * np.cos(np.linspace(0, np.pi, carried))[:, np.newaxis, np.newaxis]
    back = window.markers[at] + ease * (window.markers[0] - window.markers[at])
    parts = [window.markers[:at], back, np.repeat(window.markers[:1], held, axis=0), window.markers]
    return _rows(window, np.concatenate(parts))


def _zeros(window: Window, rng: Draw) -> Window:
    gone = rng.random(len(window.t)) < rng.uniform(0.002, 0.1)
    return replace(window, markers=np.where(gone[:, np.newaxis, np.newaxis], 0.0, window.markers))


def _sentinel(window: Window, rng: Draw) -> Window:
    value = rng.choice([-1.0, 99.999, -9.999, 9999.0])
    gone = rng.random(window.markers.shape[:2]) < rng.uniform(0.002, 0.05)
    return replace(window, markers=np.where(gone[..., np.newaxis], value, window.markers))


def _gaps(fill: str) -> Callable[[Window, Draw], Window]:
    def filled(window: Window, rng: Draw) -> Window:
        markers = window.markers.copy()
        for _ in range(rng.integers(1, 5)):
            length = round(rng.uniform(0.1, 1.0) / (window.t[1] - window.t[0]))
            begin = int(rng.integers(3, len(markers) - length - 3))
            end = begin + length
            if fill == "held":
                markers[begin:end] = markers[begin - 1]
            else:
                share = np.linspace(0, 1, length + 2)[1:-1, np.newaxis, np.newaxis]
                if fill == "cubic":
                    share = 3 * share**2 - 2 * share**3
                markers[begin:end] = markers[begin - 1] + share * (markers[end] - markers[begin - 1])
        return replace(window, markers=np.round(markers, 6))

    return filled


def _upsampled(campaign: Campaign, rng: Draw) -> Campaign:
    every = int(rng.integers(2, 5))

    def between(window: Window) -> Window:
        known = np.arange(0, len(window.t), every)
        flat = window.markers.reshape(len(window.t), -1)
        columns = [np.interp(np.arange(known[-1] + 1), known, column[known]) for column in flat.T]
        return _rows(window, np.round(np.stack(columns, axis=1), 6).reshape(-1, *window.markers.shape[1:]))

    return replace(campaign, windows=tuple(between(w) for w in campaign.windows))


def _filtered(*, causal: bool) -> Spoil:
    def spoil(campaign: Campaign, rng: Draw) -> Campaign:
        b, a = butter(int(rng.choice([2, 4])), rng.uniform(4.0, 15.0), fs=campaign.sample_rate)
        start = lfilter_zi(b, a)[:, np.newaxis]

        def through(window: Window) -> Window:
            flat = window.markers.reshape(len(window.t), -1)
            out = lfilter(b, a, flat, axis=0, zi=start * flat[0])[0] if causal else filtfilt(b, a, flat, axis=0)
            return replace(window, markers=np.round(out, 6).reshape(window.markers.shape))

        return replace(campaign, windows=tuple(through(w) for w in campaign.windows))

    return spoil


def _rate(campaign: Campaign, rng: Draw) -> Campaign:
    factor = 1 + rng.choice([-1, 1]) * 10 ** rng.uniform(-3.5, -2.3)
    return replace(campaign, windows=tuple(replace(w, t=np.round(factor * w.t, 6)) for w in campaign.windows))


def _jitter(window: Window, rng: Draw) -> Window:
    late = rng.exponential(rng.uniform(1e-3, 6e-3), len(window.t))
    return replace(window, t=np.round(np.maximum.accumulate(window.t + late) + 1e-6 * np.arange(len(late)), 6))


def _bunched(window: Window, rng: Draw) -> Window:
    n = len(window.t)
    late = rng.exponential(rng.uniform(1e-3, 5e-3), n)
    hit = rng.random(n) < rng.uniform(0.02, 0.1)
    late[hit] += rng.uniform(0.02, 0.08, int(hit.sum()))
    return replace(window, t=np.round(np.maximum.accumulate(window.t + late) + 1e-6 * np.arange(n), 6))


def _axes(campaign: Campaign, rng: Draw) -> Campaign:
    turns = [np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0.0]]), np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0.0]])]
    return _turned(campaign, turns[rng.integers(2)], np.zeros(3))


def _frame(campaign: Campaign, rng: Draw) -> Campaign:
    turn = Rotation.from_rotvec([*rng.normal(0, 0.03, 2), rng.uniform(-np.pi, np.pi)]).as_matrix()
    return _turned(campaign, turn, rng.uniform(-1, 1, 3))


def _turned(campaign: Campaign, turn: np.ndarray, shift: np.ndarray) -> Campaign:
    windows = (replace(w, markers=w.markers @ turn.T + shift, equilibrium=None) for w in campaign.windows)
    return replace(campaign, windows=tuple(windows))


def _marker_offset(campaign: Campaign, rng: Draw) -> Campaign:
    by = rng.normal(size=3)
    by *= rng.uniform(0.003, 0.08) / np.linalg.norm(by)
    return replace(campaign, robot=replace(campaign.robot, marker=campaign.robot.marker + by))


def _knocked(campaign: Campaign, rng: Draw) -> Campaign:
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


def _spikes(window: Window, rng: Draw) -> Window:
    hit = rng.random(window.markers.shape[:2]) < rng.uniform(0.001, 0.02)
    by = rng.normal(size=window.markers.shape) * rng.uniform(0.005, 0.2)
    return replace(window, markers=np.where(hit[..., np.newaxis], window.markers + by, window.markers))


FRAME = ("frame", "axes")
KINDS: Sequence[Kind] = (
    Kind("nothing", _same, _same),
    Kind("held at start", _each(_held_at_start), _same),
    Kind("held at start of some", _each(_held_at_start, 0.4), _same),
    Kind("caught at end", _each(_caught, 0.7), _same),
    Kind("braked at end", _each(_braked, 0.7), _same),
    Kind("second release", _each(_second_release, 0.4), _same),
    Kind("(0, 0, 0)", _same, _each(_zeros)),
    Kind("sentinel", _same, _each(_sentinel)),
    Kind("gaps by lines", _same, _each(_gaps("linear"))),
    Kind("gaps by cubics", _same, _each(_gaps("cubic"))),
    Kind("gaps held", _same, _each(_gaps("held"))),
    Kind("upsampled", _same, _upsampled),
    Kind("low-pass, causal", _same, _filtered(causal=True), ("low-passed",)),
    Kind("low-pass, zero phase", _same, _filtered(causal=False), ("low-passed",)),
    Kind("rate off", _same, _rate),
    Kind("stamps jitter", _same, _each(_jitter)),
    Kind("stamps bunched", _same, _each(_bunched)),
    Kind("axes", _same, _axes, FRAME),
    Kind("capture frame", _same, _frame, FRAME),
    Kind("marker offset", _same, _marker_offset, ("arker is not where", "frame"), one=True),
    Kind("marker knocked", _knocked, _same, several=True),
    Kind("spikes", _same, _each(_spikes)),
)
