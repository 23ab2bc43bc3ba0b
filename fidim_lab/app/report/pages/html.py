"""From a page's values to HTML: `render`. One file, nothing to load; the only script is ours, known by its hash.

Text reaches the page escaped; only our own SVG, style sheet and script go in as they are.
"""

import base64
import hashlib
from dataclasses import dataclass
from functools import partial
from importlib.resources import files

from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup

from fidim_lab.app.report.drawings.drawing import Drawing
from fidim_lab.app.report.drawings.svg import distinct


@dataclass(frozen=True)
class Rendered:
    """A page and the pictures on it."""

    html: str
    drawings: tuple[Drawing, ...]
    """in the order of the page"""


def render(template: str, page: object) -> Rendered:
    """The page as one HTML file. `template`: one of the *.html.jinja beside this module."""
    drawings: list[Drawing] = []
    environment = Environment(
        loader=FunctionLoader(_text),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["picture"] = partial(_picture, drawings)
    script = _text("script.js")
    html = environment.get_template(template).render(
        page=page, style=Markup(_text("page.css")), script=Markup(script), script_hash=_policy_hash(script)
    )
    return Rendered(html, tuple(drawings))


def _picture(drawings: list[Drawing], drawing: Drawing) -> Markup:
    """The SVG with identifiers of its own."""
    drawings.append(drawing)
    return Markup(distinct(drawing.svg, f"p{len(drawings)}"))


def _policy_hash(script: str) -> str:
    """By which the page's content policy knows our script: no other runs, whatever a window is called."""
    digest = hashlib.sha256(script.encode()).digest()
    return f"sha256-{base64.b64encode(digest).decode()}"


def _text(name: str) -> str:
    return (files("fidim_lab.app.report.pages") / name).read_text(encoding="utf-8")
