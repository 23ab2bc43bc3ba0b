"""The fit as a whole: recordings in, the body with its uncertainty out.

    found = fit(mechanism, windows)
    found.values, found.sd, found.chi2_per_dof, found.ending

With effects in the mechanism their θ is estimated too, from `mechanism.theta` as the start and within `theta_sd` of it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import PARAMETER_NAMES, Body, Sensors, Window
from fidim_lab.errors import RefusedError
from fidim_lab.identification.equations.consistency import can_move
from fidim_lab.identification.equations.refusals import together
from fidim_lab.identification.markers.noise_shape import noise_shapes
from fidim_lab.identification.mle import spread
from fidim_lab.identification.mle.judge import Remainder, noise_alone, remainder
from fidim_lab.identification.mle.starts import springs
from fidim_lab.identification.mle.starts.possible import nearest_possible, scales
from fidim_lab.identification.mle.starts.springs import spring_prior, with_springs
from fidim_lab.identification.mle.starts.start import Guess, as_states, first_guesses
from fidim_lab.identification.mle.trajectories.likelihood import Likelihood, Point
from fidim_lab.identification.mle.trajectories.normal import Prior, reduced
from fidim_lab.identification.mle.trajectories.optimise import FINAL, ON_THE_WAY, ROUGH, Ending, optimise
from fidim_lab.identification.mle.trajectories.rate_likelihood import RateLikelihood
from fidim_lab.identification.mle.trajectories.recordings import FollowedSamples, body_changes, prepare
from fidim_lab.identification.mle.trajectories.stages import EARLY, FAR_PRIOR, HORIZONS, TRUSTED, Journey, grow
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.model.sensitivity.rates import reads_rates
from fidim_lab.model.sensitivity.starts import tied
from fidim_lab.model.slots import Effect


@dataclass(frozen=True, eq=False)
class Fit:
    """An optimum and everything that is known about it."""

    likelihood: Likelihood
    journey: Journey
    start: Body
    """where the search began"""
    start_moved: bool
    """the body asked for could not move; the nearest that can was taken"""
    unused: dict[str, str]
    """window id → why it could not be used"""
    misfits: tuple[float, ...]
    """how far lengths and markers were apart at the start of each recording, m"""
    remainders: tuple[Remainder, ...]
    """one for each recording"""
    prior: Prior
    """in force at the optimum"""
    plausible: Float[np.ndarray, " shared"]
    """how far each parameter may plausibly be from its start"""
    names: tuple[str, ...]
    doubt: Float[np.ndarray, "body body"] | None = None
    """covariance of what only seems to be determined (`undetermined`), on top of the nominal one"""

    @property
    def values(self) -> Float[np.ndarray, " shared"]:
        """The shared parameters."""
        return self.journey.optimum.point.shared

    def place_of(self, effect: Effect) -> slice:
        """Where an effect's θ is among the shared parameters. Raises KeyError where the fit has no such effect."""
        first = BODY
        for other in self.likelihood.mechanism.effects:
            if other == effect:
                return slice(first, first + len(effect.parameters))
            first += len(other.parameters)
        raise KeyError(f"{effect} is not in this fit")

    @property
    def body(self) -> Body:
        """The identified body."""
        return self.journey.optimum.point.body

    @property
    def ending(self) -> Ending:
        """How the last optimisation ended."""
        return self.journey.optimum.ending

    @property
    def settled(self) -> bool:
        """Whether nothing better is near: the search ended so, or a step promises less than a standard deviation.

        In a valley that the data leave flat a search may go on for ever without a gain that matters.
        """
        optimum = self.journey.optimum
        if optimum.ending.settled or not optimum.foretold:
            return optimum.ending.settled
        return optimum.cost - optimum.foretold[-1] < max(1.0, self.chi2_per_dof)

    @property
    def chi2_per_dof(self) -> float:
        """Of all markers and lengths that were used."""
        dof = sum(left.dof for left in self.remainders) - len(self.values)
        return sum(left.chi2 for left in self.remainders) / max(1, dof)

    @property
    def noise_ratio(self) -> float:
        """Marker noise by fourth differences of the residuals over the stated one; 1 where that cannot be told."""
        return float(np.median(self._noise_ratios)) if len(self._noise_ratios) else 1.0

    @property
    def noise_doubt(self) -> float:
        """Standard deviation of the square of `noise_ratio`, by the scatter of windows; 0 where less than two tell."""
        squares = self._noise_ratios**2
        of_median = np.sqrt(np.pi / 2)
        return float(of_median * squares.std(ddof=1) / np.sqrt(len(squares))) if len(squares) > 1 else 0.0

    @property
    def _noise_ratios(self) -> Float[np.ndarray, " W"]:
        """Of the windows that tell theirs."""
        return np.array([one.noise for one in self.remainders if one.noise is not None]) / self.likelihood.noise

    @property
    def excess(self) -> float:
        """χ²/dof for the noise that the residuals show: 1 says that the model is right, whatever noise was stated."""
        return self.chi2_per_dof / self.noise_ratio**2

    @property
    def explained(self) -> bool:
        """Whether nothing but noise is left."""
        return noise_alone(self.remainders, self.likelihood.noise, self.noise_ratio)

    @property
    def tables(self) -> Float[np.ndarray, "W s s"]:
        """The windows' reduced tables at the optimum."""
        return reduced(self.journey.optimum.tables, self.likelihood.own)

    @property
    def tempered_tables(self) -> Float[np.ndarray, "W s s"]:
        """In units of what is left: the squares over χ²/dof, where that is more than the stated noise."""
        return self.tables / np.sqrt(max(1.0, self.chi2_per_dof))

    @property
    def prior_rows(self) -> Float[np.ndarray, "shared s"]:
        """The prior at the optimum."""
        return self.prior.rows(self.values)

    @property
    def quadratic(self) -> spread.Quadratic:
        """The sum of squares near the optimum."""
        return spread.Quadratic.of(self.tables, self.prior_rows)

    @property
    def covariance(self) -> Float[np.ndarray, "shared shared"]:
        """Nominal: believes model and noise."""
        return self._doubted(self.quadratic.covariance)

    @property
    def tempered_covariance(self) -> Float[np.ndarray, "shared shared"]:
        """The information to rely on where the residual is more than noise: the data's over χ²/dof."""
        return self._doubted(spread.Quadratic.of(self.tempered_tables, self.prior_rows).covariance)

    def _doubted(self, covariance: Float[np.ndarray, "shared shared"]) -> Float[np.ndarray, "shared shared"]:
        if self.doubt is not None:
            covariance[:BODY, :BODY] += self.doubt
        return covariance

    @property
    def sd(self) -> Float[np.ndarray, " shared"]:
        """Nominal standard deviations."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def open_combinations(self) -> tuple[spread.Combination, ...]:
        """The combinations that the data do not determine."""
        return spread.open_combinations(self.covariance, self.plausible, self.names)

    def without(self, dropped: Float[np.ndarray, " shared"]) -> Float[np.ndarray, " shared"]:
        """The estimate with the parameters marked in `dropped` (bool) set to zero, to first order."""
        free = ~np.asarray(dropped, dtype=bool)
        return self.values + self.quadratic.step(free, -self.values)


def fit(
    mechanism: Mechanism,
    windows: Sequence[Window],
    *,
    start: Body | None = None,
    theta_sd: Float[np.ndarray, " theta"] | None = None,
    bounds: tuple[Float[np.ndarray, " theta"], Float[np.ndarray, " theta"]] | None = None,
    hasty: bool = False,
) -> Fit:
    """Fit body (and θ, if the mechanism has effects) to the windows; see the module.

    start: where to begin, the robot's nominal body unless given. theta_sd: standard deviations of a normal prior on θ
    about mechanism.theta, infinite unless given. bounds: lowest and highest θ, held within the fit. hasty: to a
    standard deviation only, and windows that get lost stay so. Noise and resolution are those of the robot's sensors.
    Effects that stretch cables make springs of them (`springs`). Windows that cannot be used are in `unused`. Raises
    RefusedError where none can, or where no motion can be simulated from the start.
    """
    wanted = mechanism.robot.nominal if start is None else start
    body = nearest_possible(wanted)
    spread_of_theta = np.full(mechanism.theta.size, np.inf) if theta_sd is None else np.asarray(theta_sd, dtype=float)
    plausible = np.concatenate([scales(body), spread_of_theta])
    begun = _begun(mechanism, body, windows, plausible)
    prior = Prior(mean=begun.shared, sd=plausible, firm=BODY)
    if bounds is not None:
        unbounded = np.full(BODY, np.inf)
        prior = replace(prior, low=np.concatenate([-unbounded, bounds[0]]), high=np.concatenate([unbounded, bounds[1]]))
    journey = _grown(begun, prior, hasty=hasty)
    if journey is None:
        raise RefusedError(
            "The motion cannot be simulated from the start values.",
            hint="Check geometry and nominal inertia in the robot file.",
        )
    elsewhere = _begun_elsewhere(begun, journey)
    if elsewhere:
        # they were guessed by rests of the body as it was thought to be
        known = _begun(mechanism, nearest_possible(journey.optimum.point.body), windows, plausible)
        again = _grown(known, prior, hasty=hasty)
        if again is not None and _begun_elsewhere(known, again) < elsewhere:
            begun, journey = known, again
    likelihood, simulation = begun.likelihood, journey.optimum.simulation
    return Fit(
        likelihood=likelihood,
        journey=journey,
        start=body,
        start_moved=not can_move(wanted),
        unused=begun.unused,
        misfits=tuple(guess.misfit for guess in begun.guesses),
        remainders=tuple(remainder(likelihood, simulation, w) for w in range(len(likelihood.recordings))),
        prior=prior.loosened(1.0 if float(journey.ends.max()) < EARLY else FAR_PRIOR),
        plausible=plausible,
        names=names_of(mechanism),
    )


def _grown(begun: "_Begun", prior: Prior, *, hasty: bool) -> Journey | None:
    free = np.ones(len(begun.shared), dtype=bool)
    start = Point(begun.shared, begun.likelihood.guesses)
    last = ON_THE_WAY if hasty else FINAL
    return grow(begun.likelihood, start, prior, free, last=last, once=hasty, near=start.body)


def _begun_elsewhere(begun: "_Begun", journey: Journey) -> int:
    """How many windows whose orientation nobody read begin in a pose from which a cable is slack at once."""
    return sum(begun.guesses[w].is_open and time < TRUSTED for w, (time, _) in journey.slack.items())


@dataclass(frozen=True, eq=False)
class _Begun:
    """A likelihood with the shared parameters at which its guesses were made."""

    likelihood: Likelihood
    shared: Float[np.ndarray, " shared"]
    guesses: tuple[Guess, ...]
    unused: dict[str, str]


def _begun(mechanism: Mechanism, body: Body, windows: Sequence[Window], plausible: np.ndarray) -> _Begun:
    """Where the search begins; with springs of unknown stiffness, where the first horizon is followed best."""
    made = with_springs(mechanism)
    tries: list[tuple[float, _Begun]] = []
    thetas = springs.starts(mechanism)
    for theta in thetas:
        recordings, guesses, unused = _guessed(made, body, windows, theta)
        shared = np.concatenate([body.vector, theta])
        likelihood = likelihood_of(made, shared, recordings, guesses, made.robot.sensors)
        begun = _Begun(likelihood, shared, guesses, unused)
        if len(thetas) == 1:
            return begun
        start, ends = Point(shared, likelihood.guesses), np.full(len(recordings), HORIZONS[0])
        ends = np.minimum(ends, [recording.end for recording in recordings])
        free = np.ones(len(shared), dtype=bool)
        found = optimise(likelihood, start, ends, Prior(shared, plausible), ROUGH, free)
        tries.append((np.inf if found is None else found.cost, begun))
    return min(tries, key=lambda each: each[0])[1]


def likelihood_of(
    mechanism: Mechanism,
    shared: Float[np.ndarray, " shared"],
    recordings: tuple[FollowedSamples, ...],
    guesses: Sequence[Guess],
    sensors: Sensors,
) -> Likelihood:
    """What was recorded, with the noise of the sensors, and the first guesses made whole."""
    begins = np.array([recording.begin for recording in recordings])
    states = replace(as_states(guesses), body_changes=body_changes(recordings))
    states = tied(mechanism, shared, states, begins) if mechanism.springs else states
    if reads_rates(mechanism):
        return RateLikelihood(mechanism, recordings, states, sensors.gyro_noise, sensors.encoder_resolution)
    shapes = noise_shapes([(recording.t, recording.markers) for recording in recordings], sensors.marker_noise)
    return Likelihood(
        mechanism,
        tuple(replace(recording, evening=shape) for recording, shape in zip(recordings, shapes, strict=True)),
        states,
        sensors.marker_noise,
        sensors.encoder_resolution,
        spring_prior(mechanism, shared, states, recordings),
    )


def names_of(mechanism: Mechanism) -> tuple[str, ...]:
    """Of the shared parameters; an effect's parameter is a name or a record with one."""
    return (*PARAMETER_NAMES, *(str(getattr(p, "name", p)) for effect in mechanism.effects for p in effect.parameters))


def _guessed(
    mechanism: Mechanism, body: Body, windows: Sequence[Window], theta: Float[np.ndarray, " theta"]
) -> tuple[tuple[FollowedSamples, ...], tuple[Guess, ...], dict[str, str]]:
    """Recordings with their first guesses, and the windows that have none."""
    recordings: list[FollowedSamples] = []
    unused: dict[str, str] = {}
    for window in windows:
        try:
            recordings.append(prepare(window, mechanism.robot, rates=reads_rates(mechanism)))
        except RefusedError as refusal:
            unused[window.id] = str(refusal)
    found = first_guesses(mechanism, body, recordings, theta)
    guesses = tuple(guess for guess in found if isinstance(guess, Guess))
    kept = tuple(recording for recording, guess in zip(recordings, found, strict=True) if isinstance(guess, Guess))
    refused = zip(recordings, found, strict=True)
    unused |= {one.window.id: str(refusal) for one, refusal in refused if isinstance(refusal, RefusedError)}
    if not kept:
        reasons = together(unused) or "there is none"
        raise RefusedError(f"No window of role 'identify' can be used: {reasons}")
    return kept, guesses, unused
