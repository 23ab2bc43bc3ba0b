"""Text that somebody else wrote is printable before it reaches a terminal."""

import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fidim_lab.say import LONGEST, printable

TEXTS = [
    ("winch 1: 20.4 N", "winch 1: 20.4 N"),
    ("Müller, “x” → ±1 µm", "Müller, “x” → ±1 µm"),
    ("a\r\nFAKE LINE", "a  FAKE LINE"),
    ("a\tb\u00a0c\u2028d", "a b c d"),
    ("\x1b[2J\x1b]0;OWNED\x07", "\\x1b[2J\\x1b]0;OWNED\\x07"),
    ("\x9b2J", "\\x9b2J"),
    ("\u202egnp.exe", "\\u202egnp.exe"),
    ("a\u200bb\u2066c", "a\\u200bb\\u2066c"),
    ("\ud800", "\\ud800"),
    ("\0\b\x7f", "\\x00\\x08\\x7f"),
    ("[bold]not markup of ours[/]", "[bold]not markup of ours[/]"),
]


@pytest.mark.parametrize(("text", "shown"), TEXTS)
def test_a_terminal_only_shows_it(text, shown):
    assert printable(text) == shown


def test_what_is_too_long_is_cut_and_says_so():
    assert printable("A" * 3000) == "A" * (LONGEST - 1) + "…"
    assert printable("abcd", 4) == "abcd"
    assert printable("\x1b\x1b", 6) == "\\x1b\\…"


@given(st.text(), st.integers(1, 50))
def test_nothing_that_a_terminal_obeys_is_left(text, longest):
    shown = printable(text, longest)
    assert len(shown) <= longest
    assert not any(unicodedata.category(c) in {"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"} for c in shown)
    assert printable(shown, longest) == shown
