"""Instruments: the regressor of a free motion simulated with the body found so far, sample by sample.

Every 2.5 s of a window are predicted from their own fitted initial state (`trajectory.predict`): long enough that the
few fitted numbers know next to nothing of the noise, short enough that a model which lacks something does not slip a
cycle. The simulated motion then makes equations as the measured one does: same weights, same filter. They move with the
measured ones and have none of their noise.
"""

from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.data.records import Body, Motion
from fidim_lab.errors import FidimError
from fidim_lab.identification.equations.linear import Sampled
from fidim_lab.identification.equations.problem import Problem, WindowEquations, motion_equations
from fidim_lab.identification.motion.measured import MeasuredMotion
from fidim_lab.identification.motion.recipe import Variant
from fidim_lab.identification.motion.surface import marker_jacobian
from fidim_lab.identification.motion.trajectory import predict
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import marker_selector

PIECE = 2.5
"""s"""
SAME_TIME = 0.25
"""of a sample step: rows of measured and simulated motion that are nearer belong together"""


@dataclass(frozen=True, eq=False)
class Instrumented:
    """Measured equations beside simulated ones; windows that could not be simulated are named."""

    windows: tuple[Sampled, ...]
    missing: tuple[str, ...]
    """ids of windows without instruments"""


def instrumented(
    problem: Problem, mechanism: Mechanism, windows: tuple[WindowEquations, ...], body: Body, weights: Body
) -> Instrumented:
    """The windows' equations with instruments from free motion of `body`; `weights` as in `WindowEquations.rows`."""
    found: list[Sampled] = []
    missing: list[str] = []
    for equations in windows:
        sampled = _window(problem, mechanism, equations, body, weights)
        if sampled is None:
            missing.append(equations.window.id)
        else:
            found.append(sampled)
    return Instrumented(tuple(found), tuple(missing))


def _window(
    problem: Problem, mechanism: Mechanism, equations: WindowEquations, body: Body, weights: Body
) -> Sampled | None:
    """None where no piece of the window can be simulated with this body, or hardly any sample is common to both."""
    pieces = _pieces(mechanism, equations.measured, body)
    if not pieces:
        return None
    try:
        simulated = motion_equations(problem.mechanism, _joined(mechanism, equations.measured, pieces), problem.recipe)
        Z, times = simulated.rows(weights), simulated.times
    except FidimError:
        return None
    measured, there = _common(equations.times, times, 1 / equations.measured.rate)
    if len(measured) < 2:
        return None
    kept = equations.picked(len(measured))
    return Sampled(equations.rows(weights)[measured[kept]], Z[there[kept]][..., 1:], equations.freedoms)


def _pieces(mechanism: Mechanism, measured: MeasuredMotion, body: Body) -> list[Motion]:
    """The motion of every piece that can be simulated."""
    t, window = measured.motion.t, measured.window
    count = max(1, round((t[-1] - t[0]) / PIECE))
    bounds = np.searchsorted(t, np.linspace(t[0], t[-1], count + 1)[:-1]).tolist()
    found: list[Motion] = []
    for begin, end in zip(bounds, [*bounds[1:], len(t)], strict=True):
        rows = np.flatnonzero((window.t >= t[begin] - 1e-9) & (window.t <= t[end - 1] + 1e-9))
        lengths = None if window.lengths is None else window.lengths[rows]
        part = replace(window, t=window.t[rows], markers=window.markers[rows], lengths=lengths, further={})
        prediction = predict(mechanism, body, replace(measured, window=part, motion=_rows(measured.motion, begin, end)))
        if prediction is not None:
            found.append(prediction.motion)
    return found


def _joined(mechanism: Mechanism, measured: MeasuredMotion, pieces: list[Motion]) -> MeasuredMotion:
    """The pieces in place of the measured motion, at the measured samples that they reach."""
    robot = mechanism.robot
    kept, there = _common(measured.motion.t, np.concatenate([m.t for m in pieces]), 1 / measured.rate)
    motion = Motion(
        measured.motion.t[kept],
        np.concatenate([m.positions for m in pieces])[there],
        np.concatenate([m.rotations for m in pieces])[there],
        np.concatenate([m.twists for m in pieces])[there],
        np.concatenate([m.accelerations for m in pieces])[there],
    )
    if measured.variant is Variant.FREE:
        jacobian = marker_selector(motion.rotations, robot.marker, measured.axes)
    else:
        jacobian = marker_jacobian(motion.rotations, robot.markers[: measured.window.markers.shape[1]])
    return replace(
        measured,
        motion=motion,
        samples=measured.samples[kept],
        jacobian=jacobian,
        conditioning=measured.conditioning[kept],
    )


def _rows(motion: Motion, begin: int, end: int) -> Motion:
    return Motion(
        motion.t[begin:end],
        motion.positions[begin:end],
        motion.rotations[begin:end],
        motion.twists[begin:end],
        motion.accelerations[begin:end],
    )


def _common(a: np.ndarray, b: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Indices into two increasing arrays of times (s) of the entries that both have."""
    nearest = np.clip(np.searchsorted(b, a), 1, len(b) - 1)
    nearest -= a - b[nearest - 1] < b[nearest] - a
    same = np.abs(b[nearest] - a) < SAME_TIME * step
    return np.flatnonzero(same), nearest[same]
