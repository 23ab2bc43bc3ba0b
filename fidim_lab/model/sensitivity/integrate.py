"""Free motions of W windows on one grid, by Dormand and Prince's eighth-order method from node to node.

One compiled loop for the whole batch. Each step writes the rotation as a Gibbs vector relative to its own start.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from jaxtyping import Bool, Float
from scipy.integrate import DOP853

from fidim_lab.model.batch import blocks, evaluate, from_rows, function, rows
from fidim_lab.model.geometry import gibbs_rate, rotation_from_gibbs
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.native import Kernel
from fidim_lab.model.sensitivity.equations import BODY, slopes
from fidim_lab.model.sensitivity.grid import Grid
from fidim_lab.model.sensitivity.stiff import Began, follow
from fidim_lab.model.sensitivity.work import count_work

COARSE = 1e-5
"""m: what blocks of a stiff grid may leave out of a marker's motion, a fifth of what the best cameras see"""
RINGING = 0.7
"""s, in which 40 N s/m take nearly all of what rings at a winch of 10 kg"""
SOLVABLE = 0.05
"""s: what has no solution in blocks as long as that is hardly a motion, and not looked for in shorter ones"""
MARKER_SPEEDS = np.array([1.0, 1.0, 1.0, 0.2, 0.2, 0.2])
"""m: by a twist, of a marker at 0.2 m"""
STAGES = DOP853.n_stages
# scipy's stubs do not know the tableau
COEFFICIENTS: np.ndarray = np.asarray(DOP853.A)[:STAGES, :STAGES]
NODES: np.ndarray = np.asarray(DOP853.C)[:STAGES]
WEIGHTS: np.ndarray = np.asarray(DOP853.B)


@dataclass(frozen=True, eq=False)
class States:
    """Initial states of W windows: where the platform is let go, and how fast it is then."""

    positions: Float[np.ndarray, "W 3"]
    rotations: Float[np.ndarray, "W 3 3"]
    twists: Float[np.ndarray, "W 6"]
    """[ṗ; ω], world frame; Ξ v = 0 for cables that are no springs"""
    tensions: Float[np.ndarray, "W springs"] | None = None
    """of the springs by their stretch alone, N/kg; None: not known yet (`starts.tied`)"""
    astray: Float[np.ndarray, "W extra"] | None = None
    """how far effects' own states are from where they usually begin (`Effect.extra_start`); None: nowhere"""
    body_changes: Float[np.ndarray, "W 9"] | None = None
    """what the body of each window has beyond the shared one (`Window.body_change`); None: nothing"""

    def of(self, chosen: np.ndarray) -> "States":
        """Some of the windows."""
        tensions, astray, changes = (
            None if values is None else values[chosen] for values in (self.tensions, self.astray, self.body_changes)
        )
        return States(self.positions[chosen], self.rotations[chosen], self.twists[chosen], tensions, astray, changes)

    def shared(self, shared: Float[np.ndarray, " shared"]) -> Float[np.ndarray, "W shared"]:
        """The shared parameters as each window has them."""
        return _with_changes(shared, self.body_changes, len(self.positions))

    def with_one(self, window: int, other: "States", place: int) -> "States":
        """With the state of one window taken from a place in others."""

        def taken(ours: np.ndarray, theirs: np.ndarray) -> np.ndarray:
            changed = ours.copy()
            changed[window] = theirs[place]
            return changed

        tensions = None
        if self.tensions is not None and other.tensions is not None:
            tensions = taken(self.tensions, other.tensions)
        astray = self.astray
        if other.astray is not None:
            nowhere = np.zeros((len(self.positions), other.astray.shape[1]))
            astray = taken(nowhere if astray is None else astray, other.astray)
        return States(
            taken(self.positions, other.positions),
            taken(self.rotations, other.rotations),
            taken(self.twists, other.twists),
            tensions,
            astray,
            self.body_changes,
        )


