"""What is done to the motion that is recorded: a hand at the start, a catch, a brake, another body."""

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from benchmarks.spoilt.spoiling import Draw, rows
from fidim_lab.data.records import Window


def held_at_start(window: Window, rng: Draw) -> Window:
    count = round(rng.uniform(0.4, 3.0) / float(np.median(np.diff(window.t))))
    return rows(window, np.concatenate([np.repeat(window.markers[:1], count, axis=0), window.markers]))


def caught(window: Window, rng: Draw) -> Window:
    at = round(rng.uniform(0.5, 0.92) * len(window.t))
    held = np.repeat(window.markers[at : at + 1], len(window.t) - at, axis=0)
    return rows(window, np.concatenate([window.markers[:at], held]))


def braked(window: Window, rng: Draw) -> Window:
    """A hand slows it down on its way until it stands still."""
    at, within = rng.uniform(0.5, 0.9) * window.t[-1], rng.uniform(0.2, 1.0)
    late = np.maximum(window.t - at, 0.0)
    when = np.where(late > 0, at + within * (1 - np.exp(-late / within)), window.t)
    flat = window.markers.reshape(len(window.t), -1)
    markers = CubicSpline(window.t, flat)(when).reshape(window.markers.shape)
    return replace(window, markers=markers)


def second_release(window: Window, rng: Draw) -> Window:
    step = float(np.median(np.diff(window.t)))
    at, carried, held = (round(x / step) for x in rng.uniform([3.0, 0.5, 0.3], [6.0, 1.5, 2.0]))
    ease = 0.5 - 0.5 * np.cos(np.linspace(0, np.pi, carried))[:, np.newaxis, np.newaxis]
    back = window.markers[at] + ease * (window.markers[0] - window.markers[at])
    parts = [window.markers[:at], back, np.repeat(window.markers[:1], held, axis=0), window.markers]
    return rows(window, np.concatenate(parts))
