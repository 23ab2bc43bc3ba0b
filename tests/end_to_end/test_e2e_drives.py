"""A cable out of its tension limits; a drive that is silent, faulty, or another one. Real frames, real reactions."""

from dataclasses import replace

import pytest

from drivers.cia402.profile.machine import Command
from drivers.cia402.profile.words import controlword
from fidim_lab.app.compose import simulated
from procedures.outcomes import Outcome
from procedures.recording.journal import LineKind
from sim_backends.bus_faults import FrameRule
from sim_backends.drive.axis.machine import State

QUICK_STOP = controlword(Command.QUICK_STOP)
STEPS = {"MoveTo": 0.4, "Settle": 0.1, "Ask": 1.0, "Record": 0.5}
"""step, and how long after its begin the fault comes"""
HALTED, NMT_STOP = 0x10F, 0x02
METRES_PER_COUNT = 2e-5


def check_quick_stop(ended):
    """Each drive was told to stop by a single frame in the cycle of the trip, and nothing else afterwards.

    But for a halt before NMT stop, to a drive that is seen to be enabled still.
    """
    words = ended.controlwords(since=ended.trip.t)
    assert {(node, QUICK_STOP) for node in (1, 2, 3, 4)} <= {(node, word) for t, node, word in words}
    by_network = {(f.t, f.data[1]) for f in ended.frames if f.id == 0x000 and f.data[0] == NMT_STOP}
    later = [(t, node, word) for t, node, word in words if t > ended.trip.t]
    assert all(word == QUICK_STOP or (word == HALTED and (t, node) in by_network) for t, node, word in later)


def check_kept(ended, step):
    """The open window is kept, up to the fault."""
    assert (ended.folder / "rejected" / "i01-attempt1.csv").exists() == (step == "Record")
    if step == "Record":
        assert ended.report.reason.endswith(
            "What was recorded of the open window is kept in rejected/i01-attempt1.csv."
        )
        rows = (ended.folder / "rejected" / "i01-attempt1.csv").read_text().count("\n") - 1
        assert rows >= round(100 * (ended.planted[0] - ended.begun["Record"][0])) - 2


# tensions -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("newton", "says"),
    [(-50.0, "Window i01: tension of cable 3 is 1"), (+165.0, "Window i01: tension of cable 3 is 22")],
)
def test_a_tension_out_of_its_limits_at_rest_ends_the_run_before_anybody_is_asked(rehearsal, newton, says):
    rehearsal.at("Hold", lambda stage: stage.add_tension(3, newton))
    ended = rehearsal.run()
    report = ended.check()
    assert report.reason.startswith(says)
    assert "(18 to 220 N is allowed)" in report.reason
    assert report.outcome is Outcome.FAIL
    assert report.exit_code == 1
    assert "Ask" not in ended.begun
    assert {drive.state for drive in ended.drives} == {State.OPERATION_ENABLED}


@pytest.mark.parametrize("step", ["MoveTo", "Settle", "Record"])
@pytest.mark.parametrize(("newton", "says"), [(+300.0, "over 250 N for 0.1 s"), (-120.0, "under 2 N for 0.1 s")])
@pytest.mark.sampled(1)
def test_a_tension_beyond_its_threshold_stops_everything(rehearsal, step, newton, says):
    rehearsal.at(step, lambda stage: stage.add_tension(3, newton), after=STEPS[step])
    ended = rehearsal.run()
    report = ended.check()
    assert "The tension guard stopped the run" in report.reason
    assert "cable 3 has" in report.reason
    assert says in report.reason
    assert report.exit_code == 3
    assert ended.trip.t - ended.planted[0] < 0.2
    check_quick_stop(ended)
    check_kept(ended, step)
    assert {drive.state for drive in ended.drives} == {State.QUICK_STOP_ACTIVE}


# silence ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["silent", "sdo_silent"])
def test_a_drive_that_does_not_answer_at_bring_up(rehearsal, kind):
    rehearsal.at("", lambda stage: setattr(stage.drive(2).faults, kind, True))
    ended = rehearsal.run()
    report = ended.check(held=False)
    assert report.reason.startswith("winch 2 (node 2): no answer to SDO read of 1000:0 within 0.5 s.")
    assert "winch 2 has never reported" in report.held_says
    assert report.exit_code == 3
    assert {drive.state for drive in ended.drives} == {State.SWITCH_ON_DISABLED}  # nobody was given power


