"""What `fidim resume` hands to a service: the run as it was begun, a rehearsal's input files from its own folder."""

from pathlib import Path

import numpy as np
import pytest

from fidim_lab.app.formats.run_spec import PLAN, RIG, RunSpec, write_spec
from fidim_lab.app.service.process import opening
from fidim_lab.app.session import resume
from fidim_lab.app.session.resume import ResumeOptions
from fidim_lab.data.plan_file import read_plan, write_plan
from fidim_lab.data.records import Plan, PlannedWindow, Role
from fidim_lab.errors import FileError, RefusedError

SIMULATED = Path(__file__).parents[4] / "examples" / "rigs" / "simulated.toml"


@pytest.fixture
def begun(monkeypatch):
    """The specs that would have been run."""
    found = []
    monkeypatch.setattr(resume, "start_and_watch", lambda spec, place, confirmed: found.append(spec) or 0)
    return found


def _folder(tmp_path, **spec):
    folder = tmp_path / "run"
    folder.mkdir()
    write_spec(folder, RunSpec(plan=tmp_path / "gone" / PLAN, out=folder, **spec))
    return folder


def test_a_rehearsal_whose_papers_are_gone_goes_on_from_the_copies_in_its_folder(tmp_path, begun):
    folder = _folder(tmp_path, rig=tmp_path / "gone" / RIG, embedded=True, hide=("rotational-drag",))
    (folder / RIG).write_text(SIMULATED.read_text())
    assert resume.resume_command(ResumeOptions(folder, accept_place=True, trust=False)) == 0
    [spec] = begun
    assert (spec.rig, spec.plan) == (folder / RIG, folder / PLAN)
    assert spec.resume
    assert spec.accept_place
    assert spec.hide == ("rotational-drag",)


def test_a_real_rigs_file_is_not_replaced_by_its_copy(tmp_path, begun):
    """Paths in it are relative to where it was; that it is gone is for a person to mend."""
    folder = _folder(tmp_path, rig=tmp_path / "gone" / RIG)
    (folder / RIG).write_text(SIMULATED.read_text())
    with pytest.raises(FileError, match=r"gone/rig\.toml: no such file"):
        resume.resume_command(ResumeOptions(folder, accept_place=False, trust=False))
    assert begun == []


def test_an_embedded_robot_rests_where_the_journal_left_it_by_a_plan_that_can_be_read(tmp_path):
    place = np.array([1.1, -0.3, -0.3])
    windows = tuple(PlannedWindow(id, Role.IDENTIFY, np.full(4, 1.5), np.zeros(2), place) for id in ("i01", "i02"))
    write_plan(tmp_path / PLAN, opening._resting_at(Plan("two", windows), (1.1, 1.2, 1.3, 1.4)))
    assert read_plan(tmp_path / PLAN, 4).windows[0].lengths.tolist() == [1.1, 1.2, 1.3, 1.4]


HOOKS = {"on_finish": "rm -rf /", "on_fault": "mail me"}


def _resumed(tmp_path, begun, *, trust=False, **spec):
    folder = _folder(tmp_path, rig=tmp_path / "gone" / RIG, embedded=True, **spec)
    (folder / RIG).write_text(SIMULATED.read_text())
    resume.resume_command(ResumeOptions(folder, accept_place=False, trust=trust))
    return begun[-1]


@pytest.mark.parametrize(
    ("typed", "kept"),
    [(b"", ("", "")), (b"no\nno\n", ("", "")), (b"y\n\n", ("", "")), (b"no\nyes\n", ("", HOOKS["on_fault"]))],
)
def test_commands_of_a_folder_are_carried_out_only_where_a_person_says_so(tmp_path, begun, typing, capfd, typed, kept):
    typing(typed)
    spec = _resumed(tmp_path, begun, **HOOKS)
    assert (spec.on_finish, spec.on_fault) == kept
    said = capfd.readouterr().err
    assert "rm -rf /" in said


def test_a_folder_that_is_trusted_is_asked_nothing(tmp_path, begun, typing):
    typing(b"")
    spec = _resumed(tmp_path, begun, trust=True, procedure="/home/me/own.py", **HOOKS)
    assert (spec.on_finish, spec.procedure) == (HOOKS["on_finish"], "/home/me/own.py")


def test_a_procedure_that_is_a_file_is_carried_out_only_where_a_person_says_so(tmp_path, begun, typing):
    typing(b"no\n")
    with pytest.raises(RefusedError, match="was not allowed"):
        _resumed(tmp_path, begun, procedure="/tmp/theirs.py")
    assert begun == []
