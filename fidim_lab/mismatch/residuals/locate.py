"""Where the whitened residual is not noise: window, time, channel, frequency, and what it correlates with.

`locate` gives one `Where` for each window that stands out, largest first; `goes_along` looks for what its course
follows. Times come from sliding energy, frequencies from a periodogram with the chance that noise has such a line.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.ndimage import uniform_filter1d
from scipy.special import chdtrc, chdtri

from fidim_lab.arrays import runs
from fidim_lab.identification.markers.finding import marker_channel
from fidim_lab.mismatch.residuals.residual import Leftover
from fidim_lab.mismatch.residuals.thresholds import RESIDUALS
from fidim_lab.mismatch.thresholds import SHARED


@dataclass(frozen=True)
class Line:
    """A line of a spectrum: values ≈ amplitude · sin(2π f t + phase), t on the window's own clock."""

    frequency: float
    """Hz"""
    phase: float
    """rad"""
    amplitude: float
    """in standard deviations of the noise"""
    chance: float
    """that noise has one as high anywhere in the spectrum"""


@dataclass(frozen=True)
class Companion:
    """A quantity with which the residual correlates."""

    name: str
    correlation: float
    """0 … 1; of oscillations whatever their phase, of energies signed"""


@dataclass(frozen=True)
class Where:
    """One place of a mismatch; the fields of spec/formats.md `where`, and some more."""

    window: str
    t: tuple[float, float]
    channel: str
    frequency: float | None
    """Hz; None where no line stands out"""
    share: float
    """of all the campaign's χ² beyond the noise"""
    says: str
    line: Line | None = None
    companions: tuple[Companion, ...] = ()


def locate(leftovers: Sequence[Leftover], most: int = 12) -> tuple[Where, ...]:
    """The windows that stand out, largest share first; none where all is noise (chance 1e-4 per campaign)."""
    usable = [one for one in leftovers if one.count > 0 and len(one.t) > 3]
    excess = {one.window: max(0.0, one.chi2 - one.count + one.own) for one in usable}
    total = sum(excess.values())
    found: list[Where] = []
    for one in usable:
        busy = _busy(one, SHARED.chance / len(usable))
        whole = chdtrc(max(1, one.count - one.own), one.chi2) < SHARED.chance / len(usable)
        if busy is None and not whole:
            continue
        found.append(_where(one, busy or (0, len(one.t)), total))
    return tuple(sorted(found, key=lambda where: -where.share)[:most])


