"""Which kinds of recording can be imported, and the reader of each. A new kind is one file and one line here."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from fidim_lab.data.importers.irma4u import read_irma4u
from fidim_lab.data.importers.recording import Recording
from fidim_lab.errors import SetupError

Reader = Callable[[Sequence[Path]], Recording]
"""Reads the files of one kind from files or folders. Raises FileError or SetupError naming what is wrong."""

READERS: Mapping[str, Reader] = MappingProxyType({"irma4u": read_irma4u})


def read_recording(kind: str, sources: Sequence[Path]) -> Recording:
    """Read a recording of one kind from its files or folders.

    Raises SetupError where there is no such kind, otherwise what the kind's reader raises.
    """
    if kind not in READERS:
        raise SetupError(f"No recording of kind {kind!r} is known.", hint=f"Known kinds: {', '.join(sorted(READERS))}.")
    return READERS[kind](sources)
