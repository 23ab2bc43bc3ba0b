"""What the architecture has reached stays: small folders, small façades, one class for one name (CONTRIBUTING.md)."""

import ast
from collections import Counter, defaultdict
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PRODUCT = ("fidim_lab", "drivers", "procedures", "sim_backends")
MOST_MODULES = 20
"""of a folder, with its __init__: what one screen lists"""
MOST_NAMES = 12
"""of a façade"""
LARGER = {
    "fidim_lab": "the public interface (docs/python.md)",
    "fidim_lab/api": "the same, where it is made",
    "fidim_lab/app/compose": "real or simulated: the only place that chooses, so all that can be chosen",
    "procedures/steps": "the vocabulary that protocols speak, engine and handlers understand",
}

TWICE = {
    "Campaign Robot": "fidim_lab.api's handle on the record of the same name: users know one of them",
    "Identified": "what fidim_lab.api returns, and one body from the paper's own takes",
    "NmtCommand NmtState": "driver and simulated drive share no code (import-linter): each has its own",
    "Winch": "the robot file's record, and the port of the device",
    "Rest": "the model's and the simulated world's, which share no code",
    "WinchTable WindowTable Table": "tables of files, told apart by the file",
    "Refusal Start Stop Step Answer": "words of the socket, of journals and of procedures, as files keep them",
}
"""names that stand more than once with a reason"""

LEFT = frozenset(
    """
    Balance Candidate Evidence Finding Fit Found FreeMotion Kind Judged Known Limits Measurement Member Outcome
    Parameter Place Placed Point Posed Predicted Prediction Reading Recording Rows Sample Search Seen Stretch Trial
    Unknown Verdict WindowColumns Workspace
    """.split()  # noqa: SIM905
)
"""names that stood more than once when this test was written: this list only becomes shorter"""


@cache
def modules(*folders: str) -> tuple[Path, ...]:
    """Every Python file below, relative to the repository."""
    return tuple(sorted(p.relative_to(ROOT) for folder in folders for p in (ROOT / folder).rglob("*.py")))


@cache
def twice() -> dict[str, list[str]]:
    """Public classes of the product that bear the same name, with their files."""
    found: defaultdict[str, list[str]] = defaultdict(list)
    for path in modules(*PRODUCT):
        for node in ast.parse((ROOT / path).read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found[node.name].append(path.as_posix())
    return {name: files for name, files in found.items() if len(files) > 1}


def test_no_folder_holds_more_modules_than_are_seen_at_once() -> None:
    counted = Counter(path.parent.as_posix() for path in modules(*PRODUCT, "tests", "benchmarks"))
    assert {folder: count for folder, count in counted.items() if count > MOST_MODULES} == {}


@pytest.mark.parametrize("path", [p for p in modules(*PRODUCT) if p.name == "__init__.py"], ids=str)
def test_a_facade_is_small_and_says_what_it_is(path: Path) -> None:
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    assert ast.get_docstring(tree), "what goes in, what comes out"
    lists = [n.value for n in tree.body if isinstance(n, ast.Assign) and ast.unparse(n.targets[0]) == "__all__"]
    names = [name for exported in lists for name in ast.literal_eval(exported)]
    assert len(names) <= MOST_NAMES or path.parent.as_posix() in LARGER


def test_a_name_is_one_class() -> None:
    allowed = LEFT.union(*(names.split() for names in TWICE))
    assert {name: files for name, files in twice().items() if name not in allowed} == {}


def test_every_exception_is_still_one() -> None:
    allowed = LEFT.union(*(names.split() for names in TWICE))
    assert sorted(allowed - twice().keys()) == []
