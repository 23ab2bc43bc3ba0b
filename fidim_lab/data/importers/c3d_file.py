"""C3D, the exchange format of biomechanics that Vicon, Qualisys, OptiTrack and others write. Needs the package c3d.

Markers, rate, unit (POINT:UNITS) and the upward axis (POINT:X_SCREEN, Y_SCREEN) are read; analog channels and events
are not. A point whose residual is negative was not seen. Every mistake is a FileError.
"""

import importlib
import io
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fidim_lab.data.files.input_file import MIB, read_bytes
from fidim_lab.data.importers.reading.cells import MIN_FRAMES, length_scale
from fidim_lab.data.importers.reading.clock import check_rate
from fidim_lab.data.importers.reading.labels import apart
from fidim_lab.data.importers.reading.signatures import refuse_empty
from fidim_lab.data.importers.recording import MarkerLog
from fidim_lab.errors import FileError, SetupError

LIMIT = 256 * MIB
"""bytes; ten minutes of 40 markers at 200 Hz have 77 MiB"""
MOST_POINTS = 1000
WORDS = 4
"""of one point: x, y, z, residual; the shortest file keeps each in two bytes"""


def read_c3d(path: Path) -> MarkerLog:
    """Read one file. Raises FileError, and SetupError without the package."""
    library = _library()
    data = read_bytes(path, LIMIT)
    refuse_empty(path, data)
    try:
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            reader = library.Reader(io.BytesIO(data))
            _check_size(path, reader, len(data))
            frames = [points for _, points, _ in reader.read_frames(analog_transform=False, check_nan=False)]
            count = reader.last_frame - reader.first_frame + 1
            names = _labels(reader)
            rate, unit, screen = float(reader.point_rate), _text(reader, "POINT:UNITS"), reader.get_screen_axis()
    except FileError:
        raise
    except Exception as error:  # the library answers damage with struct, index, value, key and Unicode errors
        raise FileError(path, "", f"is damaged or no C3D file ({type(error).__name__}: {str(error)[:80]})") from None
    if len(frames) < count and told:
        raise FileError(path, "", f"ends after {len(frames)} of {count} frames: it was cut off")
    with np.errstate(invalid="ignore"):  # signalling NaN of damaged bytes
        points = np.array(frames, dtype=float)
    return _log(path, names, check_rate(path, rate), points, unit, screen)


def _library() -> Any:
    try:
        return importlib.import_module("c3d")
    except ImportError as error:
        raise SetupError(f"C3D files need the package c3d: {error}", hint="pip install 'fidim-lab[c3d]'") from None


def _check_size(path: Path, reader: Any, size: int) -> None:
    """Raises FileError where the header promises more than the file can hold."""
    points, frames = int(reader.point_used), int(reader.last_frame) - int(reader.first_frame) + 1
    if not 1 <= points <= MOST_POINTS:
        raise FileError(path, "POINT:USED", f"{points} points; 1 to {MOST_POINTS} were expected")
    if frames < MIN_FRAMES:
        raise FileError(path, "", f"{frames} frames; a recording has at least {MIN_FRAMES}")
    if 2 * WORDS * points * frames > size:
        raise FileError(path, "", f"{points} points in {frames} frames are more than the file holds: it was cut off")


def _labels(reader: Any) -> list[str]:
    """Names of points: a parameter holds 255 of them, those beyond stand in LABELS2, LABELS3 and so on."""
    names: list[str] = []
    for number in range(1, MOST_POINTS):
        found = reader.get(f"POINT:LABELS{number if number > 1 else ''}")
        if found is None:
            break
        names += [str(name).strip() for name in found.string_array]
    return names


def _text(reader: Any, name: str) -> str:
    found = reader.get(name)
    return "" if found is None else str(found.string_value).strip(" \0")


def _log(
    path: Path, names: Sequence[str], rate: float, points: np.ndarray, unit: str, screen: tuple[str, str] | None
) -> MarkerLog:
    """points: (N, M, 5) in the file's unit."""
    positions = points[:, :, :3].copy()
    positions[(points[:, :, 3] < 0.0) | ~np.isfinite(positions).all(axis=2)] = np.nan
    count = positions.shape[1]
    named = [name or f"*{k + 1}" for k, name in enumerate([*names[:count], *[""] * (count - len(names))])]
    scale = length_scale(path, "POINT:UNITS", unit) if unit else 1.0
    up = _up(screen)
    labelled, kept, loose = apart(named, scale * positions)
    said = [f"{rate:g} Hz" + (f", lengths in {unit}" if unit else "") + (f", {up} upwards" if up else "")]
    t = np.arange(len(positions)) / rate
    decided = (said[0] + ", as the file's POINT parameters say",)
    return MarkerLog(path, labelled, rate, t, kept, scale, up, decided, unlabelled=loose, unit_said=bool(unit))


def _up(screen: tuple[str, str] | None) -> str | None:
    """The axis that points upwards on the screen, where it is a positive one."""
    axis = "" if screen is None else str(screen[1]).strip(" \0").lower()
    return axis[1] if axis in {"+x", "+y", "+z"} else None
