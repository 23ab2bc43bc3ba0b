"""Files that are no text: what their first bytes say they are, and how they can be read."""

from pathlib import Path

from fidim_lab.errors import FileError

SIGNATURES = (
    (b"\x89HDF\r\n\x1a\n", "HDF5 or a MATLAB file of version 7.3", "Write its arrays as a table: fidim import csv."),
    (b"MATLAB 5.0", "a MATLAB file", "Read it by fidim import csv, or by qtm-mat where QTM wrote it."),
    (b"SQLite format 3\0", "an SQLite database", "A ROS 2 bag is read by fidim import ros2-bag."),
    (b"#ROSBAG", "a bag of ROS 1", "Convert it: rosbags-convert --src FILE --dst FOLDER."),
    (b"\x89MCAP", "an MCAP file", "Read it by fidim import mcap."),
    (b"PAR1", "a Parquet file", "Write it as a table: pandas.read_parquet(FILE).to_csv(TABLE)."),
    (b"\x1f\x8b", "packed with gzip", "Unpack it first: gunzip FILE."),
    (b"PK\x03\x04", "a ZIP: NumPy's .npz, a workbook or packed files", "Unpack it, or write its arrays as a table."),
    (b"\x93NUMPY", "an array of NumPy", "Write it as a table: numpy.savetxt(TABLE, numpy.load(FILE))."),
    (b"\x80\x02", "a pickle of Python", "Write its arrays as a table: pandas.DataFrame(…).to_csv(TABLE)."),
    (b"\x80\x03", "a pickle of Python", "Write its arrays as a table: pandas.DataFrame(…).to_csv(TABLE)."),
    (b"\x80\x04", "a pickle of Python", "Write its arrays as a table: pandas.DataFrame(…).to_csv(TABLE)."),
    (b"\x80\x05", "a pickle of Python", "Write its arrays as a table: pandas.DataFrame(…).to_csv(TABLE)."),
)
"""first bytes, what such a file is, what to do with it"""
C3D = b"\x50"
"""second byte of a C3D file; the first tells where its parameters begin"""


def refuse_empty(path: Path, data: bytes) -> None:
    """Raises FileError for a file, or its first bytes, of which nothing was written."""
    if not data.strip(b"\0 \t\r\n"):
        raise FileError(path, "", "is empty")


def refuse_no_text(path: Path, data: bytes) -> None:
    """Raises FileError for an empty file, and for one whose first bytes say that it is no text, naming what it is."""
    refuse_empty(path, data)
    for begin, what, hint in SIGNATURES:
        if data.startswith(begin):
            raise FileError(path, "", f"is {what}; a text was expected.", hint=hint)
    if data[1:2] == C3D and data[0] < 32 and b"POINT" in data[: 1 << 14]:
        raise FileError(path, "", "is a C3D file; a text was expected.", hint="Read it by fidim import c3d.")
