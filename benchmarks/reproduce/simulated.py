"""The paper's experiment repeated on campaigns whose truth is the paper's result.

`optimised_windows` are Table 2 with Table 3; `read` is one identification in the paper's form or ours;
`essential_difference` is Eq. 48–49; `sigma_perps` is Fig. 3. Nothing here simulates: campaigns come from outside.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.reproduce import paper
from fidim_lab.data.records import Body, Campaign, PlannedWindow, Robot, Role
from fidim_lab.errors import FidimError
from fidim_lab.identification.equations import total_least_squares
from fidim_lab.identification.equations.problem import Problem, build
from fidim_lab.identification.motion.filters import LOW_PASS
from fidim_lab.identification.motion.recipe import BEST, PAPER, Recipe, Variant
from fidim_lab.identification.results.validation import residual, sigma_perp
from fidim_lab.identification.workspace import displaced
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import conditioning, free_twist_basis, marker_selector, simulate_free_motion
from fidim_lab.model.regressor import free_regressor

FREE = PAPER
"""Eq. 44–46"""
FULL = replace(PAPER, variant=Variant.FULL)
"""Eq. 47: the pose from the markers alone, everything else as in `FREE`"""
TIDY = replace(PAPER, signals=LOW_PASS)
"""as `FREE`, but ends where the filter's kernel is not whole are cut off, and differentiators have the filter's band"""
OURS = BEST

DISPLACEMENT_X = 1e-3 * np.array([10.0, -20.0, 24.9, 24.9, -20.0, 24.9, 24.9, 24.9, 24.9, 24.9, 24.9, 24.9])
"""(12,) our choice of Table 3's x row, m: 24.9 mm, the one legible value, everywhere but at k = 1, 2, 5, where it leads
out of reach or slackens a cable; there the multiple of 5 mm with the highest smallest tension"""
DISPLACEMENT_Y_12 = 9.97e-3
"""m: what we take for k = 12, where 99.7 mm is printed; with that a cable goes slack and others pass 1 kN"""
HOPELESS = PAPER.max_condition
"""conditioning of x, y at rest beyond which a window gives the paper's form no equations"""
ESSENTIAL = 6


@dataclass(frozen=True, eq=False)
class OptimisedWindow:
    """One column of Tables 2 and 3 on the nominal robot."""

    planned: PlannedWindow
    conditioning: float
    """of x, y of the marker as free coordinates, at rest"""
    worst_conditioning: float
    """in motion"""
    tension: tuple[float, float]
    """smallest and largest in motion, N"""
    regressor: np.ndarray
    """(200, 10) of 100 noise-free samples in x, y"""


@dataclass(frozen=True, eq=False)
class IdentifiedRun:
    """One identification."""

    values: np.ndarray
    """(9,)"""
    percent: np.ndarray
    """(9,) σ% (Eq. 34)"""
    sigma_W: float
    C: float
    used: tuple[str, ...]
    unused: dict[str, str]
    """window → reason"""

    @property
    def body(self) -> Body:
        """The identified body."""
        return Body.from_vector(self.values)

    def error_percent(self, truth: Body) -> np.ndarray:
        """(9,) of the true values."""
        return 100 * (self.values / truth.vector - 1)

    def in_sd(self, truth: Body) -> np.ndarray:
        """(9,) error over the stated sd."""
        return (self.values - truth.vector) / np.maximum(self.percent / 100 * np.abs(self.values), 1e-300)


@dataclass(frozen=True, eq=False)
class Places:
    """The four identifications from one set of twelve windows; a sentence where one was refused."""

    free: IdentifiedRun | str
    """the paper's form, x and y of one marker (Eq. 46)"""
    full: IdentifiedRun | str
    """the paper's form, full pose (Eq. 47)"""
    ours: IdentifiedRun | str
    """our weights and filters, one marker"""
    noise_free: IdentifiedRun | str
    """`free` without any sensor noise: what the method alone misses"""
    noise_free_tidy: IdentifiedRun | str
    """the same with `TIDY`: without what the ends and plain differences add"""


@dataclass(frozen=True, eq=False)
class Reproduction:
    """Everything that is printed."""

    optimised: tuple[OptimisedWindow, ...]
    cost: float
    """C of the optimised windows without noise"""
    table2: Places
    full_without: IdentifiedRun | str
    """Table 2's full pose without the windows in which x, y are hopeless"""
    random: Places
    sigma_perps: dict[str, float]
    """Fig. 3, from random places, with the body of `random.free`"""
    expected: float | None
    """√λ ‖χ‖ σ_W of `random.free`"""
    noise: float
    seconds: float

    @property
    def hopeless(self) -> tuple[str, ...]:
        """Optimised windows at which x, y are hopeless free coordinates, at rest."""
        return hopeless(self.optimised)

    def columns(self, equation: int) -> dict[str, IdentifiedRun | str]:
        """The identifications beside Eq. 46 or Eq. 47."""
        if equation == 46:
            return {
                "Table 2": self.table2.free,
                "random": self.random.free,
                "ideal sensors": self.random.noise_free,
                "tidy filter": self.random.noise_free_tidy,
                "ours": self.random.ours,
            }
        return {
            "Table 2": self.table2.full,
            f"without k = {', '.join(name.lstrip('k0') for name in self.hopeless)}": self.full_without,
            "random": self.random.full,
        }


