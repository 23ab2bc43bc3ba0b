"""What a new run says where drives have power: only then, and whose run it was."""

import json
import os

import pytest

from drivers.cia402.bring_up import HAS_POWER
from fidim_lab.app.service.lock import held
from fidim_lab.app.service.place import ServicePlace
from fidim_lab.app.session.left_holding import left_by, power_advice


@pytest.fixture
def place(tmp_path):
    return ServicePlace(tmp_path, "rig")


def killed(place, folder):
    """A service that had the rig, as SIGKILL leaves it."""
    child = os.fork()
    if child == 0:
        with held(place, folder):
            os._exit(0)
    os.waitpid(child, 0)


def test_the_run_of_a_killed_service_is_known(place, tmp_path):
    assert left_by(place) is None
    run = tmp_path / "a run"
    run.mkdir()
    killed(place, run)
    assert left_by(place) == run
    run.rmdir()
    assert left_by(place) is None


def test_a_service_that_lives_or_ended_by_itself_has_left_nothing(place, tmp_path):
    with held(place, tmp_path):
        assert left_by(place) is None
    assert left_by(place) is None


@pytest.mark.parametrize("said", [b"", b"{", b"[]", b'{"pid": 3}', b'{"folder": 3}'])
def test_a_lock_that_says_nothing(place, said):
    place.lock.write_bytes(said)
    assert left_by(place) is None


def summary(tmp_path, reason):
    (tmp_path / "summary.json").write_text(json.dumps({"outcome": "error", "reason": reason}))


def test_both_ways_on_are_said(tmp_path):
    summary(tmp_path, f"4 of 4 winches: winch 1 (node 1): {HAS_POWER} (quick stop active).")
    said = "\n".join(power_advice(tmp_path, tmp_path / "my rig.toml", tmp_path / "old run"))
    assert f"    fidim resume '{tmp_path}/old run'\n" in said
    assert f"    fidim power-off '{tmp_path}/my rig.toml'\n" in said
    assert "FOLDER_OF_THAT_RUN" in "\n".join(power_advice(tmp_path, tmp_path / "rig.toml", None))


def test_nothing_is_said_of_other_endings(tmp_path):
    summary(tmp_path, "Guard: the platform is slack.")
    assert power_advice(tmp_path, tmp_path / "rig.toml", None) == ()
    assert power_advice(tmp_path / "nowhere", tmp_path / "rig.toml", None) == ()
