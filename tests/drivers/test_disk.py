"""The disk behind its port: in order, never waited for, and what fails or does not keep up is told."""

import asyncio
import re
import threading
import time

import pytest

from drivers.disk import DiskThreads, InlineDisk
from fidim_lab.errors import HardwareError


def refuse():
    raise HardwareError("windows/i01.csv.part: cannot be written: No space left on device.")


@pytest.fixture(params=[InlineDisk, DiskThreads])
def disk(request):
    made = request.param()
    yield made
    if isinstance(made, DiskThreads):
        made.close()


def test_everything_in_the_order_in_which_it_was_given(disk):
    done = []

    async def main():
        for k in range(50):
            disk.put(lambda k=k: done.append(k), 10)
            disk.secure(lambda: done.append("secured"))
        return await disk.do(lambda: [k for k in done if k != "secured"])

    assert asyncio.run(main()) == list(range(50))
    assert done.count("secured") == 50
    assert disk.error is None


def test_the_first_failure_stays_and_later_jobs_are_still_tried(disk):
    done = []

    async def main():
        disk.put(refuse)
        disk.put(lambda: done.append("journal"))
        disk.secure(refuse)
        await disk.do(lambda: None)

    asyncio.run(main())
    assert "No space left on device" in disk.error
    assert done == ["journal"]


def test_who_waits_gets_what_was_raised(disk):
    async def main():
        with pytest.raises(HardwareError, match="No space left"):
            await disk.do(refuse)
        with pytest.raises(ZeroDivisionError):
            await disk.do(lambda: 1 // 0)

    asyncio.run(main())
    assert disk.error is None, "it was told already"


def test_a_slow_fsync_keeps_no_write_and_no_loop_waiting():
    release, written = threading.Event(), []

    async def main():
        with DiskThreads() as disk:
            begun = time.monotonic()
            disk.secure(release.wait)
            for k in range(100):
                disk.put(lambda k=k: written.append(k))
            gave = time.monotonic() - begun
            while len(written) < 100:
                await asyncio.sleep(0.001)  # noqa: TID251 - real threads are waited for
            release.set()
            return gave

    assert asyncio.run(main()) < 5.0  # s; the fsync goes on until it is released


def test_more_than_there_is_room_for_is_told_and_nothing_is_written_past_the_hole():
    release, written = threading.Event(), []
    with DiskThreads(room=1000) as disk:
        disk.put(release.wait)
        for k in range(20):
            disk.put(lambda k=k: written.append(k), 100)
        assert "does not keep up" in disk.error
        assert "What was recorded so far is kept" in disk.error
        with pytest.raises(HardwareError, match="does not keep up"):
            asyncio.run(disk.do(lambda: None))
        release.set()
    assert written == list(range(10))


def test_a_disk_that_does_not_go_on_is_told_and_left_behind():
    release = threading.Event()
    disk = DiskThreads(patience=0.1)
    disk.put(release.wait)
    with pytest.raises(HardwareError, match=r"has not answered for 0\.1 s"):
        asyncio.run(disk.do(lambda: None))
    assert re.search(r"has not accepted data for \d+\.\d", disk.error)
    begun = time.monotonic()
    disk.close()
    assert time.monotonic() - begun < 30.0
    release.set()


def test_a_bug_in_a_job_is_told_and_ends_no_thread():
    with DiskThreads() as disk:
        disk.put(lambda: 1 // 0)
        asyncio.run(disk.do(lambda: None))
        assert "ZeroDivisionError" in disk.error
        assert "Please report this" in disk.error
