"""First-order influence of every hypothesis on a fitted model whose cables are springs.

As `columns`, but nothing is composed: with springs the equations of motion with every hypothesis in them are explicit,
so `model.sensitivity` has their derivatives, by states, tensions, body and all θ alike. Only periodic forces are the
influence of a unit of force times sin and cos. Stretch of cables that are rigid in the fitted model is left out: to be
springs they would need states that the fit does not have.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from jaxtyping import Float

from fidim_lab.effects.loads.constant_force import ConstantForce
from fidim_lab.identification.mle.starts.springs import stretches
from fidim_lab.identification.mle.trajectories.likelihood import Likelihood, Simulation, priors_by
from fidim_lab.mismatch.linearised.columns import (
    ResidualColumns,
    Scorer,
    composed,
    frequency_of,
    scored_places,
    seen_by,
    waves,
)
from fidim_lab.mismatch.linearised.hypotheses import Hypotheses, Hypothesis, rides
from fidim_lab.model.batch import over_samples
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity import markers
from fidim_lab.model.sensitivity.equations import BODY, derivatives, sprung
from fidim_lab.model.sensitivity.integrate import Trajectories, node_times
from fidim_lab.model.sensitivity.sampling import own_states, sampled
from fidim_lab.model.sensitivity.starts import Starts, linearised_starts
from fidim_lab.model.sensitivity.variation import variations


class SprungScorer:
    """The influence of all hypotheses on one model with springs; used as `Scorer`."""

    def __init__(self, mechanism: Mechanism, tried: Hypotheses) -> None:
        self.mechanism = mechanism
        self.tried = replace(tried, direct=tuple(h for h in tried.direct if _goes_with(mechanism, h)))
        effects = [*mechanism.effects, *(h.effect for h in self.tried.direct)]
        theta = np.concatenate([mechanism.theta, *(h.absent for h in self.tried.direct)])
        kind = {"springs": True, "quiet": mechanism.quiet}
        self._all = Mechanism(mechanism.robot, effects, theta.tolist(), native=mechanism.native, **kind)
        pushed = [*mechanism.effects, ConstantForce()]
        self._pushed = Mechanism(mechanism.robot, pushed, [*mechanism.theta.tolist(), 0.0, 0.0, 0.0], **kind)
        self._frequencies = tuple(dict.fromkeys(frequency_of(h) for h in self.tried.periodic))
        places = scored_places(list(self.tried.direct), mechanism.theta.size)
        self._places = np.concatenate([*places, np.zeros(0)]).astype(int)

    def columns(self, likelihood: Likelihood, simulation: Simulation) -> Iterator[ResidualColumns]:
        """Every window's residual and derivatives at a simulated point, batch by batch."""
        yield from (task() for task in self.tasks(likelihood, simulation))

    def tasks(
        self, likelihood: Likelihood, simulation: Simulation, windows: Sequence[int] | None = None
    ) -> Sequence[Callable[[], ResidualColumns]]:
        """The work of `columns` for each window (or only these), to be done in parallel."""
        point = simulation.point
        shared = np.concatenate([point.shared, self._all.theta[len(point.shared) - BODY :]])
        starts = linearised_starts(self._all, shared, point.states, likelihood.begins)
        return [
            partial(self._window, likelihood, simulation, starts, shared, int(w), batch.trajectories.only(place))
            for batch in simulation.batches
            for place, w in enumerate(batch.members)
            if windows is None or int(w) in windows
        ]

    def _window(
        self,
        likelihood: Likelihood,
        simulation: Simulation,
        starts: Starts,
        shared: np.ndarray,
        w: int,
        one: Trajectories,
    ) -> ResidualColumns:
        recording, own = likelihood.recordings[w], likelihood.own
        base = own + len(simulation.point.shared)
        unstretched = None if starts.unstretched_by is None else starts.unstretched_by[w][np.newaxis]
        by = variations(self._all, one, shared, starts.states_by[w][np.newaxis], unstretched=unstretched)
        places = self.mechanism.robot.markers[: recording.markers.shape[1]]
        use, seen = recording.seen_until(float(simulation.ends[w]))
        steady = markers.varied_at(one, by, places, recording.t[use])
        motion = sampled(self.mechanism, simulation.point.shared, one, 0, recording.t[use])
        states = own_states(one, 0, recording.t[use])
        sights = seen_by(self._all, shared[BODY:], motion, states, recording.begin + recording.t[use])
        steady[..., own + BODY :] += sights[:, : len(places)]
        chosen = np.concatenate([np.arange(base), own + BODY + self._places])
        waving = self._waving(simulation, w, one, places, recording.begin, recording.t[use])
        by_markers = np.concatenate([steady[..., chosen], waving], axis=-1)
        known = np.isfinite(recording.lengths)
        residual = simulation.residuals[w]
        jacobian = np.zeros((len(residual.rows), by_markers.shape[-1]))
        count, last = len(residual.markers), len(residual.markers) + int(known.sum())
        jacobian[:count] = likelihood.whitened(w, by_markers[seen], seen)
        jacobian[count:last, : len(chosen)] = starts.lengths_by[w][known][:, chosen] / likelihood.resolution
        jacobian[last:, : len(chosen)] = priors_by(likelihood, starts, w)[:, chosen]
        return ResidualColumns(w, residual.rows, jacobian[:, :own], jacobian[:, own:base], jacobian[:, base:])

    def _waving(
        self,
        simulation: Simulation,
        w: int,
        one: Trajectories,
        places: Float[np.ndarray, "M 3"],
        begin: float,
        times: np.ndarray,
    ) -> Float[np.ndarray, "T M 3 Q"]:
        """Columns of the periodic hypotheses."""
        if not self._frequencies:
            return np.zeros((len(times), len(places), 3, 0))
        shared = np.concatenate([simulation.point.shared, np.zeros(3)])
        t = node_times(one)
        flat = (t, one.positions[0], one.rotations[0], one.moving[0])
        constants = one.constants_at_nodes(shared)
        table = over_samples(derivatives(self._pushed).now(), len(t), *flat, constants)[1]
        force = table.reshape(len(t), one.moving.shape[-1], -1)[:, :6, -3:]
        further = np.concatenate([force @ waves(f, t[:, 0]) for f in self._frequencies], axis=-1)
        nothing = np.zeros((1, 6 + one.moving.shape[-1], len(simulation.point.shared) + further.shape[-1]))
        still = np.zeros((1, len(sprung(self.mechanism)), len(simulation.point.shared)))
        by = variations(self.mechanism, one, simulation.point.shared, nothing, further[np.newaxis], still)
        forced = markers.varied_at(one, by, places, times)[..., len(simulation.point.shared) :]
        parts = [np.zeros((*forced.shape[:-1], 0))]
        for h in self.tried.periodic:
            k = 6 * self._frequencies.index(frequency_of(h))
            parts.append(composed(h, forced[..., k : k + 6], self.mechanism.robot.mass, begin + times))
        return np.concatenate(parts, axis=-1)


def _goes_with(mechanism: Mechanism, tried: Hypothesis) -> bool:
    """Whether it stretches no cable that is rigid in the model, and has no states of its own."""
    if rides(tried):
        return False
    if not stretches(tried.effect) or len(sprung(mechanism)) == mechanism.n:
        return True
    return tried.effect.cable is not None and tried.effect.cable - 1 in sprung(mechanism)


def scorer_of(mechanism: Mechanism, tried: Hypotheses) -> Scorer | SprungScorer:
    """The influence of all hypotheses on a model, whatever its cables are."""
    return SprungScorer(mechanism, tried) if mechanism.springs else Scorer(mechanism, tried)
