"""Files that others may have written are read by `fidim_lab.data.files.input_file` alone; others are listed."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("fidim_lab", "drivers", "procedures", "sim_backends")
READING = {"read_text", "read_bytes", "open", "load", "loads", "loadmat", "import_od", "reader"}
"""names of calls that read a file or parse what was read"""
OWNERS = {"json", "tomllib", "csv", "scipy.io", "io", "os", "np", "numpy", "pickle", "canopen"}

ALLOWED = {
    "fidim_lab/data/files/input_file.py": "the reader itself",
    "fidim_lab/data/files/toml_file.py": "parses what input_file has read",
    "fidim_lab/data/files/whole_file.py": "writes",
    "fidim_lab/app/report/pages/html.py": "a template within the package",
    "fidim_lab/app/formats/key_words.py": "a table within the package",
    "fidim_lab/app/records/export_robot.py": "a template within the package",
    "fidim_lab/app/records/import_recording.py": "a journal that this command has just written",
    "fidim_lab/data/importers/reading/cells.py": "the cells of a line that read_text has read",
    "fidim_lab/data/importers/reading/decoding.py": "a message of a bag that its bounded reader has read",
    "fidim_lab/data/importers/motive_csv.py": "splits the text that read_text has read",
    "fidim_lab/app/judging/judgement.py": "an argument of its own process",
    "fidim_lab/app/terminal/worker_pipe.py": "a line of its own process",
    "fidim_lab/app/tui/foresee.py": "a line of its own process",
    "fidim_lab/app/session/run_process.py": "the log of a process it began",
    "fidim_lab/app/service/own_process.py": "the same",
    "fidim_lab/app/service/lock.py": "checks owner and kind of the lock by itself",
    "drivers/disk.py": "writes",
    "drivers/mocap/sender.py": "a table of the kernel, which fidim_lab.data.files.input_file refuses: it has no size",
    "drivers/remote_operator.py": "a line of a peer",
    "sim_backends/hand_server.py": "a line of a peer",
    "procedures/recording/journal.py": "appends to what read_bytes has checked",
    "procedures/recording/part_file.py": "writes",
    "procedures/recording/run_folder.py": "a lock in the folder",
    "procedures/recording/disk.py": "brings a folder to the disk",
}
"""files with a reason; what reads a user's file is none"""


def _calls(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        match node.func:
            case ast.Name(id="open"):
                yield "open"
            case ast.Attribute(attr="read_text" | "read_bytes" as name, value=owner):
                if ast.unparse(owner) != "input_file":
                    yield name
            case ast.Attribute(attr="open", value=owner) if node.args and _is_mode(node.args[0]):
                yield f"{ast.unparse(owner)}.open"
            case ast.Attribute(attr=name, value=owner) if name in READING and ast.unparse(owner) in OWNERS:
                yield f"{ast.unparse(owner)}.{name}"
            case _:
                pass


def _is_mode(argument: ast.expr) -> bool:
    return isinstance(argument, ast.Constant) and isinstance(argument.value, str)


@cache
def _found() -> dict[str, set[str]]:
    found: dict[str, set[str]] = {}
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            calls = set(_calls(ast.parse(path.read_text(encoding="utf-8"))))
            if calls:
                found[path.relative_to(ROOT).as_posix()] = calls
    return found


def test_no_file_of_a_user_is_read_but_by_the_one_reader() -> None:
    others = {name: calls for name, calls in _found().items() if name not in ALLOWED}
    assert not others, f"read by fidim_lab.data.files.input_file, or name the reason here: {others}"


def test_every_exception_is_still_one() -> None:
    assert ALLOWED.keys() - _found().keys() == set()


def test_reading_is_recognized() -> None:
    text = "open(p)\np.read_text()\np.open('rb')\njson.loads(t)\ntomllib.load(f)\nos.open(p, 0)\nport.open()\nx.load()"
    wanted = {"open", "read_text", "p.open", "json.loads", "tomllib.load", "os.open"}
    assert set(_calls(ast.parse(text))) == wanted
