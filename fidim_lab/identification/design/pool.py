"""Random windows that obey all limits, and the best dozen of them by exchange: the start of descents.

C of a set of windows depends on the sum of their 10 × 10 tables W′ᵀW′ alone, so exchanging costs next to nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.design.limits import worst_of_kinds
from fidim_lab.identification.design.motions import Motions, simulate
from fidim_lab.identification.design.task import DesignTask
from fidim_lab.identification.design.windows import Neighbour, ReleasedWindow, place, rest_beside
from fidim_lab.identification.workspace import Workspace, rest_near
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import conditioning, marker_selector

LEAST = 0.028
"""m: a place that does not allow a displacement of so much is of no use"""
SHARES = (0.95, 0.7, 0.45)
"""of the displacement that would be allowed if all grew in proportion to it; the first that is allowed is taken"""
TOGETHER, FEW = 24, 6
"""motions that are simulated at once: few sizes of batch, since each has a compiled loop of its own"""
INSIDE, DEPTH = 0.8, (0.3, 1.1)
"""part of the anchors' box, and depths below it in the workspace's scale, from which places are drawn"""
KNOWN, BESIDE, ASIDE = 6, 0.8, 0.15
"""once so many windows are known, this share of draws is beside one of them, by up to this many m of each cable"""
MOST_DRAWS = 100
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


@dataclass(frozen=True, eq=False)
class _Swing:
    """A displacement of a place within the limits at rest."""

    lengths: np.ndarray
    direction: np.ndarray
    size: float
    placed: ReleasedWindow
    resting: Float[np.ndarray, "4"]
    """how far at rest beyond the limits of each kind: negative"""

    @property
    def z(self) -> np.ndarray:
        return np.concatenate([self.lengths, self.size * self.direction])


def draw(
    mechanism: Mechanism, task: DesignTask, wanted: int, rng: np.random.Generator, say: Callable[[int], None]
) -> Pool:
    """`wanted` random windows within the limits; `say` hears how many there are.

    Raises InfeasibleError where hardly any place obeys them.
    """
    found: list[tuple[_Swing, np.ndarray]] = []
    waiting: list[_Swing] = []
    drawn = 0
    while len(found) < wanted and drawn < MOST_DRAWS * wanted:
        drawn += 1
        swing = _drawn(mechanism, task, [swing for swing, _ in found], rng)
        if swing is not None:
            waiting.append(swing)
        if len(waiting) == TOGETHER or (waiting and drawn == MOST_DRAWS * wanted):
            found.extend(_largest(mechanism, task, waiting))
            waiting = []
            say(min(len(found), wanted))
    if len(found) < task.equilibria:
        raise InfeasibleError(
            f"Of {drawn} random places {len(found)} allow a swing within the limits; {task.equilibria} are needed.",
            hint="Check the robot file first (units, mass, body, geometry): fidim doctor --robot FILE. Where it finds "
            "nothing, ask for fewer equilibria, or widen the limits as far as the machine itself allows.",
        )
    chosen = found[:wanted]
    return Pool(np.array([swing.z for swing, _ in chosen]), np.array([table for _, table in chosen]))


def tabled(mechanism: Mechanism, task: DesignTask, z: Float[np.ndarray, "K z"]) -> Pool:
    """The windows of these that obey all limits, with their tables."""
    tables, beyond = judged(mechanism, task, [place(mechanism, task, one) for one in z])
    kept = beyond.max(axis=1) <= 0
    return Pool(z[kept], tables[kept])


def paper_criterion(sums: Tables) -> Float[np.ndarray, " K"]:
    """C of K sums of W′ᵀW′."""
    values = np.linalg.eigvalsh(sums)
    return (np.sqrt(values[:, -1]) + 1) / np.sqrt(np.maximum(values[:, 1], 1e-300))


def exchange(pool: Pool, count: int, judge: Judge, rng: np.random.Generator) -> Int[np.ndarray, " W"]:
    """Which windows: `count` random ones, each in turn exchanged for the one that lowers the criterion most."""
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
    return chosen


def _drawn(mechanism: Mechanism, task: DesignTask, known: list[_Swing], rng: np.random.Generator) -> _Swing | None:
    """A random rest within the limits, displaced a little in a random direction; None where that cannot be."""
    angle = rng.uniform(-np.pi, np.pi)
    direction = np.array([np.cos(angle), np.sin(angle)])[: len(task.axes)]
    try:
        lengths, (rest, held) = _rest(mechanism, task, known, rng)
        resting = _resting(mechanism, task, rest.position, rest.rotation, held)
        if resting.max() >= 0:
            return None
        placed = place(mechanism, task, np.concatenate([lengths, LEAST * direction]), (rest, held))
    except InfeasibleError:
        return None
    return _Swing(lengths, direction, LEAST, placed, resting)


def _rest(
    mechanism: Mechanism, task: DesignTask, known: list[_Swing], rng: np.random.Generator
) -> tuple[np.ndarray, Neighbour]:
    """Anywhere in the workspace, or, cheaper and more often within the limits, beside a place that is known."""
    if len(known) >= KNOWN and rng.uniform() < BESIDE:
        chosen = known[rng.integers(len(known))]
        lengths = chosen.lengths + ASIDE * rng.uniform(-1, 1, task.robot.n)
        return lengths, rest_beside(mechanism, task, lengths, chosen.placed.resting)
    aside, depth = INSIDE * rng.uniform(-1, 1, 3), rng.uniform(*DEPTH)
    rest = rest_near(mechanism, Workspace(task.robot).place(aside, depth))
    return rest.lengths, (rest.pose, rest.tensions)


def _resting(
    mechanism: Mechanism, task: DesignTask, position: np.ndarray, rotation: np.ndarray, held: np.ndarray
) -> Float[np.ndarray, "4"]:
    """`worst_of_kinds` of a platform that does not move."""
    low, high = task.robot.limits.tension
    tension = task.robot.mass * held
    xi = mechanism.structure_matrix(position[np.newaxis], rotation[np.newaxis])
    bad = conditioning(xi, marker_selector(rotation[np.newaxis], task.robot.marker, task.axes))[0]
    return np.array(
        [
            (low - tension.min()) / (high - low),
            (tension.max() - high) / (high - low),
            -1.0,
            np.log(bad) / np.log(task.conditioning) - 1.0,
        ]
    )


def _largest(mechanism: Mechanism, task: DesignTask, swings: list[_Swing]) -> list[tuple[_Swing, np.ndarray]]:
    """Each that obeys the limits, displaced about as far as they allow, with its table."""
    tables, beyond = judged(mechanism, task, [swing.placed for swing in swings])
    found = [(swing, tables[k]) for k, swing in enumerate(swings) if beyond[k].max() <= 0]
    grown = [b - swing.resting for swing, b in zip(swings, beyond, strict=True)]
    allowed = [s.size * float((-s.resting / g.clip(1e-6)).min()) for s, g in zip(swings, grown, strict=True)]
    allowed = [size for size, b in zip(allowed, beyond, strict=True) if b.max() <= 0]
    left = list(range(len(found)))
    for share in SHARES:
        tried = [(k, _enlarged(mechanism, task, found[k][0], share * allowed[k])) for k in left]
        possible = [(k, swing) for k, swing in tried if swing is not None]
        tables, beyond = judged(mechanism, task, [swing.placed for _, swing in possible], FEW)
        for (k, swing), table, b in zip(possible, tables, beyond, strict=True):
            if b.max() <= 0:
                found[k] = (swing, table)
                left.remove(k)
    return found


def _enlarged(mechanism: Mechanism, task: DesignTask, swing: _Swing, size: float) -> _Swing | None:
    """The same displaced farther; None where that is less, or cannot be."""
    if size <= swing.size:
        return None
    try:
        z = np.concatenate([swing.lengths, size * swing.direction])
        placed = place(mechanism, task, z, swing.placed.resting)
    except InfeasibleError:
        return None
    return _Swing(swing.lengths, swing.direction, size, placed, swing.resting)


def judged(
    mechanism: Mechanism, task: DesignTask, placed: list[ReleasedWindow], together: int = TOGETHER
) -> tuple[Float[np.ndarray, "K 10 10"], Float[np.ndarray, "K 4"]]:
    """W′ᵀW′ of each motion, and how far beyond its limits it goes (infinite where it breaks down)."""
    tables, beyond = np.zeros((len(placed), 10, 10)), np.full((len(placed), 4), np.inf)
    for first in range(0, len(placed), together):
        some = placed[first : first + together]
        figures = _figures(simulate(mechanism, task, some + [some[0]] * (together - len(some))))
        here = slice(first, first + len(some))
        tables[here], beyond[here] = (values[: len(some)] for values in figures)
    return tables, beyond


def _figures(motions: Motions) -> tuple[Float[np.ndarray, "W 10 10"], Float[np.ndarray, "W 4"]]:
    with np.errstate(invalid="ignore"):
        beyond = np.nan_to_num(worst_of_kinds(motions), nan=np.inf)
    W = motions.regressors[:, motions.sampled].reshape(len(beyond), -1, 10)
    with np.errstate(over="ignore", invalid="ignore"):  # of motions that break down, which are beyond every limit
        return np.swapaxes(W, 1, 2) @ W, beyond
