"""Is a run's folder what it was when the run ended? Every file is held against the manifest."""

from dataclasses import dataclass
from pathlib import Path

from fidim_lab.app.formats.manifest import FileEntry, Manifest, Software, file_entries, read_manifest, software


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
