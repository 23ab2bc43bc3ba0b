"""Where services are found: the same place from every shell, believed only where it is the user's own."""

import fcntl
import json
import multiprocessing
import os
from contextlib import contextmanager

import pytest

from fidim_lab.app.service import lock as lock_module
from fidim_lab.app.service import place as module
from fidim_lab.app.service.lock import held, holder, left_behind
from fidim_lab.app.service.place import ServicePlace, all_places, runtime_folder
from fidim_lab.errors import SetupError


@pytest.fixture
def shared(tmp_path, monkeypatch):
    """A /tmp of the test's own."""
    monkeypatch.delenv("FIDIM_RUNTIME_DIR")
    monkeypatch.setattr(module, "SHARED", tmp_path)
    return tmp_path


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.setenv("FIDIM_RUNTIME_DIR", str(tmp_path))
    return ServicePlace(tmp_path, "rig")


@contextmanager
def somebody(path):
    """Another process that holds a lock of this file; its id."""
    ready, end = multiprocessing.Event(), multiprocessing.Event()

    def hold():
        fcntl.flock(os.open(path, os.O_RDWR | os.O_CREAT, 0o600), fcntl.LOCK_EX)
        ready.set()
        end.wait(60.0)

    process = multiprocessing.get_context("fork").Process(target=hold)
    process.start()
    assert ready.wait(60.0)
    yield process.pid
    end.set()
    process.join()


@pytest.mark.parametrize("session", [None, "xdg", "another"])
def test_the_place_hangs_on_the_user_and_on_no_variable_of_a_session(shared, monkeypatch, session):
    monkeypatch.setenv("TMPDIR", str(shared / "elsewhere"))
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    if session:
        (shared / session).mkdir()
        monkeypatch.setenv("XDG_RUNTIME_DIR", str(shared / session))
    assert runtime_folder() == shared / f"fidim-{os.getuid()}"


def test_a_session_has_a_link_to_it_for_who_looks_there(shared, monkeypatch):
    (shared / "xdg").mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(shared / "xdg"))
    with held(ServicePlace(runtime_folder(), "rig"), shared / "run"):
        assert (shared / "xdg" / "fidim" / "rig.lock").read_bytes()


@pytest.mark.parametrize("wrong", ["open to all", "a link", "a file"])
def test_a_place_that_is_not_the_users_alone_is_refused(shared, wrong):
    folder = shared / f"fidim-{os.getuid()}"
    match wrong:
        case "open to all":
            folder.mkdir()
            folder.chmod(0o755)
        case "a link":
            (shared / "theirs").mkdir(mode=0o700)
            folder.symlink_to(shared / "theirs")
        case _:
            folder.touch()
    with pytest.raises(SetupError, match=r"FIDIM_RUNTIME_DIR"):
        runtime_folder()


@pytest.mark.skipif(os.getuid() != 0, reason="only root can make folders of other users")
def test_root_sees_services_of_all_users_but_no_folder_that_somebody_made_for_another(shared):
    runtime_folder()
    for name, owner in (("fidim-1000", 1000), ("fidim-1001", 1000), ("fidim-x", 1000)):
        (shared / name).mkdir(mode=0o700)
        (shared / name / "rig.lock").touch(mode=0o600)
        os.chown(shared / name, owner, owner)
        os.chown(shared / name / "rig.lock", owner, owner)
    assert [found.folder.name for found in all_places()] == ["fidim-1000"]


def test_who_holds_it_is_told_and_confirmed_by_the_kernel(place, tmp_path):
    assert holder(place) is None
    with held(place, tmp_path / "run") as lock:
        lock.tell(port=4711)
        found = holder(place)
        assert found is not None
        assert (found.pid, found.folder, found.port) == (os.getpid(), str(tmp_path / "run"), 4711)
        with pytest.raises(SetupError, match=f"process {os.getpid()}, run .*fidim shutdown"), held(place, tmp_path):
            pass
    assert holder(place) is None
    assert left_behind(place) is None


@pytest.mark.parametrize(
    "told",
    [
        *(b"", b"\0\0", b"{}", b"[1]", b"x" * 100_000),
        *(b'{"pid":0,"folder":"r"}', b'{"pid":-1,"folder":"r"}', b'{"pid":1,"folder":"r"}'),
        *(b'{"pid":true,"folder":3}', b'{"pid":"x","folder":"r"}', b'{"pid":99999999,"folder":"r"}'),
    ],
)
def test_a_process_that_does_not_hold_the_lock_is_never_named(place, told):
    """Least of all 0, the caller's own group, -1, everybody, or 1."""
    with somebody(place.lock) as pid:
        place.lock.write_bytes(told)
        found = holder(place)
    assert found is not None
    assert found.pid == pid


def test_without_a_list_of_the_kernel_only_a_plausible_process_is_believed(place, monkeypatch):
    monkeypatch.setattr(lock_module, "LOCKS", place.folder / "none")
    with somebody(place.lock):
        for told, believed in ((os.getpid(), os.getpid()), (0, 0), (1, 0)):
            place.lock.write_text(json.dumps({"pid": told, "folder": "r"}))
            found = holder(place)
            assert found is not None
            assert found.pid == believed


@pytest.mark.parametrize("kind", ["link", "fifo", "folder"])
def test_what_is_no_file_of_the_users_is_no_lock(place, tmp_path, kind):
    match kind:
        case "link":
            (tmp_path / "other").write_text("{}")
            place.lock.symlink_to(tmp_path / "other")
        case "fifo":
            os.mkfifo(place.lock)
        case _:
            place.lock.mkdir()
    assert holder(place) is None
    assert left_behind(place) is None


@pytest.mark.skipif(os.getuid() != 0, reason="only root can make files of other users")
def test_a_lock_of_another_user_counts_for_nothing(place):
    with somebody(place.lock):
        os.chown(place.lock, 1000, 1000)
        assert holder(place) is None
