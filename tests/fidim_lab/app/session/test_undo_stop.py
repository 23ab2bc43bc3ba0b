"""An emergency stop is undone deliberately or not at all: as a person, a pipe or cron types it."""

import json
from pathlib import Path
from threading import Event, Thread, Timer

import pytest

from fidim_lab.app.cli import run
from fidim_lab.app.service.lock import held
from fidim_lab.app.service.place import place_of
from fidim_lab.app.session import run_process
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.data.rigs.stop_file import Stopped, keep_stop, read_stop, stop_path

SIMULATED = Path(__file__).parents[4] / "examples" / "rigs" / "simulated.toml"
STOPPED = Stopped("fidim ui #2", "key", "2026-11-25T10:58:03.123+00:00")
SENTENCE = "emergency stop by fidim ui #2: key (2026-11-25 10:58:03 UTC)"
PLAN = (Path(__file__).parents[3] / "one_window.toml").read_text(encoding="utf-8")


@pytest.fixture
def rig(tmp_path, monkeypatch):
    """A rig that was stopped."""
    monkeypatch.setenv("FIDIM_RUNTIME_DIR", str(tmp_path))
    path = tmp_path / "rig.toml"
    path.write_text(SIMULATED.read_text())
    (tmp_path / "plan.toml").write_text(PLAN)
    keep_stop(stop_path(path, embedded=False), STOPPED)
    return path


@pytest.fixture
def started(monkeypatch):
    """What would have been started."""
    found = []

    def start(spec, place):
        found.append(spec)
        raise KeyboardInterrupt

    monkeypatch.setattr(run_process, "service_process", start)
    return found


REFUSALS = [b"", b"\n", b"y\ny\n", b"no\n", b"yes\n", b"yes\nno\n", b"yes\nyes please\n", b"yes\n\x1b[Ayes\n"]


@pytest.mark.parametrize("typed", REFUSALS)
def test_a_run_on_a_stopped_rig_moves_nothing_unless_both_questions_are_answered(rig, started, typing, capfd, typed):
    typing(typed)
    assert run(["run", str(rig.with_name("plan.toml")), "--rig", str(rig), "--out", str(rig.with_name("r"))]) == 1
    said = capfd.readouterr().err
    assert SENTENCE in said
    assert "has the cause been removed?" in said
    assert started == []
    assert read_stop(stop_path(rig, embedded=False)) == STOPPED


def test_a_run_begins_once_both_are_answered_and_the_service_undoes_the_stop(rig, started, typing):
    typing(b"yes\nYes\n")
    assert run(["run", str(rig.with_name("plan.toml")), "--rig", str(rig), "--out", str(rig.with_name("r"))]) == 130
    assert len(started) == 1
    assert read_stop(stop_path(rig, embedded=False)) == STOPPED, "until the service has reset it"


def test_an_unattended_run_refuses_a_stopped_rig_whatever_is_typed(rig, started, typing, capfd):
    typing(b"yes\nyes\n")
    answers = ["--answer", "displace-and-release=done", "--answer", "steady=done"]
    command = ["run", str(rig.with_name("plan.toml")), "--rig", str(rig), "--out", str(rig.with_name("r"))]
    assert run([*command, "--unattended", *answers]) == 1
    said = " ".join(capfd.readouterr().err.split())
    assert SENTENCE in said
    assert "fidim reset" in said
    assert started == []


def test_a_rehearsal_is_not_held_by_the_stop_of_the_real_rig_and_does_not_undo_it(rig, started, typing):
    typing(b"")
    command = ["run", str(rig.with_name("plan.toml")), "--rig", str(rig), "--out", str(rig.with_name("r"))]
    assert run([*command, "--embedded"]) == 130
    assert len(started) == 1
    assert read_stop(stop_path(rig, embedded=False)) == STOPPED


@pytest.mark.parametrize("typed", REFUSALS)
def test_a_reset_needs_both_answers(rig, typing, capfd, typed):
    typing(typed)
    assert run(["reset", "--rig", str(rig)]) == 1
    assert "stays latched" in capfd.readouterr().err
    assert read_stop(stop_path(rig, embedded=False)) == STOPPED


def test_a_reset_undoes_the_stop_without_a_service_and_says_what_it_was(rig, typing, tmp_path):
    typing(b"yes\nyes\n")
    for undone in (SENTENCE, ""):
        assert run(["reset", "--rig", str(rig), "--json", str(tmp_path / "a.json")]) == 0
        assert json.loads((tmp_path / "a.json").read_text())["undone"] == undone
    assert read_stop(stop_path(rig, embedded=False)) is None


def test_a_reset_wants_to_know_of_what(rig, capfd):
    assert run(["reset"]) == 2
    assert run(["reset", str(rig.parent), "--rig", str(rig)]) == 2


def test_a_shutdown_without_a_service_says_so(rig, capfd):
    assert run(["shutdown"]) == 1
    assert "No service is running." in capfd.readouterr().out


def test_reset_waits_for_a_service_that_is_just_ending(rig, typing, capfd):
    """Its lock is held, and nobody listens any more."""
    place = place_of(read_rig(rig, opened=False), embedded=False)
    begun, end = Event(), Event()

    def service() -> None:
        with held(place, rig.parent):
            begun.set()
            end.wait(20)

    ending = Thread(target=service)
    ending.start()
    assert begun.wait(20)
    Timer(0.3, end.set).start()
    typing(b"yes\nyes\n")
    assert run(["reset", "--rig", str(rig)]) == 0
    ending.join()
    assert "The emergency stop is reset." in capfd.readouterr().out
    assert read_stop(stop_path(rig, embedded=False)) is None
