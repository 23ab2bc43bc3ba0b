"""`commission` on simulated drives: healthy ones pass, each planted defect is found, objects may be absent."""

import asyncio
import math
import struct

import numpy as np
import pytest

from drivers.canbus.transport import CanFrame
from drivers.cia402.dictionary import GENERIC_EDS, DriveFamily, WinchConfig
from drivers.cia402.motion import Cia402Winch, WinchTrials
from drivers.cia402.watch import CanopenMaster
from drivers.clock import LoopClock
from drivers.ports import DriveState, MarkerFrame, Rig, Trial
from fidim_lab.data.records import Plan, PlannedWindow, Role
from fidim_lab.data.robot_file import read_robot, robot_path
from procedures.events import StepFinished, StepStarted
from procedures.outcomes import Outcome
from procedures.protocols.catalogue import experiment
from procedures.run import run_procedure
from procedures.settings import CommissionSettings, Settings
from procedures.steps.commission import ProveStop
from sim_backends.drive.axis import DrumShaft
from sim_backends.drive.node import SimulatedDrive
from sim_backends.drive.objects import read_eds
from sim_backends.in_process_bus import InProcessBus
from sim_backends.jumping_loop import run

CLOCK = LoopClock()
ROBOT = read_robot(robot_path("irma4"))
PLAN = Plan(
    "stops",
    tuple(
        PlannedWindow(f"w{k}", Role.IDENTIFY, np.full(4, 1.4), np.zeros(2), np.array([1.2, -0.2, -0.3]))
        for k in range(1, 5)
    ),
)
LAG = 0.01
"""s of a position loop with Kv 100/s"""


class NoMarkers:
    rate = 100.0

    def latest(self):
        return MarkerFrame(CLOCK.now(), int(100 * CLOCK.now()), (None,))

    def counters(self):
        return {}

    async def frames(self):
        while True:
            await CLOCK.sleep(0.01)
            yield self.latest()


class Person:
    """Answers every question; other winches than the wanted ones are left out, for the tests' time."""

    def __init__(self, wanted):
        self.wanted = wanted

    async def answer(self, prompt):
        names = [window for window in ("w1", "w2", "w3", "w4") if f"{window}:" in prompt.text]
        return "skip" if names and names[0] not in self.wanted else "done"


class Bench:
    """Four drives; what is done to the second one is the case's."""

    def __init__(self, spoil=lambda drive: None, change=lambda config: config, wanted=("w2",)):
        self.spoil, self.change, self.wanted = spoil, change, wanted
        self.results = {}
        self.heard = [self.hear]

    def _build(self):
        self.bus = InProcessBus(CLOCK.now)
        self.master = CanopenMaster(self.bus, CLOCK, sync_rate=100.0)
        self.drives, self.winches = [], []
        for node in range(1, 5):
            shaft = DrumShaft()
            drive = SimulatedDrive(node, read_eds(GENERIC_EDS, node), shaft, lag=LAG)
            config = WinchConfig(
                name=f"winch {node}",
                node_id=node,
                counts_per_turn=2.0 * math.pi * 0.05 * 2e5,
                drum_radius=0.05,
                rated_current=5.0,
                current_limit=4.0,
                max_speed=0.5,
                max_acceleration=1.0,
                length_limits=(0.5, 3.0),
                home_length=1.4,
                direction=(-1) ** node,
                on_trial=True,
            )
            if node == 2:
                self.spoil(drive)
                config = self.change(config)
            self.bus.attach(drive)
            self.drives.append(drive)
            self.winches.append(Cia402Winch(config, self.master))
        trials = tuple(WinchTrials(winch, "A. Tester") for winch in self.winches)
        self.rig = Rig(CLOCK, tuple(self.winches), NoMarkers(), Person(self.wanted), bus=self.master, trials=trials)

    def hear(self, event):
        if isinstance(event, StepFinished) and isinstance(event.step, ProveStop):
            self.results[event.step.winch + 1, event.step.trial] = event.result

    async def _live(self):
        while True:
            self.bus.advance(CLOCK.now())
            await CLOCK.sleep(min(max(self.bus.due - CLOCK.now(), 1e-4), 0.05))

    def commission(self, folder):
        settings = Settings(commission=CommissionSettings(watch=0.5))
        made = experiment("commission", PLAN, ROBOT, settings, statics=lambda lengths: np.full(len(lengths), 60.0))

        async def main():
            self._build()
            tasks = [asyncio.ensure_future(work) for work in (self.master.run(), self._live())]
            try:
                report = await run_procedure(made, self.rig, folder, wall_time=lambda: "now", listeners=self.heard)
                self.states = {winch.latest().state for winch in self.winches}
                return report
            finally:
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)

        return run(main())