@dataclass(frozen=True, eq=False)
class Trajectories:
    """W motions at the N nodes of one grid; NaN from where a motion breaks down (no body, a singular pose)."""

    grid: Grid
    begins: Float[np.ndarray, " W"]
    """s on each window's own clock, at the grid's 0"""
    positions: Float[np.ndarray, "W N 3"]
    rotations: Float[np.ndarray, "W N 3 3"]
    twists: Float[np.ndarray, "W N 6"]
    accelerations: Float[np.ndarray, "W N 6"]
    tensions: Float[np.ndarray, "W N n"]
    """per unit mass, N/kg; negative where the model has lost its validity"""
    unstretched: Float[np.ndarray, "W springs"] | None = None
    """lengths of the springs, m; None where there are none"""
    extra: Float[np.ndarray, "W N extra"] | None = None
    """effects' own states; None where there are none"""
    body_changes: Float[np.ndarray, "W 9"] | None = None
    """as in the states that they began with"""

    def only(self, window: int) -> "Trajectories":
        """One of the windows alone."""
        return self.of(slice(window, window + 1))

    def of(self, chosen: slice | Bool[np.ndarray, " W"]) -> "Trajectories":
        """Some of the windows."""
        state = (self.positions[chosen], self.rotations[chosen], self.twists[chosen])
        unstretched = None if self.unstretched is None else self.unstretched[chosen]
        extra = None if self.extra is None else self.extra[chosen]
        changes = None if self.body_changes is None else self.body_changes[chosen]
        forces = (self.accelerations[chosen], self.tensions[chosen])
        return Trajectories(self.grid, self.begins[chosen], *state, *forces, unstretched, extra, changes)

    @property
    def is_coarse(self) -> Bool[np.ndarray, " W"]:
        """Which windows move too quickly for the blocks of a stiff grid; also where blocks so long have no solution.

        What rings at first is not looked at: it is to die, not to be followed.
        """
        if not self.grid.resolution.stiff:
            return np.zeros(len(self.begins), dtype=bool)
        quick = self.grid.tails(self.twists * MARKER_SPEEDS, RINGING) > COARSE
        lost = ~np.isfinite(self.twists[:, -1]).all(axis=1)
        return quick | lost if self.grid.resolution.block > SOLVABLE else quick

    def breaks_down(self, window: int, until: float) -> bool:
        """Whether a motion ends before the block in which `until` (s of the grid) lies is over.

        Derivatives are collocated on whole blocks: up to there they need the motion.
        """
        k, block = self.grid.resolution.intervals, self.grid.resolution.block
        last = k * min(self.grid.blocks, max(1, int(np.ceil(until / block - 1e-9))))
        return not bool(np.isfinite(self.positions[window, last]).all())

    @property
    def own_states(self) -> Float[np.ndarray, "W N extra"]:
        """Effects' own states, none where there are none."""
        return np.zeros((*self.positions.shape[:2], 0)) if self.extra is None else self.extra

    @property
    def moving(self) -> Float[np.ndarray, "W N moving"]:
        """[v; ω; ξ]."""
        return self.twists if self.extra is None else np.concatenate([self.twists, self.extra], axis=-1)

    def constants(self, shared: Float[np.ndarray, " shared"]) -> Float[np.ndarray, "W constants"]:
        """What the equations of motion take as constant in each window: unstretched lengths and shared parameters."""
        count = len(self.begins)
        lengths = np.zeros((count, 0)) if self.unstretched is None else self.unstretched
        return np.concatenate([lengths, _with_changes(shared, self.body_changes, count)], axis=1)

    def constants_at_nodes(self, shared: Float[np.ndarray, " shared"]) -> Float[np.ndarray, "K constants"]:
        """The same for every node of every window, K = W N."""
        return np.repeat(self.constants(shared), self.grid.nodes, axis=0)

    def first_slack(self, window: int) -> tuple[float, int] | None:
        """When (s from the grid's 0, by interpolation) and which cable (1-based) first has no tension; None if taut.

        Never a spring: it carries on slack.
        """
        held = self.tensions[window]
        slack = np.flatnonzero((held <= 0).any(axis=1))
        if len(slack) == 0:
            return None
        node = int(slack[0])
        cable = int(np.argmin(held[node]))
        if node == 0:
            return 0.0, cable + 1
        before, after = held[node - 1, cable], held[node, cable]
        share = before / (before - after)
        t = self.grid.t
        return float(t[node - 1] + share * (t[node] - t[node - 1])), cable + 1


