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
}
"""names that stand twice with a reason"""


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
    allowed = {name for names in TWICE for name in names.split()}
    assert {name: files for name, files in twice().items() if name not in allowed} == {}


def test_every_exception_is_still_one() -> None:
    allowed = {name for names in TWICE for name in names.split()}
    assert sorted(allowed - twice().keys()) == []
