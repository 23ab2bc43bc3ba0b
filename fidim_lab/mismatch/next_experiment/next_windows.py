"""Windows to record next: `to_separate` for effects that cannot be told apart, `to_know` for the body.

Both look at random windows that obey all the robot's limits, and the winches' where they are given. `compare` and
`fidim design --after` ask here.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Campaign, Role, Window
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.design import pool
from fidim_lab.identification.design.information import information
from fidim_lab.identification.design.next_window import NextWindow, next_window
from fidim_lab.identification.design.task import Criterion, DesignTask
from fidim_lab.identification.design.windows import place
from fidim_lab.identification.mle.starts.possible import scales
from fidim_lab.mismatch.next_experiment.proposal import Claim, Odds, Proposal, ProposedTrial
from fidim_lab.mismatch.next_experiment.separate import KnownRobot, completed, separating, with_markers
from fidim_lab.mismatch.next_experiment.thresholds import NEXT_EXPERIMENT
from fidim_lab.model.mechanism import Mechanism

Reach = Sequence[tuple[float, float]]
"""m, the shortest and longest length of each cable that its winch allows"""


def to_separate(
    campaign: Campaign,
    claims: Sequence[Claim],
    body: Float[np.ndarray, "9"] | None = None,
    *,
    noise: float = 1.0,
    seed: int = 1,
    more: int = 3,
    more_markers: bool = True,
    reach: Reach | None = None,
    native: bool = True,
) -> tuple[Proposal, ...]:
    """For each claim the windows that tell it from its rivals; with three markers where one is not enough.

    campaign: what has been recorded. body: nine base parameters as identified. noise: √(χ²/dof) of the completed model.
    more: windows at most, with the markers that there are.
    more_markers: whether markers may be asked for that the platform does not carry (a person has to mount them).
    Rivals are those of the claim and all others that the recorded windows leave open. A proposal whose `separates` is
    False says that no window of the pool does, with any of these sensors, or why there are no odds. Raises SetupError
    for robots that windows cannot be designed for, InfeasibleError where hardly any obeys the limits.
    """
    robot = campaign.robot
    task = DesignTask(robot, equilibria=1, native=native)
    mechanism = task.mechanism()
    recorded = _recorded(mechanism, task, campaign)
    trials = [_trial(mechanism, task, z) for z in _pool(mechanism, task, seed, reach).z]
    known = KnownRobot(robot, recorded, body, noise, native)
    return tuple(_proposed(known, claim, trials, more, more_markers=more_markers) for claim in claims)


def to_know(
    campaign: Campaign,
    body: Float[np.ndarray, "9"] | None = None,
    *,
    criterion: Criterion = Criterion.A,
    seed: int = 1,
    reach: Reach | None = None,
    native: bool = True,
) -> NextWindow:
    """The window that shrinks the covariance of the body most, given the windows there are and what is plausible.

    body: nine base parameters as identified; nominal without. Raises as `to_separate`.
    """
    task = DesignTask(campaign.robot, equilibria=1, criterion=criterion, native=native)
    mechanism = task.mechanism()
    placed = [place(mechanism, task, z) for z in _seen(task, campaign)]
    if not placed:
        raise InfeasibleError(
            "No window of the campaign determines lengths, marker and equilibrium: nothing can be proposed yet."
        )
    # with what is plausible beforehand: one or two windows alone may leave a direction without any information
    known = information(mechanism, task, placed, body).sum(axis=0) + np.diag(scales(campaign.robot.nominal) ** -2.0)
    return next_window(mechanism, task, np.linalg.inv(known), _pool(mechanism, task, seed, reach), body)


def _proposed(
    known: KnownRobot, claim: Claim, trials: Sequence[ProposedTrial], more: int, *, more_markers: bool
) -> Proposal:
    """For one claim; with more windows and three markers where that is much better than what it has."""
    try:
        if known.recorded:
            claim = completed(known, claim)
        first = separating(known, claim, trials, more=more)
    except InfeasibleError as refusal:
        return Proposal(claim, (), Odds("", 0.0, 0.0), (), len(known.robot.markers), refusal=refusal.message)
    if first.separates or not more_markers:
        return first
    marked = replace(known, marked=with_markers(known.robot))
    better = separating(marked, claim, trials, more=NEXT_EXPERIMENT.most_windows)
    return better if better.after[-1].non_centrality > 2 * first.after[-1].non_centrality else first


def _pool(mechanism: Mechanism, task: DesignTask, seed: int, reach: Reach | None) -> pool.Pool:
    drawn = pool.draw(
        mechanism, task, NEXT_EXPERIMENT.next_windows_pool, np.random.default_rng([seed, 3]), lambda _: None
    )
    if reach is None:
        return drawn
    low, high = np.array(reach).T
    lengths = drawn.z[:, : task.robot.n]
    there = ((lengths >= low) & (lengths <= high)).all(axis=1)
    if not there.any():
        raise InfeasibleError(
            f"Of {len(there)} random windows within the robot's limits none is within those of the winches.",
            hint="Compare length_limits in the rig file with the robot's workspace.",
        )
    return pool.Pool(drawn.z[there], drawn.tables[there])


def _trial(mechanism: Mechanism, task: DesignTask, z: np.ndarray) -> ProposedTrial:
    return ProposedTrial(z[: task.robot.n], z[task.robot.n :], place(mechanism, task, z).start)


def _recorded(mechanism: Mechanism, task: DesignTask, campaign: Campaign) -> list[ProposedTrial]:
    return [_trial(mechanism, task, z) for z in _seen(task, campaign)]


def _seen(task: DesignTask, campaign: Campaign) -> list[Float[np.ndarray, " z"]]:
    """Lengths and displacement of each window that was recorded to identify from, as they were."""
    found = (_unknowns(task, window) for window in campaign.of_role(Role.IDENTIFY))
    return [z for z in found if z is not None]


def _unknowns(task: DesignTask, window: Window) -> Float[np.ndarray, " z"] | None:
    if window.lengths is None or window.equilibrium is None:
        return None
    there = np.flatnonzero(np.isfinite(window.markers[:, 0]).all(axis=1))
    lengths = np.nanmean(window.lengths, axis=0)
    if not len(there) or not np.isfinite(lengths).all():
        return None
    away = window.markers[there, 0][:, list(task.axes)] - window.equilibrium[list(task.axes)]
    # where it swings through its largest displacement it is nearly at rest, as where it was let go
    return np.concatenate([lengths, away[int(np.argmax(np.linalg.norm(away, axis=1)))]])
