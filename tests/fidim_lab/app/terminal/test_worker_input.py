"""Workers take their requests line by line, and end with whoever sends them."""

import os
import signal
import subprocess
import sys
from contextlib import suppress

import pytest

WORKER = """
from fidim_lab.app.terminal.worker_pipe import requests
for line in requests():
    print("took", line, flush=True)
    while line == "for ever":
        pass
"""
PARENT = """
import subprocess, sys
worker = subprocess.Popen([sys.executable, "-c", sys.argv[1]], stdin=subprocess.PIPE, start_new_session=True)
worker.stdin.write(b"for ever\\n"); worker.stdin.flush()
worker.wait()
"""
PATIENCE = 60.0
"""s, of a busy computer"""


@pytest.fixture
def started():
    """Starts a process; it is dead when the test is over."""
    processes = []

    def start(*arguments):
        process = subprocess.Popen(
            [sys.executable, "-c", *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        processes.append(process)
        return process

    yield start
    for process in processes:
        process.kill()
        process.wait()
        process.stdin.close()
        process.stdout.close()


def test_lines_come_whole_and_in_order(started):
    worker = started(WORKER)
    lines = ["one\n", "two ü\n", "x" * 200_000 + "\n"]
    worker.stdin.write("".join(lines))
    worker.stdin.flush()
    assert [worker.stdout.readline() for _ in lines] == [f"took {line}" for line in lines]


def test_a_worker_that_computes_ends_when_its_pipe_is_closed(started):
    worker = started(WORKER)
    worker.stdin.write("for ever\n")
    worker.stdin.flush()
    assert worker.stdout.readline() == "took for ever\n"
    worker.stdin.close()
    assert worker.wait(PATIENCE) == 0


def test_a_worker_that_computes_ends_when_its_parent_is_killed(started):
    parent = started(PARENT, WORKER)
    assert parent.stdout.readline() == "took for ever\n"  # the worker's: it has its parent's standard output
    os.kill(parent.pid, signal.SIGKILL)
    # the end of the output that they share is the end of both
    with suppress(subprocess.TimeoutExpired):
        assert parent.communicate(timeout=PATIENCE)[0] == ""
        return
    pytest.fail("the worker goes on without its parent")
