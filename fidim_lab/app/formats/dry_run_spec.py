"""What a dry run was told, "fidim-dry-run/1": kept in its folder as run.json, so that it goes on after a kill.

`fidim resume` reads the same file of a run on a rig (`service.spec`); the key `format` tells them apart.
"""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from fidim_lab.app.formats.run_spec import NAME
from fidim_lab.data.files.input_file import read_json
from fidim_lab.data.files.mistakes import validated_json

FORMAT = "fidim-dry-run/1"


class DryRunSpec(BaseModel):
    """One rehearsal in this process; plan and robot are in its folder."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal["fidim-dry-run/1"] = FORMAT
    seed: Annotated[int, Field(ge=0)]
    hide: tuple[str, ...] = ()
    real_time: bool = False
    excite: bool = False


def write_dry_run(folder: Path, spec: DryRunSpec) -> None:
    """Keep it beside the run. Raises OSError."""
    (folder / NAME).write_text(spec.model_dump_json(indent=1) + "\n", encoding="utf-8")


def read_dry_run(folder: Path) -> DryRunSpec | None:
    """None where the folder's run is another. Raises FileError for a wrong one."""
    path = folder / NAME
    if not path.exists():
        return None
    found = read_json(path)
    if not isinstance(found, dict) or found.get("format") != FORMAT:
        return None
    return validated_json(path, found, DryRunSpec.model_validate)
