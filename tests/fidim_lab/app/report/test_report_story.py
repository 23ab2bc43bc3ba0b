"""What the report makes of a journal: whole, broken off, resumed, wrong."""

import pytest

from fidim_lab.app.report.contents.story import read_story
from fidim_lab.errors import FileError
from procedures.outcomes import Outcome
from procedures.recording.journal import LineKind


@pytest.fixture
def path(tmp_path):
    return tmp_path / "journal.jsonl"


def test_attempts_and_verdicts(path, journal_at):
    lines = journal_at(path).begin("i01", "v02", "v03")
    lines.attempt(problem="too little").attempt().attempt("v02")
    lines.step("GiveUp", "v03", Outcome.SKIPPED, "skipped by the operator").end()
    story = read_story(path)
    first, second, third = story.windows
    assert [(a.number, a.outcome, a.reason) for a in first.attempts] == [
        (1, Outcome.FAIL, "too little"),
        (2, Outcome.PASS, ""),
    ]
    assert first.outcome is Outcome.PASS
    assert first.attempts[0].measurements[0].low == 0.005
    assert (len(second.attempts), second.outcome) == (1, Outcome.PASS)
    assert (third.attempts, third.outcome, third.reason) == ((), Outcome.SKIPPED, "skipped by the operator")
    assert story.recordings == 3
    assert (story.outcome, story.held) == (Outcome.PASS, "All winches stand still, held.")


def test_hands_that_never_left_are_an_attempt_without_recording(path, journal_at):
    journal_at(path).begin("i01").step("AwaitHandsOff", outcome=Outcome.FAIL, reason="still held").attempt().end()
    first, second = read_story(path).windows[0].attempts
    assert (first.recorded, first.outcome, first.reason) == (False, Outcome.FAIL, "still held")
    assert (second.number, second.recorded, second.outcome) == (2, True, Outcome.PASS)


def test_the_check_of_a_rejected_recording_is_told_once(path, journal_at):
    journal_at(path).begin("i01").attempt(problem="too little").end()
    (incident,) = read_story(path).incidents
    assert (incident.window, incident.reason, incident.outcome) == ("i01", "too little", Outcome.FAIL)


def test_times_are_those_of_the_run(path, journal_at):
    journal_at(path).begin("i01").step("MoveTo").step("Settle").step("Accept").end()
    story = read_story(path)  # a line a second, the first being 0
    assert [(b.window, b.kind, b.begin, b.end) for b in story.bouts] == [
        ("i01", "moving", 1.0, 2.0),
        ("i01", "settling", 3.0, 4.0),
    ]
    assert story.seconds == 8.0


def test_a_run_that_broke_off_is_told_to_its_last_line(path, journal_at):
    lines = journal_at(path).begin("i01").step("AwaitHandsOff").start("Record")
    lines.write(LineKind.TRIPPED, outcome=Outcome.ERROR, reason="cable 2 is slack")
    with path.open("ab") as file:
        file.write(b'{"number": 9, "t": 1')  # torn by the power cut
    story = read_story(path)
    assert story.outcome is Outcome.UNSET
    assert "middle of the run" in story.reason
    assert story.bouts[-1].kind == "recording"
    assert [(i.what, i.reason) for i in story.incidents] == [("guard", "cable 2 is slack")]
    assert story.windows[0].attempts[0].outcome is Outcome.UNSET


def test_a_resumed_run_counts_on(path, journal_at, ticking):
    journal_at(path).begin("i01", "i02").attempt("i01").start("MoveTo", "i02")
    journal_at(path, ticking(start=5.0)).begin("i02").step("MoveTo", "i02").attempt("i02").end()  # after a reboot
    story = read_story(path)
    assert [w.outcome for w in story.windows] == [Outcome.PASS, Outcome.PASS]
    ends = [bout.end for bout in story.bouts]
    assert ends == sorted(ends)
    assert story.seconds == 9.0 + 12.0
    assert story.outcome is Outcome.PASS


def test_an_empty_journal_tells_nothing(path):
    path.touch()
    assert read_story(path) is None


def test_wrong_measurements_name_the_line(path, journal_at):
    journal_at(path).begin("i01").step("AwaitHandsOff").step("CheckWindow", measurements=[{"value": "much"}])
    with pytest.raises(FileError, match="entry 5, measurements"):
        read_story(path)