def test_healthy_drives_are_proven_and_left_without_power(tmp_path):
    bench = Bench(wanted=("w1", "w2", "w3", "w4"))
    report = bench.commission(tmp_path / "run")
    assert report.outcome is Outcome.PASS, report.reason
    assert report.exit_code == 0, report.held_says
    assert {row.outcome for row in report.windows} == {Outcome.PASS}
    for (_, trial), result in bench.results.items():
        if trial is Trial.LOST_SYNC:
            assert result.outcome is Outcome.FAIL  # nothing watches SYNC, and heartbeat does
            continue
        assert result.outcome is Outcome.PASS, (trial, result.reason)
        time, way = result.values
        reaction = 0.25 if trial is Trial.LOST_HEARTBEAT else 0.0
        ramp = 0.25 if trial is Trial.HALT else 0.025
        assert time <= reaction + ramp + 0.06
        assert way <= 0.05 * (reaction + 0.06 + 0.5 * ramp) + 1e-4
        assert way >= 0.05 * 0.8 * reaction - 1e-4
    assert bench.states == {DriveState.SWITCH_ON_DISABLED}


def without(*objects):
    """A config whose drive has not these objects, as its family file says."""
    family = DriveFamily(name="lacking", absent=dict.fromkeys(objects, "proven by trial"))
    return lambda config: config.changed(family=family)


def watches_sync(drive):
    drive.od.fix(0x1006, 0, 10_000)


DEFECTS = {
    "heartbeat_ignored": (Trial.LOST_HEARTBEAT, "it does not stop"),
    "sync_ignored": (Trial.LOST_SYNC, "it does not stop"),
    "quick_stop_ignored": (Trial.QUICK_STOP, "it does not stop"),
    "ramp_ten_times_too_long": (Trial.QUICK_STOP, "time to standstill is"),
    "halt_coasts": (Trial.HALT, "it does not stop"),
    "following_error_ignored": (Trial.FOLLOWING_ERROR, "it does not stop"),
    "limit_ignored": (Trial.POSITION_LIMIT, "passes its position limit"),
    "wrong_direction": (Trial.QUICK_STOP, "moves in the wrong direction"),
    "encoder_frozen": (Trial.QUICK_STOP, "its encoder moved 0.0 mm"),
    "enables_itself": (Trial.QUICK_STOP, "afterwards it is in"),
    "stops_in_words": (Trial.QUICK_STOP, "it does not stop"),
    "brake_open": (Trial.QUICK_STOP, "moved without power is"),
}


@pytest.mark.parametrize("defect", DEFECTS)
@pytest.mark.sampled(2)
def test_a_planted_defect_is_found(tmp_path, defect):
    trial, says = DEFECTS[defect]

    def spoil(drive):
        setattr(drive.defects, defect, True)
        if trial is Trial.LOST_SYNC:
            watches_sync(drive)

    # A drive that watches the heartbeat needs no reaction to SYNC: the defect matters where it has no such watch.
    change = without("1016:1", "6007:0") if trial is Trial.LOST_SYNC else lambda config: config
    bench = Bench(spoil, change)
    report = bench.commission(tmp_path / "run")
    found = bench.results[2, trial]
    assert found.outcome is Outcome.FAIL
    assert says in found.reason
    assert report.exit_code in (1, 3)
    rows = {row.id: row.outcome for row in report.windows}
    assert rows == dict.fromkeys(("w1", "w3", "w4"), Outcome.SKIPPED) | {"w2": Outcome.FAIL}, report.reason
    assert says in next(row.reason for row in report.windows if row.id == "w2")


