"""The parts of a recording without a hand, by a rule fixed before any fit (spec/irma4u.md §2).

With locked motors the platform's Newton–Euler equations, projected on the directions in which the cables do no work,
must balance by themselves (Eq. 21). What is left over, with the nominal body, is an outside force: a hand that pushes
adds power, one that brakes takes it, and friction takes a little too. The rule looks at its power and its size only;
the mass does not matter. `find_hand_free` applies it to poses over time and says why each window begins and ends.

Directions of soft cables count as free: where cables meet nearly in one point, a singular value of Ξ is so small that
the direction belongs to the motion (the yaw of such a robot is where a hand would otherwise go unseen).

The rule needs a nominal body. A hand lighter than its limits looks like damping and survives. It compares with the
inertial forces, so it stands a geometry that is wrong by millimetres in a soft direction; where swings are slow and no
direction is soft, `free_stretches` finds more.
"""

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from fidim_lab.arrays import Mask, PerCable, Positions, Rotations, Series, runs
from fidim_lab.data.records import Motion
from fidim_lab.errors import RefusedError
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.regressor import parameter_vector, platform_regressor

FILTER_ORDER = 4


@dataclass(frozen=True)
class HandFreeRule:
    """The thresholds, fixed before any fit (spec/irma4u.md §2)."""

    low_pass: float = 8.0
    """Hz, zero phase"""
    power_time: float = 0.4
    """s over which power and residual are averaged"""
    energy_time: float = 1.0
    """s over which the kinetic energy E is averaged"""
    power: tuple[float, float] = (-5.0, 0.3)
    """1/s: mean power of the residual over E"""
    residual: float = 0.5
    """rms of the residual over that of the inertial forces"""
    energy: float = 0.005
    """E over its 95th percentile in the recording: slower than this, friction is no longer small"""
    shortest: float = 1.5
    """s, after trimming"""
    trim: float = 0.1
    """s, at each end"""
    soft: float = 0.1
    """singular value of Ξ over the next larger one, under which its direction counts as free"""
    arm: float = 0.2
    """m, by which rotations are made comparable with translations"""


class Cut(StrEnum):
    """Why a sample is not hand-free."""

    PUSHED = "a hand adds energy"
    BRAKED = "a hand takes energy away"
    UNEXPLAINED = "a large residual, of a hand or of friction"
    STILL = "the platform hardly moves"
    MISSING = "the markers give no pose"
    EDGE = "the recording ends"


@dataclass(frozen=True)
class FreeStretch:
    """A time of free motion."""

    begin: float
    """s"""
    end: float
    """s"""

    @property
    def duration(self) -> float:
        """s"""
        return self.end - self.begin


@dataclass(frozen=True)
class HandFreeWindow(FreeStretch):
    """One stretch without a hand."""

    before: Cut
    after: Cut
    says: str
    """why it begins and ends there, with the values, for people"""


@dataclass(frozen=True, eq=False)
class SampleBalance:
    """The projected Newton–Euler balance of every sample, per unit mass."""

    power: Series
    """1/s, mean power of the residual over the mean kinetic energy"""
    residual: Series
    """rms of the residual over that of the inertial forces"""
    energy: Series
    """J/kg, mean kinetic energy"""
    free_directions: int
    """how many directions count as free"""
    singular_values: PerCable
    """of Ξ with rotations times `arm`, median over the recording"""


@dataclass(frozen=True, eq=False)
class HandFree:
    """What the rule found."""

    windows: tuple[HandFreeWindow, ...]
    too_short: tuple[HandFreeWindow, ...]
    """stretches that pass but last less than `shortest` s, trimmed as well"""
    balance: SampleBalance
    reasons: tuple[Cut | None, ...]
    """of every sample; None where it is hand-free"""