def _busy(one: Leftover, chance: float) -> tuple[int, int] | None:
    """Rows (begin, end) of the most energetic stretch whose sliding energy noise does not reach."""
    z = np.nan_to_num(one.values.reshape(len(one.t), -1))
    seen = np.isfinite(one.values.reshape(len(one.t), -1)).sum(axis=1).astype(float)
    width = max(3, round(RESIDUALS.locate_segment / float(np.median(np.diff(one.t)))))
    energy = uniform_filter1d((z**2).sum(axis=1), width, mode="constant") * width
    dof = np.maximum(uniform_filter1d(seen, width, mode="constant") * width, 1.0)
    tests = max(1, len(one.t) // max(1, width // 4))
    stands = energy > chdtri(dof, chance / tests)
    stretches = _joined(runs(stands), width)
    if not stretches:
        return None
    return max(stretches, key=lambda run: float((energy - dof)[run[0] : run[1]].sum()))


def _joined(stretches: list[tuple[int, int]], gap: int) -> list[tuple[int, int]]:
    """Stretches that are closer than `gap` rows, as one."""
    found: list[tuple[int, int]] = []
    for begin, end in stretches:
        if found and begin - found[-1][1] <= gap:
            found[-1] = (found[-1][0], end)
        else:
            found.append((begin, end))
    return found


def _where(one: Leftover, rows: tuple[int, int], total: float) -> Where:
    begin, end = rows
    part = one.values[begin:end].reshape(end - begin, -1)
    energy = np.nansum(part**2, axis=0)
    column = int(np.argmax(energy))
    channel = marker_channel(*divmod(column, 3))
    share = float(np.clip((energy.sum() - np.isfinite(part).sum()) / total, 0.0, 1.0)) if total > 0 else 0.0
    line = strongest_line(one, column)
    shown = line if line.chance < 1e-3 else None
    companions = goes_along(one, column)
    t = (float(one.t[begin]), float(one.t[end - 1]))
    rms = float(np.sqrt(energy[column] / max(1, int(np.isfinite(part[:, column]).sum()))))
    says = (
        f"Window {one.window}, {t[0]:.2f} to {t[1]:.2f} s: {channel} deviates by {rms * one.noise * 1e3:.3g} mm rms, "
    )
    says += f"{rms:.1f} times the noise"
    if shown is not None:
        size, phase = shown.amplitude * one.noise * 1e3, np.degrees(shown.phase)
        says += f", most at {shown.frequency:.2f} Hz ({size:.2g} mm, phase {round(float(phase))}°)"
    if companions:
        says += f"; it correlates with {companions[0].name} ({companions[0].correlation:.2f})"
    says += f". This is {share:.0%} of the unexplained motion."
    return Where(one.window, t, channel, None if shown is None else shown.frequency, share, says, shown, companions)


def strongest_line(one: Leftover, column: int) -> Line:
    """The highest line of one channel (a column of values as (T, 3M)), by a periodogram four times finer than 1/T."""
    step, values = one.on_grid()
    x = values[:, column]
    seen = np.isfinite(x)
    count = int(seen.sum())
    lines = np.fft.rfft(np.where(seen, x, 0.0), RESIDUALS.locate_finer * len(x))
    frequencies = np.fft.rfftfreq(RESIDUALS.locate_finer * len(x), step)
    inside = (frequencies >= 1 / (step * len(x))) & (
        frequencies < RESIDUALS.locate_highest
    )  # less than one cycle is a drift, no line
    height = np.where(inside, np.abs(lines) ** 2 / max(1, count), 0.0)
    at = int(np.argmax(height))
    independent = (
        max(1.0, inside.sum() / RESIDUALS.locate_finer) * 2.5
    )  # peaks between the bins, of an oversampled periodogram
    chance = -np.expm1(independent * np.log1p(-np.exp(-min(float(height[at]), 700.0))))
    phase = float(np.angle(1j * lines[at]) - 2 * np.pi * frequencies[at] * one.t[0])
    phase = float(np.mod(phase + np.pi, 2 * np.pi) - np.pi)
    return Line(float(frequencies[at]), phase, float(2 * np.abs(lines[at]) / max(1, count)), float(chance))


def goes_along(one: Leftover, column: int, least: float = RESIDUALS.locate_worth) -> tuple[Companion, ...]:
    """The quantities that one channel, or its energy, follows, strongest first; empty without a motion."""
    x = one.values.reshape(len(one.t), -1)[:, column]
    seen = np.isfinite(x)
    if seen.sum() < 20:
        return ()
    width = max(3, round(RESIDUALS.locate_segment / float(np.median(np.diff(one.t)))))
    filled = np.where(seen, x, 0.0)
    energy = uniform_filter1d(filled**2, width)
    found = [Companion(name, _along(energy, feature)) for name, feature in _slow(one, width).items()]
    found += [Companion(name, _coherence(filled, feature)) for name, feature in _fast(one).items()]
    return tuple(sorted((c for c in found if abs(c.correlation) >= least), key=lambda c: -abs(c.correlation)))


def _along(x: np.ndarray, y: np.ndarray) -> float:
    x, y = x - x.mean(), y - y.mean()
    scale = float(np.linalg.norm(x) * np.linalg.norm(y))
    return float(x @ y) / scale if scale > 0 else 0.0


def _coherence(x: np.ndarray, y: np.ndarray) -> float:
    """Correlation at the best phase."""
    if np.ptp(y) == 0 or np.ptp(x) == 0:
        return 0.0
    a, b = _analytic(x - x.mean()), _analytic(y - y.mean())
    return float(np.abs(np.vdot(a, b)) / (np.linalg.norm(a) * np.linalg.norm(b)))


def _analytic(x: np.ndarray) -> np.ndarray:
    """The signal without its negative frequencies, as scipy.signal.hilbert, which takes half a second to import."""
    twice = np.zeros(len(x))
    twice[0] = 1.0
    twice[1 : (len(x) + 1) // 2] = 2.0
    if len(x) % 2 == 0:
        twice[len(x) // 2] = 1.0
    return np.fft.ifft(np.fft.fft(x) * twice)


def _slow(one: Leftover, width: int) -> dict[str, Float[np.ndarray, " T"]]:
    """What the energy may follow."""
    found = {"the time since the start": one.t - one.t[0]}
    if one.motion is not None:
        speed2 = (one.motion.twists[:, :3] ** 2).sum(axis=1)
        found["the square of the speed"] = uniform_filter1d(speed2, width)
        found["the square of the turning rate"] = uniform_filter1d((one.motion.twists[:, 3:] ** 2).sum(axis=1), width)
        away = one.motion.positions - one.motion.positions.mean(axis=0)
        found["the displacement"] = uniform_filter1d((away**2).sum(axis=1), width)
    return found


def _fast(one: Leftover) -> dict[str, Float[np.ndarray, " T"]]:
    """What the residual itself may follow."""
    found: dict[str, np.ndarray] = {}
    if one.motion is not None:
        speed = np.linalg.norm(one.motion.twists[:, :3], axis=1)
        for axis, name in enumerate("xyz"):
            found[f"the position in {name}"] = one.motion.positions[:, axis]
            found[f"the velocity in {name}"] = one.motion.twists[:, axis]
            found[f"the turning rate about {name}"] = one.motion.twists[:, 3 + axis]
            found[f"speed times velocity in {name}"] = speed * one.motion.twists[:, axis]
    for cable in range(0 if one.tensions is None else one.tensions.shape[1]):
        if one.tensions is not None:
            found[f"the tension of cable {cable + 1}"] = one.tensions[:, cable]
    for cable in range(0 if one.swivel_rates is None else one.swivel_rates.shape[1]):
        if one.swivel_rates is not None:
            found[f"the sign of the swivel rate of cable {cable + 1}"] = np.sign(one.swivel_rates[:, cable])
    return found
