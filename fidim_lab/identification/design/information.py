"""The expected accuracy of maximum likelihood: each window's information on the body, and criteria A and D.

Marker noise and the encoders' resolution are those of the robot file; a window's start and lengths are unknowns of its
own and are eliminated. Unlike C this depends on no chart of free coordinates.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.design.cost import Cost
from fidim_lab.identification.design.motions import Sensitive
from fidim_lab.identification.design.task import SAMPLED, Criterion, DesignTask
from fidim_lab.identification.design.windows import ReleasedWindow, place
from fidim_lab.identification.mle.starts.possible import scales
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity import markers
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.model.sensitivity.grid import Grid
from fidim_lab.model.sensitivity.integrate import States, integrate
from fidim_lab.model.sensitivity.starts import linearised_starts
from fidim_lab.model.sensitivity.variation import variations

RATE = 100.0
"""Hz of the motion capture"""
DIFFERENCE = 1e-5
"""m: step of the difference quotients of A and D, whose derivatives are of second order"""

NOTHING = 1e-14
"""of the largest eigenvalue: information that is rounding"""

Information = Float[np.ndarray, "W 9 9"]


def information(
    mechanism: Mechanism,
    task: DesignTask,
    placed: Sequence[ReleasedWindow],
    shared: Float[np.ndarray, "9"] | None = None,
) -> Information:
    """Information of each window about the nine base parameters, for a body (nominal unless given)."""
    shared = task.shared if shared is None else shared
    count, zeros = len(placed), np.zeros(len(placed))
    states = States(
        np.array([one.start.position for one in placed]),
        np.array([one.start.rotation for one in placed]),
        np.zeros((count, 6)),
    )
    starts = linearised_starts(mechanism, shared, states, zeros)
    grid = Grid.covering(task.seconds, SAMPLED)
    found = integrate(mechanism, shared, states, grid, zeros)
    by = variations(mechanism, found, shared, starts.states_by)
    seen = markers.varied_at_nodes(found, by, task.robot.markers)[:, :, 0]
    weights = np.sqrt(RATE * _weights(grid)) / task.robot.sensors.marker_noise
    rows = (weights[:, np.newaxis, np.newaxis, np.newaxis] * seen).reshape(count, -1, seen.shape[-1])
    lengths = starts.lengths_by / task.robot.sensors.encoder_resolution
    both = np.concatenate([rows, lengths], axis=1)
    # by orthogonal elimination of the window's own unknowns: never negative, as a difference of squares can be
    own = both.shape[2] - BODY
    triangle = np.asarray(np.linalg.qr(both, mode="r"))  # the stubs take it for a pair
    left = triangle[:, own:, own:]
    return np.swapaxes(left, 1, 2) @ left


def predicted_sd(total: Float[np.ndarray, "9 9"]) -> Float[np.ndarray, "9"]:
    """Standard deviations at the Cramér–Rao bound from the summed information."""
    return np.sqrt(np.diag(np.linalg.inv(total)))


def judged(task: DesignTask, sums: Float[np.ndarray, "K 9 9"]) -> Float[np.ndarray, " K"]:
    """Criterion A or D of K sums of information: a typical sd relative to the plausible error of a parameter."""
    scale = scales(task.robot.nominal)
    values = np.linalg.eigvalsh(sums * np.outer(scale, scale))
    values = np.maximum(values, NOTHING * values[:, -1:])  # what is not seen at all has a variance, only a huge one
    if task.criterion is Criterion.A:
        return np.sqrt(np.mean(1 / values, axis=1))
    return np.exp(-np.mean(np.log(values), axis=1) / 2)


def precision(mechanism: Mechanism, sensitive: Sensitive) -> Cost:
    """A or D of a set of windows, averaged over the task's bodies, with its derivative."""
    task, placed = sensitive.motions.task, sensitive.motions.placed
    bodies = (task.shared, *task.bodies)
    parts = [_precision(mechanism, task, placed, shared) for shared in bodies]
    return Cost(float(np.mean([part.value for part in parts])), np.mean([part.gradient for part in parts], axis=0))


def _precision(mechanism: Mechanism, task: DesignTask, placed: Sequence[ReleasedWindow], shared: np.ndarray) -> Cost:
    each = information(mechanism, task, placed, shared)
    value = float(judged(task, each.sum(axis=0)[np.newaxis])[0])
    gradient = np.zeros((len(placed), task.width))
    for k in range(task.width):
        there = information(mechanism, task, [_aside(mechanism, task, one, k) for one in placed], shared)
        # one window at a time changes the sum: the criterion of W sums at once
        gradient[:, k] = (judged(task, each.sum(axis=0) + there - each) - value) / DIFFERENCE
    return Cost(value, gradient)


def _aside(mechanism: Mechanism, task: DesignTask, placed: ReleasedWindow, k: int) -> ReleasedWindow:
    step = np.zeros(task.width)
    step[k] = DIFFERENCE
    n = task.robot.n
    lengths = mechanism.lengths(placed.rest.position[np.newaxis], placed.rest.rotation[np.newaxis])[0]
    marker = task.robot.marker
    away = placed.start.position + placed.start.rotation @ marker - placed.rest.position - placed.rest.rotation @ marker
    z = np.concatenate([lengths, away[list(task.axes)]]) + step
    try:
        return place(mechanism, task, z, placed.resting)
    except InfeasibleError as refusal:  # a step of 10 µm from a place that exists
        raise InfeasibleError(
            f"The design's window at lengths {np.round(z[:n], 4)} m is at the edge: {refusal}"
        ) from refusal


def _weights(grid: Grid) -> Float[np.ndarray, " N"]:
    """Quadrature weights of the nodes, s."""
    last, k = grid.quadrature[-1], grid.resolution.intervals
    weights = np.zeros(grid.nodes)
    for block in range(grid.blocks):
        weights[block * k : block * k + k + 1] += last
    return weights
