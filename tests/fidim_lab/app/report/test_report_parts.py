"""Parts of the report: where the platform hangs, digits, columns, sentences, checksums."""

import csv
import hashlib
import io
import tomllib
from dataclasses import replace
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

from fidim_lab.app.formats.manifest import write_manifest
from fidim_lab.app.report.contents.folder import Drives, provenance
from fidim_lab.app.report.contents.story import Incident
from fidim_lab.app.report.drawings.drawing import Drawing, write_pictures
from fidim_lab.app.report.drawings.figures import ParameterRow
from fidim_lab.app.report.drawings.scene import scene, slanted, views
from fidim_lab.app.report.pages.page import copies
from fidim_lab.app.report.sections.incidents import incident_rows
from fidim_lab.app.report.sections.numerals import decimals, duration, fixed, interval, size
from fidim_lab.app.report.sections.paper import is_papers_robot
from fidim_lab.app.report.sections.tables import drive_tables, parameter_table
from fidim_lab.app.report.sections.windows import measured_tension
from fidim_lab.app.report.sections.words import found_sentence, truth_sentence
from fidim_lab.data.records import WinchTorque
from fidim_lab.errors import FileError
from fidim_lab.model.mechanism import Mechanism
from procedures.outcomes import Outcome


@pytest.fixture
def hung(irma4, resting, campaign):
    """Where the cables hold the resting platform, by its own pose; and how to see what the report makes of a window."""
    attachments = np.array([cable.a for cable in irma4.cables])
    expected = resting.pose.position + attachments @ resting.pose.rotation.T

    def seen(robot, **changes):
        window = replace(campaign.windows[0], **changes)
        one = replace(campaign, robot=robot, windows=(window,))
        return scene(one, Mechanism(robot), robot.nominal).hanging[0]

    return expected, seen


def test_the_platform_hangs_where_its_lengths_put_it(irma4, hung):
    expected, seen = hung
    np.testing.assert_allclose(seen(irma4).attachments, expected, atol=1e-5)


def test_the_platform_hangs_where_its_markers_put_it(irma4, resting, hung):
    expected, seen = hung
    body = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.2, 0.05]])
    robot = replace(irma4, marker=body[0], extra_markers=tuple(body[1:]))
    markers = np.tile(resting.pose.position + body @ resting.pose.rotation.T, (200, 1, 1))
    markers[:50, 1] = np.nan
    np.testing.assert_allclose(seen(robot, markers=markers, lengths=None).attachments, expected, atol=1e-9)


@pytest.mark.parametrize("why", ["no lengths", "elsewhere", "impossible lengths"])
def test_an_unknown_pose_leaves_only_the_path(irma4, campaign, hung, why):
    window = campaign.windows[0]
    changes = {
        "no lengths": {"lengths": None},
        "elsewhere": {"markers": window.markers + 0.5},
        "impossible lengths": {"lengths": 0.1 * window.lengths},
    }
    found = hung[1](irma4, **changes[why])
    assert found.attachments is None
    assert len(found.path) == 200


def test_the_robot_is_drawn_without_a_pose_too(irma4, campaign):
    bare = replace(campaign, windows=(replace(campaign.windows[0], lengths=None),))
    drawn = scene(bare, Mechanism(irma4), irma4.nominal)
    pictures = views(drawn)
    assert [seen for seen, _ in pictures] == ["from above", "from the side", "from the front"]
    svgs = [slanted(drawn), *(svg for _, svg in pictures)]
    assert all(f">{cable}</text>" in svg for svg in svgs for cable in range(1, 5))


@pytest.mark.parametrize(
    ("uncertainty", "expected"),
    [(0.12, 2), (0.099, 3), (1.0, 1), (14.0, 0), (250.0, 0), (1e-9, 5), (0.0, 3), (None, 3), (float("nan"), 3)],
)
def test_two_figures_of_the_uncertainty_are_shown(uncertainty, expected):
    assert decimals(uncertainty) == expected


def test_numbers_for_people():
    assert interval(168.2512, 0.1749) == "168.25 ± 0.17"
    assert fixed(float("nan"), 2) == "–"
    assert [duration(s) for s in (2.0, 9.996, 119.6, 372.551)] == ["2 s", "10 s", "2 min 00 s", "6 min 13 s"]
    assert [size(n) for n in (12, 1999, 14_722_888)] == ["12 B", "2.0 kB", "14.72 MB"]


ROW = ParameterRow("s_z", 193.2, sd=0.1, spread=None, nominal=190.0, true=None)


def test_columns_appear_only_when_known():
    bare = parameter_table("", [ROW], {"re-fit": ()})
    assert bare.columns == ("parameter", "identified", "sd", "CAD")
    assert bare.rows == (("s_z", "193.20", "0.10", "190.00"),)
    full = parameter_table("", [replace(ROW, spread=0.4, true=193.0)], {"re-fit": ("193.1",)})
    assert full.columns[3:] == ("spread", "spread, %", "CAD", "re-fit", "true", "error", "error / ±")
    assert full.rows[0][1:] == ("193.20", "0.10", "0.40", "0.21", "190.00", "193.1", "193.00", "+0.20", "+0.5")


def test_the_sentence_about_truth_counts_and_names_the_worst():
    rows = (replace(ROW, true=193.05), replace(ROW, name="I_xx", true=192.7))
    assert "1 of 2 parameters lie within twice" in truth_sentence(rows)
    assert "at most 5.0 times (I_xx)" in truth_sentence(rows)
    assert truth_sentence((ROW,)) == ""


