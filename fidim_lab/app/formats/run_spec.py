"""What a service is to do, "fidim-run/1": handed to its process as JSON, kept beside the run so that it can go on.

`fidim run` makes one from its options, `fidim resume` reads it back from the run folder.
"""

import math
from collections.abc import Mapping
from dataclasses import is_dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, get_type_hints

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from drivers.ports import PromptKind
from fidim_lab.app.formats.key_words import range_words
from fidim_lab.data.files.input_file import read_json
from fidim_lab.data.files.mistakes import read_json_as
from fidim_lab.data.rigs.stop_file import stop_path
from fidim_lab.errors import FileError, SetupError
from procedures.settings import Settings

NAME = "run.json"
PLAN = "plan.toml"
RIG = "rig.toml"
"""byte for byte the rig file; paths in it are relative to where it was (run.json)"""
SUMMARY = "summary.json"
"""how the run ended, beside it (`unattended` writes it)"""
FORMAT = "fidim-run/1"
HOOK_TIMEOUT = 60.0
"""s that a hook may take"""


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


TimeOfDay = Annotated[str, Field(pattern=r"^([01]\d|2[0-3]):[0-5]\d$")]


class AnswerSpec(_Part):
    """What is answered to a kind of prompt where nobody does."""

    choice: Annotated[str, Field(min_length=1)]
    after: Annotated[float, Field(ge=0)] = 0.0
    """s"""


class UnattendedSpec(_Part):
    """Leaving a robot alone."""

    answers: dict[PromptKind, AnswerSpec] = {}
    max_hours: Annotated[float, Field(gt=0)] | None = None
    quiet_hours: tuple[TimeOfDay, TimeOfDay] | None = None
    """from, to (local time of day): no window begins between them"""


class RunSpec(_Part):
    """One run on one rig. Paths are absolute."""

    format: Literal["fidim-run/1"] = FORMAT
    plan: Path
    rig: Path
    out: Path
    procedure: str = "identify"
    """name of a built-in procedure, or a Python file"""
    resume: bool = False
    """the run of this folder goes on"""
    accept_place: bool = False
    """resume from wherever the robot is: a person has looked"""
    settings: dict[str, float] = {}
    """"table.key" → value, for what the rig file does not say (fidim run --set)"""
    embedded: bool = False
    """the rig's devices are simulated in a child process of the service: a rehearsal in real time"""
    dry_run: bool = False
    """`fidim dry-run --ui`: the rig file was made for this run, its copy in the run folder counts"""
    seed: int = 1
    """of an embedded world"""
    hide: tuple[str, ...] = ()
    """effects hidden in an embedded world"""
    alone: bool = False
    """nobody looks: each kind of prompt must have an answer in `unattended`"""
    unattended: UnattendedSpec | None = None
    on_finish: str = ""
    """shell command after a run that ended well; the folder is its $FIDIM_RUN, the outcome $FIDIM_OUTCOME"""
    on_fault: str = ""
    """… after one that did not"""
    by: str = ""
    """who is at the robot while stops are tried (`fidim commission`)"""
    operator: str = ""
    """who records, for the history"""
    note: str = ""
    """what is to be remembered of it"""
    stay: bool = False
    """the service goes on after the run, for clients to look at, until one shuts it down (or resumes the run)"""
    tcp_port: int | None = None
    """also listen at this port of 127.0.0.1, with a token; 0 takes a free one"""

    @property
    def stopped(self) -> Path:
        """The file that keeps its emergency stop: the rig's; a dry run, which has none of its own, has it beside."""
        if self.dry_run:
            return self.out.with_name(f"{self.out.name}.stopped.toml")
        return stop_path(self.rig, embedded=self.embedded)

    @property
    def own_place(self) -> Path | None:
        """By what its service is found where its rig file was made for it (`place_of`)."""
        return self.out if self.dry_run else None


def write_spec(folder: Path, spec: RunSpec) -> None:
    """Keep it beside the run. Raises OSError."""
    (folder / NAME).write_text(spec.model_dump_json(indent=1) + "\n", encoding="utf-8")


def read_spec(folder: Path) -> RunSpec:
    """Raises FileError where the folder is no run of a service."""
    path = folder / NAME
    if not path.exists():
        raise FileError(path, "", "no such file.", hint="Only what `fidim run` began can be resumed.")
    return read_json_as(path, RunSpec.model_validate)


def again(spec: RunSpec, folder: Path) -> RunSpec:
    """The same run, to go on in its folder, wherever that is now.

    The input files of a dry run were made for it, as a rehearsal's may have been, and are gone: the folder has copies.
    """
    update: dict[str, object] = {"out": folder, "resume": True}
    if spec.dry_run or (spec.embedded and not spec.rig.exists()):
        update |= {"rig": folder / RIG, "plan": folder / PLAN}
    return spec.model_copy(update=update)


def read_summary(folder: Path) -> dict[str, Any]:
    """What a run said when it ended, "fidim-summary/1"; empty where it left nothing that can be read."""
    try:
        found = read_json(folder / SUMMARY)
    except FileError:
        return {}
    return found if isinstance(found, dict) else {}


def overridden(settings: Settings, values: Mapping[str, float]) -> Settings:
    """Settings with some numbers changed. Raises SetupError naming what there is to change, or what it may be."""
    tables: dict[str, Any] = {name: part for name, part in vars(settings).items() if is_dataclass(part)}
    for key, value in values.items():
        table, _, name = key.partition(".")
        known = numbers(tables.get(table))
        if name not in known:
            what = ", ".join(sorted(known or tables))
            raise SetupError(f"--set {key}: no such number; there are {what}.")
        tables[table] = replace(tables[table], **{name: _allowed(key, value, number_type(type(tables[table]), name))})
    return replace(settings, **tables)


def numbers(part: object) -> dict[str, float]:
    """The numbers of a table of settings that can be set; none where it is no table."""
    inside = vars(part) if is_dataclass(part) else {}
    return {name: value for name, value in inside.items() if isinstance(value, int | float)}


def number_type(table: type[object], name: str) -> TypeAdapter[float]:
    """What a number of a table of settings may be."""
    return TypeAdapter(get_type_hints(table, include_extras=True)[name])


def _allowed(key: str, value: float, wanted: TypeAdapter[float]) -> float:
    """The number as the setting's type has it. Raises SetupError."""
    try:
        if math.isfinite(value):
            return wanted.validate_python(value)
    except ValidationError:
        pass
    raise SetupError(
        f"--set {key}={value:g}: {number_words(wanted.json_schema())} is allowed.",
        hint="SI units; docs/file-keys.md lists all settings. Guards may be set as far as a rig file may set them.",
    )


def number_words(schema: dict[str, Any]) -> str:
    """What a setting's schema allows, e.g. "a whole number ≥ 1, ≤ 20"."""
    kind = {"boolean": "0 or 1", "integer": "a whole number"}.get(schema["type"], "a number")
    return f"{kind} {range_words(schema)}".strip()
