"""One body and one geometry fitted to several campaigns at once.

Every campaign is fitted alone first. Their linearised problems, each at its own optimum, give the point that serves all
best; from there all windows are fitted together. Where that loses the phase of a window, the horizon grows again.

Where the model misses more of a window than noise, that window's squares are divided by the χ²/dof that they leave:
its noise is as large as what is left, and found with the fit. So a millimetre that the model cannot follow is no
measurement of an anchor to a micrometre, and a window with a marker that jumps does not outvote the others. A usual
survey's factor is chosen by evidence where no file states one.

Friction may be at each joint of a cable: where it is tied to the platform, at its pulley's swivel, at the wrap. All of
them are fitted, then those that the evidence can do without are left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from fidim_lab.data.records import Body, Role
from fidim_lab.effects.dissipation.attachment_friction import AttachmentFriction
from fidim_lab.effects.dissipation.pulley_friction import PulleyFriction, SwivelDamping, SwivelFriction
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.errors import RefusedError
from fidim_lab.identification.joint.found import JointFit
from fidim_lab.identification.joint.members import JointMember, Layout, lay_out
from fidim_lab.identification.joint.search import JointOptimum, linear_tables, search
from fidim_lab.identification.joint.sharing import Common
from fidim_lab.identification.mle.evidence import FACTORS, SAME, over_factors
from fidim_lab.identification.mle.fit import Fit, fit
from fidim_lab.identification.mle.judge import Remainder
from fidim_lab.identification.mle.starts.possible import nearest_possible, scales
from fidim_lab.identification.mle.trajectories.likelihood import Likelihood, Point, Simulation, simulate, stepped
from fidim_lab.identification.mle.trajectories.normal import Part, Prior, Tables, step_of_parts
from fidim_lab.identification.mle.trajectories.optimise import DAMPING, ON_THE_WAY, Effort
from fidim_lab.identification.mle.trajectories.stages import FAR_PRIOR, is_lost
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.model.sensitivity.grid import FINE, QUICK
from fidim_lab.model.sensitivity.integrate import States

HORIZONS = (1.0, 3.0, 10.0)
"""s, by which the way is taken again where a window got lost; starts are known well by then"""
ROUND = replace(ON_THE_WAY, promise=1e-1, haste=20.0)
"""to a third of a standard deviation; where the model is wrong to 2 of χ²: the quick grid feigns a gain of 1.5"""
LAST = replace(ROUND, promise=1e-3, haste=2e3)
"""to a thirtieth of a standard deviation where the model is right; as `ROUND` where it is wrong: of sixty real takes
the best fit on the fine grid is within 0.05 of the stated standard deviations, and costs three times as much"""
FRICTION: tuple[NamedEffect, ...] = (AttachmentFriction(), SwivelFriction(), SwivelDamping(), PulleyFriction())
"""at the joints of a cable, alike for all cables"""
ROUNDS = 3
"""of choosing χ²/dof and the survey's factor, and fitting again; both settle in two"""
COARSE = 10.0
"""χ²/dof beyond which the grid for the way is fine enough: its error is a thousandth of what the model misses"""
SETTLED = 1.3
"""times, by which the χ²/dof of no window changes any more; standard deviations change by less than its root"""


@dataclass(frozen=True, eq=False)
class Alone:
    """A campaign fitted by itself."""

    found: Fit
    """its geometry as in the file, and only to a standard deviation: where the joint fit begins"""
    member: JointMember


def alone(common: Common, *, native: bool) -> tuple[Alone, ...]:
    """Each campaign by itself. Raises RefusedError as `mle.fit`."""
    found: list[Alone] = []
    for campaign in common.campaigns:
        windows = list(campaign.of_role(Role.IDENTIFY))
        if not windows:
            raise RefusedError(
                f"{campaign.name}: no window has the role 'identify'.",
                hint="Give some windows of campaign.toml the role 'identify', or leave this campaign out.",
            )
        single = fit(Mechanism(campaign.robot, native=native), windows, hasty=True)
        member = JointMember(campaign, single.likelihood, single.journey.ends, _worth(single.remainders))
        found.append(Alone(single, member))
    return tuple(found)


