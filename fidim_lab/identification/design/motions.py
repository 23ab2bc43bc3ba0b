"""The free motions of designed windows with all quantities that judge a design, and exact derivatives.

A quantity is a sum of weights times [W′; τ; Ξ_d] at a node; its derivative by the state there is one reverse sweep
(CasADi), carried to the design's unknowns by the trajectories' sensitivities. Ξ_d: Ξ over the dependent coordinates.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from jaxtyping import Float, Int

from fidim_lab.identification.design.task import SAMPLED, DesignTask
from fidim_lab.identification.design.windows import ReleasedWindow
from fidim_lab.model.batch import from_rows, function, over_samples, rows
from fidim_lab.model.geometry import skew
from fidim_lab.model.mechanism import Mechanism, structure_expression
from fidim_lab.model.native import built
from fidim_lab.model.sensitivity.equations import BODY, Sample, slopes, turned
from fidim_lab.model.sensitivity.grid import Grid, Resolution
from fidim_lab.model.sensitivity.integrate import States, Trajectories, integrate
from fidim_lab.model.sensitivity.variation import Variations, variations


@dataclass(frozen=True, eq=False)
class Motions:
    """W windows at the N nodes of their grid."""

    task: DesignTask
    placed: tuple[ReleasedWindow, ...]
    trajectories: Trajectories
    regressors: Float[np.ndarray, "W N free 10"]
    """W′ = Ξ⊥ᵀ W_EE (Eq. 22) with Ξ⊥ of the marker's free coordinates"""
    dependent: Float[np.ndarray, "W N n n"]
    """Ξ over the dependent coordinates"""

    @property
    def tensions(self) -> Float[np.ndarray, "W N n"]:
        """N."""
        return self.trajectories.tensions * self.task.robot.mass

    @property
    def displacements(self) -> Float[np.ndarray, "W N free"]:
        """Of the marker's free coordinates from rest, m."""
        marker, axes = self.task.robot.marker, list(self.task.axes)
        places = self.trajectories.positions + self.trajectories.rotations @ marker
        rests = np.array([one.rest.position + one.rest.rotation @ marker for one in self.placed])
        return (places - rests[:, np.newaxis])[..., axes]

    @property
    def sampled(self) -> np.ndarray:
        """Indices of the nodes that enter W: the task's samples, evenly spread, without t = 0."""
        wanted = self.task.seconds * np.arange(1, self.task.samples + 1) / self.task.samples
        return np.abs(self.trajectories.grid.t[:, np.newaxis] - wanted).argmin(axis=0)


def simulate(
    mechanism: Mechanism, task: DesignTask, placed: Sequence[ReleasedWindow], resolution: Resolution = SAMPLED
) -> Motions:
    """Free motions from the starts; NaN where one breaks down. Slack cables show as negative tensions."""
    states = States(
        np.array([one.start.position for one in placed]),
        np.array([one.start.rotation for one in placed]),
        np.zeros((len(placed), 6)),
    )
    found = integrate(mechanism, task.shared, states, Grid.covering(task.seconds, resolution), np.zeros(len(placed)))
    count, nodes = found.positions.shape[:2]
    at = (np.zeros((count, nodes, 1)), found.positions, found.rotations, found.twists, task.shared)
    regressors, dependent = over_samples(_values(mechanism, task), count * nodes, *at)
    n, free = task.robot.n, len(task.axes)
    return Motions(
        task,
        tuple(placed),
        found,
        regressors.reshape(count, nodes, free, 10),
        dependent.reshape(count, nodes, n, n),
    )


