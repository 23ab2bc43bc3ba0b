"""Where a winch was told to be, set-points on drives that take objects in order, and stops by the network."""

import struct
from collections.abc import Callable, Coroutine
from typing import Any

import pytest

from drivers.trajectory import Trajectory

OnBench = Callable[..., None]
Script = Callable[[Any], Coroutine[Any, Any, None]]


def in_order(drive: Any) -> None:
    """A drive that takes the objects of a frame one by one, as they are mapped: the controlword before the target."""

    def rpdo(data: bytes) -> None:
        word, mode, target = struct.unpack("<Hbi", data)
        drive.put(0x6061, mode)
        drive._control(word)
        drive.put(0x607A, target)

    drive._rpdo = rpdo


def test_a_drive_that_takes_the_controlword_first_never_goes_to_its_old_target(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        in_order(bench.drive)
        await bench.enabled()
        scale = bench.winch.config.scale
        for length in (1.2, 1.5, 0.9):
            await bench.winch.move_to(length, speed=0.4, acceleration=1.0)
            assert bench.drive.goal == scale.count(length)
            await bench.cycles(600)
            assert bench.winch.latest().length == pytest.approx(length, abs=1e-4)

    on_bench(script)


def test_it_knows_its_last_command_from_power_on_to_power_off(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        winch, now = bench.winch, bench.master.clock.now
        await bench.ready()
        assert winch.commanded is None
        await winch.enable()
        assert winch.commanded.at(now()) == (pytest.approx(1.0), 0.0)
        asked = now()
        await winch.move_to(2.0, speed=0.5, acceleration=1.0)
        move = winch.commanded
        assert (move.start, move.target, move.speed, move.acceleration) == (pytest.approx(1.0), 2.0, 0.5, 1.0)
        assert asked < move.t < now()
        await bench.cycles(100)
        sample = winch.latest()
        await winch.hold()
        assert winch.commanded.target == pytest.approx(winch.latest().length)
        assert winch.commanded.target >= sample.length
        winch.quick_stop()
        assert winch.commanded.is_stop
        winch.power_off()
        assert winch.commanded is None

    on_bench(script)


def test_a_quick_stop_is_told_by_the_ramp_from_what_the_encoder_says(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.enabled()
        await bench.winch.move_to(2.0, speed=0.5, acceleration=1.0)
        await bench.cycles(50)
        sample = bench.winch.latest()
        bench.winch.quick_stop()
        stop: Trajectory = bench.winch.commanded
        assert stop.velocity == pytest.approx(sample.velocity)
        ramp = bench.winch.config.quick_stop_deceleration
        assert stop.end - stop.t == pytest.approx(abs(sample.velocity) / ramp)

    on_bench(script)


def test_nmt_stop_comes_after_a_halt_and_the_encoder_answers_afterwards_without_pdos(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.enabled()
        before = len(bench.bus.sent)
        bench.winch.force_stop()
        ramp, (halt_id, halt), stop = bench.bus.sent[before:]
        steep = bench.winch.config.drive_acceleration(bench.winch.config.quick_stop_deceleration)
        assert ramp == (0x603, b"\x23\x84\x60\x00" + steep.to_bytes(4, "little")), "as a quick stop, not as its move"
        assert (halt_id, halt[:3]) == (0x203, bytes((0x0F, 0x01, 1)))
        assert stop == (0x000, bytes((0x02, 3)))
        seconds = bench.winch.fall_silent()
        assert seconds >= bench.winch.config.host_timeout
        begin = len(bench.bus.sent)
        await bench.cycles(100)
        assert [f for f in bench.bus.sent[begin:] if f[0] in (0x080, 0x77F)] == []
        assert await bench.winch.ask_length() == pytest.approx(1.0)
        assert bench.drive.nmt == 0x7F

    on_bench(script)
