"""What a run must withstand. Each fault is planted at a step and ends in a held robot, a sentence, nothing lost."""

import asyncio
import errno
import os
import signal

import pytest

from drivers.ports import DriveState, PromptKind
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.window_csv import read_window_csv
from procedures.events import RunFinished, StepStarted, Tripped
from procedures.handlers import HANDLERS
from procedures.outcomes import Outcome
from procedures.recording.journal import LineKind, read_journal
from procedures.steps import Record
from sim_backends.jumping_loop import run

STEPS = (
    "Enable",
    "TryWinches",
    "MoveTo",
    "Settle",
    "Hold",
    "ReadEncoders",
    "CheckTension",
    "ComparePlace",
    "Ask",
    "AwaitHandsOff",
    "Record",
    "CheckWindow",
    "Accept",
)


def held_line(folder):
    return next(e for e in read_journal(folder / "journal.jsonl") if e.kind is LineKind.HELD)


def test_a_tension_under_its_limit_at_rest_ends_the_run(world, lab, tmp_path):
    world.at("Settle", lambda: setattr(world.winches[2], "tension", 12.0))
    report = world.run(lab.one, tmp_path / "run")
    assert report.outcome is Outcome.FAIL
    assert "tension of cable 3 is 12 N (18 to 220 N is allowed)" in report.reason
    assert report.reason.startswith("Window i01")
    assert world.stopped
    assert report.held
    assert not any(isinstance(e, StepStarted) and type(e.step).__name__ == "Record" for e in world.events)


def test_a_tension_just_under_its_limit_is_marginal(world, lab, tmp_path):
    world.at("Settle", lambda: setattr(world.winches[2], "tension", 19.0))
    world.at("Ask", lambda: setattr(world.winches[2], "tension", None))
    report = world.run(lab.one, tmp_path / "run")
    assert report.outcome is Outcome.PASS  # the window itself is good
    line = next(e for e in read_journal(tmp_path / "run" / "journal.jsonl") if e.step == "CheckTension" and e.reason)
    assert line.outcome is Outcome.MARGINAL


FAULTS = {
    "fault word": (
        lambda w: setattr(w.winches[1], "fault", "overcurrent (0x2310)"),
        "winch 2 reports a fault: overcurrent (0x2310)",
    ),
    "silent drive": (
        lambda w: setattr(w.winches[0], "silent_since", w.now()),
        "winch 1 has not answered for 0.2",
    ),
    "drive drops out": (
        lambda w: setattr(w.winches[3], "state", DriveState.SWITCHED_ON),
        "winch 4 is in state “switched on”",
    ),
    "unknown state": (
        lambda w: setattr(w.winches[3], "state", DriveState.UNKNOWN),
        "winch 4 has not answered for 0.0",
    ),
    "overload": (lambda w: setattr(w.winches[2], "tension", 300.0), "cable 3 has 300.0 N, over 250 N"),
}


@pytest.mark.parametrize("step", ["MoveTo", "Settle", "Ask", "Record"])
@pytest.mark.parametrize("fault", FAULTS)
def test_a_guard_stops_all_winches_at_once_and_names_the_cause(world, lab, tmp_path, fault, step):
    plant, says = FAULTS[fault]
    planted = []
    world.at(step, lambda: (plant(world), planted.append(world.now())))
    report = world.run(lab.one, tmp_path / "run")
    trip = next(e.trip for e in world.events if isinstance(e, Tripped))
    assert says in trip.says
    assert says in report.reason
    assert report.outcome is Outcome.ERROR
    assert report.exit_code == 3
    assert trip.t - planted[0] < 0.25
    for winch in world.winches:
        silent = fault == "silent drive" and winch is world.winches[0]
        assert winch.commands[-1] == ("force_stop" if silent else "quick_stop")
    assert world.fallen_silent == (fault == "silent drive")
    assert world.motions_after("quick_stop") == 0
    lines = read_journal(tmp_path / "run" / "journal.jsonl")
    assert says in next(e for e in lines if e.kind is LineKind.TRIPPED).reason
    assert report.held == (fault != "silent drive")
    if fault == "silent drive":
        assert "cut the power by hand" in report.held_says
        assert "winch 1 was not seen to stop (has not answered" in report.held_says


