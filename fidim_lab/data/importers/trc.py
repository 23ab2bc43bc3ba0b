"""TRC, the marker file of OpenSim, Cortex and others: tab-separated, y-up by its convention.

    PathFileType  4  (X/Y/Z)  name.trc
    DataRate  CameraRate  NumFrames  NumMarkers  Units  OrigDataRate …
    100       100         500        4           mm     …
    Frame#  Time  A  <tab><tab>  B …
    <tab><tab>    X1  Y1  Z1  X2 …

Every mistake is a FileError with the line it is in.
"""

from pathlib import Path

from fidim_lab.data.importers.reading.cells import (
    NO_HEADER,
    SPACES,
    cells_of,
    decimal_of,
    length_scale,
    read_export,
    table,
)
from fidim_lab.data.importers.reading.clock import clocked, header_rate
from fidim_lab.data.importers.reading.labels import apart
from fidim_lab.data.importers.recording import MarkerLog
from fidim_lab.errors import FileError

HEADER_LINES = 5
LEAD = 2
"""Frame#, Time"""


def read_trc(path: Path) -> MarkerLog:
    """Read one export. Raises FileError with line and column."""
    text = read_export(path).splitlines()
    delimiter = "\t" if any("\t" in line for line in text[:1]) else SPACES
    lines = [cells_of(line, delimiter) or [""] for line in text]
    if len(lines) < HEADER_LINES or lines[0][0].strip() != "PathFileType":
        raise FileError(path, "line 1", "is not a TRC file: 'PathFileType' was expected.", hint=NO_HEADER)
    head = dict(zip((cell.strip() for cell in lines[1]), (cell.strip() for cell in lines[2]), strict=False))
    if lines[3][0].strip().rstrip("#").lower() != "frame":
        raise FileError(path, "line 4", "'Frame#' was expected first")
    names = tuple(cell.strip() for cell in lines[3][LEAD:] if cell.strip())
    if not names:
        raise FileError(path, "line 4", "no marker")
    decimal = decimal_of(text[HEADER_LINES : HEADER_LINES + 50], delimiter)
    values = table(path, lines[HEADER_LINES:], HEADER_LINES + 1, LEAD + 3 * len(names), lead=LEAD, decimal=decimal)
    unit = head.get("Units", "")
    scale = length_scale(path, "line 3, Units", unit) if unit else 1.0
    names, positions, loose = apart(names, scale * values[:, LEAD:].reshape(len(values), -1, 3))
    said_rate = header_rate(path, 3, head.get("DataRate", ""))
    t, rate, doubt = clocked(path, said_rate, values[:, 0], values[:, 1])
    lengths = f"lengths in {unit}, " if unit else ""
    said = (f"{lengths}{rate:g} Hz and y upwards: as the header and the convention of TRC say",)
    known = bool(unit)
    return MarkerLog(
        path, names, rate, t, positions, scale, "y", said, unlabelled=loose, unit_said=known, rate_doubt=doubt
    )