def integrate(
    mechanism: Mechanism,
    shared: Float[np.ndarray, " shared"],
    states: States,
    grid: Grid,
    begins: Float[np.ndarray, " W"],
    unstretched: Float[np.ndarray, "W springs"] | None = None,
    extra: Float[np.ndarray, "W extra"] | None = None,
) -> Trajectories:
    """The motions of all windows. `begins` matters only to effects that depend on time.

    unstretched: of the mechanism's springs, m; extra: effects' own states at the begins (`starts.linearised_starts`
    gives both). Cables are not watched here: see
    `Trajectories.first_slack`. Never raises for the physics: NaN instead. Quiet springs ask for a stiff grid.
    """
    count_work(len(states.positions), grid.nodes)
    if mechanism.quiet:
        return _followed(mechanism, shared, states, grid, begins, unstretched, extra)
    count, nodes, t = len(states.positions), grid.nodes, grid.t
    timing = np.empty((count, nodes, 2))
    timing[..., 0] = begins[:, np.newaxis] + t
    timing[..., 1] = np.append(np.diff(t), 0.0)  # the last step goes nowhere: it gives the last node's accelerations
    own = np.zeros((count, 0)) if extra is None else extra
    state = np.concatenate([states.positions, states.rotations.reshape(count, 9), states.twists, own], axis=1)
    lengths = np.zeros((count, 0)) if unstretched is None else unstretched
    constants = np.concatenate([lengths, states.shared(shared)], axis=1)
    at = np.empty((count, nodes, state.shape[1]))
    outputs = np.empty((count, nodes, 6 + own.shape[1] + mechanism.n))
    for some in blocks(nodes):
        size = some.stop - some.start
        steps = _steps(mechanism, count, size)
        after, found = evaluate(steps, state, timing[:, some], np.repeat(constants, size, axis=0))
        after = after.reshape(count, size, -1)
        at[:, some] = np.concatenate([state[:, np.newaxis], after[:, :-1]], axis=1)
        outputs[:, some] = found.reshape(count, size, -1)
        state = after[:, -1]
    return Trajectories(
        grid=grid,
        begins=begins,
        positions=at[..., :3],
        rotations=at[..., 3:12].reshape(count, nodes, 3, 3),
        twists=at[..., 12:18],
        accelerations=outputs[..., :6],
        tensions=outputs[..., 6 + own.shape[1] :],
        unstretched=unstretched,
        extra=None if extra is None else at[..., 18:],
        body_changes=states.body_changes,
    )


def _followed(
    mechanism: Mechanism,
    shared: np.ndarray,
    states: States,
    grid: Grid,
    begins: np.ndarray,
    unstretched: np.ndarray | None,
    extra: np.ndarray | None,
) -> Trajectories:
    """The motions of all windows, block by block (`stiff`)."""
    rigid = mechanism.compiled("rigid cables", lambda made: Mechanism(made.robot, native=made.native))
    one = Grid(1, grid.resolution)

    def nearby(began: Began, at: float) -> np.ndarray:
        """How rigid cables would let the platform move in the block that begins so."""
        there = States(began.positions, began.rotations, began.moving[:, :6], body_changes=states.body_changes)
        return integrate(rigid, shared[:BODY], there, one, begins + at).twists

    count = len(states.positions)
    own = np.zeros((count, 0)) if extra is None else extra
    lengths = np.zeros((count, 0)) if unstretched is None else unstretched
    constants = np.concatenate([lengths, states.shared(shared)], axis=1)
    moving = np.concatenate([states.twists, own], axis=1)
    began = Began(states.positions, states.rotations, moving)
    found = follow(mechanism, grid, begins, constants, began, nearby)
    return Trajectories(
        grid=grid,
        begins=begins,
        positions=found.positions,
        rotations=found.rotations,
        twists=found.moving[..., :6],
        accelerations=found.slopes[..., :6],
        tensions=found.slopes[..., 6 + own.shape[1] :],
        unstretched=unstretched,
        extra=None if extra is None else found.moving[..., 6:],
        body_changes=states.body_changes,
    )