def fit_jointly(
    common: Common, singles: Sequence[Alone], effects: Sequence[NamedEffect] = (), *, native: bool = False
) -> JointFit:
    """Fit all campaigns together; see the module.

    effects: what may dissipate, alike in all of them; left out where the recordings do not ask for it.
    Raises RefusedError where no motion can be simulated from the start.
    """
    every = range(len(common.campaigns))
    layout = lay_out(common, every, effects, native=native)
    members = tuple(one.member.by(mechanism) for one, mechanism in zip(singles, layout.mechanisms, strict=True))
    body = nearest_possible(common.campaigns[0].robot.nominal)
    task = _Task(tuple(every), layout, members, body)
    found = _settled(task, _combined(task, [one.found for one in singles]))
    while len(asked_for := found.asked_for) < len(found.layout.effects):
        found = _again(common, found, every, asked_for, LAST, native=native)
    return found


def fit_some(common: Common, whole: JointFit, chosen: Sequence[int], *, native: bool = False) -> JointFit:
    """The fit of some of the campaigns, begun where the whole would be without the others to first order."""
    return _again(common, whole, chosen, whole.layout.effects, ROUND, native=native)


def _again(
    common: Common,
    whole: JointFit,
    chosen: Sequence[int],
    effects: Sequence[NamedEffect],
    last: Effort,
    *,
    native: bool,
) -> JointFit:
    """Some of the campaigns with some of the effects, begun where the whole would be to first order."""
    layout = lay_out(common, chosen, effects, native=native)
    members = tuple(whole.members[k].by(m) for k, m in zip(chosen, layout.mechanisms, strict=True))
    task = _Task(tuple(chosen), layout, members, whole.start)
    each = zip(whole.layout.effects, whole.layout.of_effects, strict=True)
    kept = np.ones(whole.layout.size, dtype=bool)
    for place in (place for effect, place in each if effect not in effects):
        kept[place] = False
    optimum = whole.optimum
    begun = [
        _Begun(whole.members[k].likelihood, optimum.simulations[k], optimum.tables[k], kept[whole.layout.places[k]])
        for k in chosen
    ]
    return _settled(task, _together(task, begun, whole.factor), whole.factor, last)


@dataclass(frozen=True, eq=False)
class _Task:
    chosen: tuple[int, ...]
    layout: Layout
    members: tuple[JointMember, ...]
    body: Body
    """where the search begins"""

    def prior(self, factor: float) -> Prior:
        return self.layout.prior(self.body.vector, FAR_PRIOR * scales(self.body), factor)


def _settled(
    task: _Task, start: tuple[np.ndarray, Sequence[States]], factor: float = 1.0, last: Effort = LAST
) -> JointFit:
    """The optimum with the windows' χ²/dof and the survey's factor that it has itself; last: how exact it is."""
    effort, rounds = ROUND, 1
    while True:
        prior = task.prior(factor)
        optimum = _fitted(task, start, prior, effort)
        if optimum is None:
            names = ", ".join(member.campaign.name for member in task.members)
            raise RefusedError(
                f"The motion of {names} cannot be simulated with one body and one geometry.",
                hint="Identify them one by one, and compare robot files and frames.",
            )
        left = optimum.remainders(task.members)
        found = JointFit(task.chosen, task.layout, task.members, optimum, task.body, prior, factor, left)
        each = zip(task.members, left, _astray(task.members, optimum), strict=True)
        weighed = tuple(replace(m, worth=_worth(of_one), astray=lost) for m, of_one, lost in each)
        moved = [np.abs(np.log(new.worth / old.worth)).max() for new, old in zip(weighed, task.members, strict=True)]
        best = _best_factor(found) if any(piece.guessed for piece in task.layout.pieces) else 1.0
        same = max(moved) < np.log(SETTLED) and 1 / SAME < best / factor < SAME
        if (same and found.settled and (effort is last or not found.explained)) or rounds == ROUNDS:
            return found
        task, factor, start = replace(task, members=weighed), best, (optimum.shared, optimum.states)
        rounds += 1
        effort = last if same or rounds == ROUNDS else ROUND


def _worth(remainders: Sequence[Remainder]) -> Float[np.ndarray, " W"]:
    """Of windows whose noise is as large as what is left of them, and no smaller than stated."""
    return np.array([1.0 / max(1.0, left.chi2_per_dof) for left in remainders])


