"""Times of samples: by frame numbers and the header's rate, by a column of times, or by stamps."""

import math
import re
from pathlib import Path
from types import MappingProxyType

import numpy as np
from jaxtyping import Float

from fidim_lab.data.importers.reading.cells import number
from fidim_lab.data.importers.reading.clock_steps import SetClock, without_steps
from fidim_lab.errors import FileError
from fidim_lab.say import counted

HERTZ = re.compile(r"\s*hz\s*$", re.IGNORECASE)
UNEVEN = 0.45
"""of a step, by which a stamp may be away from even steps: more, and two samples share one"""
LINED = 16
"""stamps for a first line: by it the next as many are counted right up to a jitter of a fifth of a step"""
JITTER = 0.05
"""of a step, rms, by which stamps may be away from even steps without a word"""
DAY = 86400.0
"""s"""
SECONDS = MappingProxyType({"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "d": DAY})
"""in one unit of time; in days dates stand as numbers, by Excel, LabVIEW and MATLAB"""
RATES = (10.0, 2500.0)
"""Hz, of motion capture, by which a unit of time is told: narrower than a factor of 1000, so that one unit fits"""
ROUNDED = 2e-3
"""s, by which the first and the last of a column of times may be off together: exports round to 1 ms"""
SAME_RATE = 1e-4
"""of the rate: beyond it, and beyond rounding, header and column of times say different rates (59.94 and 60: 1e-3)"""

ONE_TAKE = "Where a file has two takes, export each by itself; where it has rows twice, delete these."


def check_rate(path: Path, rate: float) -> float:
    """The rate, Hz. Raises FileError where no camera has it."""
    if not 1.0 <= rate <= 1e4:
        raise FileError(path, "rate", f"a frame rate of {rate:g} Hz; 1 to 10000 was expected")
    return rate


def times(path: Path, rate: float, frames: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
    """s since the first frame by frame numbers, which may have gaps. Raises FileError where they do not go on."""
    check_rate(path, rate)
    if not np.isfinite(frames).all() or (frames % 1 != 0).any():
        raise FileError(path, "frames", "a frame without its whole number")
    back = np.flatnonzero(np.diff(frames) <= 0)
    if len(back):
        k = int(back[0])
        raise FileError(path, f"frame {frames[k + 1]:.0f}", f"comes after frame {frames[k]:.0f}.", hint=ONE_TAKE)
    return check_long(path, (frames - frames[0]) / rate, rate)


def over_midnight(stamps: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
    """Times of day, s, that go on after midnight; dates, s since 1970, as they are."""
    if not len(stamps) or np.nanmax(stamps) >= DAY:
        return stamps
    return stamps + DAY * np.cumsum(np.diff(stamps, prepend=stamps[0]) < -0.5 * DAY)


def by_time(rows: Float[np.ndarray, "N K"]) -> tuple[Float[np.ndarray, "N K"], tuple[str, ...]]:
    """Rows that begin with their time in its order, each once, and what was done, a sentence each.

    Rows that are written twice are equal to the last digit. Rows come in another order by a network, or backwards.
    Where a clock began anew or a table stands there twice, times go back over half of all that they span, two rows have
    one time, or steps are no longer those of the file: then nothing is done.
    """
    back, span = -np.diff(rows[:, 0]), np.ptp(rows[:, 0])
    if (back > 0.5 * span).any() and not (back >= 0.0).all():
        return rows, ()
    order = np.argsort(rows[:, 0], kind="stable")
    first = np.unique(np.where(np.isnan(rows), np.inf, rows), axis=0, return_index=True)[1]
    kept = order[np.isin(order, first)]
    twice = len(rows) - len(kept)
    moved = int((np.diff(kept) < 0).sum())
    steps = np.diff(rows[kept, 0])
    usual = np.median(np.abs(np.diff(rows[np.sort(kept), 0]))) if len(kept) > 1 else 0.0
    if not (twice or moved) or not (steps > 0.0).all() or abs(np.median(steps) - usual) > UNEVEN * usual:
        return rows, ()
    said = [f"{counted(twice, 'row')} that stood there twice are left out"] if twice else []
    said += ["rows were not in the order of their times and are sorted by them"] if moved else []
    return rows[kept], tuple(said)


def check_long(path: Path, t: np.ndarray, rate: float) -> np.ndarray:
    """The times, s. Raises FileError where a gap makes them far longer than what was recorded."""
    if t[-1] * rate > 100.0 * len(t) + 1000.0:
        k = int(np.argmax(np.diff(t)))
        what = f"{len(t)} frames in {t[-1]:g} s at {rate:g} Hz: numbers or times are wrong, or of several takes. The"
        raise FileError(path, "frames", f"{what} longest gap is {t[k + 1] - t[k]:g} s, before sample {k + 2}")
    return t


def header_rate(path: Path, line: int, text: str) -> float:
    """Hz as a header says it, with a decimal point or a comma; NaN where it is empty. Raises FileError otherwise.

    NaN too where cameras were triggered from outside (QTM writes EXT): only a column of times can tell the rate.
    """
    return math.nan if text.strip().upper() == "EXT" else number(path, line, 1, HERTZ.sub("", text).replace(",", "."))


def clocked(
    path: Path, said: float, frames: Float[np.ndarray, " N"], stamps: Float[np.ndarray, " N"]
) -> tuple[Float[np.ndarray, " N"], float, str]:
    """Times by the header's rate (s since the first frame), the rate, and where the column's is another, so in words.

    said: Hz, NaN where the header says none: then the column decides. stamps: the column of times, s. Frame numbers may
    count the frames that an export at a lower rate left out. Raises FileError where numbers do not go on, or nothing
    says a rate.
    """
    said = said if np.isnan(said) else check_rate(path, said)
    counted = frames - frames[0]
    step = float(np.median(np.diff(counted))) if len(counted) > 1 else 1.0
    fewer = counted / step if step > 1.0 and not (counted % step).any() else frames
    duration = float(stamps[-1] - stamps[0])
    if not (duration > 0.0 and np.isfinite(stamps).all() and (np.diff(stamps) > 0.0).all()):
        if np.isnan(said):
            raise FileError(path, "rate", "neither the header nor a column of times says a frame rate")
        return times(path, said, frames), said, ""
    off = ROUNDED / duration + SAME_RATE
    for numbers in (frames, fewer):
        if abs((numbers[-1] - numbers[0]) / duration / said - 1.0) < off:
            return times(path, said, numbers), said, ""
    column = 1.0 / _line(fewer, stamps)[1]
    if np.isnan(said):
        return times(path, column, fewer), column, ""
    return times(path, said, fewer), said, f"The file's header says {said:g} Hz, its column of times {column:.5g} Hz"


def even_times(path: Path, t: np.ndarray) -> tuple[np.ndarray, float, SetClock]:
    """Times since the first one (s) and rate of stamps that increase in even steps, with gaps; and of the clock.

    The times are even: those of the line through all stamps. The first and the last alone, off by a millisecond or
    rounded to it, give a rate that is wrong by 1e-4 in 10 s, and inertias by 2e-4: many times their ±.

    Raises FileError.
    """
    steps = np.diff(t)
    if not np.isfinite(t).all() or (steps <= 0.0).any():
        if not np.isfinite(t).all():
            raise FileError(path, "time", f"sample {int(np.argmax(~np.isfinite(t))) + 1} has no time")
        k = int(np.argmax(steps <= 0.0))
        if steps[k] == 0.0:
            what = f"sample {k + 2} has the same time as the one before, but other numbers."
            raise FileError(path, "time", what, hint="Delete the wrong one, or write times with all their digits.")
        what = f"sample {k + 2} is {-steps[k]:.4g} s before the one above."
        raise FileError(path, "time", what, hint=f"{ONE_TAKE} Where its clock was set back, cut the file there.")
    t = t - t[0]
    rate = _counted_rate(path, steps, float(1.0 / np.median(steps)))
    slots, step, off, clock = _evened(t, _counted_along(t, 1.0 / rate))
    if np.abs(off).max() > UNEVEN:  # a line does not go on where a clock was set
        slots, step, off, clock = _evened(t, np.append(0.0, np.cumsum(np.rint(steps * rate))))
    rate = 1.0 / step
    if np.abs(off).max() > UNEVEN or (np.diff(slots) == 0.0).any():
        hint = "Export the camera's own times or frame numbers (with --rate), instead of times of arrival."
        what = f"stamps are not in even steps of {step:.4g} s: bunched or jittering."
        raise FileError(path, "time", what, hint=hint)
    jitter = float(np.sqrt(np.mean(off**2)))
    if jitter > JITTER:
        clock = clock.saying(f"stamps jitter by {jitter:.0%} of a step (rms); the samples are taken as even")
    return check_long(path, (slots - slots[0]) * step, rate), rate, clock


def _evened(
    t: Float[np.ndarray, " N"], counts: Float[np.ndarray, " N"]
) -> tuple[Float[np.ndarray, " N"], float, Float[np.ndarray, " N"], SetClock]:
    """Samples counted along the line through stamps, its step (s), what they are off it (steps), and set clocks."""
    t, clock = without_steps(t, counts)
    begin, step = _line(counts, t)
    places = (t - begin) / step
    slots = np.rint(places)
    return slots, step, places - slots, clock


def _counted_along(t: Float[np.ndarray, " N"], step: float) -> Float[np.ndarray, " N"]:
    """Samples since the first, by a line through more and more of them.

    Where stamps jitter by a tenth of a step, one step in two thousand is counted wrongly by itself.
    """
    begin, known = 0.0, LINED
    while known < len(t):
        begin, step = _line(np.rint((t[:known] - begin) / step), t[:known])
        known *= 2
    counts = np.rint((t - begin) / step)
    return counts - counts[0]


def _line(counts: Float[np.ndarray, " N"], t: Float[np.ndarray, " N"]) -> tuple[float, float]:
    """Time (s) of count 0, and that of a step, by least squares."""
    middle = counts.mean()
    step = float((counts - middle) @ t / ((counts - middle) @ (counts - middle)))
    return float(t.mean()) - step * float(middle), step


def _counted_rate(path: Path, steps: np.ndarray, rate: float) -> float:
    """Hz, from a first guess: each step alone is a whole number of them, also where their median is not one."""
    rate = check_rate(path, rate)
    for _ in range(3):
        rate = max(1.0, float(np.rint(steps * rate).sum())) / float(steps.sum())
    return rate


def unit_by_steps(stamps: np.ndarray) -> str | None:
    """The unit of stamps by their step: that which makes a camera's rate; None where none does."""
    step = float(np.median(np.diff(stamps))) if len(stamps) > 1 else math.nan
    fitting = (unit for unit, scale in SECONDS.items() if step > 0.0 and RATES[0] <= 1.0 / (step * scale) <= RATES[1])
    return next(fitting, None)


def check_time_unit(map_file: Path, unit: str, stamps: np.ndarray) -> None:
    """Raises FileError for a unit with which no camera has the stamps' rate, while another one fits."""
    step, fits = float(np.median(np.diff(stamps))) * SECONDS[unit], unit_by_steps(stamps)
    if fits is not None and fits != unit and not 1.0 <= 1.0 / step <= 1e4:
        what = f"with {unit!r} the frame rate would be {1.0 / step:.4g} Hz; 1 to 10000 was expected"
        raise FileError(map_file, "time_unit", what, hint=f'The steps fit time_unit = "{fits}".')


def time_unit_of(path: Path, stamps: np.ndarray) -> str:
    """As `unit_by_steps`. Raises FileError where no unit makes a camera's rate."""
    unit = unit_by_steps(stamps)
    if unit is None:
        step = float(np.median(np.diff(stamps))) if len(stamps) > 1 else math.nan
        if step == 0.0:
            hint = "Put the markers of one sample side by side in one row; write times with all their digits."
            raise FileError(path, "time", "most rows have the time of the row before.", hint=hint)
        hint = (
            "Say time_unit in the map, and where another column has the rest of a stamp, milliseconds or nanoseconds."
        )
        raise FileError(path, "time", f"steps of {step:g} are a camera's in no unit.", hint=hint)
    return unit
