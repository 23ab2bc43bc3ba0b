"""A disk that fails, and people who are impatient."""

import errno
import os
import signal
from collections.abc import Callable
from typing import Any

import pytest

from procedures.outcomes import Outcome


def refuses(number: int) -> tuple[Callable[[Any], None], Callable[[int, bytes], int]]:
    """A fault, and a write call that raises `number` from then on."""
    struck: list[bool] = []

    def write(descriptor: int, data: bytes) -> int:
        if struck:
            raise OSError(number, os.strerror(number))
        return os.write(descriptor, data)

    return lambda stage: struck.append(True), write


@pytest.mark.fault(
    "disk",
    "the disk is full",
    reaction="hold",
    within=0.3,
    says="cannot be written: No space left on device",
    window="kept, but for at most 0.1 s",
    journal="RUN_FINISHED",
)
def test_a_full_disk(rehearsal, fault):
    plant, write = refuses(errno.ENOSPC)
    fault.strikes(rehearsal, plant, write=write)


@pytest.mark.fault(
    "disk",
    "the permission to write is lost (share gone read-only)",
    reaction="hold",
    within=0.3,
    says="cannot be written: Read-only file system",
    window="kept, but for at most 0.1 s",
    journal="RUN_FINISHED",
)
def test_a_lost_permission(rehearsal, fault):
    plant, write = refuses(errno.EROFS)
    fault.strikes(rehearsal, plant, write=write)


@pytest.mark.fault(
    "disk",
    "no new file may be made (permission denied)",
    reaction="hold",
    within=None,
    says="i01.csv.part: cannot be written: Permission denied",
    window="none was open",
    journal="RUN_FINISHED",
)
def test_a_file_that_may_not_be_made(rehearsal, fault, monkeypatch):
    really = os.open

    def refuse(path: Any, flags: int, *more: Any, **rest: Any) -> int:
        if str(path).endswith(".part") and flags & os.O_CREAT:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        return really(path, flags, *more, **rest)

    ended = fault.strikes(
        rehearsal, lambda stage: monkeypatch.setattr(os, "open", refuse), step="AwaitHandsOff", after=0.0
    )
    assert ended.report.outcome is Outcome.ERROR


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.fault(
    "people and programs",
    "Ctrl-C, a polite kill, a closed terminal",
    reaction="hold",
    within=0.1,
    says="Interrupted at “record",
    window="kept",
    journal="RUN_FINISHED",
)
@pytest.mark.sampled(1)
def test_a_polite_kill(rehearsal, fault, number):
    fault.strikes(rehearsal, lambda stage: signal.raise_signal(number))
