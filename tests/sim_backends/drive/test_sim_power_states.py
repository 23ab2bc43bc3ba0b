"""Every (state, command) pair of CiA 402 on the wire, legal and illegal; option codes of stops; faults."""

import pytest

COMMANDS = {
    "shutdown": 0x06,
    "switch on": 0x07,
    "enable": 0x0F,
    "disable voltage": 0x00,
    "quick stop": 0x02,
    "fault reset": 0x80,
}
NR, SOD, RDY, ON, OP, QS, FR, F = (
    "NOT READY",
    "SWITCH ON DISABLED",
    "READY",
    "SWITCHED ON",
    "OPERATION ENABLED",
    "QUICK STOP",
    "FAULT REACTION",
    "FAULT",
)
TABLE = {  # one column for each command above; quick stop option 6 (stay), the drum standing
    NR: (NR, NR, NR, NR, NR, NR),
    SOD: (RDY, SOD, SOD, SOD, SOD, SOD),
    RDY: (RDY, ON, OP, SOD, SOD, SOD),
    ON: (RDY, ON, OP, SOD, SOD, SOD),
    OP: (RDY, ON, OP, SOD, QS, SOD),
    QS: (QS, QS, OP, SOD, QS, SOD),
    FR: (FR, FR, FR, FR, FR, FR),
    F: (F, F, F, F, F, SOD),
}


def bring(bench, state):
    if state == NR:
        return
    bench.run(0.01)
    bench.write(0x605A, 0, "i16", 6)
    if state == F:
        bench.drive.faults.raise_fault(0x3210)
    elif state == FR:
        bench.write(0x605E, 0, "i16", 1)
        bench.enable()
        bench.profile(1000, 1000, 1000)
        bench.go(100_000)
        bench.run(1.5)
        bench.drive.faults.raise_fault(0x3210)
    else:
        words = {SOD: [], RDY: [0x06], ON: [0x06, 0x07], OP: [0x06, 0x07, 0x0F], QS: [0x06, 0x07, 0x0F, 0x02]}
        bench.control(*words[state])
        bench.run(0.01)


@pytest.mark.parametrize(
    ("state", "command", "expected"),
    [(state, command, row[i]) for state, row in TABLE.items() for i, command in enumerate(COMMANDS)],
)
def test_every_command_in_every_state(cold_bench, state, command, expected):
    bring(cold_bench, state)
    assert cold_bench.state() == state
    cold_bench.control(COMMANDS[command])
    if state != NR:
        cold_bench.run(0.01)
    assert cold_bench.state() == expected


def test_boots_into_switch_on_disabled_by_itself(cold_bench):
    assert cold_bench.heard == ["703: 00"]
    assert cold_bench.state() == NR
    cold_bench.run(0.005)
    assert cold_bench.state() == SOD


def test_fault_reset_needs_a_rising_edge(bench):
    bench.control(0x80)
    bench.drive.faults.raise_fault(0x3210)
    bench.control(0x80)
    assert bench.state() == F
    bench.control(0x00, 0x80)
    assert bench.state() == SOD


def test_a_lasting_fault_defies_reset_until_its_cause_has_gone(bench):
    bench.drive.faults.raise_fault(0x4310, lasting=True)
    bench.control(0x00, 0x80)
    assert bench.state() == F
    bench.drive.faults.end_fault(0x4310)
    assert bench.state() == F
    bench.control(0x00, 0x80)
    assert bench.state() == SOD


def moving(bench):
    """At 1000 counts/s since long."""
    bench.enable()
    bench.profile(1000, 2000, 500)
    bench.write(0x6085, 0, "u32", 4000)
    bench.go(1_000_000)
    bench.run(2.0)
    assert bench.shaft.motion(bench.t).velocity == 1000.0


STOPS = [  # object, option, what happens, s until rest, state meanwhile, state then
    (0x605A, 0, "quick stop", 0.02, SOD, SOD),
    (0x605A, 1, "quick stop", 2.0, QS, SOD),
    (0x605A, 2, "quick stop", 0.25, QS, SOD),
    (0x605A, 5, "quick stop", 2.0, QS, QS),
    (0x605A, 6, "quick stop", 0.25, QS, QS),
    (0x605B, 0, "shutdown", 0.02, RDY, RDY),
    (0x605B, 1, "shutdown", 2.0, OP, RDY),
    (0x605C, 0, "switch on", 0.02, ON, ON),
    (0x605C, 1, "switch on", 2.0, OP, ON),
    (0x605E, 0, "fault", 0.02, F, F),
    (0x605E, 1, "fault", 2.0, FR, F),
    (0x605E, 2, "fault", 0.25, FR, F),
    (0x605A, 2, "disable voltage", 0.02, SOD, SOD),
]


@pytest.mark.parametrize(("index", "option", "event", "duration", "meanwhile", "then"), STOPS)
def test_stops_as_its_option_code_says(bench, index, option, event, duration, meanwhile, then):
    assert bench.write(index, 0, "i16", option) == 0
    moving(bench)
    start = bench.shaft.motion(bench.t).position
    if event == "fault":
        bench.drive.faults.raise_fault(0x3210)
    else:
        bench.control(COMMANDS[event])
    assert bench.state() == meanwhile
    bench.run(duration - 0.006)
    assert bench.state() == meanwhile
    assert bench.shaft.motion(bench.t).velocity > 0.0
    bench.run(0.012)
    assert bench.state() == then
    assert bench.shaft.motion(bench.t).velocity == 0.0
    assert bench.shaft.motion(bench.t).position - start == pytest.approx(1000.0 * duration / 2.0)


def test_without_power_no_current_flows_and_the_load_is_held(bench):
    bench.shaft.set_load(-2.0)
    assert bench.read(0x6078, 0, "i16") == 0
    bench.enable()
    assert bench.read(0x6078, 0, "i16") == -400  # of 5 A
    bench.control(0x00)
    assert bench.read(0x6078, 0, "i16") == 0
    assert bench.shaft.motion(bench.t + 100.0).position == 1000.0


def test_a_fault_is_told_by_emcy_register_code_and_history(bench):
    bench.drive.faults.raise_fault(0x3210)
    assert bench.run(0.0) == ["083: 10 32 05 00 00 00 00 00"]
    assert bench.read(0x1001, 0, "u8") == 0x05
    assert bench.read(0x603F, 0, "u16") == 0x3210
    bench.drive.faults.raise_fault(0x8611)
    assert bench.run(0.0) == ["083: 11 86 25 00 00 00 00 00"]
    assert [bench.read(0x1003, sub, "u32") for sub in (1, 2)] == [0x8611, 0x3210]
    assert bench.read(0x1003, 0, "u8") == 2
    bench.control(0x00, 0x80)
    assert "083: 00 00 00 00 00 00 00 00" in bench.heard
    assert (bench.read(0x1001, 0, "u8"), bench.read(0x603F, 0, "u16")) == (0, 0)
    assert bench.write(0x1003, 0, "u8", 1) == 0x06090030
    assert bench.write(0x1003, 0, "u8", 0) == 0
    assert bench.read(0x1003, 1, "u32") == 0