def test_the_sentence_about_the_find_states_what_to_believe():
    wide = replace(ROW, spread=2.0)
    said = found_sentence((wide,) * 3, (wide,) * 4)
    assert said.count("193.2 ± 2.0") == 6
    assert said.count("(CAD: 190, 190, 190)") == 2


def test_tensions_come_from_currents_with_each_winchs_factor(irma4, campaign):
    window = replace(campaign.windows[0], currents=np.ones((200, 4)))
    winches = tuple(WinchTorque(0.03, gear, 0.85, 0.12) for gear in (10.0, 10.0, 20.0, 10.0))
    _, values, source = measured_tension(replace(irma4, winches=winches), window)
    np.testing.assert_allclose(values[0], [34.0, 34.0, 68.0, 34.0])
    assert source == "motor currents"
    assert measured_tension(replace(irma4, winches=None), window) is None


def test_the_papers_robot_is_known_by_its_geometry(irma4):
    moved = replace(irma4.cables[0], d=irma4.cables[0].d + np.array([0.0, 0.006, 0.0]))
    assert is_papers_robot(irma4)
    assert not is_papers_robot(replace(irma4, cables=(moved, *irma4.cables[1:])))
    assert not is_papers_robot(replace(irma4, cables=irma4.cables[:3]))


def test_files_have_their_checksums_and_what_is_derived_is_left_out(tmp_path):
    (tmp_path / "raw").mkdir()
    (tmp_path / "raw" / "can.log").write_bytes(b"frames")
    for name in ("campaign.toml", "result.json", "report.html", "x.part", ".hidden"):
        (tmp_path / name).write_text("x")
    files = provenance(tmp_path).files
    assert [file.name for file in files] == ["campaign.toml", "raw/can.log"]
    assert (files[1].size, files[1].sha256) == (6, hashlib.sha256(b"frames").hexdigest())
    versions = dict(provenance(tmp_path).versions)
    assert versions["numpy"] == np.__version__
    assert {"fidim-lab", "casadi"} <= set(versions)


def test_the_manifest_is_held_against_the_files(tmp_path):
    assert provenance(tmp_path).manifest == ()
    (tmp_path / "a.csv").write_text("t,x\n")
    write_manifest(tmp_path)
    (intact, recorded) = provenance(tmp_path).manifest
    assert intact == ("against manifest.json", "✓ all 1 files are unchanged since the run ended")
    assert recorded[1].startswith("CPython 3")
    (tmp_path / "a.csv").write_text("t,y\n")
    (tmp_path / "b.csv").write_text("")
    said = provenance(tmp_path).manifest[0][1]
    assert said == "✗ a.csv (4 bytes, but with other contents); b.csv is new"


def test_pictures_become_files_of_their_own(tmp_path):
    drawings = [Drawing("<svg viewBox='0 0 1 1'></svg>", "Tensions; dotted: …"), Drawing("<svg ></svg>", "x", "i01/ü")]
    paths = write_pictures(tmp_path / "pictures", drawings)
    assert [path.name for path in paths] == ["01-tensions-dotted.svg", "02-i01.svg"]
    assert ElementTree.parse(paths[0]).getroot().tag == "{http://www.w3.org/2000/svg}svg"
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="cannot be written"):
        write_pictures(tmp_path / "file", drawings)


def test_values_to_copy_can_be_read_back(campaign, result_of):
    result = result_of(campaign)
    texts = {copy.name.split(":")[0].split(",")[0]: copy.text for copy in copies(result, 11.0)}
    assert tomllib.loads(texts["TOML"])["parameters"]["s_z"]["value"] == 0.1932
    rows = list(csv.DictReader(io.StringIO(texts["CSV"])))
    assert [row["parameter"] for row in rows] == list(result.parameters)
    assert float(rows[2]["value"]) == 0.1932
    inertial = ElementTree.fromstring(texts["URDF inertial"]).find(".//inertial")
    assert float(inertial.find("mass").get("value")) == 11.0
    known: dict[str, object] = {}
    exec(texts["Python"], known)
    np.testing.assert_allclose(known["s"], result.body.com)


def test_what_was_said_over_and_over_is_one_row():
    warned = [
        Incident(t, "", "guard warned", Outcome.MARGINAL, f"winch {t:.0f}: {26 + t:.0f} cycles lost") for t in range(5)
    ]
    other = Incident(2.5, "i02", "record", Outcome.FAIL, "the marker was not seen")
    rows = incident_rows([*warned, other])
    assert [says for *_, says in rows] == ["5 times, first: winch 0: 26 cycles lost", "the marker was not seen"]
    assert "to" in rows[0][1]
    assert len(incident_rows(warned[:3])) == 3


def test_winches_whose_drives_can_do_the_same_share_a_table():
    same = [{"requirement": "speed limit", "grade": "good to have", "met": "configured", "found": "607F:0"}]
    other = [{**same[0], "met": "by the host", "found": "no 607F:0", "instead": "each move's speed is checked"}]
    winches = [{"config": {"name": f"winch {k}"}, "grades": grades} for k, grades in enumerate((same, other, same), 1)]
    drives = Drives.model_validate({"format": "fidim-devices/1", "winches": [*winches, {"config": {"name": "old"}}]})
    tables = drive_tables(SimpleNamespace(drives=drives.winches))
    assert [table.caption for table in tables] == [
        "What the drives of winch 1, winch 3 can do",
        "What the drives of winch 2 can do",
    ]
    assert tables[1].rows == (
        ("speed limit", "good to have", "by the host", "no 607F:0", "each move's speed is checked"),
    )