def test_a_slack_cable_while_recording_stops_the_run_and_keeps_the_rows(world, lab, tmp_path):
    world.at("Record", lambda: setattr(world.winches[1], "tension", 0.5), after=4.0)
    report = world.run(lab.one, tmp_path / "run")
    assert "cable 2 has 0.5 N, under 2 N for 0.1 s" in report.reason
    kept = read_window_csv(tmp_path / "run" / "rejected" / "i01-attempt1.csv", 4)
    assert 400 <= len(kept.t) <= 415
    assert "kept in rejected/i01-attempt1.csv" in report.reason


@pytest.mark.parametrize("seconds", [1.0, 3.0])
def test_a_slack_cable_in_the_operators_hands_is_no_trip_for_a_moment(world, lab, tmp_path, seconds):
    world.at("AwaitHandsOff", lambda: setattr(world.winches[1], "tension", 0.0))
    world.at("AwaitHandsOff", lambda: setattr(world.winches[1], "tension", None), after=seconds)
    report = world.run(lab.one, tmp_path / "run")
    tripped = [e for e in world.events if isinstance(e, Tripped)]
    assert bool(tripped) == (seconds > 2.0)
    if tripped:
        assert "cable 2 has 0.0 N, under 10 N for 2 s while the platform is handled" in report.reason


@pytest.mark.parametrize("step", ["Ask", "Record"])
def test_a_motor_that_creeps_is_stopped_in_any_step(world, lab, tmp_path, step):
    def creep():
        winch = world.winches[0]
        winch._stay()
        winch._begin, winch.creep = world.now(), 1e-3

    world.at(step, creep)
    report = world.run(lab.one, tmp_path / "run")
    assert "winch 1 is +3.0 mm from its commanded position, 3 mm is allowed" in report.reason
    assert all(w.commands[-1] == "quick_stop" for w in world.winches)
    assert report.accepted == ()


@pytest.mark.parametrize("how", ["blank_until", "frozen_until", "silent_until"])
def test_a_marker_lost_for_a_fifth_of_a_second_rejects_the_window_and_records_it_anew(world, lab, tmp_path, how):
    world.at("Record", lambda: setattr(world.markers, how, world.now() + 0.2), after=1.0)
    report = world.run(lab.one, tmp_path / "run")
    assert report.outcome is Outcome.PASS
    assert report.windows[0].attempts == 2
    kept = (tmp_path / "run" / "rejected" / "i01-attempt1.csv").read_text()
    rejected = next(e for e in read_journal(tmp_path / "run" / "journal.jsonl") if e.step == "Reject" and e.reason)
    assert "longest gap of the marker is 0." in rejected.reason
    assert len(read_campaign(tmp_path / "run").windows[0].t) == 1001
    lines = kept.splitlines()
    if how == "blank_until":
        assert sum(",,,,1.5" in line for line in lines) == pytest.approx(20, abs=1)
    if how == "silent_until":
        assert sum(line.endswith("," * 11) for line in lines) == pytest.approx(20, abs=1)
    assert "Not accepted: longest gap" in world.operator.asked[1].text


@pytest.mark.parametrize(
    ("how", "says"),
    [
        ("blank_until", "the main marker is lost for 3.0"),
        ("frozen_until", "the main marker is frozen for 3.0"),
        ("silent_until", "no frame has come from motion capture for 3.0"),
    ],
)
@pytest.mark.parametrize("step", ["Settle", "Record"])
def test_a_marker_lost_for_three_seconds_trips_the_guard(world, lab, tmp_path, how, says, step):
    world.at(step, lambda: setattr(world.markers, how, world.now() + 60.0), after=0.5)
    report = world.run(lab.one, tmp_path / "run")
    assert says in report.reason
    assert "at most 3 s is allowed" in report.reason
    assert all(w.commands[-1] == "hold" for w in world.winches)
    if step == "Record":
        assert len((tmp_path / "run" / "rejected" / "i01-attempt1.csv").read_text().splitlines()) > 30


def test_doubled_late_and_disordered_frames_change_nothing(lab, tmp_path):
    for name, disorder in (("a", False), ("b", True)):
        world = lab.make_world()
        world.markers.disorder = disorder
        assert world.run(lab.one, tmp_path / name).outcome is Outcome.PASS
    assert (tmp_path / "a/windows/i01.csv").read_bytes() == (tmp_path / "b/windows/i01.csv").read_bytes()


