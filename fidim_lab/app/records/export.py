"""`fidim export`: a campaign for pandas, MATLAB or Foxglove, or identified parameters for simulators.

csv, mcap   a campaign folder with its windows in that form        urdf, mjcf    need a mass
parquet     one table of all windows (fidim_lab.data.load)         python, toml  s′ and I′ with their sd
mat         one MATLAB file, a struct for each window

With the campaign that a result or an explanation is of, mjcf is the whole robot with its cables, from where a window
began, and python a module of functions: lengths → pose and tensions, zero dynamics.

Windows that were broken off (killed process, power cut, guard) lie as `.part` files in `windows/` and `rejected/`. What
is left of them becomes CSV files in a folder apart from any campaign: to be looked at, never to be fitted.
"""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import scipy.io

from fidim_lab.app.formats.answer_file import write_answer
from fidim_lab.app.formats.body_text import mass_of, mjcf, python_snippet, toml, urdf
from fidim_lab.app.formats.manifest import EXPORTS
from fidim_lab.app.terminal import console
from fidim_lab.data.campaign import INDEX, ROBOT, read_campaign, write_campaign
from fidim_lab.data.campaign_frame import LoadedCampaign, load_campaign
from fidim_lab.data.files.input_file import read_text
from fidim_lab.data.records import Window
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.errors import FileError, SetupError
from fidim_lab.identification.results.result_file import ResultTable, read_result

if TYPE_CHECKING:  # the mechanism takes half a second to import, and most exports need none
    from fidim_lab.app.records.export_robot import WindowStart
from collections.abc import Iterator

from fidim_lab.data.campaign import FORMAT, CampaignTable
from fidim_lab.data.files.input_file import read_bytes
from fidim_lab.data.files.toml_file import read_toml
from fidim_lab.data.robot_file import read_robot
from fidim_lab.data.window_csv import write_window_csv
from fidim_lab.data.window_mcap import read_unfinished

_CSV, _MCAP = ".csv.part", ".mcap.part"

RESULT = "result.json"
MOST_RMS = 1e-3
"""m between MuJoCo and our prediction: what is promised; loud effects of the catalogue stay below 0.01 mm (tests)"""

_OF_RESULT: Mapping[str, tuple[str, Callable[[ResultTable, float | None], str]]] = MappingProxyType(
    {
        "urdf": (".urdf", lambda result, mass: urdf(result, mass_of(result, mass))),
        "mjcf": (".xml", lambda result, mass: mjcf(result, mass_of(result, mass))),
        "python": (".py", python_snippet),
        "toml": (".toml", toml),
    }
)
"""(suffix, text) of what a result file becomes"""


def export_command(
    source: Path,
    kind: str,
    out: Path | None,
    mass: float | None,
    *,
    unfinished: bool = False,
    json_file: Path | None = None,
    robot: tuple[Path, str | None] | None = None,
) -> int:
    """Export and say where; returns 0, or 1 for an MJCF that does not move as the model that was found.

    Raises FileError for a wrong source, SetupError for options that cannot be.
    robot: the folder that a result or explanation is of, and the window with whose start the whole robot begins.
    """
    unfinished_files: list[dict[str, str]] = []
    start: WindowStart | None = None
    if kind in _OF_RESULT:
        if source.is_dir():
            kept = source / RESULT
            hint = (
                f"There is one: {kept}." if kept.exists() else f"fidim identify {source} --json result.json makes one."
            )
            raise SetupError(f"{source} is a folder; --to {kind} takes a result file.", hint=hint)
        path, start = _export_result(source, kind, out, mass, robot)
    else:
        if source.is_file():
            hint = f"It lies in one: {source.parent}." if (source.parent / INDEX).exists() else ""
            raise SetupError(f"{source} is a file; --to {kind} takes a campaign folder.", hint=hint)
        path = _export_campaign(source, kind, out)
        if unfinished:
            for made, problem in export_unfinished(source, path.with_name(f"{path.stem}-unfinished")):
                console.warn([f"{made}: incomplete: {problem}"])
                unfinished_files.append({"file": str(made), "problem": problem})
    console.out.print(f"exported    {path}", markup=False)
    rms = _replayed(path, start) if kind == "mjcf" and start is not None else None
    found = {"kind": kind, "path": str(path), "unfinished": unfinished_files}
    write_answer(json_file, "fidim-export/1", found if rms is None else {**found, "replay_rms": rms})
    return 1 if rms is not None and rms > MOST_RMS else 0


