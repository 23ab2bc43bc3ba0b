"""What a person reads after `fidim identify`."""

import functools
import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from fidim_lab.app import cli
from fidim_lab.app.analysis.identified import next_command, summary
from fidim_lab.app.analysis.identify import identify_command
from fidim_lab.app.records.import_recording import run_import
from fidim_lab.app.workflows.identify import PosedCampaign, closing_sentence, identify_posed, read_posed, run_identify
from fidim_lab.data.records import Campaign, Role
from fidim_lab.errors import FileError, SetupError
from fidim_lab.identification.equations.estimators import Method
from fidim_lab.identification.motion.pose_sources import PoseSource
from fidim_lab.identification.results.result import (
    IdentificationResult,
    InertialParameter,
    ResultOutcome,
    ShortAnswer,
    WindowVerdict,
)
from fidim_lab.identification.results.result_file import read_result


def made_up(
    *,
    spread: float | None = 2e-5,
    noise_ratio: float = 1.0,
    outcome: ResultOutcome = ResultOutcome.CONVERGED,
    windows: int = 12,
):
    used = tuple(
        WindowVerdict(f"i{k:02d}", Role.IDENTIFY, True, "surface", 961, 0.07, 0.1, 1.0, 1.2) for k in range(windows)
    )
    names = ("s_x", "s_y", "s_z", "I_xx", "I_yy", "I_zz", "I_xy", "I_xz", "I_yz")
    values = (0.002, -0.001, 0.19, 0.06, 0.06, 0.03, 0.0, 0.0, 0.0)
    parameters = {n: InertialParameter(v, 1e-5, spread, spread, v * 1.1) for n, v in zip(names, values, strict=True)}
    return IdentificationResult(
        campaign="c04", method=Method.TLS, outcome=outcome, answer=ShortAnswer("Done."), parameters=parameters,
        non_essential=(), sigma_W=0.05, C=9.0, windows=used, warnings=("mind the gap",), seconds=1.0,
        noise_ratio=noise_ratio, covariance=1e-10 * np.eye(9), attachment_plane=0.2665,
    )  # fmt: skip


def text_of(result: IdentificationResult) -> str:
    console = Console(width=140, record=True, file=io.StringIO())
    console.print(summary(result))
    return console.export_text()


def test_the_summary_shows_parameters_gauge_and_warnings():
    shown = text_of(made_up())
    assert "190.000" in shown  # s_z in mm
    assert "-76.500" in shown  # s_z − a_z: what does not depend on where P is put
    assert "I_zz about G" in shown
    assert "warning: mind the gap" in shown


def test_the_answer_comes_first_in_short_parts():
    shown = text_of(replace(made_up(), answer=ShortAnswer("Done.", certain="12 windows.", next="Use it.")))
    assert shown.splitlines()[:4] == ["c04: converged", "Verdict: Done.", "Certain: 12 windows.", "Next: Use it."]


@pytest.mark.parametrize(
    ("outcome", "json_file", "command"),
    [
        (ResultOutcome.MISFIT, None, "fidim explain 'my run'"),
        (ResultOutcome.NOT_CONVERGED, Path("r.json"), "fidim explain 'my run'"),
        (ResultOutcome.CONVERGED, None, "fidim identify 'my run' --json 'my run/result.json'"),
        (ResultOutcome.DOUBTFUL, Path("r.json"), "fidim design --after r.json --campaign 'my run' --out next"),
        (ResultOutcome.CONVERGED, Path("r.json"), "fidim export r.json --to python --campaign 'my run' --out robot.py"),
    ],
)
def test_the_next_command_follows_from_the_outcome(outcome, json_file, command):
    assert next_command(Path("my run"), made_up(outcome=outcome), json_file) == command


def test_no_design_is_proposed_for_a_robot_that_it_does_not_cover():
    """Three cables leave three motions: more windows come from places at random."""
    doubtful = replace(made_up(outcome=ResultOutcome.DOUBTFUL), freedoms=3)
    assert next_command(Path("run"), doubtful, Path("r.json")) == "fidim dry-run --robot run/robot.toml --out rehearsal"


def test_a_window_without_sigma_says_why():
    result = made_up()
    bare = replace(result.windows[0], sigma_perp=None, no_sigma="the pose is not known")
    shown = text_of(replace(result, windows=(bare, *result.windows[1:])))
    assert "σ⊥ – in i00: the pose is not known" in shown


