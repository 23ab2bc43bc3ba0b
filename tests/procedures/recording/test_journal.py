"""The journal survives crashes: cut it anywhere, and every whole line before the cut is read back."""

import json
import tempfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fidim_lab.errors import FileError
from procedures.outcomes import Outcome
from procedures.recording.journal import Journal, LineKind, read_journal


class Still:
    def now(self):
        return 1.25

    async def sleep(self, seconds):
        raise AssertionError(seconds)


def write(path, reasons):
    with Journal(path, Still(), lambda: "2026-01-01T00:00:00Z") as journal:
        for reason in reasons:
            journal.write(LineKind.STEP_FINISHED, step="Hold", outcome=Outcome.PASS, reason=reason)
    return list(read_journal(path))[-len(reasons) :]


REASONS = ("ein Seil hängt schlaff – 3,2 N", 'with "quotes", a \\ and a \n line end', "")


@pytest.fixture(scope="module")
def whole():
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "journal.jsonl"
        entries = write(path, REASONS)
        yield path.read_bytes(), entries


def test_what_is_written_is_read_back(tmp_path):
    entries = write(tmp_path / "j", REASONS)
    assert list(read_journal(tmp_path / "j")) == entries
    assert [e.reason for e in entries] == list(REASONS)
    first = json.loads((tmp_path / "j").read_text(encoding="utf-8").splitlines()[0])
    assert first == {
        "number": 1,
        "t": 1.25,
        "wall": "2026-01-01T00:00:00Z",
        "kind": "step-finished",
        "step": "Hold",
        "outcome": "pass",
        "reason": REASONS[0],
    }


@given(data=st.data())
def test_cut_at_any_byte_every_whole_line_is_kept(whole, data):
    content, entries = whole
    cut = data.draw(st.integers(0, len(content)))
    expected = content[:cut].count(b"\n")
    if cut < len(content) and content[cut : cut + 1] == b"\n":
        expected += 1  # the line is whole, only its end is missing
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "j"
        path.write_bytes(content[:cut])
        assert list(read_journal(path)) == entries[:expected]
        more = write(path, ["after the crash"])
        assert list(read_journal(path)) == [*entries[:expected], *more]
        assert more[0].number == expected + 1


@given(zeros=st.integers(1, 5000))
def test_zeros_that_a_power_cut_leaves_are_no_line(whole, zeros):
    content, entries = whole
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "j"
        path.write_bytes(content + b"\0" * zeros)
        assert list(read_journal(path)) == entries


@given(st.binary(max_size=300))
def test_any_bytes_are_read_or_refused_with_a_sentence(content):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "j"
        path.write_bytes(content)
        refusal = None
        try:
            read_journal(path)
        except FileError as error:
            refusal = error
        assert refusal is None or (refusal.place.startswith("line ") and str(path) in str(refusal))


def test_a_broken_line_before_the_last_is_an_error_with_its_number(tmp_path):
    write(tmp_path / "j", REASONS)
    lines = (tmp_path / "j").read_bytes().splitlines(keepends=True)
    (tmp_path / "j").write_bytes(lines[0] + b'{"number": 2, "t"\n' + lines[2])
    with pytest.raises(FileError, match="line 2: is not a journal line"):
        read_journal(tmp_path / "j")


def test_an_unknown_field_is_an_error(tmp_path):
    write(tmp_path / "j", ["a", "b"])
    content = (tmp_path / "j").read_text().replace('"number": 1,', '"number": 1, "colour": "red",')
    (tmp_path / "j").write_text(content)
    with pytest.raises(FileError, match="line 1"):
        read_journal(tmp_path / "j")


def test_a_missing_journal_is_an_error(tmp_path):
    with pytest.raises(FileError, match="no such file"):
        read_journal(tmp_path / "nowhere")
