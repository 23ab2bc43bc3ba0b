"""Drives that fail, and cables."""

import struct
from dataclasses import replace

import pytest

from drivers.canbus.transport import CanFrame
from sim_backends.bus_faults import FrameRule


def _by_its_port(stage, frame_id, data):
    """Drive 2's own port: nothing passes on the bus."""
    stage.drive(2).receive(CanFrame(frame_id, data, stage.now()))


@pytest.mark.fault(
    "drives",
    "a drive falls silent",
    reaction="quick stop",
    within=0.25,
    says="winch 2 has not answered for 0.1",
    window="kept",
    held=False,
)
def test_a_silent_drive(rehearsal, fault):
    fault.strikes(rehearsal, lambda stage: setattr(stage.drive(2).faults, "silent", True))


@pytest.mark.fault(
    "drives",
    "a drive goes into fault (over-current)",
    reaction="quick stop",
    within=0.03,
    says="winch 2 reports a fault: emergency 0x2310",
    window="kept",
)
def test_a_drive_fault(rehearsal, fault):
    ended = fault.strikes(rehearsal, lambda stage: stage.drive(2).faults.raise_fault(0x2310))
    assert ended.report.held_says == "All winches stand still, without motor power: winch 2."


@pytest.mark.fault(
    "drives",
    "another program switches a drive off",
    reaction="quick stop",
    within=0.03,
    says="winch 2 is in state “ready to switch on”",
    window="kept",
)
def test_a_drive_in_a_wrong_state(rehearsal, fault):
    fault.strikes(rehearsal, lambda stage: _by_its_port(stage, 0x202, bytes.fromhex("06000100000000")))


@pytest.mark.fault(
    "drives",
    "a drive is reset by somebody else",
    reaction="quick stop",
    within=0.25,
    says="winch 2 reports a fault: the drive restarted by itself",
    window="kept",
    held=False,
)
def test_a_drive_that_is_reset(rehearsal, fault):
    fault.strikes(rehearsal, lambda stage: stage.bus.inject(0x000, bytes([129, 2])))


@pytest.mark.fault(
    "drives",
    "a drive refuses a value (SDO abort) before a move",
    reaction="hold",
    says="winch 2 (node 2): SDO write of 6081:0 refused",
    window="none was open",
    journal="RUN_FINISHED",
)
def test_an_sdo_abort(rehearsal, scene, fault):
    rehearsal.plan = scene.two

    def refuse(data: bytes) -> bytes:
        return bytes.fromhex("8081600030000906") if data[:4] == bytes.fromhex("60816000") else data

    fault.strikes(
        rehearsal,
        lambda stage: stage.bus.rules.append(FrameRule(frozenset({0x582}), change=refuse)),
        step="CheckWindow",
        after=0.0,
    )


@pytest.mark.fault(
    "drives",
    "a flood of 1000 emergencies in one cycle",
    reaction="quick stop",
    within=0.1,
    says="winch 2 reports a fault",
    window="kept",
)
def test_an_emergency_flood(rehearsal, fault):
    def flood(stage):
        for k in range(1000):
            stage.bus.inject(0x82, bytes([k % 256, 0x42, 0x01, 0, 0, 0, 0, 0]))

    fault.strikes(rehearsal, flood)


@pytest.mark.fault(
    "drives",
    "a drive's heartbeat stops, its samples go on",
    reaction="quick stop",
    within=0.5,
    says="winch 2 reports a fault: no heartbeat for 0.3",
    window="kept",
)
def test_a_drive_without_heartbeat(rehearsal, fault):
    fault.strikes(rehearsal, lambda stage: stage.bus.rules.append(FrameRule(frozenset({0x702}), drop=True)))


@pytest.mark.fault(
    "drives",
    "an encoder jumps by 60 mm",
    reaction="quick stop",
    within=0.03,
    says="winch 2 is -60.0 mm from its commanded position, 3 mm is allowed",
    window="kept",
)
def test_an_encoder_jump(rehearsal, fault):
    fault.strikes(rehearsal, lambda stage: stage.drive(2).faults.jump_encoder(3000))


