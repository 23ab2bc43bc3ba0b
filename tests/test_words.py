"""Product, docs and messages use the field's words: turns that readers stumbled over do not come back."""

import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
BANNED = {
    r"\b[Ee]yes (begin|look|see)\b": "guards start / go on",
    r"\bstill up\b": "before the robot is switched off",
    r"\bbelieved of others\b": "is applied to others, shrunk by …",
    r"\bcurrents tell ±": "tensions from currents are good to ±",
    r"^The house:": "Architecture:",
    r"\b(imitators|outdone|lone_wrench|so_far|chronicle|desk)\.py\b": "the module's name of today",
    r"\b(MODEL|FORMAT|REAL|FINDINGS|DRIVERS|DESIGN|HOUSE)\.md\b": "a page of docs/spec, which is in every clone",
    r"\.\./shared\b": "something that is in every clone",
}


@cache
def texts() -> tuple[tuple[str, int, str], ...]:
    """Every line of product and documentation, with its place."""
    folders = ("fidim_lab", "drivers", "procedures", "sim_backends", "docs")
    files = [
        ROOT / "README.md",
        *(p for f in folders for s in ("*.py", "*.md", "*.jinja") for p in (ROOT / f).rglob(s)),
    ]
    return tuple(
        (str(file.relative_to(ROOT)), number, line)
        for file in files
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), start=1)
    )


@pytest.mark.parametrize("turn", BANNED)
def test_nothing_says_it_that_way(turn: str) -> None:
    found = [f"{file}:{number}: {line.strip()}" for file, number, line in texts() if re.search(turn, line)]
    assert not found, f"rather: {BANNED[turn]}"


def test_words_of_the_glossary_are_in_order_and_in_use() -> None:
    rows = re.findall(r"^\| ([^|]+) \| [^|]+ \|$", (ROOT / "docs" / "glossary.md").read_text("utf-8"), re.MULTILINE)
    words = [word for word in rows if word not in ("word", "---")]
    assert words == sorted(words)
    assert len(words) > 30
    everything = "\n".join(line for file, _, line in texts() if file != "docs/glossary.md").lower()
    assert [word for word in words if word.split(" (")[0].lower() not in everything] == []
