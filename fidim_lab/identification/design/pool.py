"""Random windows that obey all limits, and the dozen of them that is best by exchange: where descents begin.

C of a set of windows depends on the sum of their 10 × 10 tables W′ᵀW′ alone, so exchanging costs next to nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.design.limits import worst_of_kinds
from fidim_lab.identification.design.motions import simulate
from fidim_lab.identification.design.task import DesignTask
from fidim_lab.identification.design.windows import Placed, place
from fidim_lab.identification.workspace import Workspace, rest_near
from fidim_lab.model.free_motion import conditioning, marker_selector
from fidim_lab.model.mechanism import Mechanism

AMPLITUDES = (0.095, 0.075, 0.055, 0.04, 0.028)
"""m: the largest that obeys the limits is taken"""
TOGETHER = 24
"""places whose motions are simulated at once"""
INSIDE, DEPTH = 0.8, (0.3, 1.1)
"""part of the anchors' box, and depths below it in the workspace's scale, from which places are drawn"""
MOST_DRAWS = 60
"""for each window wanted"""
PASSES = 6

Tables = Float[np.ndarray, "K 10 10"]
Judge = Callable[[Float[np.ndarray, "K m m"]], Float[np.ndarray, " K"]]
"""criterion of K sums of tables"""


@dataclass(frozen=True, eq=False)
class Pool:
    """K windows within all limits."""

    z: Float[np.ndarray, "K z"]
    tables: Float[np.ndarray, "K m m"]
    """what each adds to the criterion's matrix"""


def draw(
    mechanism: Mechanism, task: DesignTask, wanted: int, rng: np.random.Generator, say: Callable[[int], None]
) -> Pool:
    """`wanted` random windows within the limits; `say` hears how many there are.

    Raises InfeasibleError where hardly any place obeys them.
    """
    found: list[np.ndarray] = []
    tables: list[np.ndarray] = []
    drawn = 0
    while len(found) < wanted and drawn < MOST_DRAWS * wanted:
        rests = _rests(mechanism, task, rng)
        drawn += TOGETHER
        for z, table in _largest(mechanism, task, rests):
            found.append(z)
            tables.append(table)
        say(min(len(found), wanted))
    if len(found) < task.equilibria:
        raise InfeasibleError(
            f"Of {drawn} random places {len(found)} allow a swing within the limits; {task.equilibria} are needed.",
            hint="Widen the limits in the robot file, or ask for fewer equilibria.",
        )
    return Pool(np.array(found[:wanted]), np.array(tables[:wanted]))


def paper_criterion(sums: Tables) -> Float[np.ndarray, " K"]:
    """C of K sums of W′ᵀW′."""
    values = np.linalg.eigvalsh(sums)
    return (np.sqrt(values[:, -1]) + 1) / np.sqrt(np.maximum(values[:, 1], 1e-300))


def exchange(pool: Pool, count: int, judge: Judge, rng: np.random.Generator) -> Float[np.ndarray, "W z"]:
    """From `count` random windows of the pool: each in turn is exchanged for the one that lowers the criterion most."""
    chosen = rng.choice(len(pool.z), count, replace=False)
    best = float(judge(pool.tables[chosen].sum(axis=0)[np.newaxis])[0])
    for _ in range(PASSES):
        before = best
        for k in rng.permutation(count):
            others = pool.tables[np.delete(chosen, k)].sum(axis=0)
            values = judge(others + pool.tables)
            values[np.delete(chosen, k)] = np.inf
            chosen[k], best = int(np.argmin(values)), float(values.min())
        if best > 0.999 * before:
            break
    return pool.z[chosen]


def _rests(mechanism: Mechanism, task: DesignTask, rng: np.random.Generator) -> list[tuple[np.ndarray, Placed]]:
    """Random rests within the limits, each with a random direction to displace it."""
    space, robot = Workspace(task.robot), task.robot
    found: list[tuple[np.ndarray, Placed]] = []
    for _ in range(TOGETHER):
        aside, depth, angle = INSIDE * rng.uniform(-1, 1, 3), rng.uniform(*DEPTH), rng.uniform(-np.pi, np.pi)
        direction = np.array([np.cos(angle), np.sin(angle)])[: len(task.axes)]
        try:
            rest = rest_near(mechanism, space.place(aside, depth))
            at = place(mechanism, task, np.concatenate([rest.lengths, np.zeros(len(task.axes))]))
        except InfeasibleError:
            continue
        tension = robot.mass * at.held
        xi = mechanism.structure_matrix(at.rest.position[np.newaxis], at.rest.rotation[np.newaxis])
        bad = conditioning(xi, marker_selector(at.rest.rotation[np.newaxis], robot.marker, task.axes))[0]
        if (
            robot.limits.tension[0] < tension.min()
            and tension.max() < robot.limits.tension[1]
            and bad < task.conditioning
        ):
            found.append((np.concatenate([rest.lengths, direction]), at))
    return found


def _largest(
    mechanism: Mechanism, task: DesignTask, rests: list[tuple[np.ndarray, Placed]]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """(z, table) of the largest displacement within the limits of each rest that has one."""
    n, left = task.robot.n, rests
    found: list[tuple[np.ndarray, np.ndarray]] = []
    for amplitude in AMPLITUDES:
        tried: list[tuple[np.ndarray, Placed]] = []
        for z, at in left:
            moved = np.concatenate([z[:n], amplitude * z[n:]])
            try:
                tried.append((moved, place(mechanism, task, moved, at)))
            except InfeasibleError:
                continue
        if not tried:
            continue
        # one size of batch: each has a compiled loop of its own
        padded = [placed for _, placed in tried] + [tried[0][1]] * (TOGETHER - len(tried))
        motions = simulate(mechanism, task, padded)
        with np.errstate(invalid="ignore"):
            good = worst_of_kinds(motions).max(axis=1) <= 0
        W = motions.regressors[:, motions.sampled].reshape(len(padded), -1, 10)
        accepted = [k for k in range(len(tried)) if good[k]]
        found.extend((tried[k][0], W[k].T @ W[k]) for k in accepted)
        done = {tried[k][0][:n].tobytes() for k in accepted}
        left = [(z, at) for z, at in left if z[:n].tobytes() not in done]
    return found