def _replayed(path: Path, start: "WindowStart") -> float | None:
    """Replay by MuJoCo, where it is installed, and print how far it is from our prediction; that in m."""
    from fidim_lab.app.compose.multibody import replay_rms

    rms = replay_rms(read_text(path), start.t, start.marker)
    if rms is None:
        console.out.print("not replayed: MuJoCo is not installed here (pip install mujoco)")
        return None
    found = f"MuJoCo is {1e3 * rms:.2g} mm rms off our own prediction of window {start.window} ({start.t[-1]:.3g} s)"
    console.out.print(f"replayed    {found}; at most {1e3 * MOST_RMS:g} mm is allowed", markup=False)
    if rms > MOST_RMS:
        console.warn([f"{path} does not move as the model that was found: do not use it. This is a fault of fidim."])
    return rms


def _export_result(
    source: Path, kind: str, out: Path | None, mass: float | None, robot: tuple[Path, str | None] | None
) -> tuple[Path, "WindowStart | None"]:
    suffix, make = _OF_RESULT[kind]
    text, start = (make(_result(source), mass), None) if robot is None else _robot(source, kind, mass, *robot)
    path = _free(out or source.parent / EXPORTS / f"{source.stem}{suffix}")
    return _written(path, lambda: path.write_text(text, encoding="utf-8")), start


def _result(source: Path) -> ResultTable:
    try:
        return read_result(source)
    except FileError as error:
        if error.place == "format":
            error.hint += " With --campaign FOLDER mjcf and python also take what fidim explain --json writes."
        raise


def _robot(source: Path, kind: str, mass: float | None, folder: Path, window: str | None) -> tuple[str, "WindowStart"]:
    """The robot with its cables, from where a window begins; the mass is that of its file unless given.

    Raises SetupError for other kinds.
    """
    if kind not in ("mjcf", "python"):
        raise SetupError(f"--campaign makes the whole robot, which {kind} cannot hold; mjcf and python can.")
    from fidim_lab.app.records.export_robot import robot_mjcf, robot_model, robot_python, start_of

    campaign = read_campaign(folder)
    model = robot_model(source, campaign)
    start = start_of(model, campaign, window)
    named = ", ".join(effect.label for effect in model.mechanism.effects if isinstance(effect, NamedEffect))
    effects = f", with {named}" if named else ""
    origin = f"Robot of campaign {campaign.name} by fidim-lab, from {source.name}{effects}."
    make = robot_mjcf if kind == "mjcf" else robot_python
    return make(model, start, campaign.robot.mass if mass is None else mass, origin), start


def _export_campaign(source: Path, kind: str, out: Path | None) -> Path:
    campaign = load_campaign(source)
    suffix = "" if kind in ("csv", "mcap") else f".{kind}"
    name = f"{source.resolve().name}{suffix}" if suffix else f"{source.resolve().name}-{kind}"
    path = _free(out or source / EXPORTS / name)
    if kind == "parquet":
        return _written(path, lambda: _parquet(path, campaign))
    if kind == "mat":
        return _written(path, lambda: scipy.io.savemat(path, matlab(campaign), oned_as="column", long_field_names=True))
    return _written(path, lambda: write_campaign(path, campaign, suffix=".csv" if kind == "csv" else ".mcap"))