def _with_changes(shared: np.ndarray, changes: np.ndarray | None, windows: int) -> Float[np.ndarray, "W shared"]:
    every = np.broadcast_to(shared, (windows, len(shared)))
    if changes is None:
        return every
    width = changes.shape[1]
    return np.concatenate([every[:, :width] + changes, every[:, width:]], axis=1)


def node_times(trajectories: Trajectories) -> Float[np.ndarray, "K 1"]:
    """Time of every node of every window on the windows' own clocks, K = W N, s."""
    return (trajectories.begins[:, np.newaxis] + trajectories.grid.t).reshape(-1, 1)


def _steps(mechanism: Mechanism, windows: int, steps: int) -> ca.Function:
    """So many steps of so many windows, one after the other."""
    return step_of(mechanism).derived(
        (windows, steps), lambda step: step.mapaccum("motion", steps, {"base": 8}).map(windows)
    )


def step_of(mechanism: Mechanism) -> Kernel:
    """One step from node to node; for a native mechanism machine code, some time after the first call."""
    return mechanism.compiled("sensitivity: step", lambda made: Kernel.of(_compile_step(made), native=made.native))


def _compile_step(mechanism: Mechanism) -> ca.Function:
    """(state 18 + E, [t, h], constants) → (state at t + h, [v̇; ξ̇; τ] at t); the state is [p; R row by row; v; ω; ξ].

    It calls the slopes instead of containing them: twelve copies would take a C compiler ten times as long to build.
    """
    solve = slopes(mechanism)
    gibbs, spin, flat = ca.SX.sym("gibbs", 3), ca.SX.sym("spin", 3), ca.SX.sym("flat", 9)
    turned = rows(rotation_from_gibbs(gibbs) @ from_rows(flat, 3, 3))
    turn = function("turn", [gibbs, spin, flat], [turned, gibbs_rate(gibbs, spin)])
    own = solve.numel_in(3)  # [v; ω; ξ]
    state, timing = ca.MX.sym("state", 12 + own), ca.MX.sym("timing", 2)
    constants = ca.MX.sym("constants", solve.numel_in(4))
    time, h, reference = timing[0], timing[1], state[3:12]
    start = ca.vertcat(state[:3], ca.MX.zeros(3), state[12:])
    found: list[ca.MX] = []
    outputs: list[ca.MX] = []
    for node, coefficients in zip(NODES, COEFFICIENTS, strict=True):
        terms = [float(c) * slope for c, slope in zip(coefficients, found, strict=False) if c != 0]
        at = start + h * sum(terms, ca.MX.zeros(6 + own))
        rotation, rate = turn(at[3:6], at[9:12], reference)
        output = solve(time + float(node) * h, at[:3], rotation, at[6:], constants)
        outputs.append(output)
        found.append(ca.vertcat(at[6:9], rate, output[:own]))
    end = start + h * sum((float(c) * slope for c, slope in zip(WEIGHTS, found, strict=True)), ca.MX.zeros(6 + own))
    after = ca.vertcat(end[:3], turn(end[3:6], end[9:12], reference)[0], end[6:])
    return ca.Function("eighth_order_step", [state, timing, constants], [after, outputs[0]])
