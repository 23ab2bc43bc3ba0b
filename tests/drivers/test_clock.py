"""The loop of real time: waits that end when they should, beside sockets, threads and signals."""

import asyncio
import os
import selectors
import signal
import time

import pytest

from drivers.clock import LoopClock, precise_loop


def run(main):
    with asyncio.Runner(loop_factory=precise_loop) as runner:
        return runner.run(main)


@pytest.mark.skipif(not hasattr(selectors, "EpollSelector"), reason="without epoll it is asyncio's own loop")
def test_a_wait_is_not_rounded_up_to_milliseconds():
    async def main():
        clock, late = LoopClock(), []
        for _ in range(100):
            due = clock.now() + 0.0021
            await clock.sleep(0.0021)
            late.append(clock.now() - due)
        return sorted(late)

    late = run(main())
    assert late[0] >= 0.0
    assert late[2] < 3e-4  # rounded up each would be 0.9 ms; a busy computer spoils many


def test_sockets_threads_and_other_wakes_end_a_wait_early():
    async def main():
        loop, begin = asyncio.get_running_loop(), time.monotonic()
        reader, writer = os.pipe()
        heard = loop.create_future()
        loop.add_reader(reader, heard.set_result, None)
        loop.run_in_executor(None, os.write, writer, b"x")
        await asyncio.wait_for(heard, 20.0)
        loop.remove_reader(reader)
        os.close(reader)
        os.close(writer)
        process = await asyncio.create_subprocess_exec("true")
        assert await process.wait() == 0
        return time.monotonic() - begin

    assert run(main()) < 10.0


def test_a_signal_ends_a_wait_early():
    async def main():
        loop, heard = asyncio.get_running_loop(), asyncio.Event()
        loop.add_signal_handler(signal.SIGUSR1, heard.set)
        loop.call_later(0.05, os.kill, os.getpid(), signal.SIGUSR1)
        async with asyncio.timeout(20.0):
            await heard.wait()
        loop.remove_signal_handler(signal.SIGUSR1)

    begin = time.monotonic()
    run(main())
    assert time.monotonic() - begin < 10.0
