"""The virtual clock: order, jumps, cancellation, time-outs, threads, signals."""

import asyncio
import os
import signal
import socket
import threading
import time

import pytest

from drivers.clock import LoopClock
from sim_backends.jumping_loop import JumpingEventLoop, run

clock = LoopClock()


def test_ten_minutes_pass_in_milliseconds():
    async def main():
        begin = clock.now()
        for _ in range(600):
            await clock.sleep(1.0)
        return begin, clock.now()

    started = time.monotonic()
    begin, end = run(main())
    assert begin == 0.0
    assert end == pytest.approx(600.0)
    assert time.monotonic() - started < 20.0


def test_timers_run_in_order_and_at_their_time():
    seen = []

    async def wait(name, seconds):
        await clock.sleep(seconds)
        seen.append((name, round(clock.now(), 9)))

    async def main():
        await asyncio.gather(wait("c", 3.0), wait("a", 0.5), wait("b", 0.5), wait("zero", 0.0), wait("d", 1e5))

    run(main())
    assert seen == [("zero", 0.0), ("a", 0.5), ("b", 0.5), ("c", 3.0), ("d", 1e5)]


def test_what_is_ready_runs_before_the_time_jumps():
    async def main():
        woken = asyncio.Event()
        asyncio.get_running_loop().call_later(1.0, woken.set)
        for _ in range(1000):
            await clock.sleep(0.0)
        assert clock.now() == 0.0
        await woken.wait()
        return clock.now()

    assert run(main()) == 1.0


def test_a_cancelled_sleep_takes_no_time():
    async def main():
        sleeper = asyncio.create_task(clock.sleep(1000.0))
        await clock.sleep(1.0)
        sleeper.cancel()
        with pytest.raises(asyncio.CancelledError):
            await sleeper
        await clock.sleep(1.0)
        return clock.now()

    assert run(main()) == 2.0


def test_time_outs_are_virtual():
    async def main():
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(asyncio.Event().wait(), 30.0)
        first = clock.now()
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(5.0):
                await clock.sleep(6.0)
        return first, clock.now()

    assert run(main()) == (30.0, 35.0)


def test_twice_the_same():
    async def main():
        log = []

        async def ticker(name, period):
            for _ in range(50):
                await clock.sleep(period)
                log.append((name, clock.now()))

        await asyncio.gather(*(ticker(i, 0.001 * (i + 1)) for i in range(10)))
        return log

    assert run(main()) == run(main())


def test_time_stands_still_while_a_thread_works():
    async def main():
        asyncio.get_running_loop().call_later(1e6, lambda: None)
        result = await asyncio.to_thread(lambda: time.monotonic_ns() and threading.current_thread().name)
        waited = await asyncio.to_thread(threading.Event().wait, 0.05)
        return result, waited, clock.now()

    name, waited, now = run(main())
    assert "asyncio" in name
    assert (waited, now) == (False, 0.0)


def test_sockets_are_heard_before_the_time_jumps():
    async def main():
        ours, theirs = socket.socketpair()
        ours.setblocking(False)
        with ours, theirs:
            theirs.send(b"here")
            return await asyncio.wait_for(asyncio.get_running_loop().sock_recv(ours, 10), 1.0), clock.now()

    assert run(main()) == (b"here", 0.0)


def test_ctrl_c_while_jumping_runs_the_teardown():
    seen = []

    async def main():
        seen.append("begun")
        try:
            while True:
                await clock.sleep(0.01)
        finally:
            await clock.sleep(5.0)
            seen.append("torn down")

    timer = threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        run(main())
    timer.join()
    assert seen == ["begun", "torn down"]


@pytest.mark.parametrize("jumping", [True, False])
def test_a_signal_handler_wakes_the_loop(jumping):
    """With timers it jumps all the time; without any it waits, and must be woken."""

    async def main():
        pressed = asyncio.Event()
        loop = asyncio.get_running_loop()
        loop.add_signal_handler(signal.SIGINT, pressed.set)

        async def jump():
            while True:
                await clock.sleep(0.01)

        other = asyncio.create_task(jump()) if jumping else None
        await pressed.wait()
        loop.remove_signal_handler(signal.SIGINT)
        if other is not None:
            other.cancel()
        return True

    timer = threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    assert run(main())
    timer.join()


def test_it_is_an_event_loop_like_others():
    loop = JumpingEventLoop()
    try:
        assert loop.time() == 0.0
        assert loop.run_until_complete(asyncio.wait_for(clock.sleep(2.0), 3.0)) is None
        assert loop.time() == 2.0
    finally:
        loop.close()


@pytest.mark.parametrize("takes", [(0.0, 0.0), (0.02, 0.0), (0.0, 0.02)])
def test_the_answers_of_threads_come_at_the_same_moment_however_long_they_took(takes):
    seen = []

    async def ask(name, seconds):
        await asyncio.to_thread(time.sleep, seconds)  # noqa: TID251 - real work
        seen.append((name, clock.now()))

    async def others():
        for number in range(100):
            await clock.sleep(0.0)
            time.sleep(2e-4)  # noqa: TID251 - real work
            seen.append((number, clock.now()))
        await clock.sleep(0.1)
        seen.append(("later", clock.now()))

    async def main():
        await asyncio.gather(ask("first", takes[0]), ask("second", takes[1]), others())

    run(main())
    assert seen == [*((number, 0.0) for number in range(100)), ("first", 0.0), ("second", 0.0), ("later", 0.1)]
