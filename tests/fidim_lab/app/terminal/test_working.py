"""Progress of commands: how long it took before tells how long it will take, and a pipe gets nothing of it."""

import io
import json

import pytest
from rich.console import Console

from fidim_lab.app.terminal import console
from fidim_lab.app.terminal.working import Working, left_words, windows_of


@pytest.fixture
def times(monkeypatch):
    """What the clock says, one after another."""
    said = iter([0.0, 10.0, 100.0, 104.0])
    monkeypatch.setattr("fidim_lab.app.terminal.working.perf_counter", lambda: next(said))


def test_the_next_estimate_comes_from_what_it_took_for_each_window(times, tmp_path):
    file = tmp_path / "cache" / "durations.json"
    with Working("identifying", 5, durations=file) as first:
        assert first.expected == 0.0
    with Working("identifying", 2, durations=file) as second:
        assert second.expected == pytest.approx(4.0)  # 10 s for five windows
    assert json.loads(file.read_text()) == {"identifying": 2.0}  # 4 s for two the second time


def test_what_failed_tells_nothing_about_the_next_time(times, tmp_path):
    file = tmp_path / "durations.json"
    with pytest.raises(ValueError, match="wrong"), Working("identifying", durations=file):
        raise ValueError("wrong")
    assert not file.exists()


@pytest.mark.parametrize("text", ["", "[]", '{"identifying": "long"}'])
def test_a_damaged_cache_is_no_fault(times, tmp_path, text):
    file = tmp_path / "durations.json"
    file.write_text(text)
    with Working("identifying", durations=file) as shown:
        assert shown.expected == 0.0
    assert json.loads(file.read_text()) == {"identifying": 10.0}


def test_a_cache_that_cannot_be_written_is_no_fault(times, tmp_path):
    (tmp_path / "file").write_text("")
    with Working("identifying", durations=tmp_path / "file" / "durations.json"):
        pass


def test_a_terminal_sees_what_goes_on_and_a_pipe_nothing(monkeypatch, tmp_path):
    file = tmp_path / "durations.json"
    file.write_text('{"identifying": 30.0}')
    for terminal in (True, False):
        written = io.StringIO()
        monkeypatch.setattr(console, "err", Console(file=written, force_terminal=terminal, width=100))
        with Working("identifying", 2, durations=file) as shown:
            shown.update("predicting [v01]")
        assert ("predicting [v01]" in written.getvalue()) == terminal
        assert ("about 60 s left" in written.getvalue()) == terminal
        file.write_text('{"identifying": 30.0}')


def test_words_are_no_more_exact_than_the_estimate():
    assert left_words(-1.0) == "longer than before"
    assert left_words(12.4) == "about 12 s left"
    assert left_words(400.0) == "about 7 min left"


def test_windows_are_counted_once(tmp_path):
    assert windows_of(tmp_path) == 1
    (tmp_path / "windows").mkdir()
    for name in ("i01.csv", "i01.mcap", "i02.csv"):
        (tmp_path / "windows" / name).touch()
    assert windows_of(tmp_path) == 2
