"""Angular rates as phone apps export them: a column of times and three of a gyroscope.

phyphox names axes and units ("Gyroscope x (rad/s)"), Sensor Logger and Android's sensors do not: rates are rad/s there,
and the order of the columns may be z, y, x. Columns are found by their names, whatever their order. Stamps jitter, come
twice, or leave gaps: the samples of each short span of time become one.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from fidim_lab.data.importers.reading.as_table import read_table
from fidim_lab.data.importers.reading.cells import cells_of, delimiter_of
from fidim_lab.data.importers.reading.clock import SECONDS, time_unit_of
from fidim_lab.data.importers.reading.columns import TOP, TableMap, read_columns
from fidim_lab.errors import FileError

UNIT = re.compile(r"[(\[]\s*([^)\]]*)\s*[)\]]\s*$")
TIME = re.compile(r"(seconds_elapsed|elapsed.*|time.*|t|.*stamp.*)", re.IGNORECASE)
GYRO = re.compile(r"gyro|rotation.?rate|angular|omega|ω|rate|^w[xyz]$", re.IGNORECASE)
OTHER = re.compile(r"acc|grav|mag|orient|quat|user", re.IGNORECASE)
AXIS = re.compile(r"(?:^|[^a-z]|[a-z](?=[XYZ]$)|^w)([xyzXYZ])$")
RATE_UNITS = {"rad/s": 1.0, "rad s^-1": 1.0, "deg/s": np.pi / 180, "°/s": np.pi / 180, "dps": np.pi / 180}
"""rad/s in one unit"""
BUNCHED = 0.2
"""share of steps below a fifth of the mean one: jitter makes a hundredth, stamps of whole packets four fifths"""
SHORT = 0.2
SPAN = 0.02
"""s that become one sample: a swing of 3 Hz loses 0.6 % in it, and no period changes"""
FLAT = 3
"""equal readings in a row at the largest value of an axis: it saturates. Noise repeats none so often"""
BACK = 1e-3
"""s by which a stamp may go back"""


@dataclass(frozen=True, eq=False)
class GyroRecording:
    """Angular rates at even times, in the gyroscope's own axes."""

    path: Path
    t: Float[np.ndarray, " N"]
    """s since the first sample"""
    rates: Float[np.ndarray, "N 3"]
    """rad/s; NaN where nothing was recorded, or an axis was saturated"""
    unit_said: bool
    """whether header or user state the unit of the rates"""
    decided: tuple[str, ...]

    @property
    def rate(self) -> float:
        """Hz."""
        return float(1 / (self.t[1] - self.t[0]))


def read_gyro(path: Path, unit: str | None = None) -> GyroRecording:
    """Read one export; unit: of the rates, the header's or else rad/s unless given.

    Raises FileError naming columns, bunched stamps, or a file without angular rates.
    """
    names = _names(path)
    time, axes = _columns(path, names)
    said = [found[1].strip() for name in axes if (found := UNIT.search(name))]
    scale = RATE_UNITS.get((unit or (said[0] if said else "rad/s")).lower().replace("grad", "deg"))
    if scale is None:
        what = f"rates in {said[0][:20]!r}; rad/s or deg/s were expected"
        raise FileError(path, f"column {axes[0]}", what, hint="State the unit with --unit rad/s or --unit deg/s.")
    read = read_columns(path, TableMap(time=time), [time, *axes], "a gyroscope needs it.")
    stamps, rates = read.values[:, 0], scale * read.values[:, 1:]
    stated = UNIT.search(time)
    by_name = "s" if "second" in time.lower() else stated[1].strip() if stated else ""
    seconds = "s" if read.dated else by_name if by_name in SECONDS else time_unit_of(path, stamps)
    t, rates, tidied = _in_order(path, (stamps - stamps[0]) * SECONDS[seconds], rates)
    said_unit = unit or (said[0] if said else "")
    decided = [f"columns {', '.join(axes)} are the rates about x, y, z, in {said_unit or 'rad/s'}"]
    decided += [f"{len(t) / t[-1]:.4g} Hz by the stamps, which are in {seconds}", *tidied, *read.decided]
    rates, flat = _without_saturation(rates)
    decided += flat
    grid, even = _even(t, rates)
    decided.append(f"the samples of each {1e3 * (grid[1] - grid[0]):.0f} ms become one")
    return GyroRecording(path, grid, even, bool(said_unit), tuple(decided))


def _names(path: Path) -> list[str]:
    """The header: the first line at the top that has a time and three axes. Raises FileError."""
    lines = [line for line in read_table(path).splitlines() if line.strip()][:TOP]
    mark = delimiter_of(lines)
    for line in lines:
        names = [cell.strip().strip('"').strip() for cell in cells_of(line, mark)]
        if any(TIME.fullmatch(UNIT.sub("", name).strip()) for name in names) and _axes(names):
            return names
    found = next((line for line in lines if re.search("[A-Za-z]", line)), "")[:120]
    what = f"no line names a time and the rates about x, y, z; found {found!r}"
    raise FileError(path, "line 1", what, hint="Export the gyroscope as CSV: phyphox, Gyroscope; Sensor Logger.")