@dataclass(frozen=True, eq=False)
class Sensitive:
    """Motions with the derivatives of their states by the design's unknowns."""

    motions: Motions
    by: Variations

    @staticmethod
    def of(mechanism: Mechanism, motions: Motions) -> "Sensitive":
        """Carry the derivatives of the starts along."""
        task = motions.task
        starts = np.zeros((len(motions.placed), 12, task.width + BODY))
        starts[:, :6, : task.width] = np.array([one.start_by for one in motions.placed])
        return Sensitive(motions, variations(mechanism, motions.trajectories, task.shared, starts))

    def at_nodes(
        self,
        mechanism: Mechanism,
        nodes: Int[np.ndarray, "W K"],
        weights: Float[np.ndarray, "W K m"],
    ) -> Float[np.ndarray, "W K z"]:
        """Derivative by each window's z of Σ weights · [W′; τ (N); Ξ_d], at chosen nodes of each window.

        m: the entries of the three, row by row, one after the other (`weighted` puts them in their places).
        """
        task, found = self.motions.task, self.motions.trajectories
        count, chosen = nodes.shape
        samples = count * chosen
        windows = np.arange(count)[:, np.newaxis]
        scaled = weights.reshape(samples, -1).copy()
        regressor = 10 * len(task.axes)
        scaled[:, regressor : regressor + task.robot.n] *= task.robot.mass
        given = (
            np.zeros((samples, 1)),
            found.positions[windows, nodes],
            found.rotations[windows, nodes],
            found.twists[windows, nodes],
            task.shared,
        )
        (by_state,) = over_samples(_gradient(mechanism, task), samples, *given, scaled)
        poses, twists = self.by.poses[windows, nodes], self.by.twists[windows, nodes]
        by = np.concatenate([poses, twists], axis=2)[..., : task.width]
        return (by_state.reshape(count, chosen, 1, 12) @ by)[:, :, 0]

    def weighted(
        self,
        *,
        regressors: Float[np.ndarray, "W K free 10"] | None = None,
        tensions: Float[np.ndarray, "W K n"] | None = None,
        dependent: Float[np.ndarray, "W K n n"] | None = None,
    ) -> Float[np.ndarray, "W K m"]:
        """The weights of `at_nodes`; 0 for what is not given."""
        n, free = self.motions.task.robot.n, len(self.motions.task.axes)
        parts = ((regressors, 10 * free), (tensions, n), (dependent, n * n))
        given = next(part for part, _ in parts if part is not None)
        shape = given.shape[:2]
        columns = [np.zeros((*shape, m)) if part is None else part.reshape(*shape, m) for part, m in parts]
        return np.concatenate(columns, axis=2)

    def displacements_by(self) -> Float[np.ndarray, "W N free z"]:
        """Derivative of the displacement from rest at every node."""
        task, found = self.motions.task, self.motions.trajectories
        width, axes = task.width, list(task.axes)
        arms = found.rotations @ task.robot.marker
        turned_by = found.rotations @ self.by.poses[:, :, 3:, :width]
        moved = self.by.poses[:, :, :3, :width] + np.cross(turned_by, arms[..., np.newaxis], axis=2)
        rest = np.array([one.marker_by for one in self.motions.placed])
        return moved[:, :, axes] - rest[:, np.newaxis]


def _values(mechanism: Mechanism, task: DesignTask) -> ca.Function:
    """(time, position, rotation, twist, shared) → W′ and Ξ_d, row by row."""

    def make(made: Mechanism) -> ca.Function:
        inputs, quantities = _expressions(made, task)
        return _machine(made, function("design_values", inputs, [rows(quantities[0]), rows(quantities[2])]))

    return mechanism.compiled(f"design: {task.axes} values", make)


def _gradient(mechanism: Mechanism, task: DesignTask) -> ca.Function:
    """The same and weights → derivative of their sum by [δp; δφ; δv; δω]."""

    def make(made: Mechanism) -> ca.Function:
        inputs, (regressor, tensions, dependent) = _expressions(made, task)
        stacked = ca.vertcat(rows(regressor), tensions, rows(dependent))
        weights = ca.SX.sym("weights", stacked.numel())
        _, position, flat, twist, _ = inputs
        slope = ca.gradient(ca.dot(weights, stacked), ca.vertcat(position, flat, twist))
        by_state = ca.vertcat(slope[:3], turned(flat).T @ slope[3:12], slope[12:])
        return _machine(made, function("design_gradient", [*inputs, weights], [by_state]))

    return mechanism.compiled(f"design: {task.axes} gradient", make)