def test_the_watch_of_sync_takes_the_place_of_the_heartbeats(tmp_path):
    bench = Bench(watches_sync, without("1016:1"))
    report = bench.commission(tmp_path / "run")
    assert report.windows[1].outcome is Outcome.PASS, report.reason
    assert bench.results[2, Trial.LOST_HEARTBEAT].outcome is Outcome.FAIL
    assert bench.results[2, Trial.LOST_SYNC].outcome is Outcome.PASS


def test_a_drive_that_is_not_told_its_quick_stop_ramp_may_be_slower(tmp_path):
    """It stops on the move's ramp, 0.2 m/s²: proven, and slower from then on; ten times slower still is not."""
    bench = Bench(lambda drive: drive.od.fix(0x6085, 0, round(0.2 * 2e5)), without("6085:0"))
    report = bench.commission(tmp_path / "run")
    assert report.windows[1].outcome is Outcome.PASS, report.windows[1].reason
    time, _ = bench.results[2, Trial.QUICK_STOP].values
    assert time == pytest.approx(0.25, abs=0.06)
    crawling = Bench(lambda drive: drive.od.fix(0x6085, 0, round(0.02 * 2e5)), without("6085:0"))
    assert crawling.commission(tmp_path / "other").windows[1].outcome is Outcome.FAIL


@pytest.mark.parametrize("absent", [("6065:0", "605E:0", "6007:0"), ("6065:0", "605E:0")])
def test_a_fault_reaction_is_proven_by_a_lost_host_that_ends_in_fault(tmp_path, absent):
    """Without 6065 nothing else provokes one. By 6007 it is a quick stop, which shows no fault reaction."""
    bench = Bench(change=without(*absent))
    report = bench.commission(tmp_path / "run")
    assert report.windows[1].outcome is Outcome.PASS, report.windows[1].reason
    assert ("faulted" in bench.results[2, Trial.LOST_HEARTBEAT].readings) is ("6007:0" in absent)


@pytest.mark.parametrize(
    ("absent", "skipped"),
    [
        ("605D:0", None),
        ("6065:0", Trial.FOLLOWING_ERROR),
        ("607D:1", Trial.POSITION_LIMIT),
        ("6007:0", None),
    ],
)
@pytest.mark.sampled(2)
def test_a_drive_that_lacks_an_object_is_tried_in_all_else(tmp_path, absent, skipped):
    bench = Bench(watches_sync, without(absent), wanted=("w1", "w2"))  # what is withheld from the first hits it, too
    report = bench.commission(tmp_path / "run")
    outcomes = {trial: bench.results[2, trial].outcome for trial in Trial}
    assert [trial for trial, outcome in outcomes.items() if outcome is Outcome.SKIPPED] == (
        [skipped] if skipped else []
    )
    assert report.windows[1].outcome is Outcome.PASS, report.windows[1].reason


def test_another_winch_that_gets_power_meanwhile_is_stopped(tmp_path):
    """By its own port: nobody here commands it, so that nothing else is compared with its encoder."""
    bench = Bench()

    def strike(event):
        if isinstance(event, StepStarted) and isinstance(event.step, ProveStop) and not struck:
            struck.append(event.t)
            for word in (0x06, 0x07, 0x0F):
                bench.drives[2].receive(CanFrame(0x203, struct.pack("<Hbi", word, 1, 0), CLOCK.now()))

    struck = []
    bench.heard.append(strike)
    report = bench.commission(tmp_path / "run")
    assert report.reason.startswith("The power guard stopped the run")
    assert "winch 2 and winch 3 have power at the same time, but only one is tested" in report.reason
    assert report.held_says.startswith("All winches stand still")
