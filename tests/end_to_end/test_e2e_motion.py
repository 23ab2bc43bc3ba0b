"""Uncommanded motion, and stops that are not obeyed: the plant's true lengths beside what the run says."""

import asyncio
import os
import signal
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.rehearsal import rehearsal as rehearsing
from drivers.canbus.transport import CanFrame
from drivers.cia402.wire.nmt import NmtCommand
from procedures.events import RunFinished
from procedures.held_watch import watch_held
from procedures.recording.journal import LineKind
from sim_backends.bus_faults import FrameRule

RUN_ON = 0.010
"""m within which an uncommanded motion at 0.05 m/s must have ended"""
DEAF = FrameRule(frozenset({0x202, 0x602}), drop=True)
"""the receive path of drive 2: RPDO and SDO; what it says itself goes on"""


def halts(stage):
    """Bit 8, by the drive's own port: no guard of the bus sees it."""
    stage.write_pdo(2, unseen=True, controlword=0x12F, mode=1)


def moves(stage, cable, metres):
    stage.send_to(cable, metres, unseen=True)


def spins(stage):
    stage.spin(2, 0.05, unseen=True)


def creeps(stage):
    """1 mm/s, by a brake or current limit that gives way."""

    async def creep():
        for _ in range(20):
            moves(stage, 2, 0.001)
            await stage.rig.rig.clock.sleep(1.0)

    stage.tasks.append(asyncio.ensure_future(creep()))


@pytest.mark.parametrize("step", ["Ask", "Settle", "CheckTension", "AwaitHandsOff", "Record"])
@pytest.mark.parametrize("fault", [spins, lambda stage: moves(stage, 2, 0.25)], ids=["spinning drum", "set-point"])
@pytest.mark.sampled(1)
def test_a_winch_that_moves_while_it_should_hold_stops_within_ten_millimetres(rehearsal, truth, step, fault):
    rehearsal.at(step, lambda stage: (truth.watch(stage), fault(stage)), after=0.02)
    ended = rehearsal.run()
    report = ended.check(opened=False)
    assert ended.trip.guard == "motion"
    assert report.reason.startswith("The motion guard stopped the run")
    assert "winch 2" in report.reason
    assert np.abs(truth.moved).max() <= RUN_ON
    assert report.accepted == ()


def test_all_winches_moved_by_somebody_else_are_seen_and_no_window_is_accepted(rehearsal, truth):
    rehearsal.at("Ask", lambda s: (truth.watch(s), [moves(s, cable, 0.15) for cable in (1, 2, 3, 4)]), after=0.5)
    report = rehearsal.run().check(opened=False)
    assert np.abs(truth.moved).max() <= RUN_ON
    assert report.accepted == ()


def test_a_slow_creep_is_seen_by_its_length(rehearsal, truth):
    rehearsal.at("Ask", lambda stage: (truth.watch(stage), creeps(stage)), after=0.1)
    ended = rehearsal.run()
    ended.check(opened=False)
    assert ended.trip.guard == "motion"
    assert np.abs(truth.moved).max() <= 0.005


@pytest.mark.parametrize(("step", "counts"), [("Ask", 3000), ("Settle", -3000), ("CheckWindow", 750), ("Record", 200)])
@pytest.mark.sampled(1)
def test_an_encoder_that_jumps_is_seen_before_the_next_move(rehearsal, scene, step, counts):
    rehearsal.plan = scene.two
    rehearsal.at(step, lambda stage: stage.drive(2).faults.jump_encoder(counts), after=0.0)
    ended = rehearsal.run()
    ended.check(opened=False)
    assert ended.trip.guard == "motion"
    assert ended.trip.t - ended.planted[0] <= 0.03
    assert len(ended.begun["MoveTo"]) == 1


def test_a_drive_that_halts_alone_in_a_move_stops_the_others(rehearsal, truth):
    rehearsal.at("MoveTo", lambda s: (truth.watch(s), halts(s)), after=0.25)
    ended = rehearsal.run()
    report = ended.check(opened=False)
    assert ended.trip.guard == "motion"
    assert np.ptp(truth.moved) <= 0.012
    assert all(one.stands and one.obeyed for one in report.stopped)