@pytest.mark.fault(
    "drives",
    "another program turns a drum that should hold, at 0.05 m/s",
    reaction="quick stop",
    within=0.2,
    says="from its commanded position, 3 mm is allowed",
    window="kept",
)
def test_a_drum_that_another_program_turns(rehearsal, fault):
    fault.strikes(rehearsal, lambda stage: stage.spin(2, 0.05, unseen=True))


@pytest.mark.fault(
    "drives",
    "a winch creeps by 1 mm a second while somebody displaces the platform",
    reaction="quick stop",
    within=4.0,
    says="winch 2 is +3.0 mm from its commanded position, 3 mm is allowed",
    window="none was open",
)
def test_a_winch_that_creeps(rehearsal, fault):
    fault.strikes(rehearsal, lambda stage: stage.spin(2, 0.001, unseen=True), step="Ask", after=0.1)


@pytest.mark.fault(
    "drives",
    "a drive halts alone in a move",
    reaction="quick stop",
    within=0.25,
    says="from its commanded position, 3 mm is allowed",
    window="none was open",
)
def test_a_drive_that_halts_alone(rehearsal, fault):
    halt = struct.pack("<Hbi", 0x12F, 1, 0)
    fault.strikes(rehearsal, lambda stage: _by_its_port(stage, 0x202, halt), step="MoveTo", after=0.25)


@pytest.mark.fault(
    "drives",
    "another program turns a drum whose encoder is frozen in place and speed, while a hand carries the platform",
    reaction="quick stop",
    within=0.3,
    says="its own set-point (6062) has moved by +",
    window="none was open",
    held=False,
)
def test_a_set_point_that_moves_behind_a_frozen_encoder(rehearsal, fault):
    def strike(stage):
        defects = stage.drive(3).defects
        defects.encoder_frozen = defects.speed_frozen = True
        stage.spin(3, 0.05, unseen=True)

    fault.strikes(rehearsal, strike, step="Ask", after=2.0)


@pytest.mark.fault(
    "drives",
    "a drum pays out at 0.05 m/s and nothing of its drive shows it, with a person at the platform",
    reaction="quick stop",
    within=1.0,
    says="mm longer than its encoder says",
    window="none was open",
    held=False,
)
def test_an_encoder_that_is_frozen_while_its_drum_turns(rehearsal, fault):
    def strike(stage):
        defects = stage.drive(2).defects
        defects.encoder_frozen = defects.speed_frozen = defects.demand_frozen = True
        stage.spin(2, 0.05, unseen=True)

    fault.strikes(rehearsal, strike, step="Ask", after=0.3)


@pytest.mark.fault(
    "drives",
    "another program turns a drum in profile velocity mode",
    reaction="quick stop",
    within=0.03,
    says="winch 2 reports a fault: it has changed to profile velocity (3), profile position (1) was commanded",
    window="kept",
)
def test_a_drum_that_a_vendors_tool_turns(rehearsal, fault):
    fault.strikes(rehearsal, lambda stage: stage.spin_in_velocity_mode(2, 0.05, unseen=True))


@pytest.mark.fault(
    "drives",
    "a drive that holds changes to profile torque mode, where nothing holds",
    reaction="quick stop",
    within=0.03,
    says="winch 2 reports a fault: it has changed to profile torque (4), profile position (1) was commanded",
    window="none was open",
)
def test_a_drive_that_changes_its_mode(rehearsal, fault):
    fault.strikes(rehearsal, lambda stage: stage.write_byte(2, 0x6060, 4), step="Ask", after=0.1)


def _lost(bit):
    def change(data):
        return struct.pack("<H", struct.unpack_from("<H", data)[0] & ~(1 << bit)) + data[2:]

    return lambda stage: stage.bus.rules.append(FrameRule(frozenset({0x182}), change=change))