def test_a_window_is_given_up_after_four_attempts_and_the_next_one_recorded(world, lab, tmp_path):
    def weak():
        world.displacement = 0.002

    def strong():
        world.displacement = 0.03

    world.at("Ask", weak)
    world.at("GiveUp", strong)
    report = world.run(lab.plan, tmp_path / "run")
    assert report.outcome is Outcome.FAIL
    assert report.windows[0].outcome is Outcome.FAIL
    assert report.windows[0].attempts == 4
    assert "rejected 4 times, the last time: amplitude (peak to peak) is " in report.windows[0].reason
    assert "1 of 2 windows accepted" in report.reason
    assert [row.id for row in report.accepted] == ["i02"]
    assert len(list((tmp_path / "run" / "rejected").glob("*.csv"))) == 4
    assert len(read_campaign(tmp_path / "run").windows) == 1


def test_a_swinging_platform_is_steadied_by_the_operator(world, lab, tmp_path):
    world.amplitude = 0.02
    report = world.run(lab.one, tmp_path / "run")
    assert report.outcome is Outcome.PASS
    assert "still moves" in world.operator.asked[0].text


def test_a_platform_that_never_rests_is_given_up(world, lab, tmp_path):
    world.amplitude = 0.02
    world.operator.answer = _only_waits(world)
    report = world.run(lab.one, tmp_path / "run")
    assert report.outcome is Outcome.FAIL
    assert "still moves 40" in report.windows[0].reason


def _only_waits(world):
    async def answer(prompt):
        await world.clock.sleep(1.0)
        return prompt.choices[0]

    return answer


@pytest.mark.parametrize("command", ["configure", "enable"])
def test_a_drive_that_refuses(world, lab, tmp_path, command):
    for k in (0, 2):
        world.winches[k].refuses = command
    report = world.run(lab.one, tmp_path / "run")
    assert report.outcome is Outcome.ERROR
    assert f"2 of 4 winches: winch 1, winch 3: refuses to {command}. Look at" in report.reason
    assert report.reason.count("Look at its display.") == 1  # what two advise is said once
    assert all("move_to" not in w.commands for w in world.winches)


def test_a_winch_that_cannot_hold_is_quick_stopped_and_the_others_held(world, lab, tmp_path):
    world.at("Ask", lambda: setattr(world.winches[2], "hangs", True))
    world.operator.answers[PromptKind.DISPLACE_AND_RELEASE] = "abort"
    report = world.run(lab.one, tmp_path / "run")
    assert report.outcome is Outcome.ABORTED
    assert [w.commands[-1] for w in world.winches] == ["hold", "hold", "quick_stop", "hold"]
    assert "winch 3 was quick-stopped" in report.held_says
    assert report.held


class FullDisk:
    """Takes so many bytes, the last line only in part."""

    def __init__(self, room):
        self.room = room

    def __call__(self, descriptor, data):
        if self.room <= 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        taken = os.write(descriptor, data[: self.room])
        self.room -= taken
        return taken


def test_a_full_disk_while_recording_ends_in_a_held_robot_and_keeps_what_was_written(world, lab, tmp_path):
    lab.make_world().run(lab.plan, tmp_path / "whole")
    first = sum(path.stat().st_size for path in (tmp_path / "whole" / "windows").glob("i01.*"))
    world.write = FullDisk(first + 60_345)  # the second window stops somewhere in a line
    report = world.run(lab.plan, tmp_path / "run")
    assert report.outcome is Outcome.ERROR
    assert "No space left on device" in report.reason
    assert "windows/i02." in report.reason
    assert world.stopped
    assert report.held
    assert len(read_campaign(tmp_path / "run").windows) == 1
    rows = (tmp_path / "run" / "rejected" / "i02-attempt1.csv").read_bytes()
    assert rows.endswith(b"\n")
    assert rows.count(b"\n") > 100
    assert {line.count(b",") for line in rows.splitlines()} == {11}


def test_dev_full_is_what_a_full_disk_looks_like(world, lab, tmp_path):
    full = os.open("/dev/full", os.O_WRONLY)
    world.write = lambda _descriptor, data: os.write(full, data)
    try:
        report = world.run(lab.one, tmp_path / "run")
    finally:
        os.close(full)
    assert "No space left on device" in report.reason
    assert report.held


@pytest.mark.parametrize("step", STEPS)
def test_a_full_disk_under_the_journal_ends_in_a_held_robot(world, lab, tmp_path, step, monkeypatch):
    def fill():
        def full(_descriptor):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        monkeypatch.setattr("procedures.recording.journal.os.fsync", full)

    world.at(step, fill)
    report = world.run(lab.one, tmp_path / "run")
    assert report.outcome is Outcome.ERROR
    assert "No space left on device" in report.reason
    assert report.held
    assert world.stopped


