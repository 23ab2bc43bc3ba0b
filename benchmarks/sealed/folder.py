"""The folder of a benchmark: campaigns for everybody to read, truth under seal, one answer file for each.

    settings.json              what was asked for
    campaigns/b0001/           as `fidim simulate` writes them, without truth
    sealed/b0001.json          the truth: read by `opened` alone, after the last explanation
    commitment.json            SHA-256 of each sealed file, and of all together
    answers/b0001.json         what `explain` said
    loudness/b0001.json        how much the secret changes, measured after opening

Every file is written whole or not at all, so that a benchmark which was cut off goes on.
"""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fidim_lab.data.files import input_file
from fidim_lab.errors import FileError, RefusedError, SetupError

Json = dict[str, Any]


@dataclass(frozen=True)
class BenchmarkFolder:
    """Where everything of one benchmark lies."""

    path: Path

    @property
    def settings(self) -> Path:
        """What was asked for."""
        return self.path / "settings.json"

    @property
    def commitment(self) -> Path:
        """The hashes."""
        return self.path / "commitment.json"

    def campaign(self, name: str) -> Path:
        """A campaign folder."""
        return self.path / "campaigns" / name

    def sealed(self, name: str) -> Path:
        """The truth of one campaign."""
        return self.path / "sealed" / f"{name}.json"

    def answer(self, name: str) -> Path:
        """What was said of it."""
        return self.path / "answers" / f"{name}.json"

    def loudness(self, name: str) -> Path:
        """How much its secret changes."""
        return self.path / "loudness" / f"{name}.json"


def write_json(path: Path, content: Json) -> None:
    """Whole or not at all. Raises SetupError where it cannot be written."""
    part = path.with_name(f".{path.name}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")
        part.replace(path)
    except OSError as error:
        raise SetupError(f"{path}: cannot be written ({error.strerror}).", hint="Choose another --out.") from error


def read_json(path: Path) -> Json:
    """Read a file of this folder. Raises SetupError where it is missing or was cut off."""
    try:
        return input_file.read_json(path)
    except FileError as error:
        raise SetupError(f"{error.message}.", hint="Delete it, and call the benchmark again.") from error


def commit(folder: BenchmarkFolder, names: list[str]) -> str:
    """Write the hashes of the sealed files, and give the one of all of them (hex).

    Hashes that are there already are kept, and must still be right. Raises RefusedError where they are not.
    """
    now = {name: _digest(folder.sealed(name)) for name in names}
    if folder.commitment.exists():
        verify(folder, names)
    else:
        write_json(folder.commitment, {"algorithm": "sha256", "whole": _whole(now), "campaigns": now})
    return str(read_json(folder.commitment)["whole"])


def verify(folder: BenchmarkFolder, names: list[str]) -> None:
    """Raises RefusedError where a sealed truth is not the one that was committed to."""
    committed: dict[str, str] = read_json(folder.commitment)["campaigns"]
    for name in names:
        if committed.get(name) != _digest(folder.sealed(name)):
            raise RefusedError(
                f"{folder.sealed(name)}: its hash is not the one in {folder.commitment}; the truth was changed.",
                hint="Nothing can be proved with it any more: begin again in a new --out.",
            )


def opened(folder: BenchmarkFolder, name: str) -> Json:
    """The truth of a campaign. To be called when everything is explained."""
    return read_json(folder.sealed(name))


def keep_settings(folder: BenchmarkFolder, settings: Json) -> None:
    """Write the settings, or see that they are the same as before. Raises SetupError where they are not."""
    if not folder.settings.exists():
        write_json(folder.settings, settings)
        return
    before = read_json(folder.settings)
    if before != settings:
        differ = ", ".join(f"{key}: {before.get(key)} there" for key in settings if before.get(key) != settings[key])
        raise SetupError(f"{folder.path} holds a benchmark with other settings ({differ}).", hint="Take another --out.")


def _digest(path: Path) -> str:
    return hashlib.sha256(input_file.read_bytes(path)).hexdigest()


def _whole(digests: dict[str, str]) -> str:
    lines = "".join(f"{digest}  {name}\n" for name, digest in sorted(digests.items()))
    return hashlib.sha256(lines.encode()).hexdigest()
