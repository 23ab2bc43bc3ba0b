"""Shorter pictures are the same pictures."""

import re
import xml.etree.ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fidim_lab.app.report.drawings.tight import classed, shortened, ungrouped

HUNDREDTHS = st.integers(-99_999, 99_999).map(lambda k: k / 100)
PLACES = st.lists(st.tuples(HUNDREDTHS, HUNDREDTHS), min_size=1, max_size=30)
TOKEN = re.compile(r"[MLlz]|-?(?:\d+\.?\d*|\.\d+)")


def walked(way):
    """Absolute places of a path, as the SVG standard reads it: 'M', 'L', 'l', numbers that a sign or blank parts."""
    tokens = TOKEN.findall(way)
    assert re.sub(r"\s", "", "".join(tokens)) == re.sub(r"\s", "", way)
    places, letter, at = [], "", (0.0, 0.0)
    while tokens:
        if tokens[0] in "MLlz":
            letter = tokens.pop(0)
            if letter == "z":
                places.append("z")
                continue
        x, y = float(tokens.pop(0)), float(tokens.pop(0))
        at = (at[0] + x, at[1] + y) if letter == "l" else (x, y)
        places.append((letter == "M", round(at[0], 2), round(at[1], 2)))
    return places


@given(st.lists(st.tuples(PLACES, st.booleans()), min_size=1, max_size=4))
def test_a_shortened_line_goes_through_the_same_places(lines):
    way = " ".join(
        "M " + " L ".join(f"{x:g} {y:g}" for x, y in places) + (" z" if closed else "") for places, closed in lines
    )
    [short] = re.findall(r' d="([^"]*)"', shortened(f'<path d="{way}"/>'))
    assert walked(short) == walked(way)


@pytest.mark.parametrize(
    ("way", "short"),
    [
        ("M 0 0 L 10 0.5 L 10 0 L 9.75 100 z", "M0 0l10 .5 0-.5-.25 100z"),
        ("M 1 1 z L 2 2 L 3 3", "M 1 1 z L 2 2 L 3 3"),
        ("M 0 0 C 1 2 3 4 5 6", "M 0 0 C 1 2 3 4 5 6"),
    ],
)
def test_lines_are_relative_and_curves_stay(way, short):
    assert shortened(f'<path d="{way}"/>') == f'<path d="{short}"/>'


def test_only_groups_that_say_something_stay_and_all_are_closed():
    svg = '<svg><g><g clip-path="url(#a)"><g><path d="M0 0"/></g></g></g><g/><g><text>g</text></g></svg>'
    found = ungrouped(svg)
    assert found == '<svg><g clip-path="url(#a)"><path d="M0 0"/></g><text>g</text></svg>'
    ET.fromstring(found)


def test_a_style_that_comes_twice_is_said_once():
    svg = '<svg><style>*{a}</style><path style="fill: none"/><path style="fill: none"/><path style="x: &amp;"/></svg>'
    found = classed(svg)
    [name] = re.findall(r"\.(s\w+)\{fill: none\}</style>", found)
    assert found.count(f'<path class="{name}"/>') == 2
    assert 'style="x: &amp;"' in found
    other = classed('<svg><style></style><text style="fill: none"/><text style="fill: none"/></svg>')
    assert f".{name}{{fill: none}}" in other  # the same name for the same style: pictures share a page


def test_without_a_place_for_rules_nothing_is_changed():
    svg = '<svg><path style="fill: none"/><path style="fill: none"/></svg>'
    assert classed(svg) == svg