def find_hand_free(
    mechanism: Mechanism, t: Series, positions: Positions, rotations: Rotations, rule: HandFreeRule | None = None
) -> HandFree:
    """Find the hand-free windows of one recording.

    Args:
        mechanism: geometry and nominal body.
        t: (N,) s, even steps.
        positions: (N, 3) of P, world frame, m; NaN where there is no pose.
        rotations: (N, 3, 3) body → world.
        rule: the thresholds; the fixed ones unless given.

    Raises RefusedError where the recording is too short for the rule, InfeasibleError at a singular pose.
    """
    rule = rule or HandFreeRule()
    step = sampling_step(t, rule.shortest)
    missing = np.any(np.isnan(positions), axis=1)
    motion = smooth_motion(t, positions, rotations, rule.low_pass)
    balance = newton_euler_balance(mechanism, motion, rule)
    missing = moving_mean(missing, round(rule.power_time / step)) > 0.0
    reasons = _reasons(balance, missing, rule)
    free = np.array([reason is None for reason in reasons])
    stretches = [_window(t, begin, end, reasons, balance) for begin, end in runs(free)]
    trimmed = [replace(window, begin=window.begin + rule.trim, end=window.end - rule.trim) for window in stretches]
    return HandFree(
        windows=tuple(window for window in trimmed if window.duration >= rule.shortest),
        too_short=tuple(window for window in trimmed if 0.0 < window.duration < rule.shortest),
        balance=balance,
        reasons=reasons,
    )


def sampling_step(t: Series, shortest: float) -> float:
    """The step of even times, s. Raises RefusedError where two of the shortest stretches (s) do not fit in."""
    step = float(np.median(np.diff(t)))
    if len(t) * step < 2 * shortest:
        raise RefusedError(f"{len(t) * step:.1f} s are too short to look for free motion in.")
    return step


def smooth_motion(t: Series, positions: Positions, rotations: Rotations, low_pass: float) -> Motion:
    """Poses with twist and acceleration, through a zero-phase Butterworth low-pass (Hz) and central differences.

    Gaps are bridged by straight lines. Coarser than what identification uses: enough to see a hand.
    """
    from scipy.signal import butter, sosfiltfilt  # half a second to import, and hardly ever used

    step = float(np.median(np.diff(t)))
    sections = butter(FILTER_ORDER, low_pass, fs=1.0 / step, output="sos")
    poses = _bridged(np.column_stack([positions, rotations.reshape(-1, 9)]))
    poses = sosfiltfilt(sections, poses, axis=0)
    left, _, right = np.linalg.svd(poses[:, 3:].reshape(-1, 3, 3))
    turned = left @ right
    velocity = np.gradient(poses[:, :3], step, axis=0)
    spin_matrix = np.gradient(turned, step, axis=0) @ turned.transpose(0, 2, 1)
    antisymmetric = 0.5 * (spin_matrix - spin_matrix.transpose(0, 2, 1))
    spin = np.stack([antisymmetric[:, 2, 1], antisymmetric[:, 0, 2], antisymmetric[:, 1, 0]], axis=1)
    twists = np.concatenate([velocity, spin], axis=1)
    return Motion(t, poses[:, :3], turned, twists, np.gradient(twists, step, axis=0))


def newton_euler_balance(mechanism: Mechanism, motion: Motion, rule: HandFreeRule) -> SampleBalance:
    """Residual of the cable-free projection of Newton–Euler (Eq. 19, 21) with the nominal body."""
    body, gravity = mechanism.robot.nominal, mechanism.robot.gravity
    chi = parameter_vector(body)
    residual = platform_regressor(motion, gravity) @ chi
    inertial = platform_regressor(motion, np.zeros(3)) @ chi
    scale = np.array([1.0, 1.0, 1.0, rule.arm, rule.arm, rule.arm])
    structure = mechanism.structure_matrix(motion.positions, motion.rotations) / scale
    _, singular, right = np.linalg.svd(structure)
    typical = np.median(singular, axis=0)
    held = _held(typical, rule.soft)
    basis = right[:, held:]
    projected = np.einsum("nki,ni->nk", basis, residual / scale)
    speeds = np.einsum("nki,ni->nk", basis, motion.twists * scale)
    inertial = np.einsum("nki,ni->nk", basis, inertial / scale)

    step = float(motion.t[1] - motion.t[0])
    over_power, over_energy = round(rule.power_time / step), round(rule.energy_time / step)
    energy = moving_mean(_kinetic_energy(motion, body.com, body.inertia_matrix), over_energy)
    tiny = np.finfo(float).tiny
    return SampleBalance(
        power=moving_mean((projected * speeds).sum(axis=1), over_power) / np.maximum(energy, tiny),
        residual=np.sqrt(
            moving_mean((projected**2).sum(axis=1), over_power)
            / np.maximum(moving_mean((inertial**2).sum(axis=1), over_power), tiny)
        ),
        energy=energy,
        free_directions=6 - held,
        singular_values=typical,
    )