def test_a_drive_that_falls_silent_during_bring_up(rehearsal):
    rehearsal.at("Enable", lambda stage: setattr(stage.drive(2).faults, "silent", True), after=0.05)
    report = rehearsal.run().check(held=False)
    assert report.reason.startswith("winch 2 (node 2): OPERATIONAL expected within 2.2 s, PRE-OPERATIONAL by its last")
    assert "s ago" in report.reason


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.sampled(1)
def test_a_drive_that_falls_silent_is_missed_and_stops_by_itself(rehearsal, step):
    rehearsal.at(step, lambda stage: setattr(stage.drive(2).faults, "silent", True), after=STEPS[step])
    ended = rehearsal.run()
    report = ended.check(held=False)  # nobody can say of a silent drive that it stands still
    assert "winch 2 has not answered for 0.1" in report.reason
    assert "NOT VERIFIED" in report.held_says
    assert "winch 2 was not seen to stop (has not answered for 0." in report.held_says
    assert "cut the power by hand" in report.held_says
    assert report.held_says.endswith("winch 1, winch 3, winch 4 stand still.")
    assert report.exit_code == 3
    assert ended.trip.t - ended.planted[0] < 0.15
    check_quick_stop(ended)
    check_kept(ended, step)
    assert {drive.state for drive in ended.drives} == {State.QUICK_STOP_ACTIVE}
    assert max(ways(ended)) - min(ways(ended)) < 0.03  # it missed our heartbeat within 0.25 s


DEAF = "winch 2 reports a fault: it sends samples and answers no question (SDO): a stop may not reach it"


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.sampled(1)
def test_a_drive_that_sends_and_hears_nothing_is_found_before_it_must_obey(rehearsal, step):
    """Its receive path hangs, RPDO and SDO; its samples and heartbeats go on as ever."""
    deaf = FrameRule(frozenset({0x202, 0x602}), drop=True)
    rehearsal.at(step, lambda stage: stage.bus.rules.append(deaf), after=STEPS[step])
    ended = rehearsal.run()
    report = ended.check(held=False)
    assert DEAF in report.reason
    assert "cut the power by hand" in report.held_says
    assert "winch 2 did not obey" in report.held_says
    assert report.exit_code == 3
    assert ended.trip.t - ended.planted[0] < 2.1  # half a second between two questions, one repetition
    check_quick_stop(ended)


def test_a_drive_that_answers_no_sdo_any_more_ends_the_run_and_keeps_the_first_window(scene, rehearsal):
    rehearsal.plan = scene.two
    rehearsal.at("Accept", lambda stage: setattr(stage.drive(2).faults, "sdo_silent", True))
    ended = rehearsal.run()
    report = ended.check()
    assert DEAF in report.reason
    assert report.exit_code == 3
    assert [row.id for row in report.accepted] == ["i01"]
    assert {drive.state for drive in ended.drives} == {State.QUICK_STOP_ACTIVE}


# none moves alone ---------------------------------------------------------------------------------------------------


def ways(ended):
    """How far each winch has gone, m."""
    return [abs(place) * METRES_PER_COUNT for place, _ in ended.shafts]


def test_a_drive_that_takes_no_set_point_is_not_left_behind(rehearsal):
    deaf = FrameRule(frozenset({0x202}), drop=True)
    rehearsal.at("MoveTo", lambda stage: stage.bus.rules.append(deaf))
    ended = rehearsal.run()
    report = ended.check()
    assert report.reason == "winch 2: did not start its move within 0.2 s of the others"
    assert report.exit_code == 3
    assert max(ways(ended)) < 0.015


def test_a_drive_that_acknowledges_and_stays_is_not_left_behind(rehearsal):
    where_it_is = FrameRule(frozenset({0x202}), change=lambda data: data[:3] + bytes(4))
    rehearsal.at("MoveTo", lambda stage: stage.bus.rules.append(where_it_is))
    ended = rehearsal.run()
    report = ended.check()
    assert "The motion guard stopped the run" in report.reason
    assert "winch 2 is +" in report.reason
    assert "mm from its commanded position, 3 mm is allowed" in report.reason
    assert report.exit_code == 3
    assert "Settle" not in ended.begun


def test_in_real_time_no_winch_moves_while_another_cannot_be_prepared(scene):
    ended = scene.in_real_time(
        lambda rehearsal: rehearsal.at("MoveTo", lambda stage: setattr(stage.drive(2).faults, "sdo_silent", True))
    )
    report = ended.check(log=False)
    assert report.reason.startswith("winch 2 (node 2): no answer to SDO ")
    assert report.exit_code == 3
    assert max(ways(ended)) == 0.0


# faults -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.sampled(1)
def test_a_fault_word_stops_everything(rehearsal, step):
    rehearsal.at(step, lambda stage: stage.drive(2).faults.raise_fault(0x2310), after=STEPS[step])
    ended = rehearsal.run()
    report = ended.check()
    assert "winch 2 reports a fault: emergency 0x2310 (continuous over-current)" in report.reason
    assert report.held_says == "All winches stand still, without motor power: winch 2."
    assert report.exit_code == 3
    assert ended.trip.t - ended.planted[0] < 0.03
    check_quick_stop(ended)
    check_kept(ended, step)
    assert [drive.state for drive in ended.drives].count(State.FAULT) == 1
    assert any(frame.id == 0x82 and frame.data[:2] == b"\x10\x23" for frame in ended.frames)  # the EMCY is in the log