def test_a_set_point_that_one_drive_never_got_stops_the_others(rehearsal, truth):
    lost = FrameRule(frozenset({0x202}), skip=1, count=1, drop=True)
    rehearsal.at("MoveTo", lambda stage: (truth.watch(stage), stage.bus.rules.append(lost)))
    ended = rehearsal.run()
    ended.check(opened=False)
    # the move's own check comes before the guard: 3 mm at 0.2 m/s² take 0.17 s, and it may be 0.06 s late
    assert ended.report.reason == "winch 2: did not start its move within 0.2 s of the others"
    assert np.ptp(truth.moved) <= 0.010


def slow(rehearsal):
    """0.02 m/s: a stop that is not obeyed has time to be seen."""
    rehearsal.settings = replace(rehearsal.settings, motion=replace(rehearsal.settings.motion, speed=0.02))


def silences(ended, since):
    """Whether neither SYNC nor the host's heartbeat was sent any more for the last half second."""
    late = [f for f in ended.frames if f.id in (0x080, 0x77F) and f.t > since]
    return not late


@pytest.mark.parametrize("how", ["fault of another", "SIGINT"])
@pytest.mark.sampled(1)
def test_a_drive_that_does_not_hear_a_stop_is_stopped_by_the_network_and_the_end_says_so(rehearsal, truth, how):
    slow(rehearsal)

    def strike(stage):
        truth.watch(stage)
        stage.bus.rules.append(DEAF)
        if how == "SIGINT":
            os.kill(os.getpid(), signal.SIGINT)
        else:
            stage.drive(3).faults.raise_fault(0x2310)

    rehearsal.at("MoveTo", strike, after=0.2)
    ended = rehearsal.run()
    report = ended.report
    stop = next(f for f in ended.frames if f.id == 0 and f.data == bytes((NmtCommand.STOP, 2)))
    assert silences(ended, stop.t + 0.05)
    assert abs(truth.moved[1]) <= RUN_ON
    assert not report.held
    assert report.exit_code == (130 if how == "SIGINT" else 3)
    assert report.held_says.startswith("NOT VERIFIED that the robot is held: cut the power by hand")
    assert "winch 2 did not obey the stop" in report.held_says
    assert "All winches stand still" not in report.held_says
    obeyed = {one.name: one.obeyed for one in report.stopped}
    assert obeyed == {"winch 1": True, "winch 2": False, "winch 3": True, "winch 4": True}
    held = next(e for e in ended.journal if e.kind is LineKind.HELD)
    assert held.data["winches"][1]["obeyed"] is False
    assert held.data["winches"][1]["moved"] == pytest.approx(truth.moved[1], abs=2e-3)


def test_a_drive_that_hears_the_network_only_is_measured_after_it(rehearsal, truth):
    """It takes no controlword; by SDO, after NMT stop and pre-operational, its encoder still answers."""
    slow(rehearsal)
    word = b"\x2b\x40\x60\x00"
    deaf = (
        FrameRule(frozenset({0x202}), drop=True),
        FrameRule(frozenset({0x602}), change=lambda data: b"" if data.startswith(word) else data),
    )
    rehearsal.at("MoveTo", lambda s: (s.bus.rules.extend(deaf), s.drive(3).faults.raise_fault(0x2310)), after=0.2)
    report = rehearsal.run().report
    assert report.held_says.startswith("All winches stand still by now, but cut the power by hand")
    assert all(one.stands for one in report.stopped)
    assert not report.held


@pytest.mark.parametrize(
    ("nodes", "frames", "away"), [((2,), 2, 0.0), ((2,), None, 0.0), ((1, 2, 3, 4), None, 0.0), ((), 0, 0.12)]
)
@pytest.mark.sampled(1)
def test_a_quick_stop_that_is_lost_on_its_way_is_repeated_until_it_is_confirmed(rehearsal, truth, nodes, frames, away):
    """At 0.1 m/s NMT stop came after 7.1 mm, 13.4 mm where the bus was away. None: no RPDO arrives any more."""

    def strike(stage):
        async def lose():
            stage.bus.cut = away > 0.0
            if nodes:
                ids = frozenset(0x200 + node for node in nodes)
                stage.bus.rules.append(FrameRule(ids, count=frames, drop=True))
            stage.control.emergency_stop("pressed")
            await stage.sleep(away)
            stage.bus.cut = False

        truth.watch(stage)
        stage.spawn(lose())

    rehearsal.at("MoveTo", strike, after=0.5)
    ended = rehearsal.run()
    report = ended.check(opened=False)
    assert np.abs(truth.moved).max() <= (0.012 if away else 0.005)
    assert all(one.stands and one.obeyed for one in report.stopped)
    assert not [f for f in ended.frames if f.id == 0 and f.data[:1] == bytes((NmtCommand.STOP,))]
    assert report.held_says == "All winches stand still, held."


