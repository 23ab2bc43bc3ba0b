"""Product, docs and messages use the field's words: turns that readers stumbled over do not come back."""

import ast
import re
from collections.abc import Iterator
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
    r"\bbelieve the spread\b": "the spread is the uncertainty",
    r"\bhold(s|ing)? one direction hardly\b": "hardly hold one direction",
    r"\bcarr(y|ies) the error of what\b": "are wrong by an unknown amount",
    r"\bmay not have power\b": "must not be switched on",
    r"\bby score it takes\b": "by its score χ² falls by",
    r"\bwitness that no fit\b": "information that no fit uses",
    r"\b(imitators|outdone|lone_wrench|so_far|chronicle|desk)\.py\b": "the module's name of today",
    r"\b(MODEL|FORMAT|REAL|FINDINGS|DRIVERS|DESIGN|HOUSE)\.md\b": "a page of docs/spec, which is in every clone",
    r"\.\./shared\b": "something that is in every clone",
    r"\bthat no fit (has|may|can)\b": "held-out windows",
    r"\bof its lever\b": "of the distance that is meant",
}

IN_MESSAGES = {
    r"(?<![Tt]here )\bis no (?!longer\b)": "is not a",
    r"\btells? (no|not|nothing|most|more|little|too|whether|its|their|of)\b": "shows, reports, determines",
    r"\b(is|are|was|be|not) told\b(?! (apart|to be silent))": "is reported, is not known",
    r"\bgo(es)? on\b": "continues",
    r"\bgo(es)? with\b": "needs; correlates with; is in proportion to",
    r"\basked for\b": "requested, commanded",
    r"\bof which\b": "two sentences",
    r"\bpassed over\b": "ignored",
    r"\bput right\b": "corrected",
    r"\bcomes? on top\b": "in addition",
    r"\bat last:": "the last time:",
    r"\banew\b": "again",
    r"\b[Mm]end(s|ed|ing)?\b": "correct",
    r"\b[Ss]ay --": "give",
    r"\bcannot be meant\b": "is a mistake",
    r"\bfeigns?\b": "may be caused by",
    r"\b(do|does) without\b": "does not need",
    r"\bnobody (knows|tells)\b": "is not known",
    r"\bas of an?\b": "such as, like",
    r"\bwith no other\b|\bis none of\b": "is not one of",
    r"^(Of|That|Likewise)\b(?!.* (is|are|have|has) )": "a whole sentence that names its subject",
}
"""turns that stay out of what a program says: texts in the code other than docstrings"""


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


@cache
def messages() -> tuple[tuple[str, int, str], ...]:
    """Every text of three words or more that the product's code holds, docstrings apart, with its place."""
    files = [p for folder in ("fidim_lab", "drivers", "procedures") for p in (ROOT / folder).rglob("*.py")]
    return tuple(
        (str(file.relative_to(ROOT)), node.lineno, text)
        for file in files
        for node, text in _literals(ast.parse(file.read_text(encoding="utf-8")))
        if text.count(" ") >= 2
    )


def _literals(tree: ast.AST) -> Iterator[tuple[ast.expr, str]]:
    nodes = list(ast.walk(tree))
    apart = {node.value for node in nodes if isinstance(node, ast.Expr)}
    apart |= {part for node in nodes if isinstance(node, ast.JoinedStr) for part in node.values}
    for node in nodes:
        if isinstance(node, ast.JoinedStr):
            yield node, "".join(str(part.value) if isinstance(part, ast.Constant) else "…" for part in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in apart:
            yield node, node.value


@pytest.mark.parametrize("turn", IN_MESSAGES)
def test_no_message_says_it_that_way(turn: str) -> None:
    found = [f"{file}:{number}: {text[:120]}" for file, number, text in messages() if re.search(turn, text)]
    assert not found, f"rather: {IN_MESSAGES[turn]}"


def test_words_of_the_glossary_are_in_order_and_in_use() -> None:
    rows = re.findall(r"^\| ([^|]+) \| [^|]+ \|$", (ROOT / "docs" / "glossary.md").read_text("utf-8"), re.MULTILINE)
    words = [word for word in rows if word not in ("word", "---")]
    assert words == sorted(words)
    assert len(words) > 30
    everything = "\n".join(line for file, _, line in texts() if file != "docs/glossary.md").lower()
    assert [word for word in words if word.split(" (")[0].lower() not in everything] == []
