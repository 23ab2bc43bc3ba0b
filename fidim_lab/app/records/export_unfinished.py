"""What is left of windows that were broken off (killed process, power cut, guard): to be looked at, never to be fitted.

They lie as `.part` files in `windows/` and `rejected/`, and become CSV files in a folder apart from any campaign.
"""

from collections.abc import Iterator
from pathlib import Path

from fidim_lab.data.campaign import FORMAT, INDEX, CampaignTable
from fidim_lab.data.files.input_file import read_bytes
from fidim_lab.data.files.toml_file import read_toml
from fidim_lab.data.robot_file import read_robot
from fidim_lab.data.window_csv import write_window_csv
from fidim_lab.data.window_mcap import read_unfinished
from fidim_lab.errors import FileError

_CSV, _MCAP = ".csv.part", ".mcap.part"


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