def _fitted(
    task: _Task, start: tuple[np.ndarray, Sequence[States]], prior: Prior, effort: Effort
) -> JointOptimum | None:
    """At full length; by growing horizons where a window gets lost."""
    usual = 1.0 / float(np.median(np.concatenate([member.worth for member in task.members])))
    effort = replace(effort, resolution=FINE) if usual < COARSE else effort
    found = search(task.members, task.layout, start, np.inf, prior, effort)
    if found is not None and not _lost(task.members, found):
        return found
    for horizon in HORIZONS:
        on_the_way = search(task.members, task.layout, start, horizon, prior, ON_THE_WAY)
        if on_the_way is None:
            return found
        start = (on_the_way.shared, on_the_way.states)
    again = search(task.members, task.layout, start, np.inf, prior, effort)
    return min((one for one in (found, again) if one is not None), key=lambda one: one.cost, default=None)


def _lost(members: Sequence[JointMember], found: JointOptimum) -> bool:
    """Whether a window got lost that may be found again."""
    return any(of_one - m.astray for m, of_one in zip(members, _astray(members, found), strict=True))


def _astray(members: Sequence[JointMember], found: JointOptimum) -> list[frozenset[int]]:
    each = zip(members, found.simulations, strict=True)
    return [frozenset(w for w in range(len(m.ends)) if is_lost(m.likelihood, one, w)) for m, one in each]


@dataclass(frozen=True, eq=False)
class _Begun:
    """One campaign linearised at a point of its own."""

    likelihood: Likelihood
    simulation: Simulation
    tables: Tables
    """each window's weighed by what it is worth"""
    kept: Bool[np.ndarray, " local"]
    """which of its shared parameters the task has; the others become zero"""


def _combined(task: _Task, fits: Sequence[Fit]) -> tuple[np.ndarray, list[States]]:
    """The point that serves all campaigns best to first order, each linearised at its own optimum."""
    begun: list[_Begun] = []
    for found, member, place in zip(fits, task.members, task.layout.places, strict=True):
        local = np.concatenate([found.values[:BODY], np.zeros(len(place) - BODY)])
        point = Point(local, found.journey.optimum.point.states)
        simulation = simulate(member.likelihood, point, member.ends, QUICK)
        if simulation is None:
            raise RefusedError(f"{member.campaign.name}: its motion cannot be simulated.")
        tables = linear_tables(member, simulation)
        begun.append(_Begun(member.likelihood, simulation, tables, np.ones(len(place), dtype=bool)))
    return _together(task, begun, 1.0)


def _together(task: _Task, begun: Sequence[_Begun], factor: float) -> tuple[np.ndarray, list[States]]:
    """One step from points with parameters of their own to the best common ones."""
    parts: list[Part] = []
    for one, place in zip(begun, task.layout.places, strict=True):
        tables, own = one.tables.copy(), one.likelihood.own
        tables[:, :, -1] -= tables[:, :, own:-1] @ one.simulation.point.shared
        columns = np.concatenate([np.ones(own, dtype=bool), one.kept, [True]])
        parts.append(Part(tables[:, :, columns], own, place))
    prior, nowhere = task.prior(factor), np.zeros(task.layout.size)
    free = np.ones(task.layout.size, dtype=bool)
    steps, shared, _ = step_of_parts(parts, prior.rows(nowhere), DAMPING[0], free, prior.room(nowhere))
    states: list[States] = []
    for one, own, place in zip(begun, steps, task.layout.places, strict=True):
        there = np.zeros(len(one.kept))
        there[one.kept] = shared[place]
        states.append(stepped(one.likelihood, one.simulation, own, there - one.simulation.point.shared).states)
    return shared, states


def _best_factor(found: JointFit) -> float:
    """Times a usual survey, by the evidence of the linearised problem."""
    problem = found.linearised()
    evidences = np.zeros(len(FACTORS))
    for k, factor in enumerate(FACTORS):
        there, temper = problem.settled(found.prior_sd(factor))
        evidences[k] = there.nats(temper)
    return float(FACTORS[over_factors(evidences)[1]])