def test_a_drive_that_restarts_in_a_move_is_asked_for_its_encoder(rehearsal):
    """Its boot-up message is lost: nothing passes on the bus but its silence."""
    reset = bytes((NmtCommand.RESET_NODE, 2))
    rehearsal.at("MoveTo", lambda s: s.drive(2).receive(CanFrame(0x000, reset, s.now())), after=0.25)
    report = rehearsal.run().report
    assert "winch 2 was not seen to stop" in report.held_says or "winch 2 did not obey the stop" in report.held_says
    assert {one.name: one.stands for one in report.stopped}["winch 2"]


def turns_behind_frozen_samples(stage):
    old = {id_: [] for id_ in (0x182, 0x282)}

    def repeat(id_, data):
        old[id_].append(data)
        return old[id_][0]

    stage.bus.rules.extend(FrameRule(frozenset({id_}), change=lambda data, id_=id_: repeat(id_, data)) for id_ in old)
    stage.spin(2, 0.05, unseen=True)


AFTER = {
    "seen": (lambda stage: moves(stage, 2, 0.25), "winch 2 is +3.", "All winches stand still, held."),
    "behind frozen samples": (
        turns_behind_frozen_samples,
        "winch 2 reports a fault: its samples (TPDO) stay where they are, its encoder, asked by SDO, is",
        "NOT VERIFIED that the robot is held: the encoder of winch 2 is contradicted by its drive",
    ),
}


def after_the_run(rehearsal, monkeypatch, strikes, seconds=4.0):
    """Carry a run out, strike 0.2 s after its end; what was told of motion, and of what is lost."""
    told, after, lost, tasks = [], [], [], []
    monkeypatch.setattr(rehearsing, "AFTERWARDS", seconds)

    def strike(stage):
        async def watch():
            rig = stage.rig.rig
            while not told:
                await rig.clock.sleep(0.05)
            asyncio.get_running_loop().call_later(0.2, strikes, stage)
            tell = lambda *moved: after.append(moved)  # noqa: E731
            await watch_held(rig.clock, rig.winches, told[0].stopped, rehearsal.settings, tell, lost.append)

        tasks.append(asyncio.ensure_future(watch()))

    rehearsal.at("MoveTo", strike)
    rehearsal.listeners = (lambda event: told.append(event.report) if isinstance(event, RunFinished) else None,)
    rehearsal.run()
    return after, lost


@pytest.mark.parametrize("case", AFTER)
def test_a_winch_that_moves_after_the_run_is_stopped_again(rehearsal, monkeypatch, case):
    strikes, moved, ends = AFTER[case]
    after, lost = after_the_run(rehearsal, monkeypatch, strikes)
    says, held = after[0]
    assert says.startswith(f"After the stop, {moved}")
    assert held.says.startswith(ends)
    assert held.ok == (case == "seen")
    assert lost == []


def torque_off(stage, *cables):
    for cable in cables:
        stage.drive(cable).faults.safe_torque_off(True)


def one_in_fault(stage):
    stage.drive(3).faults.raise_fault(0x3210)


def silent(stage, cable):
    stage.drive(cable).faults.silent = True


LOST = {
    "all by the safety chain": (
        lambda stage: torque_off(stage, 1, 2, 3, 4),
        "winch 1, winch 2, winch 3, winch 4 have lost motor power (switch on disabled)",
        "only brakes can hold now.",
    ),
    "one in fault": (
        one_in_fault,
        "winch 3 has lost motor power (emergency 0x3210",
        "only its brake can hold now.",
    ),
    "one is not seen": (
        lambda stage: silent(stage, 2),
        "winch 2 has not answered for 0.",
        "whether the robot is held is not known any more.",
    ),
}


@pytest.mark.parametrize("case", LOST)
def test_power_or_sight_that_is_lost_after_the_run_is_told_once_and_nothing_is_stopped(rehearsal, monkeypatch, case):
    strikes, says, ends = LOST[case]
    after, lost = after_the_run(rehearsal, monkeypatch, strikes)
    assert after == []
    (told,) = lost
    assert told.startswith(f"After the stop, {says}"), told
    assert told.endswith(ends)


