import asyncio
import logging
from collections.abc import Callable
from typing import Any

import pytest

from drivers.cia402.watch import acknowledge_fault
from drivers.ports import DriveState, Winch
from fidim_lab.errors import BusError, DeviceError, RefusedError

OnBench = Callable[..., None]


def controlwords(bench: Any) -> list[int]:
    return [word & 0xFF for word in bench.drive.controlwords]


def test_a_whole_move(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        winch: Winch = bench.winch
        await winch.configure()
        sample = winch.latest()
        assert sample is not None
        assert sample.state is DriveState.SWITCH_ON_DISABLED
        await winch.enable()
        assert bench.drive.state == "enabled"
        await winch.move_to(1.02, speed=0.1, acceleration=0.5)
        sample = winch.latest()
        assert sample is not None
        assert not sample.target_reached
        await bench.cycles(100)
        sample = winch.latest()
        assert sample is not None
        assert sample.target_reached
        assert sample.length == pytest.approx(1.02, abs=1e-5)
        assert sample.fault == ""

    on_bench(script)


def test_enabling_walks_the_table_and_never_moves(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.ready()
        bench.drive.put(0x6064, 4321)
        bench.drive.put(0x607A, -99999)
        bench.drive.put(0x6081, 10000)
        await bench.winch.enable()
        assert bench.drive.controlwords == [0x06, 0x07, 0x10F, 0x12F, 0x3F, 0x2F]
        await bench.cycles(50)
        assert bench.drive.get(0x6064) == 4321

    on_bench(script)


def test_hold_then_a_new_move_never_resumes_the_old_one(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.enabled()
        await bench.winch.move_to(2.0, speed=0.5, acceleration=1.0)
        await bench.cycles(20)
        await bench.winch.hold()
        held = bench.drive.get(0x6064)
        await bench.cycles(50)
        assert bench.drive.get(0x6064) == held
        assert bench.drive.state == "enabled"
        bench.drive.controlwords.clear()
        await bench.winch.move_to(1.0, speed=0.5, acceleration=1.0)
        assert bench.drive.controlwords == [0x12F, 0x3F, 0x2F]
        await bench.cycles(400)
        assert bench.drive.get(0x6064) == 0

    on_bench(script)


def test_what_was_prepared_is_not_written_again_and_moves_nothing(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.enabled()
        bench.drive.controlwords.clear()
        await bench.winch.prepare(0.1, 0.5)
        assert bench.drive.controlwords == []
        prepared = sum(frame[0] == 0x603 for frame in bench.bus.sent)
        await bench.winch.move_to(1.02, 0.1, 0.5)
        assert sum(frame[0] == 0x603 for frame in bench.bus.sent) == prepared
        await bench.winch.move_to(1.01, 0.2, 0.5)
        assert sum(frame[0] == 0x603 for frame in bench.bus.sent) == prepared + 6
        with pytest.raises(RefusedError, match="a speed of 9 m/s"):
            await bench.winch.prepare(9.0, 0.5)

    on_bench(script)


@pytest.mark.parametrize(("stop", "word"), [("quick_stop", 0x02), ("power_off", 0x00)])
@pytest.mark.parametrize("configured", [False, True])
def test_stops_are_one_frame_at_once(on_bench: OnBench, stop: str, word: int, configured: bool) -> None:
    async def script(bench: Any) -> None:
        if configured:
            await bench.ready()
        before = len(bench.bus.sent)
        getattr(bench.winch, stop)()
        assert len(bench.bus.sent) == before + 1
        frame_id, data = bench.bus.sent[-1]
        if configured:
            assert (frame_id, data[:2]) == (0x203, bytes([word, 0]))
        else:
            assert (frame_id, data) == (0x603, bytes([0x2B, 0x40, 0x60, 0, word, 0, 0, 0]))
        assert bench.drive.controlwords == [word]

    on_bench(script)


def test_a_stop_goes_by_sdo_when_the_node_left_operational(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.enabled()
        bench.drive.nmt = 0x7F
        await bench.cycles(30)
        assert "the node is PRE-OPERATIONAL, not OPERATIONAL" in bench.winch.latest().fault
        bench.winch.power_off()
        assert bench.drive.state == "disabled"
        assert await bench.winch.link.sdo.read(0x6064) == 0, "its answer must not confuse the next SDO"

    on_bench(script)


def test_a_stop_overtakes_a_move_in_progress(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.enabled()
        bench.drive.deaf_to.add(0x3F)  # the set-point is never acknowledged, the move waits
        move = asyncio.create_task(bench.winch.move_to(1.5, 0.1, 0.5))
        await bench.cycles(10)
        bench.winch.quick_stop()
        with pytest.raises(DeviceError, match="replaced by a later one"):
            await move
        assert bench.drive.controlwords[-1] == 0x02
        assert bench.drive.state == "quick stop"

    on_bench(script)


def test_a_stop_overtakes_enabling(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.ready()
        bench.drive.deaf_to.add(0x07)
        enabling = asyncio.create_task(bench.winch.enable())
        await bench.cycles(10)
        bench.winch.power_off()
        with pytest.raises(DeviceError, match="replaced by a later one"):
            await enabling
        await bench.cycles(10)
        assert bench.drive.state == "disabled"

    on_bench(script)


def test_enabling_from_quick_stop_keeps_the_load(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.enabled()
        bench.winch.quick_stop()
        await bench.cycles(3)
        bench.drive.controlwords.clear()
        await bench.winch.enable()
        assert controlwords(bench)[:2] == [0x02, 0x0F]
        assert 0x00 not in bench.drive.controlwords

    on_bench(script)


@pytest.mark.parametrize(
    ("move", "complaint"),
    [
        ((0.4, 0.1, 0.5), r"a length of 0\.4000 m, allowed is 0\.5 to 3 m"),
        ((3.1, 0.1, 0.5), r"a length of 3\.1000 m"),
        ((float("nan"), 0.1, 0.5), "a length of nan m"),
        ((1.0, 0.6, 0.5), r"a speed of 0\.6 m/s, allowed is up to 0\.5 m/s"),
        ((1.0, 0.0, 0.5), "a speed of 0 m/s"),
        ((1.0, 0.1, 2.0), "an acceleration of 2 m/s², allowed is up to 1 m/s²"),
        ((9.0, 9.0, 9.0), "a length .*; a speed .*; an acceleration"),
    ],
)
def test_a_move_beyond_the_limits_sends_nothing(
    on_bench: OnBench, move: tuple[float, float, float], complaint: str
) -> None:
    async def script(bench: Any) -> None:
        await bench.enabled()
        before = [frame for frame in bench.bus.sent if frame[0] in (0x203, 0x603)]
        with pytest.raises(RefusedError, match=complaint):
            await bench.winch.move_to(*move)
        assert [frame for frame in bench.bus.sent if frame[0] in (0x203, 0x603)] == before

    on_bench(script)


def test_a_step_that_is_not_confirmed_names_what_was_found(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.ready()
        bench.drive.deaf_to.add(0x07)
        bench.drive.flags = 0
        with pytest.raises(DeviceError) as caught:
            await bench.winch.enable()
        text = str(caught.value)
        assert text.startswith("winch 3 (node 3): switched on after switch on expected within 0.2 s, found: ready to ")
        assert "no supply voltage at the power stage" in text

    on_bench(script)


def test_a_set_point_that_is_not_acknowledged(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.enabled()
        bench.drive.deaf_to.add(0x3F)
        with pytest.raises(DeviceError, match="the set-point acknowledged"):
            await bench.winch.move_to(1.5, 0.1, 0.5)

    on_bench(script)


def test_a_mode_that_is_not_displayed_is_no_confirmation(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.ready()
        bench.drive.stubborn_mode = True
        bench.drive.put(0x6061, 3)
        await bench.cycles(2)
        with pytest.raises(DeviceError, match=r"profile velocity \(3\)"):
            await bench.winch.enable()

    on_bench(script)


async def acknowledged(bench: Any, by: str = "A. Person") -> None:
    """As `fidim power-off --acknowledge` does it."""
    await acknowledge_fault(bench.winch.link, bench.master.clock, bench.winch.config.device, by)


def test_a_fault_is_named_latched_and_reset_only_by_a_person(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.enabled()
        bench.bus.deliver(*bench.drive.fail(0x8611))
        await bench.cycles(2)
        sample = bench.winch.latest()
        assert sample.state is DriveState.FAULT
        assert "following error" in sample.fault
        with pytest.raises(DeviceError, match="following error"):
            await bench.winch.enable()
        with pytest.raises(RefusedError, match="acknowledges it by name"):
            await acknowledged(bench, " ")
        bench.drive.controlwords.clear()
        await acknowledged(bench)
        assert bench.drive.controlwords == [0x00, 0x80, 0x00]
        assert bench.drive.state == "disabled"
        await bench.winch.configure()
        assert bench.winch.latest().fault == ""
        await bench.winch.enable()

    on_bench(script)


def test_a_fault_that_stays(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.enabled()
        bench.bus.deliver(*bench.drive.fail(0x7305))
        bench.drive.deaf_to.add(0x80)
        await bench.cycles(2)
        with pytest.raises(DeviceError, match="is still in “fault” after 3 s"):
            await acknowledged(bench)
        assert "encoder" in bench.winch.latest().fault

    on_bench(script)


def test_a_fault_at_which_the_node_leaves_operational_is_reset_by_sdo(on_bench: OnBench) -> None:
    """As CANopenNode does by default: PDOs end, and NMT start is refused, while the error register is not 0."""

    async def script(bench: Any) -> None:
        await bench.enabled()
        drive = bench.drive
        drive.starts_without_error_only = True
        bench.bus.deliver(*drive.fail(0x8611))
        drive.put(0x1001, 0x20)
        drive.nmt = 0x7F
        await bench.cycles(40)
        sample = bench.winch.latest()
        assert sample.state is DriveState.UNKNOWN
        assert "following error" in sample.fault
        assert "PRE-OPERATIONAL, not OPERATIONAL" in sample.fault
        drive.controlwords.clear()
        await acknowledged(bench)
        assert (drive.controlwords, drive.state) == ([0x00, 0x80, 0x00], "disabled")
        drive.put(0x1001, 0)
        await bench.winch.configure()
        await bench.winch.enable()
        assert bench.winch.latest().fault == ""

    on_bench(script)


def test_a_fault_during_a_move_ends_the_wait_with_its_cause(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.enabled()
        bench.drive.deaf_to.add(0x3F)
        move = asyncio.create_task(bench.winch.move_to(1.5, 0.1, 0.5))
        await bench.cycles(5)
        bench.bus.deliver(*bench.drive.fail(0x2310))
        with pytest.raises(DeviceError, match=r"went into fault while waiting .*over-current"):
            await move

    on_bench(script)


def test_an_emergency_without_fault_still_holds_but_does_not_move(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.enabled()
        bench.bus.deliver(0x83, bytes.fromhex("1042000000000000"))
        with pytest.raises(DeviceError, match="temperature of the drive"):
            await bench.winch.move_to(1.5, 0.1, 0.5)
        await bench.winch.hold()
        bench.bus.deliver(0x83, bytes.fromhex("0000080000000000"))
        assert "temperature" in bench.winch.latest().fault, "one of several errors has gone, its register says"
        bench.winch.power_off()
        await bench.cycles(5)
        await bench.winch.configure()
        assert bench.winch.latest().fault == ""

    on_bench(script)


def test_an_emergency_that_the_drive_withdraws_ends_what_it_began(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.enabled()
        bench.bus.deliver(0x83, bytes.fromhex("1042090000000000"))
        assert "temperature" in bench.winch.latest().fault
        bench.bus.deliver(0x83, bytes(8))
        assert bench.winch.latest().fault == ""
        assert "node 3 has withdrawn its emergency 0x4210 (temperature of the drive)" in bench.master.remark

    on_bench(script)


def test_a_silent_drive_becomes_unknown(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.enabled()
        bench.drive.mute = True
        await bench.cycles(100)
        sample = bench.winch.latest()
        assert sample.state is DriveState.UNKNOWN
        assert "no heartbeat for 0.42 s, one every 0.1 s expected" in sample.fault
        assert bench.winch.link.counters.lost == pytest.approx(100, abs=2)
        with pytest.raises(DeviceError, match="its state is unknown"):
            await bench.winch.hold()
        assert bench.bus.sent[-1][0] == 0x203, "where nothing is known, a quick stop is all that can be sent"
        assert bench.bus.sent[-1][1][:2] == b"\x02\x00"

    on_bench(script)


def test_a_drive_that_restarts_must_be_configured_again(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.enabled()
        bench.bus.deliver(0x703, b"\x00")
        assert "restarted by itself" in bench.winch.latest().fault
        with pytest.raises(DeviceError, match="configured again"):
            await bench.winch.move_to(1.5, 0.1, 0.5)

    on_bench(script)


def test_nothing_moves_before_configure(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        for command in (bench.winch.enable(), bench.winch.move_to(1.0, 0.1, 0.1), bench.winch.hold()):
            with pytest.raises(DeviceError, match="is not configured"):
                await command
        assert bench.winch.latest() is None

    on_bench(script)


def test_direction_turns_lengths_velocities_and_currents(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.ready()
        bench.drive.put(0x6064, 20000)
        bench.drive.put(0x6078, 250)
        await bench.cycles(2)
        sample = bench.winch.latest()
        assert sample.length == pytest.approx(1.0 - 2.0 * 3.14159265 * 0.03)
        assert sample.current == pytest.approx(1.0)

    on_bench(script, direction=-1)


def test_a_dead_bus_stops_every_drive_and_the_loop(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.enabled()
        bench.bus.fault = "can0: unplugged"
        assert "unplugged" in bench.winch.latest().fault
        with pytest.raises(BusError, match="cannot be trusted any more: can0: unplugged"):
            await bench.loop_task
        assert bench.drive.state == "quick stop"

    on_bench(script)


def test_the_library_below_prints_nothing(on_bench: OnBench, capfd: pytest.CaptureFixture[str]) -> None:
    async def script(bench: Any) -> None:
        bench.drive.mute = True
        with pytest.raises(DeviceError, match="no answer"):
            await bench.winch.configure()

    on_bench(script)
    assert capfd.readouterr().err == ""
    assert logging.getLogger("canopen").handlers


def test_a_drive_that_falls_back_is_an_error(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.ready()

        original = bench.drive.receive

        def receive(frame_id: int, data: bytes, t: float) -> Any:
            answers = original(frame_id, data, t)
            if frame_id == 0x080 and bench.drive.state == "on":
                bench.drive.state = "disabled"  # after it was seen switched on
            return answers

        bench.drive.receive = receive
        with pytest.raises(DeviceError, match="operation enabled after enable operation expected within"):
            await bench.winch.enable()
        assert bench.drive.state != "enabled"

    on_bench(script)
