"""First-order influence of every hypothesis on the recordings, as columns next to those of a fit.

All hypotheses ride on one motion. The variational equation of the fitted model is solved once more with a forcing
column for each scored parameter (`model.motion.forcing`); what acts on the cameras is added directly. Compliant cables,
loose masses, friction that gives way and periodic forces are not differentiated but composed: the influence of a unit
of cable acceleration times the second derivative of κ τ along the motion (`stretch`), that of a unit of force and
torque times what a mass that swings along pulls (`resonance`) or what has built up in the swivels holds (`giving_way`),
that of a unit of force times sin and cos.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import casadi as ca
import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Motion
from fidim_lab.effects.loads.constant_force import ConstantForce
from fidim_lab.identification.mle.starts.springs import stretches
from fidim_lab.identification.mle.trajectories.likelihood import LOOSE_POSE, LOOSE_RATE, Likelihood, Simulation
from fidim_lab.identification.mle.trajectories.recordings import FollowedSamples
from fidim_lab.mismatch.linearised.giving_way import gives_way, holds_of
from fidim_lab.mismatch.linearised.hypotheses import Hypotheses, Hypothesis, rides
from fidim_lab.mismatch.linearised.resonance import UnitTorque, pull_of
from fidim_lab.mismatch.linearised.stretch import pushes_of, stretch_of
from fidim_lab.model.batch import over_samples
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion.forcing import forcing, sightings, start_gaps
from fidim_lab.model.native import Kernel
from fidim_lab.model.sensitivity import markers
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.model.sensitivity.integrate import Trajectories
from fidim_lab.model.sensitivity.sampling import own_states, sampled
from fidim_lab.model.sensitivity.starts import spreads
from fidim_lab.model.sensitivity.variation import variations
from fidim_lab.model.slots import Effect

FRAME_SWAY = "frame-sway"


@dataclass(frozen=True)
class _UnitPull(Effect):
    """Every cable grows by θ t²/2: the influence of cable accelerations."""

    cables: int

    @property
    def parameters(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """One acceleration for each cable, m/s²."""
        return tuple(f"cable {number}" for number in range(1, self.cables + 1))

    def length_drift(self, number: int, time: ca.SX, theta: ca.SX) -> ca.SX:
        """θ t²/2."""
        return theta[number - 1] * time**2 / 2


@dataclass(frozen=True, eq=False)
class ResidualColumns:
    """One window's whitened residual with its derivatives, its own unknowns still in."""

    window: int
    residual: Float[np.ndarray, " rows"]
    by_own: Float[np.ndarray, "rows own"]
    by_shared: Float[np.ndarray, "rows shared"]
    by_scored: Float[np.ndarray, "rows Q"]
    """all scored parameters of all hypotheses, in order"""


