"""`fidim verify`: is a run's folder what it was when the run ended? Every file is held against the manifest."""

from dataclasses import asdict, dataclass
from pathlib import Path

from fidim_lab.app.formats.answer_file import write_answer
from fidim_lab.app.formats.manifest import FileEntry, Manifest, Software, file_entries, read_manifest, software
from fidim_lab.app.terminal import console
from fidim_lab.say import printable

FORMAT = "fidim-verification/1"


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


def verify_command(folder: Path, json_file: Path | None) -> int:
    """Verify and say what is wrong, file by file; 0 intact, 1 not. Raises FileError (2) where there is no manifest."""
    found = verify(folder)
    write_answer(json_file, FORMAT, {"folder": folder.name, "intact": found.intact, **asdict(found)})
    for what, names in (("changed", found.changed), ("missing", found.missing), ("extra", found.extra)):
        for name in names:
            console.out.print(f"{what:8} {printable(name)}", markup=False)
    if found.versions:
        console.warn([f"recorded with other software: {'; '.join(found.versions)}"])
    wrong = len(found.changed) + len(found.missing) + len(found.extra)
    verdict = "intact" if found.intact else f"not intact: {wrong} difference{'s' * (wrong != 1)}"
    console.out.print(f"{printable(str(folder))}: {verdict}, {found.checked} files as they were recorded", markup=False)
    return 0 if found.intact else 1


def _says(name: str, manifest: Manifest, found: dict[str, FileEntry]) -> str:
    was, is_ = manifest.files[name].size, found[name].size
    return f"{name} ({was} bytes, other ones)" if was == is_ else f"{name} ({was} bytes were recorded, {is_} found)"


def _differences(then: Software, now: Software) -> tuple[str, ...]:
    pairs = [("Python", then.python, now.python), ("fidim-lab commit", then.commit, now.commit)]
    names = sorted(then.packages.keys() | now.packages.keys(), key=str.lower)
    pairs += [(name, then.packages.get(name), now.packages.get(name)) for name in names]
    return tuple(f"{name} {was or 'absent'}, here {is_ or 'absent'}" for name, was, is_ in pairs if was != is_)
