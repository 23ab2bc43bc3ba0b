"""EDS and DCF files as text, before a parser counts what they say: `read_eds_text`."""

import re
from pathlib import Path

from fidim_lab.data.files.input_file import MIB, read_bytes
from fidim_lab.errors import FileError

LIMIT = 4 * MIB
"""bytes; the largest of a drive's maker that we know has 0.7 MiB"""
_COUNT = re.compile(r"^[ \t]*(NrOfEntries|Lines)[ \t]*[=:][ \t]*(0x[0-9a-f]+|[0-9]+)", re.MULTILINE | re.IGNORECASE)
MOST_ENTRIES = 0xFE
"""sub-indices of one object"""


def read_eds_text(path: Path) -> str:
    """The text of an EDS file. Raises FileError for no file, one too large, or a count that no file can keep.

    Makers write their names in whatever encoding their editors have; nothing that counts is beyond ASCII.
    canopen goes through `NrOfEntries` and `Lines` one by one, so that two thousand million took all memory.
    """
    text = read_bytes(path, LIMIT).decode("utf-8-sig", "replace").replace("\r\n", "\n").replace("\r", "\n")
    lines = text.count("\n") + 1
    for key, value in _COUNT.findall(text):
        allowed = lines if key.lower() == "lines" else MOST_ENTRIES
        if len(value) > 9 or int(value, 16 if "x" in value.lower() else 10) > allowed:
            raise FileError(path, key, f"{value[:20]} is more than the file can hold; at most {allowed} is allowed")
    return text