def _axes(names: Sequence[str]) -> dict[str, list[str]]:
    """Names by axis, those of a gyroscope before others; empty where an axis is missing."""
    bare = {name: UNIT.sub("", name).strip() for name in names}
    rates = [name for name, short in bare.items() if GYRO.search(short) and not OTHER.search(short)]
    others = [name for name, short in bare.items() if not OTHER.search(short)]
    for wanted in (rates, others, list(bare)):
        found: dict[str, list[str]] = {axis: [] for axis in "xyz"}
        for name in wanted:
            if axis := AXIS.search(bare[name]):
                found[axis[1].lower()].append(name)
        if all(found.values()):
            return found
    return {}


def _columns(path: Path, names: Sequence[str]) -> tuple[str, list[str]]:
    """Names of the time and of the rates about x, y, z. Raises FileError where they are accelerations or ambiguous."""
    axes = _axes(names)
    chosen = [axes[axis][0] for axis in "xyz"]
    if all(OTHER.search(name) for name in chosen):
        what = f"{', '.join(chosen)} are no angular rates"
        raise FileError(path, "line 1", what, hint="Export the gyroscope; an accelerometer shows a pendulum badly.")
    if any(len(found) > 1 for found in axes.values()):
        what = f"several columns for one axis: {', '.join(name for found in axes.values() for name in found)[:150]}"
        raise FileError(path, "line 1", what, hint="Export one gyroscope in one file.")
    times = [name for name in names if TIME.fullmatch(UNIT.sub("", name).strip())]
    return next((name for name in times if "elapsed" in name.lower()), times[0]), chosen


def _in_order(path: Path, t: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Samples at increasing times. Raises FileError where stamps go back, or are those of packets."""
    steps = np.diff(t)
    if len(t) < 20 or not np.isfinite(t).all() or t[-1] <= t[0]:
        raise FileError(path, "time", f"{len(t)} samples over {np.ptp(t):.3g} s; a recording has some seconds")
    if (steps < -BACK).any():
        k = int(np.argmin(steps))
        what = f"sample {k + 2} is {-steps[k]:.4g} s before the one above"
        raise FileError(path, "time", what, hint="Export each recording by itself.")
    twice = np.concatenate([[False], steps <= 0.0])
    mean = float(np.median(steps[steps > 0])) if twice.mean() < BUNCHED else (t[-1] - t[0]) / (len(t) - 1)
    if (steps < SHORT * mean).mean() > BUNCHED:
        share = 100 * float((steps < SHORT * mean).mean())
        what = f"stamps come in bunches: {share:.0f} % of them are less than a fifth of a step after the one before"
        hint = "They are those of packets, not of samples: record with phyphox, or at another rate."
        raise FileError(path, "time", what, hint=hint)
    tidied = [f"{int(twice.sum())} samples that came twice are left out"] if twice.any() else []
    gaps = steps[steps > 5 * mean]
    tidied += [f"{len(gaps)} gaps, the longest of {gaps.max():.2g} s"] if len(gaps) else []
    return t[~twice], rates[~twice], tidied


def _without_saturation(rates: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """NaN where an axis stays at its largest value."""
    size, said = np.abs(rates), []
    kept = rates.copy()
    for k, axis in enumerate("xyz"):
        top = size[:, k] >= np.nanmax(size[:, k]) * (1 - 1e-9)
        runs = np.convolve(top, np.ones(FLAT), mode="valid") >= FLAT
        if runs.any() and np.nanmax(size[:, k]) > 0:
            kept[top] = np.nan
            said.append(
                f"the rate about {axis} saturates at {np.nanmax(size[:, k]):.3g} rad/s in {int(top.sum())} samples"
            )
    return kept, said


def _even(t: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means over even spans, moved to their middle by the slope there; NaN where a span has no sample."""
    span = max(SPAN, 2 * float(np.median(np.diff(t))))
    count = int((t[-1] - t[0]) // span)
    place = np.minimum((t / span).astype(int), count - 1)
    known = np.isfinite(rates).all(axis=1) & (t < count * span)
    number = np.bincount(place[known], minlength=count)
    with np.errstate(invalid="ignore", divide="ignore"):
        means = np.column_stack([np.bincount(place[known], rates[known, k], count) / number for k in range(3)])
        times = np.bincount(place[known], t[known], count) / number
    grid = (np.arange(count) + 0.5) * span
    slope = np.full_like(means, np.nan)
    slope[1:-1] = (means[2:] - means[:-2]) / (2 * span)
    return grid, means + np.nan_to_num(slope) * (grid - times)[:, np.newaxis]
