"""What people say to a running procedure: the robot is held first, and the run goes on as they said, or not at all."""

from dataclasses import replace

import pytest

from drivers.ports import DriveState
from fidim_lab.data.campaign import read_campaign
from procedures.control import Control, Verb, Word
from procedures.events import Paused, Resumed, StepStarted
from procedures.outcomes import Outcome
from procedures.pace import Pace
from procedures.protocols import catalogue
from procedures.recording.journal import LineKind, read_journal
from procedures.run import run_procedure
from procedures.steps import Enable, Note, Record, Settle
from sim_backends.jumping_loop import run


@pytest.fixture
def control():
    return Control()


def saying(control, answers, verb, reason=""):
    return lambda: answers.append(control.say(Word(verb, reason, "a test")))


def names(world):
    return [type(e.step).__name__ for e in world.events if isinstance(e, StepStarted)]


@pytest.mark.parametrize("step", ["MoveTo", "Settle", "ReadEncoders", "Ask", "AwaitHandsOff", "Record"])
@pytest.mark.sampled(3)
def test_a_pause_holds_and_a_resume_goes_on_to_a_whole_campaign(step, world, lab, control, tmp_path):
    said = []
    world.at(step, saying(control, said, Verb.PAUSE), after=0.2)
    world.at(step, saying(control, said, Verb.RESUME), after=40.0)
    report = world.run(lab.plan, tmp_path / "run", control=control)
    assert said == ["", ""]
    assert report.outcome is Outcome.PASS, report.reason
    paused, resumed = (next(e for e in world.events if isinstance(e, kind)) for kind in (Paused, Resumed))
    assert resumed.t - paused.t > 35.0
    between = [e for e in world.events if paused.t < e.t < resumed.t]
    assert not [e for e in between if isinstance(e, StepStarted)], "nothing is done while paused"
    assert names(world).count(step) == (4 if step == "Ask" else 3), "once more than for two windows"
    assert {len(w.t) for w in read_campaign(tmp_path / "run").windows} == {1001}
    kinds = [e.kind for e in read_journal(tmp_path / "run" / "journal.jsonl")]
    assert kinds.index(LineKind.PAUSED) < kinds.index(LineKind.RESUMED)


def test_a_paused_move_stops_and_goes_on_to_its_goal(world, lab, control, tmp_path):
    places = []
    world.at("MoveTo", saying(control, [], Verb.PAUSE), after=0.3)
    world.at("MoveTo", lambda: places.append(world.winches[0].latest().length), after=5.0)
    world.at("MoveTo", lambda: places.append(world.winches[0].latest().length), after=9.0)
    world.at("MoveTo", saying(control, [], Verb.RESUME), after=10.0)
    report = world.run(lab.one, tmp_path / "run", control=control)
    assert places[0] == places[1]
    assert 1.4 < places[0] < 1.5
    assert report.outcome is Outcome.PASS


def test_a_window_interrupted_by_a_pause_is_recorded_again_not_spliced(world, lab, control, tmp_path):
    world.at("Record", saying(control, [], Verb.PAUSE), after=4.0)
    world.at("Record", saying(control, [], Verb.RESUME), after=8.0)
    report = world.run(lab.one, tmp_path / "run", control=control)
    assert [row.attempts for row in report.windows] == [2]
    kept = (tmp_path / "run" / "rejected").glob("*.csv")
    assert [f.name.split(".")[0] for f in kept] == ["i01-attempt1"]


def test_resume_is_refused_while_a_winch_is_elsewhere_than_it_was_held(world, lab, control, tmp_path):
    def push():
        winch = world.winches[1]
        winch._from = winch._to = winch._from + 0.0025

    world.at("Settle", saying(control, [], Verb.PAUSE), after=0.1)
    world.at("Settle", push, after=5.0)
    world.at("Settle", saying(control, [], Verb.RESUME), after=6.0)
    world.at("Settle", saying(control, [], Verb.ABORT, "the winch slips"), after=8.0)
    report = world.run(lab.one, tmp_path / "run", control=control)
    assert report.outcome is Outcome.ABORTED
    assert "the winch slips" in report.reason
    refused = [e.says for e in world.events if isinstance(e, Paused)][1]
    assert refused.startswith("still paused: winch 2 is +")
    assert not [e for e in world.events if isinstance(e, Resumed)]


@pytest.mark.parametrize("step", ["MoveTo", "Ask", "Record"])
def test_a_skipped_window_is_left_out_with_its_reason(step, world, lab, control, tmp_path):
    world.at(step, saying(control, [], Verb.SKIP, "the cable rubs"), after=0.2)
    report = world.run(lab.plan, tmp_path / "run", control=control)
    assert [row.outcome for row in report.windows] == [Outcome.SKIPPED, Outcome.PASS]
    assert report.windows[0].reason == "the cable rubs"
    assert report.outcome is Outcome.SKIPPED


