"""The rig doctor's judgements: drives in process that are as wanted, are not, or are silent; streams of all sorts."""

from pathlib import Path

import numpy as np
import pytest

from drivers.cia402.bring_up import Standing, inspect
from drivers.cia402.bring_up.bringup import bring_up
from drivers.cia402.dictionary import GENERIC_EDS, WinchConfig
from drivers.cia402.motion import Cia402Winch
from drivers.cia402.watch import CanopenMaster, acknowledge_fault, read_state, take_power
from drivers.clock import LoopClock
from drivers.ports import DriveState, MarkerFrame
from fidim_lab.app.compose import rig_settings
from fidim_lab.app.doctor.checks import Check, CheckVerdict, make_table, summary
from fidim_lab.app.doctor.mocap_doctor import Watched, check_markers, check_timing
from fidim_lab.app.doctor.rig_doctor import check_guards, check_tensions
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.errors import DeviceError, RefusedError
from procedures.guards.robot_guards import standard_guards
from procedures.settings import Reaction
from sim_backends.bus_faults import FrameRule
from sim_backends.drive.axis import DrumShaft
from sim_backends.drive.node import SimulatedDrive
from sim_backends.drive.objects import read_eds
from sim_backends.in_process_bus import InProcessBus
from sim_backends.jumping_loop import run as run_jumping

EXAMPLES = Path(__file__).parents[4] / "examples" / "rigs"
CONFIG = WinchConfig(
    name="winch 1",
    node_id=1,
    counts_per_turn=40960.0,
    drum_radius=0.03,
    rated_current=5.0,
    current_limit=10.0,
    max_speed=0.5,
    max_acceleration=1.0,
    length_limits=(0.3, 3.0),
    home_length=1.5,
)


class Bench:
    """One simulated drive, the master's end of it, and every frame that passed."""

    def __init__(self, config=CONFIG):
        self.clock = LoopClock()
        self.bus = InProcessBus(self.clock.now)
        self.drive = SimulatedDrive(1, read_eds(GENERIC_EDS, 1), DrumShaft())
        self.bus.attach(self.drive)
        self.frames = []
        self.bus.tap(self.frames.append)
        self.config = config
        self.master = CanopenMaster(self.bus, self.clock, sync_rate=100.0)
        self.link = Cia402Winch(config, self.master).link

    async def inspect(self):
        return {item.object: item for item in await inspect(self.link, self.config, 127)}


def on_bench(work, config=CONFIG):
    async def main():
        return await work(Bench(config))

    return run_jumping(main())


def test_a_drive_from_the_factory_is_fit_and_only_read():
    async def work(bench):
        found = await bench.inspect()
        assert {item.standing for item in found.values()} == {Standing.HOLDS, Standing.TO_BE_WRITTEN}
        assert found["6007:0"].standing is Standing.TO_BE_WRITTEN
        sent = [frame for frame in bench.frames if frame.id < 0x580 or frame.id == 0x601]
        assert sent
        assert all(frame.id == 0x601 and frame.data[0] == 0x40 for frame in sent)  # SDO uploads, nothing else
        assert bench.drive.od.number(0x6007) == 1

    on_bench(work)


def test_what_bring_up_has_written_holds():
    async def work(bench):
        import asyncio

        running = asyncio.ensure_future(bench.master.run())

        async def live():
            while True:
                bench.bus.advance(bench.clock.now())
                await bench.clock.sleep(0.005)

        living = asyncio.ensure_future(live())
        await bring_up(bench.master, bench.link, bench.config)
        for task in (running, living):
            task.cancel()
        found = await bench.inspect()
        assert {item.object for item in found.values() if item.standing is not Standing.HOLDS} == set()

    on_bench(work)


BREAKS = {
    "make": (lambda bench: bench.drive.od.fix(0x6075, 0, 4000), "6075:0", "4000"),
    "profile": (lambda bench: bench.drive.od.fix(0x1000, 0, 0x191), "1000:0", "0x191"),
    "fault": (lambda bench: bench.drive.faults.raise_fault(0x2310), "6041:0", "fault"),
    "register": (lambda bench: bench.drive.faults.raise_fault(0x2310), "1001:0", "3"),
}


@pytest.mark.parametrize("case", BREAKS)
def test_what_would_be_refused_is_wrong_and_has_advice(case):
    spoil, place, says = BREAKS[case]

    async def work(bench):
        spoil(bench)
        bench.bus.advance(bench.clock.now())
        item = (await bench.inspect())[place]
        assert item.standing is Standing.WRONG
        assert says in item.found
        assert item.advice

    on_bench(work)


@pytest.mark.parametrize(
    ("register", "standing"),
    [(0x11, Standing.HOLDS), (0x10, Standing.HOLDS), (0x01, Standing.WRONG), (0x90, Standing.WRONG)],
)
def test_a_drive_that_only_misses_its_host_is_fit(register, standing):
    """Some set the generic bit for every error, as the standard has it; CANopenNode does not."""

    async def work(bench):
        bench.drive.od.fix(0x1001, 0, register)
        item = (await bench.inspect())["1001:0"]
        assert (item.standing, item.found.split()[0]) == (standing, str(register))
        assert ("misses its host" in item.found) == (standing is Standing.HOLDS)

    on_bench(work)


