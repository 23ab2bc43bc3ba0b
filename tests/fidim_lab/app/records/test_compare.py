"""`fidim compare`: agreement and difference in standard deviations, what cannot be compared, the page."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.app.records.compare import compare_command
from fidim_lab.app.report.sections.compared_session import read_session
from fidim_lab.app.report.sections.comparison import compared, limit
from fidim_lab.data.campaign import write_campaign
from fidim_lab.data.records import PARAMETER_NAMES, Campaign, Role, Window
from fidim_lab.errors import FileError


def result(**shifts):
    """A result file's content; shifts: parameter → what is added to it."""
    values = dict(zip(PARAMETER_NAMES, (0.001, -0.003, 0.193, 0.046, 0.067, 0.032, 0.0, 0.0, 0.0), strict=True))
    row = {"role": "identify", "chi2_per_dof": 1.1, "rms_mm": 0.1, "sigma_perp": 0.07, "used": True}
    return {
        "format": "fidim-result/1", "campaign": "monday", "method": "mle", "outcome": "converged", "message": "",
        "parameters": {
            name: {"value": value + shifts.get(name, 0.0), "sd": 3e-5, "sd_bootstrap": 1e-5, "nominal": value}
            for name, value in values.items()
        },
        "non_essential": [], "sigma_W": None, "C": None, "seconds": 1.0,
        "windows": [{**row, "id": "i01"}, {**row, "id": "v01", "role": "validate", "chi2_per_dof": 1.02}],
    }  # fmt: skip


@pytest.fixture
def file_of(tmp_path):
    def make(name, **changes):
        path = tmp_path / f"{name}.json"
        path.write_text(json.dumps(changes.pop("table", None) or result(**changes)))
        return path

    return make


@pytest.fixture
def folder_of(tmp_path, irma4):
    """A run folder with its result."""

    def make(name, robot=irma4, **shifts):
        t = np.arange(0, 2, 0.01)
        window = Window(
            "i01", Role.IDENTIFY, t, np.zeros((200, 1, 3)), lengths=np.ones((200, 4)), currents=np.full((200, 4), 1.5)
        )
        folder = tmp_path / name
        write_campaign(folder, Campaign(name, robot, 100.0, (window, replace(window, id="v01", role=Role.VALIDATE))))
        (folder / "result.json").write_text(json.dumps(result(**shifts)))
        return folder

    return make


def test_differences_are_measured_in_the_sd_of_the_difference(file_of):
    found = compared(read_session(file_of("a")), read_session(file_of("b", s_x=9e-5)))
    (shift, *others) = found.shifts
    assert shift.z == pytest.approx(9e-5 / (3e-5 * np.sqrt(2)))
    assert [other.z for other in others] == [0.0] * 8
    assert found.agree
    assert "s_x differs most, by 2.1 sd" in found.message


def test_a_difference_beyond_chance_is_named_and_fails(file_of, tmp_path, capsys):
    out = tmp_path / "c.json"
    assert compare_command(file_of("a"), file_of("b", s_z=-2e-4, I_yy=3e-4), out, None) == 1
    told = json.loads(out.read_text())
    assert told["format"] == "fidim-comparison/1"
    assert told["agree"] is False
    assert told["parameters"]["s_z"]["z"] == pytest.approx(-2e-4 / (3e-5 * np.sqrt(2)))
    assert "differ by more than chance explains (3.3 sd) in s_z, I_yy" in told["message"]
    assert told["windows"][1]["a"]["chi2_per_dof"] == 1.02
    assert "-4.7" in capsys.readouterr().out


def test_the_page_shows_the_better_sessions_interval_and_ticks_where_the_bars_are(file_of, tmp_path):
    rough = result()
    for parameter in rough["parameters"].values():
        parameter["sd"] = 2e-3
    page = tmp_path / "compare.html"
    compare_command(file_of("a", table=rough), file_of("b", s_x=9e-5), None, page)
    text = page.read_text(encoding="utf-8")
    cells = re.findall(r"<t[dh][^>]*>([^<]*)</t[dh]>", text)
    row = cells.index("s_x")
    assert cells[row : row + 7] == ["s_x", "1.000", "2.000", "1.090", "0.030", "0.090", "+0.0"]
    assert "monday, twice" in text
    assert ">2</text>" in text
    assert "3.5868" not in text


def test_nine_parameters_share_the_chance_of_a_false_alarm():
    draws = np.random.default_rng(3).normal(size=(100_000, 9))
    assert (np.abs(draws).max(axis=1) > limit()).mean() == pytest.approx(0.01, abs=0.002)


def test_folders_tell_tensions_and_where_robot_files_differ(folder_of, irma4, tmp_path):
    moved = replace(irma4.cables[1], d=irma4.cables[1].d + np.array([0.0, 0.004, 0.0]))
    other = replace(irma4, mass=irma4.mass + 1.0, cables=(irma4.cables[0], moved, *irma4.cables[2:]))
    a, b = read_session(folder_of("a")), read_session(folder_of("b", robot=other))
    found = compared(a, b)
    expected = 1.5 * irma4.winches[0].newton_per_ampere
    assert a.tension == pytest.approx((expected, expected))
    assert a.origin == "parameters from its result.json"
    assert any("by up to 4 mm" in warning for warning in found.warnings)
    assert any(" kg" in warning for warning in found.warnings)
    page = tmp_path / "compare.html"
    assert compare_command(tmp_path / "a", tmp_path / "b", None, page) == 0
    text = page.read_text(encoding="utf-8")
    assert "✓ the sessions agree" in text
    assert text.count("<svg") == 2


def test_methods_and_outcomes_that_weaken_a_comparison_are_said(file_of):
    poor = {**result(), "method": "tls", "outcome": "misfit"}
    found = compared(read_session(file_of("a")), read_session(file_of("b", table=poor)))
    assert any("identified by mle, B by tls" in warning for warning in found.warnings)
    assert any("B is “misfit”" in warning for warning in found.warnings)


def test_without_uncertainties_nothing_is_judged(file_of):
    bare = result()
    bare["parameters"] = {name: {"value": p["value"]} for name, p in bare["parameters"].items()}
    found = compared(*(read_session(file_of(name, table=bare)) for name in "ab"))
    assert not found.agree
    assert "neither session states an uncertainty" in found.message


def test_a_session_without_result_is_told(folder_of, file_of, monkeypatch):
    from fidim_lab.errors import RefusedError

    def refuse(folder):
        raise RefusedError("Too little motion.")

    monkeypatch.setattr("fidim_lab.app.workflows.identify.run_identify", refuse)
    folder = folder_of("a")
    (folder / "result.json").unlink()
    found = compared(read_session(folder), read_session(file_of("b")))
    assert not found.agree
    assert "A has none" in found.message
    assert "Too little motion." in found.a.says


def test_a_result_about_other_windows_is_not_taken(folder_of, monkeypatch):
    folder = folder_of("a")
    stale = result()
    stale["windows"] = stale["windows"][:1]
    (folder / "result.json").write_text(json.dumps(stale))
    asked = []

    class Found:
        def to_json(self):
            asked.append(folder)
            return result()

    monkeypatch.setattr("fidim_lab.app.workflows.identify.run_identify", lambda place: Found())
    assert read_session(folder).origin == "identified now"
    assert asked == [folder]


def test_what_is_missing_is_an_error(tmp_path):
    with pytest.raises(FileError, match="no such folder"):
        read_session(tmp_path / "nowhere")