def test_a_retry_while_recording_records_again_and_elsewhere_begins_the_window_again(world, lab, control, tmp_path):
    world.at("Record", saying(control, [], Verb.RETRY, "somebody walked by"), after=3.0)
    report = world.run(lab.one, tmp_path / "run", control=control)
    assert report.outcome is Outcome.PASS
    assert names(world).count("Record") == 2
    assert names(world).count("Settle") == 1
    again = lab.make_world()
    another = Control()
    again.at("Settle", saying(another, [], Verb.RETRY), after=0.1)
    assert again.run(lab.one, tmp_path / "again", control=another).outcome is Outcome.PASS
    assert names(again).count("MoveTo") == 2


def test_repeats_by_a_persons_word_end_too(world, lab, control, tmp_path):
    def again(event):
        world.hear(event)
        if isinstance(event, StepStarted) and type(event.step).__name__ == "Settle":
            control.say(Word(Verb.RETRY, "again"))

    report = world.run(lab.plan, tmp_path / "run", control=control, listeners=(again,))
    assert [row.outcome for row in report.windows] == [Outcome.FAIL, Outcome.FAIL]
    assert "begun 4 times" in report.windows[0].reason


def test_an_abort_ends_held_with_the_reason(world, lab, control, tmp_path):
    world.at("MoveTo", saying(control, [], Verb.ABORT, "fire drill"), after=0.2)
    report = world.run(lab.plan, tmp_path / "run", control=control)
    assert (report.outcome, report.held) == (Outcome.ABORTED, True)
    assert "fire drill" in report.reason
    assert "a test" in report.reason
    assert world.stopped


@pytest.mark.parametrize("step", ["Enable", "MoveTo", "Settle", "Ask", "Record"])
def test_the_emergency_stop_acts_before_it_returns_and_latches(step, world, lab, control, tmp_path):
    seen = []

    def press():
        assert control.emergency_stop("somebody pressed it")
        seen.append([winch.commands[-1] for winch in world.winches])

    world.at(step, press, after=0.05)
    report = world.run(lab.plan, tmp_path / "run", control=control)
    assert seen == [["quick_stop"] * 4]
    assert report.outcome is Outcome.ERROR
    assert "emergency stop" in report.reason
    assert world.motions_after("quick_stop") == 0
    assert not control.emergency_stop("after the end")


def test_an_emergency_stop_while_paused_is_one_too(world, lab, control, tmp_path):
    world.at("Settle", saying(control, [], Verb.PAUSE), after=0.1)
    world.at("Settle", lambda: control.emergency_stop("again somebody"), after=3.0)
    report = world.run(lab.one, tmp_path / "run", control=control)
    assert report.outcome is Outcome.ERROR
    assert all(w.state is DriveState.QUICK_STOP_ACTIVE for w in world.winches)


@pytest.mark.parametrize(
    ("step", "verb", "why"),
    [
        ("Enable", Verb.SKIP, "does not belong to a window"),
        ("MoveTo", Verb.RESUME, "not paused"),
        ("CheckWindow", Verb.RETRY, "just ending"),
    ],
)
def test_what_cannot_be_done_now_is_refused_with_why(step, verb, why, world, lab, control, tmp_path):
    said = []

    def hear(event):
        if isinstance(event, StepStarted) and type(event.step).__name__ == step:
            said.append(control.say(Word(verb)))

    assert world.run(lab.one, tmp_path / "run", control=control, listeners=(hear,)).outcome is Outcome.PASS
    assert why in said[0]
    assert control.say(Word(Verb.PAUSE)) == "nothing is running"


def test_a_procedure_that_knows_no_skip_ends_there_held(world, lab, control, tmp_path):
    def own():
        yield Enable()
        yield Settle(window="i01", tolerance=1e-9, over=1.0, timeout=5.0)
        yield Note(remark="never said")

    experiment = catalogue.experiment("identify", lab.one, world.robot, world.settings, statics=lambda v: v * 0 + 60.0)
    experiment = replace(experiment, procedure=own)
    world.at("Settle", saying(control, [], Verb.SKIP, "no time"), after=1.0)

    async def carry_out():
        return await run_procedure(
            experiment, world.rig, tmp_path / "run", wall_time=lambda: "", listeners=(world.hear,), control=control
        )

    report = run(carry_out())
    assert report.outcome is Outcome.ABORTED
    assert "cannot skip or repeat" in report.reason
    assert "Note" not in names(world)


def test_the_time_left_learns_from_slow_steps():
    pace, step = Pace(), Record(window="i01", attempt=1, duration=10.0)
    assert pace.seconds(step) == 10.0
    pace.learn(step, 20.0)
    assert pace.seconds(step) == 20.0
    pace.learn(step, 10.0)
    assert pace.seconds(step) == pytest.approx(17.0)
    assert pace.total({Record: 30.0, Note: 1.0}) == pytest.approx(52.0)
    pace.learn(step, 1e6)
    assert pace.seconds(step) < 30.0, "a coffee break is no pace"
