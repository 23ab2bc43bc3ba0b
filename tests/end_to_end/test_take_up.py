"""`take-up` on four simulated drives whose cables hang slack: wound by torque, held by brakes, in either mode."""

import asyncio
import math

import numpy as np
import pytest

from drivers.cia402.dictionary import GENERIC_EDS, WinchConfig
from drivers.cia402.motion import make_winch, pull_taut
from drivers.cia402.profile import Mode
from drivers.cia402.watch import CanopenMaster
from drivers.clock import LoopClock
from drivers.ports import DriveState, MarkerFrame, Rig
from fidim_lab.data.records import Plan, PlannedWindow, Role
from fidim_lab.data.robot_file import read_robot, robot_path
from procedures.outcomes import Outcome
from procedures.protocols.catalogue import experiment
from procedures.run import run_procedure
from procedures.settings import Settings, TautSettings
from sim_backends.bus_faults import FrameRule
from sim_backends.drive.axis import DrumShaft
from sim_backends.drive.axis.machine import State
from sim_backends.drive.node import SimulatedDrive
from sim_backends.drive.objects import read_eds
from sim_backends.in_process_bus import InProcessBus
from sim_backends.jumping_loop import run

CLOCK = LoopClock()
ROBOT = read_robot(robot_path("irma4"))
JIG = Plan("jig", (PlannedWindow("jig", Role.IDENTIFY, np.full(4, 1.4), np.zeros(2), np.array([1.2, -0.2, -0.3])),))
PER_METRE = 2e5
SLACK = (0.02, 0.0, 0.05, 0.08)
"""m"""


class SlackCable(DrumShaft):
    """Hangs slack for so many metres, and pulls like a spring of 1 A/mm after that."""

    def __init__(self, slack, direction):
        super().__init__()
        self.slack, self.direction = slack, direction

    @property
    def load_current(self):
        wound = -self.direction * self.motion(CLOCK.now()).position / PER_METRE
        return -self.direction * 1e3 * max(wound - self.slack, 0.0)


class Nobody:
    """No markers, and a person who says yes."""

    rate = 100.0

    def latest(self):
        return MarkerFrame(CLOCK.now(), int(100 * CLOCK.now()), (None,))

    def counters(self):
        return {}

    async def frames(self):
        while True:
            await CLOCK.sleep(0.01)
            yield self.latest()

    async def answer(self, prompt):
        return "done"


def carry_out(folder, mode, way=0.2, strike=None):
    """strike(drives, bus): what fails 0.3 s after all have power, while the first is pulled."""

    async def main():
        bus = InProcessBus(CLOCK.now)
        master = CanopenMaster(bus, CLOCK, sync_rate=100.0)
        drives, winches = [], []
        for node in range(1, 5):
            direction = (-1) ** node
            drive = SimulatedDrive(node, read_eds(GENERIC_EDS, node), SlackCable(SLACK[node - 1], direction))
            bus.attach(drive)
            config = WinchConfig(
                name=f"winch {node}",
                node_id=node,
                counts_per_turn=2.0 * math.pi * 0.05 * PER_METRE,
                drum_radius=0.05,
                rated_current=5.0,
                current_limit=4.0,
                max_speed=0.5,
                max_acceleration=1.0,
                length_limits=(0.5, 3.0),
                home_length=1.4,
                direction=direction,
                mode=mode,
            )
            drives.append(drive)
            winches.append(make_winch(config, master))
        pulls = tuple((lambda *how, winch=winch: pull_taut(winch, *how)) for winch in winches)
        rig = Rig(CLOCK, tuple(winches), Nobody(), Nobody(), bus=master, pulls=pulls)
        settings = Settings(taut=TautSettings(way=way))
        made = experiment("take-up", JIG, ROBOT, settings, statics=lambda lengths: np.full(len(lengths), 60.0))

        async def live():
            while True:
                bus.advance(CLOCK.now())
                await CLOCK.sleep(min(max(bus.due - CLOCK.now(), 1e-4), 0.05))

        async def later():
            while {drive.state for drive in drives} != {State.OPERATION_ENABLED}:
                await CLOCK.sleep(0.01)
            await CLOCK.sleep(0.3)
            if strike is not None:
                strike(drives, bus)

        health = [winch.watch_health() for winch in winches]
        tasks = [asyncio.ensure_future(work) for work in (master.run(), live(), later(), *health)]
        try:
            report = await run_procedure(made, rig, folder, wall_time=lambda: "now")
            lengths = None if strike else [await winch.ask_length() for winch in winches]
            return report, lengths, [winch.latest().state for winch in winches]
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    return run(main())


@pytest.mark.parametrize("mode", [Mode.PROFILE_POSITION, Mode.CYCLIC_POSITION])
def test_slack_is_wound_until_each_cable_is_taut(tmp_path, mode):
    report, lengths, states = carry_out(tmp_path / "run", mode)
    assert report.outcome is Outcome.PASS, report.reason
    assert lengths == pytest.approx([1.4 - slack for slack in SLACK], abs=2e-3)
    assert set(states) == {DriveState.SWITCH_ON_DISABLED}


def test_more_slack_than_is_allowed_ends_it_with_all_held(tmp_path):
    report, lengths, states = carry_out(tmp_path / "run", Mode.PROFILE_POSITION, way=0.03)
    assert report.outcome is Outcome.ERROR
    assert "winch 3" in report.reason
    assert "the cable is not taut after" in report.reason
    assert lengths[2] == pytest.approx(1.37, abs=5e-3)
    assert lengths[3] == pytest.approx(1.4), "it was not its turn"
    assert DriveState.SWITCH_ON_DISABLED not in states


def repeats(drives, bus):
    """Drive 1's samples are frozen."""
    first = []

    def repeat(data):
        first.append(data)
        return first[0]

    bus.rules.append(FrameRule(frozenset({0x181}), change=repeat))


FAILS = {
    "deaf": (
        lambda _, bus: bus.rules.append(FrameRule(frozenset({0x201, 0x601}), drop=True)),
        "NOT VERIFIED that the robot is held: cut the power by hand before you go near it. winch 1 did not obey",
    ),
    "silent": (
        lambda drives, _: setattr(drives[0].faults, "silent", True),
        "cut the power by hand before you go near it. winch 1 was not seen to stop",
    ),
    "frozen samples": (repeats, "but cut the power by hand before you go near the robot. winch 1 did not obey"),
}


@pytest.mark.parametrize("name", FAILS)
@pytest.mark.sampled(1)
def test_a_winch_that_pulls_is_left_in_no_torque_that_would_give_way(tmp_path, name):
    strike, says = FAILS[name]
    report, _, _ = carry_out(tmp_path / "run", Mode.PROFILE_POSITION, strike=strike)
    assert report.outcome is Outcome.ERROR
    assert says in report.held_says


def test_a_winch_that_pulls_is_quick_stopped_when_another_has_a_fault(tmp_path):
    def fault(drives, _):
        drives[2].faults.raise_fault(0x2310)

    report, _, states = carry_out(tmp_path / "run", Mode.PROFILE_POSITION, strike=fault)
    assert report.outcome is Outcome.ERROR
    assert "without motor power: winch 3." in report.held_says
    assert states[0] is DriveState.QUICK_STOP_ACTIVE, "a hold in torque mode would give way"
