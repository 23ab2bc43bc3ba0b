"""The count of dictionaries, on files of our own: what it calls read, repaired, refused, a drive, and a whole walk."""

from benchmarks.drives.__main__ import main
from benchmarks.drives.count import by_maker, by_requirement, count, files_in, summary
from drivers.cia402.dictionary import GENERIC_EDS


def test_a_folder_is_counted(tmp_path):
    text = GENERIC_EDS.read_text(encoding="utf-8")
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "whole.EDS").write_text(text, encoding="utf-8")
    (tmp_path / "repaired.dcf").write_text(text.replace("PDOMapping=0", "PDOMapping=", 1), encoding="utf-8")
    (tmp_path / "module.eds").write_text(
        "[1000]\nParameterName=x\nObjectType=7\nDataType=7\nAccessType=ro\nPDOMapping=0\n"
    )
    (tmp_path / "none.eds").write_text("<xml/>")
    (tmp_path / "notes.txt").write_text("not counted")
    counted = [count(path) for path in files_in(tmp_path)]
    assert summary(counted) == (
        "4 files: 3 read, 1 of them repaired, 1 refused; 2 are drives, of which 2 walk from bring-up to power-off "
        "(1 makers) and 0 are refused before power."
    )
    refused = next(one.refused for one in counted if one.refused)
    assert refused.startswith("none.eds: line 1: is XML or a web page, no EDS file Download the raw file")
    assert "| state machine | must have | 2 | 0 | 0 |" in by_requirement(counted)
    assert "no drive" in by_maker(counted)


def test_a_drive_that_lacks_its_position_is_refused_and_said(tmp_path, capsys):
    text = GENERIC_EDS.read_text(encoding="utf-8").replace("[6064]", "[2064]")
    (tmp_path / "blind.eds").write_text(text, encoding="utf-8")
    (one,) = [count(path) for path in files_in(tmp_path)]
    assert one.walked is None
    assert "no 6064:0" in one.lacks
    assert main([str(tmp_path), "--each"]) == 0
    assert "blind.eds: no 6064:0" in capsys.readouterr().err
    assert main([str(tmp_path / "nothing")]) == 2
