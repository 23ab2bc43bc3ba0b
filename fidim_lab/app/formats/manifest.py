"""manifest.json, "fidim-manifest/1": every file of a run with its checksum, and all that recorded it.

Written when a run has ended (again after `fidim resume`); `fidim verify` holds a folder against it. Results, reports
and exports are left out: they can be made again. The same run gives the same bytes.
"""

import hashlib
import os
import platform
import subprocess
from dataclasses import dataclass
from importlib.metadata import distributions
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict

from fidim_lab.data.files.input_file import open_input
from fidim_lab.data.files.json_file import write_json
from fidim_lab.data.files.mistakes import read_json_as
from fidim_lab.errors import FileError
from procedures.recording.disk import disk_error, sync

MANIFEST = "manifest.json"
FORMAT = "fidim-manifest/1"
DERIVED = ("result.json", "explanation.json", "validation.json", MANIFEST, f"{MANIFEST}.part")
DERIVED_SUFFIXES = (".html", ".pdf", ".svg")
EXPORTS = "export"
"""folder that is left out"""
LARGEST = 1 << 40
"""bytes of one file"""
NO_FILE = "no regular file"
"""in place of the checksum of a FIFO or device, which no run leaves: nobody waits for it"""
_GIT_TIMEOUT = 5.0


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class FileEntry(_Part):
    """One file of the run."""

    size: int
    """bytes"""
    sha256: str


class Software(_Part):
    """What recorded the run."""

    python: str
    platform: str
    commit: str | None
    """of the checkout that was run from, with "-dirty" where it had changes; None for an installed package"""
    packages: dict[str, str]
    """every installed distribution with its version"""


class Manifest(_Part):
    """The whole file."""

    format: Literal["fidim-manifest/1"]
    software: Software
    files: dict[str, FileEntry]
    """by name relative to the folder, with /"""


def write_manifest(folder: Path) -> Path:
    """Write it whole or not at all, on the disk when this returns. Raises HardwareError when the disk fails."""
    path = folder / MANIFEST
    made = Manifest(format=FORMAT, software=software(), files=file_entries(folder))
    try:
        write_json(path, made.model_dump())
        sync(folder)
    except OSError as error:
        raise disk_error(path, error) from error
    return path


def read_manifest(folder: Path) -> Manifest:
    """Raises FileError where there is none, or it is not as it should be."""
    path = folder / MANIFEST
    if not folder.is_dir():
        raise FileError(folder, "", "is not a folder" if folder.exists() else "no such folder")
    if not path.exists():
        hint = "Only runs have one, written when they end; a run that was broken off gets its own from fidim resume."
        raise FileError(path, "", "there is no manifest to verify against.", hint=hint)
    return read_json_as(path, Manifest.model_validate)


def file_entries(folder: Path) -> dict[str, FileEntry]:
    """Size and checksum of every file that counts, hidden ones too, by name. Raises FileError for one unreadable."""
    return {_name(folder, path): _entry(path) for path in sorted(folder.rglob("*")) if _counts(folder, path)}


def software() -> Software:
    """Of this process."""
    packages = {d.metadata["Name"]: d.version for d in distributions()}
    return Software(
        python=f"{platform.python_implementation()} {platform.python_version()}",
        platform=platform.platform(),
        commit=_commit(Path(__file__).parents[3]),
        packages=dict(sorted(packages.items(), key=lambda item: item[0].lower())),
    )


def _name(folder: Path, path: Path) -> str:
    return path.relative_to(folder).as_posix()


def _counts(folder: Path, path: Path) -> bool:
    parts = path.relative_to(folder).parts
    if path.is_dir() or parts[0] == EXPORTS:
        return False
    return not (len(parts) == 1 and (path.name in DERIVED or path.suffix in DERIVED_SUFFIXES))


def _entry(path: Path) -> FileEntry:
    if not path.is_file():
        return FileEntry(size=0, sha256=NO_FILE)
    with open_input(path, LARGEST) as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return FileEntry(size=path.stat().st_size, sha256=digest)


def _commit(checkout: Path) -> str | None:
    """Of the source tree, where there is one and git can tell."""
    if not (checkout / ".git").exists():
        return None
    command = ["git", "-C", str(checkout), "describe", "--always", "--abbrev=40", "--dirty", "--exclude=*"]
    quiet = {**os.environ, "GIT_OPTIONAL_LOCKS": "0"}
    try:
        told = subprocess.run(command, capture_output=True, text=True, timeout=_GIT_TIMEOUT, check=True, env=quiet)
    except (OSError, subprocess.SubprocessError):
        return None
    return told.stdout.strip() or None


@dataclass(frozen=True)
class Verification:
    """What was found; a folder is intact where the first three are empty."""

    changed: tuple[str, ...]
    """name of each file whose bytes are others, with how its size differs"""
    missing: tuple[str, ...]
    extra: tuple[str, ...]
    checked: int
    """files that are as they were"""
    versions: tuple[str, ...]
    """software that is another here: no fault of the folder, but a reason for other digits"""

    @property
    def intact(self) -> bool:
        """Whether every file is there as it was, and no other."""
        return not (self.changed or self.missing or self.extra)


def verify(folder: Path) -> Verification:
    """Hold a folder against its manifest. Raises FileError without one, and for a file that is unreadable."""
    manifest = read_manifest(folder)
    found = file_entries(folder)
    common = sorted(manifest.files.keys() & found.keys())
    changed = tuple(_says(name, manifest, found) for name in common if manifest.files[name] != found[name])
    return Verification(
        changed=changed,
        missing=tuple(sorted(manifest.files.keys() - found.keys())),
        extra=tuple(sorted(found.keys() - manifest.files.keys())),
        checked=len(common) - len(changed),
        versions=_differences(manifest.software, software()),
    )


def _says(name: str, manifest: Manifest, found: dict[str, FileEntry]) -> str:
    was, is_ = manifest.files[name].size, found[name].size
    return (
        f"{name} ({was} bytes, but with other contents)"
        if was == is_
        else f"{name} ({was} bytes were recorded, {is_} found)"
    )


def _differences(then: Software, now: Software) -> tuple[str, ...]:
    pairs = [("Python", then.python, now.python), ("fidim-lab commit", then.commit, now.commit)]
    names = sorted(then.packages.keys() | now.packages.keys(), key=str.lower)
    pairs += [(name, then.packages.get(name), now.packages.get(name)) for name in names]
    return tuple(f"{name} {was or 'absent'}, here {is_ or 'absent'}" for name, was, is_ in pairs if was != is_)
