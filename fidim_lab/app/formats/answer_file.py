"""What `--json FILE` of a command writes: one object with its format, whole or not at all."""

from collections.abc import Mapping
from pathlib import Path

from fidim_lab.app.formats.run_spec import read_summary
from fidim_lab.data.files.json_file import write_json
from fidim_lab.errors import SetupError


def write_answer(path: Path | None, form: str, table: Mapping[str, object]) -> None:
    """Write an answer of this format; nothing where nobody asked. Raises SetupError where it cannot be written."""
    if path is None:
        return
    try:
        write_json(path, {"format": form, **table})
    except OSError as error:
        what = f"--json {path}: cannot be written: {error.strerror or error}."
        raise SetupError(what, hint="Choose a folder that exists and is yours.") from error


def write_summary(path: Path | None, folder: Path, code: int) -> None:
    """What a run left in its folder, "fidim-summary/1", with the folder and the exit code of the command."""
    if path is not None:
        write_answer(path, "fidim-summary/1", {**read_summary(folder), "folder": str(folder), "exit_code": code})
