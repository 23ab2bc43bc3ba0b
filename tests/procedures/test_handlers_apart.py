"""Computing about a run in a process of its own: it answers, dies or takes too long, and the run goes on."""

import asyncio
import os
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from procedures.handlers import accuracy
from procedures.handlers.apart import apart


def name(folder: Path) -> str:
    return folder.name


def die(folder: Path) -> str:
    os._exit(3)


def sleep(folder: Path) -> str:
    threading.Event().wait(120.0)
    return folder.name


@pytest.mark.parametrize(("job", "expected"), [(name, "run"), (die, None)])
def test_it_answers_or_dies(job, expected: str | None) -> None:
    assert asyncio.run(apart(job, Path("run"))) == expected


def test_nobody_waits_for_what_takes_too_long() -> None:
    begin = time.monotonic()
    assert asyncio.run(apart(sleep, Path("run"), longest=0.2)) is None
    assert time.monotonic() - begin < 60.0


@pytest.mark.parametrize("error", [np.linalg.LinAlgError("singular"), RuntimeError("CasADi"), OSError("disk")])
def test_whatever_fails_in_it_is_told_and_ends_no_run(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    def read(_: Path) -> None:
        raise error

    monkeypatch.setattr("fidim_lab.data.campaign.read_campaign", read)
    values, problem = accuracy._identified(Path("run"))
    assert values == ()
    assert str(error) in problem