def test_a_silent_drive_is_an_error_that_names_it():
    async def work(bench):
        bench.drive.faults.silent = True
        with pytest.raises(DeviceError, match=r"winch 1 \(node 1\): no answer"):
            await bench.inspect()

    on_bench(work)


def test_a_fault_is_acknowledged_only_by_name():
    async def work(bench):
        bench.drive.faults.raise_fault(0x2310)
        bench.bus.advance(bench.clock.now())
        assert await read_state(bench.link) is DriveState.FAULT
        with pytest.raises(RefusedError, match="acknowledges it by name"):
            await acknowledge_fault(bench.link, bench.clock, "winch 1", " ")
        assert await take_power(bench.link, bench.clock, "winch 1") is DriveState.FAULT
        assert await acknowledge_fault(bench.link, bench.clock, "winch 1", "tester") is DriveState.SWITCH_ON_DISABLED

    on_bench(work)


def test_a_drive_that_refuses_to_be_switched_off_says_why():
    refused = bytes.fromhex("8040600022000008")

    async def work(bench):
        bench.drive.od.attach(0x6041, source=lambda: 0x0637)
        bench.bus.rules.append(
            FrameRule(frozenset({0x581}), change=lambda data: refused if data[1:3] == refused[1:3] else data)
        )
        with pytest.raises(DeviceError, match=r"is still in “operation enabled” .* refuses the controlword .*not in"):
            await take_power(bench.link, bench.clock, "winch 1")

    on_bench(work)


# motion capture -----------------------------------------------------------------------------------------------------


def watched(rate=100.0, *, late=(), hidden=0, frozen=False, lost=0):
    """Two seconds of frames as they might arrive."""
    rng = np.random.default_rng(3)
    frames = []
    for k in range(200):
        t = k / rate + (0.2 if k in late else 0.0) + 1e-4 * rng.random()
        position = (1.0, 2.0, 3.0) if frozen else tuple(rng.random(3))
        frames.append(MarkerFrame(t, k, (None if k < hidden else position,)))
    counters = {"received": 200, "lost": lost, "repeated": 199 if frozen else 0}
    return Watched(tuple(frames), 2.0, counters)


def failed(checks):
    return [check.name for check in checks if check.verdict is CheckVerdict.FAILED]


def test_a_stream_that_is_well():
    assert failed([*check_timing(watched(), 100.0), *check_markers(watched(), ("m",))]) == []


@pytest.mark.parametrize(
    ("seen", "rate", "names"),
    [
        (watched(rate=200.0), 100.0, ["rate"]),
        (watched(lost=20), 100.0, ["frames lost"]),
        (watched(late=range(50, 60)), 100.0, ["delay beyond the least, p99"]),
        (watched(hidden=20), 100.0, ["m seen"]),
        (watched(frozen=True), 100.0, ["positions repeated"]),
        (Watched((), 2.0, {"received": 0, "lost": 0, "repeated": 0}), 100.0, ["rate", "m seen"]),
    ],
)
def test_what_is_wrong_with_a_stream_is_named(seen, rate, names):
    assert failed([*check_timing(seen, rate), *check_markers(seen, ("m",))]) == names


# the rig file itself ------------------------------------------------------------------------------------------------


def test_weak_motors_and_guards_are_told(tmp_path):
    text = (EXAMPLES / "simulated.toml").read_text().replace("current_limit = 12.0", "current_limit = 5.0")
    (tmp_path / "rig.toml").write_text(text)
    rig = read_rig(tmp_path / "rig.toml")
    checks = check_tensions(rig)
    assert failed(checks) == ["tension at current_limit"] * 4
    assert checks[0].found == "170 N"
    guards = {check.name: check.found for check in check_guards(rig)}
    assert guards["guard marker"] == "hold (lasting 3)"


def test_reactions_of_the_rig_file_reach_the_guards():
    rig = read_rig(EXAMPLES / "vicon-udp.toml")
    settings = rig_settings(rig)
    guards = {guard.name: guard for guard in standard_guards(["w"] * 4, [34.0] * 4, (20.0, 200.0), settings.guard)}
    told = {"following error", "temperature", "bus errors"}  # what drives say of themselves
    assert set(guards) == {"drive", "power", "stale winch", "tension", "marker", "motion", "slip"} | told
    assert guards["slip"].reaction is Reaction.REJECT_WINDOW
    assert guards["marker"].reaction is Reaction.HOLD
    assert guards["motion"].reaction is Reaction.QUICK_STOP
    assert settings.motion.length_limits == ((0.3, 3.5),) * 4
    assert settings.tension.tolerance == pytest.approx(3.8 / 20.0)


def test_the_same_of_all_devices_is_one_row():
    checks = [Check("6007", CheckVerdict.OK, "3", wanted="3", device=f"winch {k}") for k in (1, 2, 3)]
    checks.append(Check("drive", CheckVerdict.UNREACHABLE, "no answer", "look", "node 4", "winch 4"))
    table = make_table(checks)
    assert table.row_count == 2
    assert list(table.columns[1].cells) == ["all 3: 6007", "winch 4: drive"]
    assert summary(checks, [checks[-1]]) == "1 of 4 checks failed: winch 4: drive"
