"""Expressions and functions of CasADi in several threads: one makes at a time, and nothing is deleted meanwhile."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread
from weakref import ref

import casadi as ca
import numpy as np
import pytest

from fidim_lab.model.batch import evaluate, function, over_samples
from fidim_lab.model.making import MAKING, made_once


def triple():
    x = ca.SX.sym("x", 2)
    return function("triple", [x], [3.7 * x])


@contextmanager
def another_thread_that_makes() -> Iterator[None]:
    begun, end = Event(), Event()

    def make() -> None:
        with MAKING:
            begun.set()
            end.wait(timeout=10)

    thread = Thread(target=make)
    thread.start()
    assert begun.wait(timeout=10)
    yield
    end.set()
    thread.join()


@pytest.mark.parametrize("make", [triple, lambda: ca.SX(0.37), lambda: ca.MX(0.37)])
def test_what_is_dropped_while_another_thread_makes_is_deleted_only_when_that_has_ended(make):
    made = make()
    watched = ref(made)
    with another_thread_that_makes():
        del made
        assert watched() is not None
        ca.SX(1)  # dropped at once: deletes nothing either
        assert watched() is not None
    ca.SX(1)
    assert watched() is None


def test_what_this_thread_drops_while_it_makes_goes_with_the_next():
    with MAKING:
        watched = ref(triple())
        ca.SX(1)
        assert watched() is None


def test_functions_are_evaluated_while_another_thread_makes(paper, somewhere):
    compiled, samples = triple(), np.ones((3, 2))
    pose = somewhere.position[np.newaxis], somewhere.rotation[np.newaxis]

    def compute() -> list[np.ndarray]:
        return [*over_samples(compiled, 3, samples), *evaluate(compiled, samples[0]), paper.lengths(*pose)]

    before = compute()
    with another_thread_that_makes():
        found = compute()
    for one, other in zip(found, before, strict=True):
        np.testing.assert_array_equal(one, other)


def test_two_threads_that_need_the_same_get_the_same():
    kept: dict[str, object] = {}
    asked = Event()
    found: list[object] = []

    def make() -> object:
        asked.wait(timeout=10)
        return object()

    threads = [Thread(target=lambda: found.append(made_once(kept, "it", make))) for _ in range(2)]
    for thread in threads:
        thread.start()
    asked.set()
    for thread in threads:
        thread.join()
    assert found == [kept["it"]] * 2


MANY = """
from threading import Thread
from time import monotonic
import casadi as ca
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.model.batch import function
from fidim_lab.model.mechanism import Mechanism

robot, numbers, end = read_robot(PAPERS_ROBOT), ca.DM([0.1 + k for k in range(100)]), monotonic() + 10

def make(mechanism):
    x = ca.SX.sym("x")
    return function("many", [x], [x * ca.SX(numbers)])

def work():
    while monotonic() < end:
        Mechanism(robot).compiled("many", make)

threads = [Thread(target=work) for _ in range(2)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
"""


@pytest.mark.slow
def test_two_threads_make_and_drop_functions_of_the_same_constants():
    """Without the lock this crashed within 2 to 8 s, six times of six."""
    done = subprocess.run([sys.executable, "-c", MANY], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
