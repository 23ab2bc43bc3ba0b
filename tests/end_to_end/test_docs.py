"""The documentation holds together: every page is in the index, every link leads somewhere, every command exists."""

import ast
import re
import shutil
import subprocess
from pathlib import Path

import click
import pytest

import fidim_lab
from fidim_lab.app import cli

DOCS = Path(__file__).parents[2] / "docs"
SITE = DOCS.parent / "build" / "site"
EXAMPLES = DOCS.parent / "examples" / "python"
BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
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


@pytest.mark.parametrize("example", ["one_winch.py", "marker_source.py"])
def test_what_an_example_uses_of_the_drivers_has_its_docstrings_in_the_site(example):
    tree = ast.parse((EXAMPLES / example).read_text(encoding="utf-8"))
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module is not None]
    used = {f"{one.module}.{name.name}" for one in imports for name in one.names if one.module.startswith("drivers.")}
    shown = re.findall(r"^::: (\S+)$", (DOCS / "drivers-api.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert used
    assert used <= set(shown)


@pytest.fixture
def site():
    """The site in a browser, from the disk: `site("page.html?q=word")` is the document after its scripts have run."""
    if BROWSER is None or not (SITE / "iframe-worker.js").is_file():
        pytest.skip("needs Chromium (apt install chromium) and the site (make docs)")

    def document(page):
        options = ("--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=20000", "--dump-dom")
        ran = subprocess.run([BROWSER, *options, f"file://{SITE}/{page}"], capture_output=True, text=True, timeout=100)
        return ran.stdout

    return document


@pytest.mark.browser
def test_the_site_is_searched_from_a_disk_and_loads_nothing_from_elsewhere(site):
    page = site("index.html?q=sigma_perp")
    found = re.findall(r'<a href="([^"]+)" class="md-search-result__link"', page)
    assert any("python-api.html" in target for target in found)
    assert re.findall(r'<(?:script|img|iframe)[^>]* src="(?:https?:)?//', page) == []


@pytest.mark.browser
def test_the_site_has_every_public_name_of_python(site):
    page = site("python-api.html")
    assert [name for name in fidim_lab.__all__ if f'id="fidim_lab.api.{name}"' not in page] == []
