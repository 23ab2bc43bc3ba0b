"""Lines out of torn bytes, and numbers out of lines: tables of what devices send, and anything at all."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.serial_line.lines import LONGEST, LineSplitter
from drivers.serial_line.template import LineTemplate
from fidim_lab.errors import SetupError

TEXT = st.text(st.characters(min_codepoint=0x20, max_codepoint=0x7E), max_size=40)


@pytest.mark.parametrize(
    ("data", "lines", "malformed"),
    [
        (b"1.5\r\n2.5\r\n", ["1.5", "2.5"], 0),
        (b"1.5\n\n\r2.5\r", ["1.5", "2.5"], 0),
        (b"1.5\n2.", ["1.5"], 0),
        (b"\0 1.5 \n", ["1.5"], 0),
        (b"\xff\xfe1.5\n2.5\n", ["2.5"], 1),
        (b"1\x07\n2\n", ["2"], 1),
        (b"x" * (LONGEST + 1) + b"\n2\n", ["2"], 1),
        (b"x" * (LONGEST + 1), [], 1),
    ],
)
def test_lines(data, lines, malformed):
    splitter = LineSplitter(skip_first=False)
    assert splitter.feed(data) == lines
    assert splitter.malformed == malformed


def test_a_stream_met_in_the_middle_begins_at_its_first_whole_line():
    splitter = LineSplitter(skip_first=True)
    assert splitter.feed(b"2.5 N\r\n13.5 N\r\n") == ["13.5 N"]
    splitter.feed(b"14")
    splitter.restart()
    assert splitter.feed(b".5 N\n15.5 N\n") == ["15.5 N"]


@given(st.lists(TEXT.filter(lambda text: text.strip() == text and text), max_size=8), st.data())
def test_torn_anywhere_it_is_the_same(lines, data):
    stream = b"".join(line.encode() + b"\r\n" for line in lines)
    splitter, heard = LineSplitter(skip_first=False), []
    while stream:
        cut = data.draw(st.integers(1, len(stream)))
        heard += splitter.feed(stream[:cut])
        stream = stream[cut:]
    assert heard == lines
    assert splitter.malformed == 0


@given(st.lists(st.binary(max_size=400), max_size=6))
def test_any_bytes_are_lines_or_counted(pieces):
    splitter = LineSplitter(skip_first=False)
    for piece in pieces:
        for line in splitter.feed(piece):
            assert line.isascii()
            assert line.isprintable()
            assert len(line) <= LONGEST


@pytest.mark.parametrize(
    ("template", "line", "values"),
    [
        ("{1};{2}", "12.5;-3", {"1": 12.5, "2": -3.0}),
        ("{1} kg", "  + 12.50  kg ", {"1": 12.5}),
        ("{1} kg", "12.50kg", {"1": 12.5}),
        ("ST,{*},{3} kg", "ST,GS,   7.25 kg", {"3": 7.25}),
        ("X={x} Y={y}", "X=-0.125 Y=+1e-3", {"x": -0.125, "y": 1e-3}),
        ("{*}:{1}", "unit 7:.5", {"1": 0.5}),
        ("{1} kg", "OVERLOAD", None),
        ("{1} kg", "12.5 lb", None),
        ("{1} kg", "12.5 kg 13.5 kg", None),
        ("{1};{2}", "12.5;", None),
        ("{1}", "1e999", None),
        ("{1}", "nan", None),
        ("$({1})", "$(4)", {"1": 4.0}),
    ],
)
def test_templates(template, line, values):
    assert LineTemplate(template).read(line) == values


@pytest.mark.parametrize(
    ("template", "says"),
    [
        ("kg", "no number"),
        ("{*}", "no number"),
        ("{1} {1}", "name twice"),
        ("{1", "do not pair"),
        ("{}", "without a name"),
        ("{1}{2}", "nothing between"),
        ("{*},{*},{*},{*},{1}", "more than 3"),
    ],
)
def test_templates_that_are_none(template, says):
    with pytest.raises(SetupError, match=says):
        LineTemplate(template)


@given(TEXT)
def test_any_line_is_numbers_or_nothing(line):
    values = LineTemplate("{*},{1},{*}").read(line)
    assert values is None or set(values) == {"1"}


@given(st.dictionaries(st.sampled_from("1234"), st.floats(-1e6, 1e6), min_size=1), TEXT)
def test_what_a_device_writes_is_read(values, status):
    names = sorted(values)
    template = LineTemplate("S:{*}#" + ";".join(f"{{{name}}}" for name in names) + " N")
    text = template.write({name: f"{values[name]:.6f}" for name in names}, anything=status.replace("#", ""))
    assert template.read(text) == {name: pytest.approx(values[name], abs=1e-6) for name in names}
