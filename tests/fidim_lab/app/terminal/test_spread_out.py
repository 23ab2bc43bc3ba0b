"""Work spread over processes: in order, a failure ends it, and so does an interruption, at once and without noise."""

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import suppress

import pytest

from fidim_lab.app.terminal.spread_out import workers
from fidim_lab.errors import SetupError


def _doubled(number: int) -> int:
    if number < 0:
        raise SetupError("a number below zero")
    threading.Event().wait(0.02 * (3 - number))
    return 2 * number


def test_results_come_in_order():
    with workers(2) as spread:
        assert list(spread(_doubled, [0, 1, 2, 3])) == [0, 2, 4, 6]


def test_a_task_that_fails_ends_it():
    with pytest.raises(SetupError, match="below zero"), workers(2) as spread:
        list(spread(_doubled, [0, -1, 2]))


def test_tasks_are_made_as_workers_get_free():
    made: list[int] = []

    def tasks() -> Iterator[int]:
        for number in range(100):
            made.append(number)
            yield number % 3

    with workers(2) as spread:
        results = iter(spread(_doubled, tasks()))
        assert next(results) == 0
        assert len(made) < 40
        assert len(list(results)) == 99


PLAIN = """
from fidim_lab.app.terminal.spread_out import workers
print("once")
with workers(2) as spread:
    print(*spread(abs, [-1, 2, -3]))
"""


def test_a_script_of_ones_own_needs_no_guard_and_runs_once(tmp_path):
    script = tmp_path / "plain.py"
    script.write_text(PLAIN)
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=60.0, check=False)
    assert (done.stdout, done.stderr) == ("once\n1 2 3\n", "")


LONG = """
import sys, time
from fidim_lab.app.terminal.spread_out import workers
if __name__ == "__main__":
    with workers(2) as spread:
        for _ in spread(time.sleep, [0.0, 600.0, 600.0, 600.0, 600.0]):
            print("begun", flush=True)
"""


@pytest.mark.parametrize("to_all", [True, False], ids=["ctrl-c", "kill"])
def test_an_interruption_ends_all_processes_and_prints_nothing_of_theirs(tmp_path, to_all):
    script = tmp_path / "long.py"
    script.write_text(LONG)
    command = [sys.executable, str(script)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "begun\n"
        if to_all:
            os.killpg(process.pid, signal.SIGINT)
        else:
            process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=20.0)
    assert errors.rstrip().endswith("KeyboardInterrupt")
    assert errors.count("Traceback") == 1, errors  # the script's own; nothing of its workers or the pool's thread
    gone = threading.Event()
    with suppress(ProcessLookupError):
        for _ in range(50):
            os.killpg(process.pid, 0)
            gone.wait(0.1)
        pytest.fail("some of its processes live on")