@pytest.mark.parametrize(
    ("result", "says"),
    [
        (made_up(), "agree within what noise explains"),
        (made_up(spread=4e-4, outcome=ResultOutcome.MISFIT), "the windows disagree by 40 times"),
        (made_up(spread=4e-4, windows=4), "4 windows are few"),
        (made_up(noise_ratio=6.2, outcome=ResultOutcome.MISFIT), "the equations are off by 6.2 times"),
        (made_up(spread=None), "fewer than three windows"),
        (made_up(outcome=ResultOutcome.IMPOSSIBLE_BODY), "do not use them"),
    ],
)
def test_the_last_sentence_is_honest(result, says):
    assert says in closing_sentence(result)


@pytest.mark.parametrize("cause", ["", "The recorded motion decays."])
def test_a_failed_fit_gives_way_to_equations_only_where_it_does_not_say_what_is_missing(cause, monkeypatch, irma4):
    """What its model lacks, the equations lack, too."""
    failed = replace(made_up(outcome=ResultOutcome.NOT_CONVERGED, noise_ratio=4.0), method=Method.MLE, cause=cause)
    monkeypatch.setattr(
        "fidim_lab.app.workflows.identify.identify",
        lambda campaign, method, *rest, **more: failed if method is Method.MLE else made_up(),
    )
    found = identify_posed(PosedCampaign(Campaign("made up", irma4, 100.0, ())))
    assert found.method is (Method.MLE if cause else Method.TLS)
    assert bool(found.fallback) is not bool(cause)


def test_mistakes_are_sentences(tmp_path):
    with pytest.raises(SetupError, match="no method 'guess'; available: mle, tls"):
        run_identify(tmp_path, "guess")
    with pytest.raises(FileError):
        run_identify(tmp_path / "nowhere")


@pytest.mark.shared
def test_the_command_prints_and_writes(shared, tmp_path, monkeypatch, capsys):
    quick = functools.partial(run_identify, predict=False)
    monkeypatch.setattr("fidim_lab.app.analysis.identify.run_identify", quick)
    path = tmp_path / "result.json"
    assert identify_command(shared / "campaigns" / "open-two-at-once", "tls", path, None) == 0
    assert read_result(path).campaign == "two at once"
    assert "s_z − a_z" in capsys.readouterr().out


@pytest.mark.shared
def test_a_campaign_folder_is_identified_and_shown(shared):
    result = run_identify(shared / "campaigns" / "open-two-at-once", "tls", predict=False)
    shown = text_of(replace(result, seconds=0.0))
    assert "i01" in shown
    assert "full" in shown
    assert "v18" in shown


@pytest.mark.slow
@pytest.mark.shared
def test_poses_from_the_robots_own_sensors_beside_those_of_the_cameras(shared, tmp_path, capsys):
    """The real recording holds both: poses agree to millimetres, and the yaw inertia to a few percent."""
    folder = tmp_path / "irma4u"
    run_import("irma4u", [shared / "recordings" / "irma4u"], folder)
    path = tmp_path / "result.json"
    assert cli.run(["identify", str(folder), "--method", "ls", "--pose-from", "swivel", "--json", str(path)]) == 1
    assert read_result(path).outcome == "misfit"  # its cables are no rigid ones: no headline says that it is identified
    said = " ".join(capsys.readouterr().out.split())
    assert "Zeros and delays of the sensors were calibrated against the markers" in said
    assert "Poses against those of the motion capture" in said
    own = read_result(path)
    cameras = run_identify(folder, "ls", predict=False)
    assert own.parameters["I_zz"].value == pytest.approx(cameras.parameters["I_zz"].value, rel=0.1)
    posed = read_posed(folder, PoseSource.SWIVEL)
    assert max(one.position for one in posed.differences) < 3e-3
    assert max(one.rotation for one in posed.differences) < 0.015


@pytest.mark.parametrize(
    ("options", "code", "says"),
    [
        (["--pose-from", "gyroscope"], 2, "'gyroscope' is not one of 'mocap', 'swivel', 'both'"),
        (["--pose-from", "swivel"], 2, "Window i01 has no column s1, s2, s3, s4"),
        (["--pose-from", "both", "--paper"], 2, "cannot be used with --paper or --report"),
    ],
)
@pytest.mark.shared
def test_wrong_pose_sources_are_sentences(shared, capsys, options, code, says):
    assert cli.run(["identify", str(shared / "campaigns" / "open-nothing-left-out"), *options]) == code
    assert says in capsys.readouterr().err
