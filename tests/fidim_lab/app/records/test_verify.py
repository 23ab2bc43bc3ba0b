"""`fidim verify`: every change of a recorded folder is named; results and reports may come and go."""

import json

import pytest

from fidim_lab.app.cli import run
from fidim_lab.app.formats import manifest as module
from fidim_lab.app.formats.manifest import MANIFEST, read_manifest, verify, write_manifest
from fidim_lab.errors import FileError


@pytest.fixture
def folder(tmp_path):
    for name in ("campaign.toml", "windows/i01.csv", "rejected/i01-attempt1.mcap.part", "raw/can.log"):
        path = tmp_path / "run" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"this is {name}\n")
    write_manifest(tmp_path / "run")
    return tmp_path / "run"


def test_a_folder_as_it_was_is_intact(folder, capsys):
    assert run(["verify", str(folder)]) == 0
    assert "intact, 4 files" in capsys.readouterr().out


def change(folder):
    (folder / "windows/i01.csv").write_text("this is windows/i02.csv\n")


def cut(folder):
    (folder / "raw/can.log").write_text("this")


def lose(folder):
    (folder / "rejected/i01-attempt1.mcap.part").unlink()


def add(folder):
    (folder / "windows/i09.csv").write_text("")


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (change, "changed  windows/i01.csv (24 bytes, but with other contents)"),
        (cut, "changed  raw/can.log (20 bytes were recorded, 4 found)"),
        (lose, "missing  rejected/i01-attempt1.mcap.part"),
        (add, "extra    windows/i09.csv"),
    ],
)
def test_each_difference_is_named(folder, tmp_path, capsys, spoil, says):
    spoil(folder)
    assert run(["verify", str(folder), "--json", str(tmp_path / "v.json")]) == 1
    out = capsys.readouterr().out
    assert says in out
    assert "not intact: 1 difference," in out
    table = json.loads((tmp_path / "v.json").read_text())
    assert table["format"] == "fidim-verification/1"
    assert not table["intact"]
    assert sum(len(table[key]) for key in ("changed", "missing", "extra")) == 1


def test_what_is_computed_from_the_files_is_not_part_of_them(folder):
    for name in ("result.json", "report.html", "export/a.parquet"):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text("x")
    assert verify(folder).intact


def test_the_same_folder_gives_the_same_manifest(folder):
    before = (folder / MANIFEST).read_bytes()
    assert write_manifest(folder).read_bytes() == before
    told = read_manifest(folder).software
    assert told.packages["numpy"]
    assert told.python.startswith("CPython 3.")


def test_other_software_is_told_but_no_fault(folder, monkeypatch, capsys):
    here = module.software()
    other = here.model_copy(update={"packages": {**here.packages, "numpy": "9.9"}})
    monkeypatch.setattr(module, "software", lambda: other)
    assert run(["verify", str(folder)]) == 0
    assert f"numpy {here.packages['numpy']}, here 9.9" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["", "{}", '{"format": "fidim-manifest/9"}', "no JSON"])
def test_a_manifest_that_is_none(folder, text):
    (folder / MANIFEST).write_text(text)
    with pytest.raises(FileError, match=r"manifest\.json"):
        verify(folder)


def test_no_manifest_is_wrong_use(folder, tmp_path, capsys):
    (folder / MANIFEST).unlink()
    assert run(["verify", str(folder)]) == 2
    assert run(["verify", str(tmp_path / "nothing")]) == 2
    assert "there is no manifest" in capsys.readouterr().err