def matlab(campaign: LoadedCampaign) -> dict[str, object]:
    """What a .mat file holds: name, sample_rate, and `windows`, a cell array of structs."""
    windows = np.empty(len(campaign.windows), dtype=object)
    windows[:] = [_struct(window) for window in campaign.windows]
    return {"name": campaign.name, "sample_rate": campaign.sample_rate, "windows": windows}


def _struct(window: Window) -> dict[str, object]:
    """One window: t (N), markers (N, 3, M) m, lengths (N, n) m, currents (N, n) A; empty where not recorded."""
    empty = np.zeros((0, 0))
    return {
        "id": window.id,
        "role": window.role.value,
        "t": window.t,
        "markers": np.moveaxis(window.markers, 1, 2),
        "lengths": empty if window.lengths is None else window.lengths,
        "currents": empty if window.currents is None else window.currents,
        "equilibrium": empty if window.equilibrium is None else window.equilibrium,
        **{f"further_{k}_{name}"[:60]: values for k, (name, values) in enumerate(window.further.items(), start=1)},
    }


def _parquet(path: Path, campaign: LoadedCampaign) -> None:
    """One table of all windows; the robot file and what campaign.toml says are in the file's metadata."""
    table = pa.Table.from_pandas(campaign.to_frame(), preserve_index=False)
    about = {
        "name": campaign.name,
        "sample_rate": campaign.sample_rate,
        "equilibrium": {w.id: None if w.equilibrium is None else w.equilibrium.tolist() for w in campaign.windows},
    }
    metadata = {b"fidim-campaign": json.dumps(about).encode()}
    robot = campaign.folder / ROBOT
    if robot.exists():
        metadata[b"fidim-robot"] = read_text(robot).encode()
    pq.write_table(table.replace_schema_metadata({**(table.schema.metadata or {}), **metadata}), path)


def _free(path: Path) -> Path:
    """A path where nothing is yet, its folder made. Raises SetupError."""
    if path.exists():
        raise SetupError(f"{path} exists already; nothing in it was touched.", hint="Choose another --out.")
    return _written(path, lambda: path.parent.mkdir(parents=True, exist_ok=True))


def _written(path: Path, write: Callable[[], object]) -> Path:
    try:
        write()
    except OSError as error:
        what = f"{path} cannot be written: {error.strerror or error}."
        raise SetupError(what, hint="Choose another --out, or make room.") from error
    return path


def unfinished_files(folder: Path) -> tuple[Path, ...]:
    """The MCAP file of each broken-off window, or its CSV file where there is no other."""
    found = {path for place in ("windows", "rejected") for path in (folder / place).glob("*.part")}
    logs = {path for path in found if path.name.endswith(_MCAP)}
    lone = {p for p in found - logs if p.name.endswith(_CSV) and p.with_name(_stem(p) + _MCAP) not in logs}
    return tuple(sorted(logs | lone))


def export_unfinished(folder: Path, out: Path) -> Iterator[tuple[Path, str]]:
    """Write each as a CSV file; yields the file (or the source, where it holds nothing) and why it is incomplete.

    Raises FileError for a folder whose campaign.toml or robot file is wrong.
    """
    robot = read_toml(folder / INDEX, CampaignTable, FORMAT).robot
    cables = read_robot(folder / robot, named_by=folder / INDEX).n
    for path in unfinished_files(folder):
        out.mkdir(parents=True, exist_ok=True)
        to = out / f"{path.parent.name}-{_stem(path)}.csv"
        if path.name.endswith(_CSV):
            text = read_bytes(path).decode("utf-8", "replace")
            to.write_text(text[: text.rfind("\n") + 1], encoding="utf-8")
            yield to, "the recording was broken off; whole lines are kept"
            continue
        try:
            window = read_unfinished(path, cables)
        except FileError as error:
            yield path, error.message
            continue
        write_window_csv(to, window.columns)
        yield to, window.problem


def _stem(path: Path) -> str:
    return path.name.removesuffix(_CSV).removesuffix(_MCAP)
