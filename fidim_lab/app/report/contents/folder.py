"""What a run, campaign or import folder holds: `read_folder`. Only campaign.toml, robot.toml and windows must be there.

campaign.toml, robot.toml, windows/   the recording            truth.json     what a simulator hid
journal.jsonl                         how it was recorded      import.json    where it was imported from
devices.json                          the drives

A report also says where it comes from: versions of what computed it, and the files with their checksums. Nothing here
depends on when or in which folder the report is written: the same run gives the same report.
"""

import hashlib
import platform
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ConfigDict

from fidim_lab.app.formats.manifest import LARGEST, MANIFEST, read_manifest, verify
from fidim_lab.app.report.contents.story import Story, read_story
from fidim_lab.data.campaign import FORMAT, INDEX, NO_RATE, CampaignTable, read_campaign
from fidim_lab.data.files.input_file import open_input, read_json
from fidim_lab.data.files.mistakes import read_json_as
from fidim_lab.data.files.toml_file import read_toml
from fidim_lab.data.records import Body, Campaign
from fidim_lab.data.robot_file import read_robot
from fidim_lab.say import printable
from procedures.recording.journal import NAME as JOURNAL

LIBRARIES = ("casadi", "numpy", "scipy", "pandas", "pydantic", "canopen", "python-can", "matplotlib", "jinja2")
DERIVED = ("result.json", "explanation.json")
"""written from the other files, with the seconds that it took: no source, and never twice the same"""
DERIVED_SUFFIXES = (".html", ".part", ".pdf", ".svg")

TRUTH = "truth.json"
IMPORT = "import.json"
DEVICES = "devices.json"
TAKES = "fidim-takes/1"
"""format of import.json where many takes were imported"""

Values3 = tuple[float, float, float]
Values6 = tuple[float, float, float, float, float, float]


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


class _Lenient(BaseModel):
    """Files of which the report needs a part."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)


class GradeRow(_Lenient):
    """How a drive met one requirement, as `fidim_lab.app.formats.devices_file` writes it."""

    requirement: str
    grade: str
    met: str
    found: str
    instead: str = ""


class DriveName(_Lenient):
    """Of a winch."""

    name: str


class DriveTable(_Lenient):
    """One winch's drive."""

    config: DriveName
    grades: tuple[GradeRow, ...] = ()


class Drives(_Lenient):
    """devices.json: the drives of a run."""

    winches: tuple[DriveTable, ...] = ()


class LeftOut(_Lenient):
    """What a simulator left out of the model."""

    title: str = ""
    label: tuple[str, ...] = ()


class Truth(_Lenient):
    """truth.json: the body that a simulator hid."""

    seed: int | None = None
    case: LeftOut = LeftOut()
    s: Values3
    I: Values6  # noqa: E741 - the file's key, the field's symbol

    @property
    def body(self) -> Body:
        """The true body."""
        return Body.from_vector([*self.s, *self.I])  # type: ignore[arg-type]


class Cluster(_Lenient):
    """The markers as a rigid body."""

    noise: float
    rms: float
    frames_used: int
    frames: int


class RegistrationTable(_Lenient):
    """How the markers were placed in the robot's frame."""

    rms: float
    compliance: float
    tilt: float


class ClockFound(_Lenient):
    """One clock against another, s."""

    offset: float
    sd: float


class Clocks(_Lenient):
    """The log's clock against motion capture."""

    log_minus_markers: ClockFound


class ImportedWindow(_Lenient):
    """One stretch that was cut out, s of the recording."""

    id: str
    t: tuple[float, float]
    says: str = ""


class Imported(_Lenient):
    """import.json, "fidim-import/1", as far as the report tells it."""

    kind: str
    name: str
    sources: dict[str, str]
    cluster: Cluster
    registration: RegistrationTable
    clock: Clocks
    windows: tuple[ImportedWindow, ...]

    def of(self, window: str) -> ImportedWindow | None:
        """Where one window was cut out; None where this import does not know it."""
        return next((found for found in self.windows if found.id == window), None)


class TakeFound(_Lenient):
    """One take of an import of many."""

    id: str
    file: str
    log: str | None = None
    decided: tuple[str, ...]
    warnings: tuple[str, ...]
    refused: str | None = None


class ImportedTakes(_Lenient):
    """What an import of many takes decided ("fidim-takes/1")."""

    kind: str
    name: str
    takes: tuple[TakeFound, ...]
    unread: dict[str, str] = {}


@dataclass(frozen=True, eq=False)
class Contents:
    """All that a report can tell of a folder; None for what is not there."""

    campaign: Campaign
    """without windows for a run that ended before the first was accepted"""
    story: Story | None
    truth: Truth | None
    imported: Imported | None
    """one recording"""
    takes: ImportedTakes | None
    """many takes"""
    rejected: tuple[str, ...]
    """names of the recordings kept aside"""
    provenance: Provenance
    drives: tuple[DriveTable, ...] = ()
    """with their grade tables; empty where nothing is known of them"""


def read_folder(folder: Path) -> Contents:
    """Read a folder. Raises FileError for a missing or wrong file, with the place in it."""
    journal = folder / JOURNAL
    many = _of_takes(folder / IMPORT)
    return Contents(
        campaign=_campaign(folder, begun=journal.exists()),
        story=read_story(journal) if journal.exists() else None,
        truth=_json(folder / TRUTH, Truth),
        imported=None if many else _json(folder / IMPORT, Imported),
        takes=_json(folder / IMPORT, ImportedTakes) if many else None,
        rejected=tuple(sorted(path.name for path in folder.glob("rejected/*.csv"))),
        provenance=provenance(folder),
        drives=() if (drives := _json(folder / DEVICES, Drives)) is None else drives.winches,
    )


def _of_takes(path: Path) -> bool:
    """Whether it is the file of an import of many takes."""
    return path.exists() and isinstance(found := read_json(path), dict) and found.get("format") == TAKES


def _campaign(folder: Path, *, begun: bool) -> Campaign:
    """The campaign; one without windows is an error unless a journal tells why there is none."""
    if begun and folder.is_dir():
        table = read_toml(folder / INDEX, CampaignTable, FORMAT)
        if not table.window:
            robot = read_robot(folder / table.robot, named_by=folder / INDEX)
            return Campaign(table.name, robot, table.sample_rate or NO_RATE, ())
    return read_campaign(folder)


Schema = TypeVar("Schema", bound=_Lenient)


def _json(path: Path, schema: type[Schema]) -> Schema | None:
    return read_json_as(path, schema.model_validate) if path.exists() else None


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