@pytest.mark.fault(
    "drives",
    "a drive is put under local control (statusword bit 9, remote, is lost)",
    reaction="quick stop",
    within=0.03,
    says="winch 2 reports a fault: it takes no more commands from the bus",
    window="none was open",
)
def test_a_drive_under_local_control(rehearsal, fault):
    fault.strikes(rehearsal, _lost(9), step="MoveTo", after=0.25)


@pytest.mark.fault(
    "drives",
    "the supply of a drive's power stage is lost (statusword bit 4), without a fault",
    reaction="quick stop",
    within=0.03,
    says="winch 2 reports a fault: it has lost the supply voltage of its power stage",
    window="kept",
)
def test_a_drive_without_voltage(rehearsal, fault):
    fault.strikes(rehearsal, _lost(4))


@pytest.mark.parametrize(
    ("index", "sub", "value"), [(0x6085, 0, 500), (0x1400, 1, 0x202 - (1 << 31))], ids=["ramp", "RPDO switched off"]
)
@pytest.mark.fault(
    "drives",
    "a vendor's tool changes what the stop of a drive rests on (605A, 6085, 6007, 1016, RPDO, …)",
    reaction="quick stop",
    within=6.0,
    says="winch 2 reports a fault: what its stops rest on is no longer as it was written",
    window="none was open",
)
def test_a_drive_whose_stop_is_changed(rehearsal, fault, index, sub, value):
    """One that hears no RPDO is stopped by SDO."""
    fault.strikes(rehearsal, lambda stage: stage.write_sdo(2, index, value, sub, unseen=True), step="Ask", after=0.1)


@pytest.mark.fault(
    "drives",
    "a drive's receive path is dead when all are told to stop",
    reaction="quick stop",
    within=0.03,
    says="winch 3 reports a fault: emergency 0x2310",
    window="none was open",
    held=False,
)
def test_a_drive_that_hears_no_stop(rehearsal, fault):
    deaf = FrameRule(frozenset({0x202, 0x602}), drop=True)

    def strike(stage):
        stage.bus.rules.append(deaf)
        stage.drive(3).faults.raise_fault(0x2310)

    ended = fault.strikes(rehearsal, strike, step="MoveTo", after=0.25)
    assert "winch 2 did not obey the stop" in ended.report.held_says
    assert "cut the power by hand" in ended.report.held_says


@pytest.mark.fault(
    "drives",
    "a drive gets hot",
    reaction="hold",
    within=0.6,
    says="winch 2 has 90 °C, at most 75 °C is allowed",
    window="kept",
)
def test_a_hot_drive(rehearsal, fault):
    fault.strikes(rehearsal, lambda stage: stage.drive(2).od.fix(0x2210, 0, 905))


@pytest.mark.fault(
    "drives",
    "a current sensor is stuck while its winch moves",
    reaction="quick stop",
    within=1.1,
    says="the motor current of cable 3 is exactly",
    window="none was open",
)
def test_a_stuck_current_sensor(rehearsal, scene, fault):
    rehearsal.settings = replace(scene.short(), guard=replace(scene.short().guard, current_stuck=0.2))
    fault.strikes(rehearsal, lambda stage: stage.drive(3).faults.stick_current(), step="MoveTo", after=0.1)


@pytest.mark.fault(
    "cables",
    "a cable goes slack",
    reaction="quick stop",
    within=0.2,
    says="under 2 N for 0.1 s",
    window="kept",
)
def test_a_slack_cable(rehearsal, fault):
    fault.strikes(rehearsal, lambda stage: stage.add_tension(3, -120.0))


@pytest.mark.fault(
    "cables",
    "a cable is overloaded",
    reaction="quick stop",
    within=0.2,
    says="over 250 N for 0.1 s",
    window="none was open",
)
def test_an_overloaded_cable(rehearsal, fault):
    fault.strikes(rehearsal, lambda stage: stage.add_tension(3, 300.0), step="MoveTo", after=0.2)