def _held(singular_values: np.ndarray, soft: float) -> int:
    """How many directions the cables truly hold: up to the first singular value far below the one before."""
    drops = np.flatnonzero(singular_values[1:] < soft * singular_values[:-1])
    return int(drops[0]) + 1 if len(drops) else len(singular_values)


def _kinetic_energy(motion: Motion, com: np.ndarray, inertia: np.ndarray) -> Series:
    velocity, spin = motion.twists[:, :3], motion.twists[:, 3:]
    body_spin = np.einsum("nji,nj->ni", motion.rotations, spin)
    return (
        0.5 * (velocity**2).sum(axis=1)
        + (velocity * np.cross(spin, motion.rotations @ com)).sum(axis=1)
        + 0.5 * np.einsum("ni,ij,nj->n", body_spin, inertia, body_spin)
    )


def _reasons(balance: SampleBalance, missing: Mask, rule: HandFreeRule) -> tuple[Cut | None, ...]:
    """The first thing that is wrong with each sample, the plainest first."""
    reasons = np.full(len(missing), None, dtype=object)
    checks = (
        (balance.residual >= rule.residual, Cut.UNEXPLAINED),
        (balance.power <= rule.power[0], Cut.BRAKED),
        (balance.power >= rule.power[1], Cut.PUSHED),
        (balance.energy <= rule.energy * np.percentile(balance.energy, 95), Cut.STILL),
        (missing, Cut.MISSING),
    )
    for wrong, cut in checks:
        reasons[wrong] = cut
    return tuple(reasons)


def _window(t: Series, begin: int, end: int, reasons: tuple[Cut | None, ...], balance: SampleBalance) -> HandFreeWindow:
    """The stretch of samples begin … end − 1."""
    before = (reasons[begin - 1] if begin > 0 else None) or Cut.EDGE
    after = (reasons[end] if end < len(t) else None) or Cut.EDGE
    says = f"before it {_words(before, balance, begin - 1)}; after it {_words(after, balance, end)}"
    return HandFreeWindow(float(t[begin]), float(t[end - 1]), before, after, says)


def _words(cut: Cut, balance: SampleBalance, row: int) -> str:
    match cut:
        case Cut.PUSHED | Cut.BRAKED:
            return f"{cut.value} ({balance.power[row]:+.2f} of the kinetic energy per second)"
        case Cut.UNEXPLAINED:
            return f"{cut.value} ({balance.residual[row]:.2f} of the inertial forces)"
        case _:
            return cut.value


def moving_mean(values: np.ndarray, samples: int) -> Series:
    """Centred moving mean over so many samples (and one); shorter at the ends of the recording."""
    half = samples // 2
    total = np.concatenate([[0.0], np.cumsum(values.astype(float))])
    rows = np.arange(len(values))
    first, last = np.maximum(rows - half, 0), np.minimum(rows + half + 1, len(values))
    return (total[last] - total[first]) / (last - first)


def _bridged(columns: np.ndarray) -> np.ndarray:
    rows = np.arange(len(columns))
    known = np.isfinite(columns).all(axis=1)
    if known.sum() < 2:
        raise RefusedError("No sample has a pose: three markers must be seen at once.")
    return np.column_stack([np.interp(rows, rows[known], column[known]) for column in columns.T])