def test_a_fault_while_power_is_switched_on_is_never_reset(rehearsal):
    rehearsal.at("Enable", lambda stage: stage.drive(2).faults.raise_fault(0x3210), after=0.05)
    ended = rehearsal.run()
    report = ended.check()
    assert report.reason.startswith("winch 2 (node 2): emergency 0x3210 (DC link over-voltage).")
    assert ended.drives[1].state is State.FAULT
    assert not [word for _, _, word in ended.controlwords() if word & 0x80]


def test_a_drive_that_is_reset_by_somebody_else(rehearsal):
    rehearsal.at("MoveTo", lambda stage: stage.bus.inject(0x000, bytes([129, 2])), after=0.4)
    ended = rehearsal.run()
    ended.check(held=ended.report.held)
    assert "winch 2 " in ended.report.reason
    assert ended.report.exit_code == 3
    assert ended.trip.t - ended.planted[0] < 0.15
    check_quick_stop(ended)


def check_no_power(ended, says):
    report = ended.check(held=False)
    assert report.reason.startswith("winch 2 (node 2): refused, it must not be switched on: ")
    assert says in report.reason
    assert report.exit_code == 3
    assert {drive.state for drive in ended.drives} == {State.SWITCH_ON_DISABLED}


def test_a_drive_that_does_not_take_its_mode_gets_no_power(rehearsal):
    rehearsal.at("", lambda stage: stage.drive(2).faults.reject_mode(1))
    check_no_power(rehearsal.run(), "6061:0 mode of operation: ")


@pytest.mark.parametrize(
    ("wanted", "says"),
    [({"vendor_id": 0x29C}, "1018:1 vendor: 153 found, 668 wanted"), ({"product_code": 7}, "1018:2 product code: ")],
)
def test_a_drive_of_another_make_gets_no_power(rehearsal, monkeypatch, wanted, says):
    configs = simulated._winch_configs

    def strict(*what):
        return tuple(c.model_copy(update=wanted) if c.node_id == 2 else c for c in configs(*what))

    monkeypatch.setattr(simulated, "_winch_configs", strict)
    rehearsal.at("", lambda stage: stage.drive(2).faults.claim_identity(vendor=0x99, product=0x77))
    check_no_power(rehearsal.run(), says)


def test_an_encoder_that_jumps_far_while_recording_ends_the_run(rehearsal):
    rehearsal.at("Record", lambda stage: stage.drive(2).faults.jump_encoder(3000), after=0.5)
    ended = rehearsal.run()
    report = ended.check()
    assert "winch 2 is -60.0 mm from its commanded position, 3 mm is allowed" in report.reason
    assert report.exit_code == 3
    check_kept(ended, "Record")


def test_a_window_after_a_small_jump_of_an_encoder_is_not_taken_for_good_either(scene, rehearsal):
    short = scene.short(repeats=1)
    rehearsal.settings = replace(short, guard=replace(short.guard, motion=5e-3))  # else that guard is there first
    rehearsal.at("Record", lambda stage: stage.drive(2).faults.jump_encoder(200), after=0.5)
    ended = rehearsal.run()
    report = ended.check()
    verdicts = [e.reason for e in ended.journal if e.step == "CheckWindow" and e.kind is LineKind.STEP_FINISHED]
    assert verdicts[0].startswith("movement of the motor of cable 2 is 4 mm")
    assert verdicts[1].startswith("encoder error of cable 2 is 4 mm")
    assert report.exit_code == 1
    assert not report.accepted


# what drives say of themselves --------------------------------------------------------------------------------------


@pytest.mark.parametrize("step", ["Settle", "Record"])
@pytest.mark.sampled(1)
def test_a_hot_drive_ends_the_run_held(rehearsal, step):
    rehearsal.at(step, lambda stage: stage.drive(2).od.fix(0x2210, 0, 905), after=STEPS[step])
    ended = rehearsal.run()
    report = ended.check()
    assert "The temperature guard stopped the run" in report.reason
    assert "winch 2 has 90 °C, at most 75 °C is allowed" in report.reason
    assert report.exit_code == 3
    assert ended.trip.t - ended.planted[0] < 0.6  # it is asked for twice a second
    check_kept(ended, step)


def test_a_flood_of_emergencies_is_a_fault_and_holds_up_nothing(rehearsal):
    """A thousand EMCY frames in one cycle: the first is latched, all are counted, the stop comes in time."""

    def flood(stage):
        for k in range(1000):
            stage.bus.inject(0x80 + 2, bytes([k % 256, 0x42, 0x01, 0, 0, 0, 0, 0]))

    rehearsal.at("Record", flood, after=0.5)
    ended = rehearsal.run()
    report = ended.check()
    assert "The drive guard stopped the run" in report.reason
    assert "winch 2 reports a fault" in report.reason
    assert ended.trip.t - ended.planted[0] < 0.1
    check_quick_stop(ended)
    check_kept(ended, "Record")
