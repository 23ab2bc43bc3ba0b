"""One run folder, one writer."""

import pytest

from fidim_lab.errors import SetupError
from procedures.recording.run_folder import one_writer


def test_one_run_folder_has_one_writer_and_a_folder_in_which_no_run_began_is_gone(tmp_path):
    folder = tmp_path / "runs" / "new"
    with one_writer(folder):
        assert folder.is_dir()
        with pytest.raises(SetupError, match="another process writes this run"), one_writer(folder):
            pass
    assert not folder.exists()
    with one_writer(folder):
        (folder / "journal.jsonl").touch()
    with one_writer(folder):
        assert [path.name for path in folder.iterdir()] == ["journal.jsonl"], "the lock leaves no file"


def test_a_folder_that_cannot_be_made_is_said(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(SetupError, match="cannot be made"), one_writer(tmp_path / "file" / "run"):
        pass