def optimised_windows(robot: Robot) -> tuple[OptimisedWindow, ...]:
    """Table 2's twelve equilibria with Table 3's displacements as far as they are legible, for the nominal body."""
    mechanism = Mechanism(robot, native=True)
    y = np.append(paper.DISPLACEMENT_Y[:-1], DISPLACEMENT_Y_12)
    return tuple(
        _optimised(mechanism, k, lengths, np.array([DISPLACEMENT_X[k], y[k]]))
        for k, lengths in enumerate(paper.LENGTHS)
    )


def _optimised(mechanism: Mechanism, k: int, lengths: np.ndarray, displacement: np.ndarray) -> OptimisedWindow:
    robot = mechanism.robot
    rest = pose_from_lengths(mechanism, robot.nominal, lengths)
    start = displaced(mechanism, rest, displacement)
    free = simulate_free_motion(mechanism, robot.nominal, start, np.zeros(6), np.linspace(0.0, 10.0, 1001))
    motion, tensions = free.motion, free.tensions * robot.mass
    poses = np.concatenate([rest.pose.position[None], motion.positions])
    turns = np.concatenate([rest.pose.rotation[None], motion.rotations])
    xi, selector = mechanism.structure_matrix(poses, turns), marker_selector(turns, robot.marker, (0, 1))
    worst = conditioning(xi, selector)
    basis = free_twist_basis(xi, selector)[1:]
    rows = np.rint(np.linspace(0, len(motion.t) - 1, 100)).astype(int)
    return OptimisedWindow(
        PlannedWindow(f"k{k + 1:02d}", Role.IDENTIFY, lengths, displacement, rest.marker_position(robot.marker)),
        float(worst[0]),
        float(worst.max()),
        (float(tensions.min()), float(tensions.max())),
        free_regressor(motion, robot.gravity, basis)[rows].reshape(-1, 10),
    )


def hopeless(windows: Sequence[OptimisedWindow]) -> tuple[str, ...]:
    """Windows at which x and y of the marker are hopeless free coordinates, at rest."""
    return tuple(w.planned.id for w in windows if w.conditioning > HOPELESS)


def cost(windows: Sequence[OptimisedWindow]) -> float:
    """C of Eq. 40 without noise: s_10 is zero then, and s_9 the smallest that is not."""
    s = np.linalg.svd(np.concatenate([w.regressor for w in windows]), compute_uv=False)
    return float((s[0] + 1) / s[8])


def read(campaign: Campaign, recipe: Recipe, without: Sequence[str] = ()) -> IdentifiedRun | str:
    """Total least squares on the `identify` windows; the reason, as a sentence, where that is refused."""
    windows = [w for w in campaign.of_role(Role.IDENTIFY) if w.id not in without]
    try:
        problem = build(campaign, recipe, windows)
        found = total_least_squares.estimate(problem)
    except FidimError as error:
        return str(error)
    percent = 100 * found.sd / np.abs(found.values)
    return IdentifiedRun(found.values, percent, found.sigma_W or 0.0, found.C or 0.0, *_windows_of(problem))


def _windows_of(problem: Problem) -> tuple[tuple[str, ...], dict[str, str]]:
    return tuple(e.window.id for e in problem.equations), {u.window.id: u.reason for u in problem.unused}


def main_marker_only(campaign: Campaign) -> Campaign:
    """The campaign as one marker sees it."""
    windows = tuple(replace(w, markers=w.markers[:, :1]) for w in campaign.windows)
    return replace(campaign, robot=replace(campaign.robot, extra_markers=()), windows=windows)


def essential_difference(places: Places) -> np.ndarray | None:
    """(6,) Eq. 48, %, of the essential parameters; None where one of the two identifications was refused."""
    free, full = places.free, places.full
    if isinstance(free, str) or isinstance(full, str):
        return None
    return 100 * np.abs((full.values - free.values) / free.values)[:ESSENTIAL]


def sigma_perps(campaign: Campaign, body: Body) -> dict[str, float]:
    """Fig. 3: σ⊥ of every `validate` window with its full pose; W in the paper's form, at all samples."""
    problem = build(campaign, FULL)
    return {e.window.id: sigma_perp(residual(e, body, body)) for e in problem.of_role(Role.VALIDATE)}