@pytest.mark.parametrize("step", STEPS)
def test_ctrl_c_at_every_step_leaves_the_robot_held(world, lab, tmp_path, step):
    """As asyncio delivers it: the main task is cancelled, and cancelled again while the robot is being held."""

    async def main():
        task = asyncio.ensure_future(world.carry_out(lab.plan, tmp_path / "run"))
        world.at(step, lambda: impatient.append(asyncio.ensure_future(impatience(task))))
        with pytest.raises(asyncio.CancelledError):
            await task

    async def impatience(task):
        for _ in range(4):
            task.cancel()
            await world.clock.sleep(0.05)

    impatient = []
    run(main())
    report = world.events[-1].report
    assert isinstance(world.events[-1], RunFinished)
    assert report.outcome is Outcome.ABORTED
    assert report.interrupted
    assert report.exit_code == 130
    assert report.reason.startswith("Interrupted at “")
    if step == "Enable":  # cancelled while the drives were being configured: they never had power
        assert [w.commands for w in world.winches] == [["configure", "hold"]] * 4
        assert not report.held
        assert "winch 1, winch 2, winch 3, winch 4, each: has never reported" in report.held_says
    else:
        assert report.held
        assert all(w.commands[-1] == "hold" for w in world.winches)
    assert held_line(tmp_path / "run").outcome is (Outcome.PASS if report.held else Outcome.ERROR)
    assert not list((tmp_path / "run").rglob("*.csv.part"))
    if step == "Record":
        assert (tmp_path / "run" / "rejected" / "i01-attempt1.csv").exists()


def test_ctrl_c_while_power_is_being_switched_on(world, lab, tmp_path):
    async def main():
        task = asyncio.ensure_future(world.carry_out(lab.one, tmp_path / "run"))
        world.at("Enable", task.cancel, after=0.07)
        with pytest.raises(asyncio.CancelledError):
            await task

    run(main())
    assert [w.commands for w in world.winches] == [["configure", "enable"]] * 4
    assert world.events[-1].report.held
    assert "without motor power" in world.events[-1].report.held_says


def test_ctrl_c_while_a_finished_run_is_being_held(world, lab, tmp_path):
    """Everything is there; the caller is interrupted, but only once the robot is held."""

    async def main():
        task = asyncio.ensure_future(world.carry_out(lab.one, tmp_path / "run"))
        world.at("Accept", task.cancel, after=0.1)
        with pytest.raises(asyncio.CancelledError):
            await task

    run(main())
    assert world.events[-1].report.outcome is Outcome.PASS
    assert world.events[-1].report.held
    assert len(read_campaign(tmp_path / "run").windows) == 1


@pytest.mark.parametrize("presses", [1, 2, 5])
def test_real_signals(world, lab, tmp_path, presses):
    """SIGINT to this process, several times: the robot is held, then KeyboardInterrupt or cancellation comes out."""

    async def press():
        for _ in range(presses):
            signal.raise_signal(signal.SIGINT)
            await world.clock.sleep(0.02)

    tasks = []
    world.at("Record", lambda: tasks.append(asyncio.ensure_future(press())))
    with pytest.raises(KeyboardInterrupt):
        world.run(lab.one, tmp_path / "run")
    report = world.events[-1].report
    assert report.outcome is Outcome.ABORTED
    assert report.held
    assert all(w.commands[-1] == "hold" for w in world.winches)
    assert (tmp_path / "run" / "rejected" / "i01-attempt1.csv").exists()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_bug_in_a_handler_leaves_the_robot_held_and_is_not_hidden(world, lab, tmp_path):
    async def broken(_stand, _step):
        raise ZeroDivisionError("a bug")

    with pytest.raises(ZeroDivisionError):
        world.run(lab.one, tmp_path / "run", handlers={**HANDLERS, Record: broken})
    report = world.events[-1].report
    assert report.outcome is Outcome.ERROR
    assert "A bug of this program" in report.reason
    assert report.held
    assert world.stopped


def test_a_winch_that_never_reports(world, lab, tmp_path):
    world.winches[3].latest = lambda: None
    report = world.run(lab.one, tmp_path / "run")
    assert "winch 4: no sample within 5 s" in report.reason
    assert not report.held
    assert "winch 4 has never reported" in report.held_says
