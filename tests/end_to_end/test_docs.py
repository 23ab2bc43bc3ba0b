"""The documentation holds together: every page is in the index, every link leads somewhere, every command exists."""

import re
from pathlib import Path

import click
import pytest

from fidim_lab.app import cli

DOCS = Path(__file__).parents[2] / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
LINK = re.compile(r"\]\(([^)\s]+)\)")


def slug(heading):
    """As GitHub makes anchors of headings."""
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")


def anchors(page):
    return {slug(line.lstrip("#")) for line in page.read_text(encoding="utf-8").splitlines() if line.startswith("#")}


def test_every_page_is_in_the_index():
    index = (DOCS / "README.md").read_text(encoding="utf-8")
    linked = {(DOCS / target.partition("#")[0]).resolve() for target in LINK.findall(index)}
    missing = [str(page.relative_to(DOCS)) for page in PAGES if page.resolve() not in linked and page.parent == DOCS]
    assert set(missing) <= {"README.md"}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(DOCS)))
@pytest.mark.sampled(2)
def test_links_lead_somewhere(page):
    for target in LINK.findall(page.read_text(encoding="utf-8")):
        if re.match(r"\w+:", target):
            continue
        file, _, anchor = target.partition("#")
        there = (page.parent / file) if file else page
        assert there.exists(), f"{page.name}: {target}"
        if anchor and there.suffix == ".md":
            assert anchor in anchors(there), f"{page.name}: {target}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(DOCS)))
@pytest.mark.sampled(2)
def test_commands_and_their_options_exist(page):
    for line in page.read_text(encoding="utf-8").splitlines():
        for name, rest in re.findall(r"(?:^ {4}|`)fidim ([a-z][a-z-]+)([^`#|]*)", line):
            assert name in cli.fidim.commands, f"{page.name}: {line}"
            command = cli.fidim.commands[name]
            if isinstance(command, click.Group) and rest.split():
                command = command.commands[rest.split()[0]]
            known = {option for one in command.params for option in (*one.opts, *one.secondary_opts)}
            used = set(re.findall(r"(?<!\S)\[?(--[a-z][a-z-]*)", rest))
            assert used <= known | {"--help", "--debug"}, f"{page.name}: {line.strip()}"
