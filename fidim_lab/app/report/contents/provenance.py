"""Where a report comes from: versions of what computed it, and the files it was computed from with their checksums.

Nothing here depends on when or in which folder the report is written: the same run gives the same report.
"""

import hashlib
import platform
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from fidim_lab.app.formats.manifest import LARGEST, MANIFEST, read_manifest
from fidim_lab.app.formats.verification import verify
from fidim_lab.data.files.input_file import open_input
from fidim_lab.say import printable

LIBRARIES = ("casadi", "numpy", "scipy", "pandas", "pydantic", "canopen", "python-can", "matplotlib", "jinja2")
DERIVED = ("result.json", "explanation.json")
"""written from the other files, with the seconds that it took: no source, and never twice the same"""
DERIVED_SUFFIXES = (".html", ".part", ".pdf", ".svg")


@dataclass(frozen=True)
class SourceFile:
    """One file of the folder."""

    name: str
    """relative to the folder, with /"""
    size: int
    """bytes"""
    sha256: str


@dataclass(frozen=True)
class Provenance:
    """What a reader needs to repeat it."""

    versions: tuple[tuple[str, str], ...]
    """name, version; fidim-lab and Python first"""
    files: tuple[SourceFile, ...]
    manifest: tuple[tuple[str, str], ...] = ()
    """what manifest.json says of them: a fact and its words; empty without one"""


def provenance(folder: Path) -> Provenance:
    """Versions, and all files of a folder but derived and hidden ones. Raises FileError where one cannot be read."""
    return Provenance(
        manifest=_manifest(folder),
        versions=(
            ("fidim-lab", _version("fidim-lab")),
            (platform.python_implementation(), platform.python_version()),
            *((name, _version(name)) for name in LIBRARIES),
        ),
        files=tuple(_source(folder, path) for path in sorted(folder.rglob("*")) if _is_source(folder, path)),
    )


def _manifest(folder: Path) -> tuple[tuple[str, str], ...]:
    """Whether the files are those of the run, and what recorded it."""
    if not (folder / MANIFEST).exists():
        return ()
    found = verify(folder)
    missing, extra = (f"{name} is missing" for name in found.missing), (f"{name} is new" for name in found.extra)
    differing = "; ".join(map(printable, (*found.changed, *missing, *extra)))
    said = f"✓ all {found.checked} files are unchanged since the run ended" if found.intact else f"✗ {differing}"
    recorded = read_manifest(folder).software
    commit = "" if recorded.commit is None else f", fidim-lab {recorded.commit}"
    return (("against manifest.json", said), ("recorded with", f"{recorded.python}{commit}"))


def _is_source(folder: Path, path: Path) -> bool:
    parts = path.relative_to(folder).parts
    derived = path.name in DERIVED or path.suffix in DERIVED_SUFFIXES
    return path.is_file() and not derived and not any(part.startswith(".") for part in parts)


def _source(folder: Path, path: Path) -> SourceFile:
    with open_input(path, LARGEST) as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return SourceFile(printable(path.relative_to(folder).as_posix()), path.stat().st_size, digest)


def _version(distribution: str) -> str:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "not installed"