def _machine(mechanism: Mechanism, compiled: ca.Function) -> ca.Function:
    return built(compiled) if mechanism.native else compiled


def _expressions(mechanism: Mechanism, task: DesignTask) -> tuple[list[ca.SX], tuple[ca.SX, ca.SX, ca.SX]]:
    """Inputs, and W′ (free × 10), τ per unit mass (n), Ξ_d (n × n)."""
    sample = Sample.of(mechanism)
    time, position, flat, twist, shared = sample.inputs
    solution = slopes(mechanism)(time, position, flat, twist, shared)
    rotation = from_rows(flat, 3, 3)
    xi = structure_expression(mechanism.cables_at(position, rotation, shared[BODY:]))
    arm = rotation @ ca.SX(ca.DM(task.robot.marker))
    selector = ca.SX.zeros(len(task.axes), 6)
    for row, axis in enumerate(task.axes):
        direction = ca.SX(ca.DM(np.eye(3)[axis]))
        selector[row, :3], selector[row, 3:] = direction.T, ca.cross(arm, direction).T
    ends = ca.SX(ca.DM(np.vstack([np.eye(len(task.axes)), np.zeros((task.robot.n, len(task.axes)))])))
    basis = ca.solve(ca.vertcat(selector, xi), ends)
    regressor = basis.T @ _platform_regressor(rotation, twist, solution[:6], task.robot.gravity)
    return sample.inputs, (regressor, solution[6:], xi @ _complement(selector))


def _complement(selector: ca.SX) -> ca.SX:
    """A basis of the dependent coordinates: of the other marker axes, and rotations about the marker (orthonormal).

    The singular values of Ξ times it are those over the twists that leave the free coordinates alone.
    """
    free = selector.shape[0]
    # Gram–Schmidt, selector rows first: what is left is orthogonal to them
    chosen = [selector[row, :].T / ca.norm_2(selector[row, :]) for row in range(free)]
    chosen[1:] = [_orthogonal(chosen[1], chosen[:1])] if free == 2 else []
    for axis in [a for a in range(6) if a >= free]:
        chosen.append(_orthogonal(ca.SX(ca.DM(np.eye(6)[axis])), chosen))
    return ca.horzcat(*chosen[free:])


def _orthogonal(vector: ca.SX, others: Sequence[ca.SX]) -> ca.SX:
    left = vector - sum((ca.dot(vector, other) * other for other in others), ca.SX.zeros(6))
    return left / ca.norm_2(left)


def _platform_regressor(rotation: ca.SX, twist: ca.SX, acceleration: ca.SX, gravity: np.ndarray) -> ca.SX:
    """W_EE of Eq. 19 per unit mass, 6 × 10."""
    spin, spin_rate = twist[3:], acceleration[3:]
    felt = acceleration[:3] - ca.SX(ca.DM(gravity))
    across = skew(spin)
    upper = ca.horzcat(felt, (skew(spin_rate) + across @ across) @ rotation, ca.SX.zeros(3, 6))
    inertia = rotation @ _inertia_columns(rotation.T @ spin_rate) + across @ rotation @ _inertia_columns(
        rotation.T @ spin
    )
    lower = ca.horzcat(ca.SX.zeros(3, 1), -skew(felt) @ rotation, inertia)
    return ca.vertcat(upper, lower)


def _inertia_columns(vector: ca.SX) -> ca.SX:
    """v̄ with I v = v̄ Ǐ (Eq. 14–16)."""
    x, y, z, o = vector[0], vector[1], vector[2], ca.SX(0)
    return ca.vertcat(ca.horzcat(x, o, o, y, z, o), ca.horzcat(o, y, o, x, o, z), ca.horzcat(o, o, z, o, x, y))