class Scorer:
    """The compiled influence of all hypotheses on one model; made once, used at many motions and horizons."""

    def __init__(self, mechanism: Mechanism, tried: Hypotheses) -> None:
        self.mechanism = mechanism
        self.tried = tried
        self._own = [h for h in tried.direct if _composition(h) == 0]
        told = repr([(h.effect, h.absent.tolist(), h.scored) for h in self._own])
        self._all = mechanism.compiled(f"with all of {told}", lambda made: _with_all(made, self._own))
        self._direct = sum(len(h.scored) for h in tried.direct)
        self._frequencies = tuple(dict.fromkeys(frequency_of(h) for h in tried.periodic))
        self._places = scored_places(self._own, mechanism.theta.size)
        count = len(self._all.theta)
        composing = range(count - 6 - mechanism.n, count)
        self._absent = (*(int(k) for place in self._places for k in place), *composing)

    def columns(self, likelihood: Likelihood, simulation: Simulation) -> Iterator[ResidualColumns]:
        """Every window's residual and derivatives at a simulated point, batch by batch."""
        yield from (task() for task in self.tasks(likelihood, simulation))

    def tasks(
        self, likelihood: Likelihood, simulation: Simulation, windows: Sequence[int] | None = None
    ) -> Sequence[Callable[[], ResidualColumns]]:
        """The work of `columns` for each window (or only these), to be done in parallel."""
        return [
            partial(self._window, likelihood, simulation, int(w), batch.trajectories.only(place))
            for batch in simulation.batches
            for place, w in enumerate(batch.members)
            if windows is None or int(w) in windows
        ]

    def _window(self, likelihood: Likelihood, simulation: Simulation, w: int, one: Trajectories) -> ResidualColumns:
        recording, own = likelihood.recordings[w], likelihood.own
        shared = simulation.point.shared
        moving = self._moving(simulation, w, one)
        begin = simulation.starts.states_by[w]
        added = np.zeros((len(begin), moving.states_by.shape[1]))
        added[:12] = moving.states_by
        starts = np.concatenate([begin, added], axis=1)
        by = variations(self.mechanism, one, shared, starts[np.newaxis], moving.further[np.newaxis])
        places = self.mechanism.robot.markers[: recording.markers.shape[1]]
        use, seen = recording.seen_until(float(simulation.ends[w]))
        by_markers = markers.varied_at(one, by, places, recording.t[use])
        direct = own + len(shared) + self._direct
        self._add_seen(by_markers[..., own + BODY : direct], recording, recording.t[use], shared, one)
        known = np.isfinite(recording.lengths)
        residual = simulation.residuals[w]
        count = len(residual.markers)
        jacobian = np.zeros((len(residual.rows), direct + 6 * len(self.tried.periodic)))
        jacobian[:count, :direct] = likelihood.whitened(w, by_markers[..., :direct][seen], seen)
        stamps = recording.begin + recording.t[use]
        for k, h in enumerate(self.tried.periodic):
            forced = by_markers[..., direct + 6 * self._frequencies.index(frequency_of(h)) :][..., :6]
            rows = composed(h, forced, self.mechanism.robot.mass, stamps)[seen]
            jacobian[:count, direct + 6 * k :][:, :6] = likelihood.whitened(w, rows, seen)
        lengths_by = np.concatenate([simulation.starts.lengths_by[w], moving.lengths_by], axis=1)[known, :direct]
        jacobian[count:-own, :direct] = lengths_by / likelihood.resolution
        jacobian[-own:, :own] = np.diag(loose_rows(likelihood))
        first, last = own, own + len(shared)
        return ResidualColumns(w, residual.rows, jacobian[:, :first], jacobian[:, first:last], jacobian[:, last:])

    def prepare(self) -> None:
        """Have the machine code for the largest part built, while something else is done."""
        self._forcing()

    def _forcing(self) -> Kernel:
        native = self.mechanism.native
        return self._all.compiled("forcing: kernel", lambda made: Kernel.of(forcing(made, self._absent), native=native))

    def _moving(self, simulation: Simulation, w: int, one: Trajectories) -> "_Moving":
        shared = simulation.point.shared
        theta = np.concatenate([shared[BODY:], self._all.theta[len(shared) - BODY :]])
        t = one.begins[0] + one.grid.t
        sample = (one.positions[0], one.rotations[0], one.twists[0], one.own_states[0])
        found = over_samples(self._forcing().now(), len(t), t[:, np.newaxis], *sample, shared[:BODY], theta)
        table = found[0].reshape(len(t), 6 + self.mechanism.n, -1)[:, :6]
        first = (x[:1] for x in (t[:, np.newaxis], *sample))
        gaps = over_samples(start_gaps(self._all, self._absent), 1, *first, shared[:BODY], theta)
        n, count = self.mechanism.n, len(self._all.theta)
        lengths, speeds = gaps[2].reshape(n, count), gaps[3].reshape(n, count)
        chosen = np.concatenate([*self._places, np.zeros(0)]).astype(int)
        force, torque, _ = np.split(table[..., count - 6 - n :], [3, 6], axis=-1)
        parts = [(table[..., chosen], lengths[:, chosen], speeds[:, chosen])]
        parts += [self._compliant(h, one, table, shared) for h in self.tried.direct if stretches(h.effect)]
        parts += [self._riding(h, one, force, torque, shared) for h in self.tried.direct if rides(h)]
        parts += [_forced(f, t, force, n) for f in self._frequencies]
        further, by_lengths, by_speeds = (np.concatenate(part, axis=-1) for part in zip(*parts, strict=True))
        order = self._order()
        by_pose = simulation.starts.lengths_by[w][:, :6]
        structure = np.hstack([by_pose[:, :3], by_pose[:, 3:] @ one.rotations[0, 0].T])
        states = np.vstack([np.zeros((6, by_speeds.shape[1])), -np.linalg.pinv(structure) @ by_speeds])
        return _Moving(further[..., order], by_lengths[:, order], states[:, order])

    def _compliant(
        self, tried: Hypothesis, one: Trajectories, table: np.ndarray, shared: np.ndarray
    ) -> tuple[np.ndarray, ...]:
        """table: v̇ by all θ, the last of which are units of force, torque and pull."""
        stretch, rate, bend = stretch_of(self.mechanism, shared[BODY:], tried.effect, one)
        seen = 0.0 if tried.effect.encoder_sees_stretch else 1.0
        unit = table[..., -6 - self.mechanism.n :]
        further = np.einsum("kij,kj->ki", unit[..., 6:], bend)[..., np.newaxis]
        if tried.effect.anchor_yields:
            pushes = np.concatenate(pushes_of(self.mechanism, shared[BODY:], tried.effect, one, shared[:3]), axis=1)
            further += np.einsum("kij,kj->ki", unit[..., :6], pushes)[..., np.newaxis]
        return further, -seen * stretch[0][:, np.newaxis], -rate[0][:, np.newaxis]

    def _riding(
        self, tried: Hypothesis, one: Trajectories, force: np.ndarray, torque: np.ndarray, shared: np.ndarray
    ) -> tuple[np.ndarray, ...]:
        if gives_way(tried):
            pulls, turns = holds_of(self.mechanism, shared[BODY:], tried, one, shared[:3])
        else:
            pulls, turns = pull_of(tried, one, shared[:3], self.mechanism.robot.gravity)
        further = np.einsum("kij,kj->ki", force, pulls) + np.einsum("kij,kj->ki", torque, turns)
        nothing = np.zeros((self.mechanism.n, 1))
        return further[..., np.newaxis], nothing, nothing

    def _order(self) -> np.ndarray:
        """From the order in which parts are computed to that of `tried.every`."""
        kinds = np.concatenate([*([_composition(h)] * len(h.scored) for h in self.tried.direct), np.zeros(0)])
        order = np.argsort(np.argsort(kinds, kind="stable"), kind="stable")
        return np.concatenate([order, len(order) + np.arange(6 * len(self._frequencies))]).astype(int)

    def _add_seen(
        self, by_markers: np.ndarray, recording: FollowedSamples, t: np.ndarray, shared: np.ndarray, one: Trajectories
    ) -> None:
        """Add what the model's own θ, and direct hypotheses, change of the cameras' report at the same motion.

        by_markers: (T M 3 P), by these; most change nothing there.
        """
        own = len(shared) - BODY
        theta = np.concatenate([shared[BODY:], self._all.theta[own:]])
        motion = sampled(self.mechanism, shared, one, 0, t)
        table = seen_by(self._all, theta, motion, own_states(one, 0, t), recording.begin + t)
        table = table[:, : by_markers.shape[1]]
        chosen = np.concatenate([*self._places, np.zeros(0)]).astype(int)
        where = own + np.argsort(self._order())[: len(chosen)]
        pairs = zip([*range(own), *chosen], [*range(own), *where], strict=True)
        for source, place in pairs:
            if table[..., source].any():
                by_markers[..., place] += table[..., source]


