"""Hooks of the site (mkdocs.yml): contents from docs/README.md, and the source files that pages link to as pages.

A page on GitHub or in an editor links to `../drivers/mocap/sequence.py`; in the site the same link leads to a page with
that file's text, so that the site can be read without anything else.
"""

import re
from pathlib import Path, PurePosixPath

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[1]
LINK = re.compile(r"\[([^\]]+)\]\(([^)\s]+)\)")
LANGUAGES = {".py": "python", ".toml": "toml", ".ipynb": "json"}


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """The navigation: headings and links of the index, each page once."""
    config.nav = contents((ROOT / "docs" / "README.md").read_text(encoding="utf-8"))
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """A page for each source file that a page links to."""
    for page in list(files.documentation_pages()):
        for _, target in LINK.findall(page.content_string):
            source = outside(page.src_uri, target)
            if source is not None and files.get_file_from_path(shown(source)) is None:
                files.append(File.generated(config, shown(source), content=text_of(source)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Links to source files lead to their pages."""

    def within(match: re.Match[str]) -> str:
        source = outside(page.file.src_uri, match[2])
        if source is None or page.file.src_uri.startswith("source/"):
            return match[0]
        up = "../" * page.file.src_uri.count("/")
        return f"[{match[1]}]({up}{shown(source)})"

    return LINK.sub(within, markdown)


def contents(index: str) -> list[object]:
    """What mkdocs calls nav, from the index page."""
    nav: list[object] = [{"Documentation": "README.md"}]
    pages: list[object] = nav
    seen = {"README.md"}
    for line in index.splitlines():
        if line.startswith("## "):
            pages = []
            nav.append({line[3:].strip(): pages})
        for title, target in LINK.findall(line):
            if target.endswith(".md") and target not in seen and not target.startswith(".."):
                seen.add(target)
                pages.append({title[0].upper() + title[1:]: target})
    return nav


def outside(page: str, target: str) -> Path | None:
    """The source file that a link of a page leads to, relative to the checkout; None for any other link."""
    if re.match(r"\w+:|#", target):
        return None
    path = (ROOT / "docs" / page).parent / target.partition("#")[0]
    inside = path.resolve().is_relative_to(ROOT / "docs")
    return None if inside or not path.is_file() else path.resolve().relative_to(ROOT)


def shown(source: Path) -> str:
    """Where the site has it."""
    return f"source/{PurePosixPath(source)}.md"


def text_of(source: Path) -> str:
    """The page of a source file."""
    if source.suffix == ".md":
        return (ROOT / source).read_text(encoding="utf-8")
    language = LANGUAGES.get(source.suffix, "text")
    text = (ROOT / source).read_text(encoding="utf-8")
    unsearched = "---\nsearch:\n  exclude: true\n---\n"  # a search is for what explains, not for its sources
    return f"{unsearched}# {PurePosixPath(source)}\n\n`````{language}\n{text}\n`````\n"