def test_a_sample_that_is_late_once_after_the_run_is_no_news(rehearsal, monkeypatch):
    def late(stage):
        stage.bus.rules.append(FrameRule(frozenset({0x182, 0x282}), count=25, drop=True))

    assert after_the_run(rehearsal, monkeypatch, late) == ([], [])


STOPPED = 0.03
"""m of cable from the fault to standstill at 0.05 m/s; `benchmarks.frozen_encoders` has all cables, steps and ways"""


def freezes(cable, speed, *, silent=True):
    """The encoder of a drum that turns, m/s; silent: the drive's own set-point does not show it, either."""

    def strike(stage):
        defects = stage.drive(cable).defects
        defects.encoder_frozen = defects.speed_frozen = True
        defects.demand_frozen = silent
        stage.spin(cable, speed, unseen=True)

    return strike


@pytest.mark.parametrize(
    ("step", "after", "cable", "speed"),
    [("Ask", 0.3, 2, 0.05), ("Ask", 2.0, 2, -0.05), ("Record", 0.3, 4, 0.05), ("Settle", 0.05, 1, 0.05)],
)
@pytest.mark.sampled(1)
def test_a_drum_behind_a_frozen_encoder_is_stopped_by_markers(rehearsal, truth, step, after, cable, speed):
    strike = freezes(cable, speed)
    rehearsal.at(step, lambda stage: (truth.watch(stage), strike(stage)), after=after)
    ended = rehearsal.run()
    report = ended.check(held=False, opened=False)
    assert ended.trip.guard == "geometry"
    assert f"{'longer' if speed > 0 else 'shorter'} than its encoder says" in report.reason
    assert report.held_says.startswith("NOT VERIFIED that the robot is held: markers contradict the encoders")
    assert np.abs(truth.moved).max() <= STOPPED
    assert report.accepted == ()


@pytest.mark.parametrize(("step", "after"), [("Ask", 2.0), ("Record", 0.3), ("Settle", 0.05)])
@pytest.mark.parametrize(("cable", "speed"), [(3, 0.05), (4, 0.05), (2, -0.05)])
@pytest.mark.sampled(1)
def test_a_drum_that_another_program_turns_behind_a_frozen_encoder_shows_in_the_drives_set_point(
    rehearsal, truth, step, after, cable, speed
):
    """With a person at the platform it went 340 mm: the cable hung slack, and nothing contradicted its encoder."""
    strike = freezes(cable, speed, silent=False)
    rehearsal.at(step, lambda stage: (truth.watch(stage), strike(stage)), after=after)
    ended = rehearsal.run()
    report = ended.check(held=False, opened=False)
    assert ended.trip.guard == "drive"
    assert f"winch {cable} reports a fault: its own set-point (6062) has moved by {'-+'[speed > 0]}" in report.reason
    assert report.held_says.startswith(
        f"NOT VERIFIED that the robot is held: the encoder of winch {cable} is contradicted by its drive"
    )
    assert np.abs(truth.moved).max() <= RUN_ON
    assert report.accepted == ()


def test_a_slack_cable_may_pay_out_unseen_only_for_as_long_as_slack_is_allowed_by_hand(rehearsal, truth):
    strike = freezes(3, 0.05)
    rehearsal.at("Ask", lambda stage: (truth.watch(stage), strike(stage)), after=2.0)
    ended = rehearsal.run()
    assert ended.trip.guard == "tension"
    assert "under 10 N for 2 s while the platform is handled; let it down slowly" in ended.report.reason
    assert np.abs(truth.moved).max() <= 0.16


@pytest.mark.parametrize("offset", [(0.02, 0.0, 0.0), (0.0, 0.1, 0.1)])
@pytest.mark.sampled(1)
def test_a_marker_taken_for_another_for_a_moment_stops_nothing(rehearsal, scene, offset):
    rehearsal.settings = scene.short(seconds=3.0)
    rehearsal.at("Ask", lambda stage: stage.mocap.add("jumps", 0.4, offset), after=1.0)
    ended = rehearsal.run()
    assert ended.trip is None
    assert ended.report.held


def test_a_marker_that_stays_elsewhere_ends_the_run(rehearsal):
    rehearsal.at("Ask", lambda stage: stage.mocap.add("jumps", 1e3, (0.0, 0.0, -0.1)), after=0.5)
    ended = rehearsal.run()
    assert ended.trip.guard == "geometry"
    assert 1.0 <= ended.trip.t - ended.planted[0] <= 1.1
    assert "or markers or motion capture's origin moved" in ended.report.reason