def _with_all(mechanism: Mechanism, tried: Sequence[Hypothesis]) -> Mechanism:
    """The model with these effects at their scan points, and with units of what others are composed of."""
    units = (ConstantForce(), UnitTorque(), _UnitPull(mechanism.n))
    theta = np.concatenate([mechanism.theta, *(h.absent for h in tried), np.zeros(6 + mechanism.n)])
    return Mechanism(mechanism.robot, [*mechanism.effects, *(h.effect for h in tried), *units], theta.tolist())


def seen_by(
    every: Mechanism, theta: np.ndarray, motion: Motion, states: np.ndarray, stamps: Float[np.ndarray, " T"]
) -> Float[np.ndarray, "T M 3 theta"]:
    """The change of the cameras' report by all θ at the same motion; states: effects' own (T, extra); stamps: s."""
    given = (
        stamps[:, np.newaxis],
        motion.positions,
        motion.rotations,
        motion.twists,
        states,
        motion.accelerations,
        theta,
    )
    return over_samples(sightings(every), len(stamps), *given)[4].reshape(len(stamps), -1, 3, len(theta))


@dataclass(frozen=True, eq=False)
class _Moving:
    further: Float[np.ndarray, "N 6 Q"]
    lengths_by: Float[np.ndarray, "n Q"]
    states_by: Float[np.ndarray, "12 Q"]


def loose_rows(likelihood: Likelihood) -> Float[np.ndarray, " own"]:
    """Derivatives of the loose priors' rows by a window's own unknowns."""
    spread = spreads(likelihood.mechanism)
    rates = np.full(likelihood.own - 6 - len(spread), LOOSE_RATE)
    return 1 / np.concatenate([np.full(6, LOOSE_POSE), rates, spread])


def _composition(tried: Hypothesis) -> int:
    """How its columns come about, in the order in which they are computed: by its slots, stretch, or own states."""
    return 1 if stretches(tried.effect) else 2 if rides(tried) else 0


def scored_places(tried: list[Hypothesis], first: int) -> list[np.ndarray]:
    """Where the scored parameters of each hypothesis stand in θ."""
    places: list[np.ndarray] = []
    for h in tried:
        places.append(first + np.array(h.scored, dtype=int))
        first += len(h.effect.parameters)
    return places


def frequency_of(tried: Hypothesis) -> float:
    """Of a periodic hypothesis, Hz: its last parameter."""
    return float(tried.absent[-1])


def composed(
    tried: Hypothesis, forced: Float[np.ndarray, "T M 3 6"], mass: float, stamps: Float[np.ndarray, " T"]
) -> Float[np.ndarray, "T M 3 6"]:
    """The columns of a periodic hypothesis, of those of unit forces at its frequency; stamps: s."""
    if tried.effect.id != FRAME_SWAY:
        return forced
    frequency = frequency_of(tried)
    return mass * (2 * np.pi * frequency) ** 2 * forced + waves(frequency, stamps)[:, np.newaxis]


def waves(frequency: float, t: np.ndarray) -> Float[np.ndarray, "T 3 6"]:
    """Displacements for units of sin x y z, cos x y z."""
    phase = 2 * np.pi * frequency * t
    return np.concatenate([wave[:, np.newaxis, np.newaxis] * np.eye(3) for wave in (np.sin(phase), np.cos(phase))], -1)


def _forced(frequency: float, t: np.ndarray, force: np.ndarray, n: int) -> tuple[np.ndarray, ...]:
    """The forcing of units of force, sin x y z, cos x y z; no influence on a window's start."""
    return force @ waves(frequency, t), np.zeros((n, 6)), np.zeros((n, 6))
