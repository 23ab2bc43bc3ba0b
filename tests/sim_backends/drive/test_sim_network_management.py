"""NMT states, boot-up, heartbeats both ways, and what the loss of the host does."""

import pytest

HOST = 0x77F


@pytest.mark.parametrize(
    ("commands", "state"),
    [
        (["01 03"], 5),
        (["01 00"], 5),  # to all
        (["01 04"], 127),  # to somebody else
        (["01 03", "80 03"], 127),
        (["02 03"], 4),
        (["02 03", "01 03"], 5),
        (["07 03"], 127),  # no command
        (["01"], 127),
        (["01 03 00"], 127),
        (["01 03", "81 03"], 127),
        (["01 03", "82 03"], 127),
    ],
)
def test_states_as_the_heartbeat_tells(bench, commands, state):
    bench.drive.od.fix(0x1017, 0, 100)  # so that a reset keeps it
    bench.frame(0x000, "82 03")
    for command in commands:
        bench.frame(0x000, command)
    assert bench.run(0.1)[-1] == f"703: {state:02x}"


@pytest.mark.parametrize("command", ["81 03", "82 03"])
def test_reset_boots_anew_with_power_on_values(bench, command):
    bench.write(0x1017, 0, "u16", 100)
    bench.write(0x6065, 0, "u32", 77)
    bench.enable()
    frames = bench.frame(0x000, command)
    assert frames[0] == "703: 00"
    assert bench.read(0x1017, 0, "u16") == 0
    assert bench.read(0x6065, 0, "u32") == (10_000 if command == "81 03" else 77)
    bench.run(0.01)
    assert bench.state() in ("SWITCH ON DISABLED", "FAULT")


def test_reset_and_stop_without_power_are_no_fault(bench):
    for command in ("82 03", "02 03", "01 03"):
        bench.frame(0x000, command)
    assert bench.state() == "SWITCH ON DISABLED"


def test_reset_node_takes_the_power_away(bench):
    bench.enable()
    bench.frame(0x000, "81 03")
    assert bench.state() == "NOT READY"
    bench.run(0.01)
    assert bench.state() == "SWITCH ON DISABLED"
    assert bench.read(0x6061, 0, "i8") == 0


def test_heartbeat_keeps_its_rhythm(bench):
    bench.write(0x1017, 0, "u16", 50)
    bench.heard.clear()
    for _ in range(1000):  # looked at every 1.3 ms
        bench.run(0.0013)
    assert bench.heard == ["703: 7f"] * 27  # at 0, 50 … 1300 ms
    bench.write(0x1017, 0, "u16", 0)
    assert bench.run(1.0) == []


def watched(bench, option, error_behaviour=1, speed=1000):
    """Enabled and moving, watching node 127 with 250 ms, its first heartbeat heard."""
    assert bench.write(0x1016, 1, "u32", 127 << 16 | 250) == 0
    assert bench.write(0x6007, 0, "i16", option) == 0
    assert bench.write(0x1029, 1, "u8", error_behaviour) == 0
    bench.write(0x6085, 0, "u32", 10_000)
    bench.write(0x605A, 0, "i16", 6)
    bench.frame(0x000, "01 03")
    bench.enable()
    bench.profile(speed, 10_000, 10_000)
    bench.go(1_000_000)
    bench.frame(HOST, "05")
    bench.heard.clear()


def test_the_watch_begins_with_the_first_heartbeat(bench):
    bench.write(0x1016, 1, "u32", 127 << 16 | 250)
    bench.write(0x6007, 0, "i16", 1)
    bench.run(10.0)
    bench.frame(HOST, "00")  # boot-up is none
    bench.run(10.0)
    assert bench.state() == "SWITCH ON DISABLED"
    bench.frame(HOST, "05")
    bench.run(0.249)
    assert bench.state() == "SWITCH ON DISABLED"
    bench.run(0.002)
    assert bench.state() == "FAULT"


def test_heartbeats_in_time_keep_it_moving(bench):
    watched(bench, option=3)
    for _ in range(20):
        bench.run(0.2)
        bench.frame(HOST, "05")
    assert bench.heard == []
    assert bench.state() == "OPERATION ENABLED"


@pytest.mark.parametrize(
    ("option", "state", "stopped_after"),
    [(0, "OPERATION ENABLED", None), (1, "FAULT", 0.1), (2, "SWITCH ON DISABLED", 0.02), (3, "QUICK STOP", 0.1)],
)
def test_loss_of_the_host_stops_the_motion(bench, option, state, stopped_after):
    watched(bench, option)
    assert bench.run(0.2495) == []
    assert bench.run(0.001)[0] == "083: 30 81 11 00 00 00 00 00"
    if stopped_after is not None:
        bench.run(stopped_after - 0.002)
        assert bench.shaft.motion(bench.t).velocity > 0.0
    bench.run(0.5)
    assert bench.state() == state
    assert bench.shaft.motion(bench.t).velocity == (1000.0 if stopped_after is None else 0.0)


def test_the_host_comes_back(bench):
    watched(bench, option=3)
    bench.run(1.0)
    assert bench.frame(HOST, "05") == ["083: 00 00 00 00 00 00 00 00"]
    assert bench.state() == "QUICK STOP"  # nothing moves by itself


@pytest.mark.parametrize(("behaviour", "nmt"), [(0, 127), (1, 5), (2, 4)])
def test_error_behaviour_after_a_loss(bench, behaviour, nmt):
    watched(bench, option=3, error_behaviour=behaviour)
    bench.run(1.0)
    assert bench.drive.nmt_state == nmt


def test_nmt_stop_is_a_lost_connection(bench):
    watched(bench, option=3)
    bench.frame(0x000, "02 03")
    assert bench.drive.state.name == "QUICK_STOP_ACTIVE"


def test_no_emergency_when_stopped(bench):
    bench.frame(0x000, "02 03")
    bench.drive.faults.raise_fault(0x3210)
    assert bench.run(0.1) == []
    assert bench.drive.state.name == "FAULT"
