"""`fidim stop` as it is typed: it finds what runs from any shell, and signals nobody but what holds a rig."""

import asyncio
import fcntl
import json
import multiprocessing
import os
import signal
import socket
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

from fidim_lab.app.service.place import ServicePlace
from fidim_lab.data.rigs.stop_file import read_stop

FIDIM = [sys.executable, "-c", "import sys; from fidim_lab.app.cli import run; sys.exit(run(sys.argv[1:]))"]


@pytest.fixture
def place(tmp_path):
    folder = tmp_path / "rt"
    folder.mkdir(mode=0o700)
    return ServicePlace(folder, "abcdefabcdef")


def stop(place, *more, **changed):
    """With what it tells programs."""
    done = stop_alone(place, "--json", str(place.folder / "said.json"), *more, **changed)
    said = json.loads((place.folder / "said.json").read_text())
    assert done.returncode == said["exit_code"]
    return done, said


def stop_alone(place, *more, **changed):
    """In a process group of its own, with a bystander in it that a signal to the group would end."""
    environment = {key: value for key, value in os.environ.items() if key not in ("XDG_RUNTIME_DIR", "TMPDIR")}
    environment |= {"FIDIM_RUNTIME_DIR": str(place.folder), **changed}
    command = [*FIDIM, "stop", *more]
    shell = 'sleep 100 & "$@"; code=$?; kill -0 $! && echo "the bystander lives"; kill $!; exit $code'
    done = subprocess.run(
        ["bash", "-c", shell, "bash", *command],
        env=environment,
        start_new_session=True,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert "the bystander lives" in done.stdout
    return done


@contextmanager
def service(place, told, *, listens, deaf=False):
    """A process that holds the rig and answers nothing; its id in `told` is replaced."""
    ready = multiprocessing.Event()

    def hold():
        os.setsid()
        signal.signal(signal.SIGTERM, signal.SIG_IGN if deaf else signal.SIG_DFL)
        descriptor = os.open(place.lock, os.O_RDWR | os.O_CREAT, 0o600)
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        os.write(descriptor, told.replace("PID", str(os.getpid())).encode())
        if listens:
            listener = socket.socket(socket.AF_UNIX)
            listener.bind(str(place.socket))
            listener.listen()
        ready.set()
        signal.pause()

    process = multiprocessing.get_context("fork").Process(target=hold)
    process.start()
    assert ready.wait(60.0)
    yield process
    process.kill()
    process.join()


def test_where_nothing_runs_it_says_so(place):
    done, said = stop(place)
    assert (said["exit_code"], said["services"]) == (1, [])
    assert "No service is running." in done.stdout


def test_where_a_service_was_killed_that_is_not_all_well(place):
    place.lock.write_text('{"pid":12345,"folder":"runs/one"}')
    done, said = stop(place)
    assert said["exit_code"] == 1
    assert "The service of run runs/one was killed" in " ".join(done.stderr.split())
    assert "HARDWARE EMERGENCY STOP" in done.stderr


@pytest.mark.parametrize("told", ["", '{"pid":0,"folder":"r"}', '{"pid":-1,"folder":"r"}', '{"pid":PID,"folder":"r"}'])
def test_a_service_without_a_socket_is_ended_and_nobody_else(place, told):
    """A lock that tells nothing yet had `kill 0` end the caller's own group."""
    with service(place, told, listens=False) as process:
        done, said = stop(place)
        process.join(10.0)
        assert process.exitcode == -signal.SIGTERM
    assert said["exit_code"] == 3
    assert "PRESS THE HARDWARE EMERGENCY STOP" in done.stderr


def test_a_service_that_hangs_and_ignores_a_polite_signal_is_killed(place):
    with service(place, '{"pid":PID,"folder":"\\u001b[2Jr"}', listens=True, deaf=True) as process:
        done, _ = stop(place)
        process.join(10.0)
        assert process.exitcode == -signal.SIGKILL
    assert f"Its process {process.pid} was ended (SIGKILL)" in done.stderr
    assert "\x1b" not in done.stderr


def test_a_stop_that_is_killed_while_it_waits_for_the_service_has_latched_the_rig(place):
    kept = place.folder / "rig.stopped.toml"
    told = json.dumps({"pid": 0, "folder": "r", "stopped": str(kept)}).replace("0", "PID", 1)
    with service(place, told, listens=True, deaf=True) as process:
        stopping = subprocess.Popen(
            [*FIDIM, "stop", "--reason", "smoke"], env={**os.environ, "FIDIM_RUNTIME_DIR": str(place.folder)}
        )
        while not kept.exists() and stopping.poll() is None:
            process.join(0.01)
        assert process.is_alive(), "it was latched only after the service had been ended"
        stopping.kill()
        stopping.wait(60.0)
    assert read_stop(kept).why == "smoke"


@pytest.mark.parametrize("changed", [{}, {"XDG_RUNTIME_DIR": "/nowhere"}, {"TMPDIR": "/nowhere", "HOME": "/nowhere"}])
def test_it_finds_a_service_from_any_shell_and_says_who_stopped_it(place, tmp_path, changed):
    heard = []

    async def serve(reader, writer):
        while line := await reader.readline():
            message = json.loads(line)
            heard.append(message)
            greeting = {
                "type": "welcome",
                "you": 1,
                "run": "r",
                "folder": "r",
                "rig": "r",
                "windows": [],
                "winches": [],
            }
            answer = {"type": "answer", "id": message.get("id", 0), "ok": True, "says": "All winches were stopped."}
            writer.write(json.dumps(greeting if message["type"] == "hello" else answer).encode() + b"\n")
        writer.close()

    async def main():
        descriptor = os.open(place.lock, os.O_RDWR | os.O_CREAT, 0o600)
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        os.write(descriptor, json.dumps({"pid": os.getpid(), "folder": str(tmp_path / "run")}).encode())
        async with await asyncio.start_unix_server(serve, place.socket):
            more = ("--reason", "a cable is slack")
            return await asyncio.to_thread(stop, place, *more, SUDO_USER="ann", **changed)

    done, said = asyncio.run(main())
    assert said["exit_code"] == 0
    assert said["services"] == [{"folder": str(tmp_path / "run"), "pid": os.getpid(), "stopped": True}]
    assert f"{tmp_path / 'run'}: All winches were stopped." in done.stdout
    assert heard[0]["client"] == "fidim stop (ann)"
    assert heard[1]["command"] == {"name": "e-stop", "reason": "a cable is slack"}


@pytest.mark.parametrize(
    "typed",
    [
        ["rig.toml"],
        ["--now", "--rigg", "rig.toml"],
        ["--rig", "not-there.toml"],
        ["--rig", "{place}/broken.toml"],
        ["--rig", "{place}"],
        ["it swings", "--reason"],
        ["--reason"],
    ],
)
def test_what_it_does_not_understand_stops_everything(place, typed):
    (place.folder / "broken.toml").write_text("bus = [")
    with service(place, '{"pid":PID,"folder":"r"}', listens=False) as process:
        done = stop_alone(place, *(word.replace("{place}", str(place.folder)) for word in typed))
        process.join(10.0)
        assert process.exitcode == -signal.SIGTERM
    assert done.returncode == 3
    assert "stopping all your services." in done.stderr


def test_a_rig_without_a_service_is_told_what_goes_on(place, tmp_path):
    rig = Path(__file__).parents[4] / "examples" / "rigs" / "simulated.toml"
    with service(place, '{"pid":PID,"folder":"runs/other"}', listens=False) as process:
        done, said = stop(place, "--rig", str(rig))
        assert process.is_alive()
    assert said["exit_code"] == 1
    assert "is running; runs/other is still running. To stop all: fidim stop." in " ".join(done.stdout.split())
