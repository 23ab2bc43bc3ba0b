"""The look after every window of a session: the worker's answers, and a run that is never held up by it."""

import asyncio
from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.app.judging import model_check, model_worker
from fidim_lab.app.judging.model_check import NO_MORE, Looked, ModelCheck
from fidim_lab.app.judging.model_worker import Looker, answer_to
from fidim_lab.data.campaign import write_campaign
from fidim_lab.identification.random_plan import random_plan
from procedures.events import WindowFinished
from procedures.outcomes import Outcome
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign

ECHO = """
import json, sys
for line in sys.stdin:
    found = {"holds": False, "took": 0.1, "chi2_per_dof": 2.0, "suspected": [{"id": "air-drag-linear"}]}
    found["says"] = f"after {line.strip()}"
    sys.stdout.write(json.dumps(found) + chr(10)); sys.stdout.flush()
"""


@pytest.fixture(scope="module")
def session(irma4):
    plan = random_plan(irma4, "session", 3, 0, 5)
    world = make_world(irma4, np.random.default_rng(5), ())
    return simulate_campaign(irma4, plan, world, np.random.default_rng(6), recording=Sampling(2.0))[0]


def finished(window, outcome=Outcome.PASS):
    return WindowFinished(0.0, window, outcome, "", 1, 3)


def checked(monkeypatch, tmp_path, command, events, planned=12, recorded=True):
    """What is told of these events by a worker of this source; (event, whether it is answered before the next)."""
    (tmp_path / "windows").mkdir()
    for event, _ in events if recorded else ():
        (tmp_path / "windows" / f"{event.window}.csv").touch()
    monkeypatch.setattr(model_check, "COMMAND", command)
    told: list[Looked] = []

    async def run():
        said = asyncio.Event()
        check = ModelCheck(tmp_path, planned, lambda one: (told.append(one), said.set()))
        for event, answered in events:
            said.clear()
            check(event)
            if answered:
                await asyncio.wait_for(said.wait(), 60)
        await check.close(60.0)

    asyncio.run(run())
    return told


def test_every_accepted_window_is_looked_at(monkeypatch, tmp_path):
    skipped, marginal = finished("i02", Outcome.SKIPPED), finished("i03", Outcome.MARGINAL)
    events = [(finished("i01"), True), (skipped, False), (marginal, True)]
    told = checked(monkeypatch, tmp_path, ECHO, events)
    assert [(one.window, one.says) for one in told] == [("i01", "after i01"), ("i03", "after i03")]
    assert told[0].suspected == ("air-drag-linear",)
    assert told[0].holds is False


def test_plans_with_too_few_windows_start_nothing(monkeypatch, tmp_path):
    assert checked(monkeypatch, tmp_path, "raise SystemExit(3)", [(finished("i01"), False)], planned=2) == []


def test_what_records_nothing_is_not_looked_at(monkeypatch, tmp_path):
    assert checked(monkeypatch, tmp_path, ECHO, [(finished("i01"), False)], recorded=False) == []


def test_a_worker_that_dies_is_told_once_and_not_asked_again(monkeypatch, tmp_path):
    told = checked(monkeypatch, tmp_path, "raise SystemExit(3)", [(finished("i01"), True), (finished("i02"), False)])
    (only,) = told
    assert only.holds is None
    assert "is no longer checked" in only.says


def test_closing_twice_before_an_answer_has_come_ends_no_run(monkeypatch, tmp_path):
    """A run that is over closes it once more in its teardown: a service with --stay ended by it."""
    (tmp_path / "windows").mkdir()
    (tmp_path / "windows" / "i01.csv").touch()
    monkeypatch.setattr(model_check, "COMMAND", "import sys; sys.stdin.read()")

    async def run():
        check = ModelCheck(tmp_path, 12, pytest.fail)
        check(finished("i01"))
        await check.close(0.5)
        await check.close(0.0)
        return "goes on"

    assert asyncio.run(run()) == "goes on"


def test_windows_that_come_while_it_computes_are_one_look(monkeypatch, tmp_path):
    events = [(finished(window), False) for window in ("i01", "i02", "i03")]
    assert [one.window for one in checked(monkeypatch, tmp_path, ECHO, events)] == ["i03"]


def test_the_worker_ends_when_it_has_seen_enough(monkeypatch, tmp_path):
    full = ECHO.replace('found["says"]', 'found["full"] = line.strip() == "i02"; found["says"]')
    events = [(finished("i01"), True), (finished("i02"), True), (finished("i03"), False)]
    told = checked(monkeypatch, tmp_path, full, events)
    assert [(one.window, one.says) for one in told] == [("i01", "after i01"), ("i02", f"after i02 {NO_MORE}")]


@pytest.mark.slow
def test_no_more_windows_are_kept_than_there_is_room_for(monkeypatch, tmp_path, session):
    monkeypatch.setattr(model_worker, "MOST", 2)
    looker = Looker(tmp_path)
    write_campaign(tmp_path, session)
    answer = answer_to(looker, lambda: 0.0)
    assert (answer["windows"], answer["full"]) == (2, True)


def test_the_worker_reads_what_is_new_in_the_folder(tmp_path, session):
    looker = Looker(tmp_path)
    write_campaign(tmp_path, replace(session, windows=session.windows[:1]))
    first = answer_to(looker, lambda: 0.0)
    assert "are needed" in first["says"]
    write_campaign(tmp_path, session)
    answer = answer_to(looker, lambda: 0.0)
    assert answer["windows"] == 3
    assert answer["holds"], answer["says"]
    assert answer["took"] == 0.0


def test_a_folder_that_cannot_be_read_is_an_answer(tmp_path):
    assert "no such file" in answer_to(Looker(tmp_path), lambda: 0.0)["failed"].lower()
