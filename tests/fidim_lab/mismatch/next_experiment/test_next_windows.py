"""The next best experiment: odds, gauges that nothing separates, the windows that are proposed."""

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import ncx2

from fidim_lab.app.analysis.design_after import AfterOptions, after_command
from fidim_lab.app.formats.explanation_file import ExplanationTable, claims_of
from fidim_lab.data.campaign import write_campaign
from fidim_lab.data.plan_file import read_plan
from fidim_lab.data.records import PARAMETER_NAMES, Campaign, Robot, Role, Window
from fidim_lab.data.robot_file import write_robot
from fidim_lab.errors import InfeasibleError, SetupError
from fidim_lab.identification.design import pool
from fidim_lab.identification.design.task import Criterion, DesignTask
from fidim_lab.identification.design.windows import place
from fidim_lab.mismatch.next_experiment.next_windows import to_know, to_separate
from fidim_lab.mismatch.next_experiment.proposal import Claim, Odds, ProposedTrial
from fidim_lab.mismatch.next_experiment.separate import KnownRobot, completed, evidence, separating, with_markers


@pytest.fixture(scope="module")
def trials(irma4: Robot) -> list[ProposedTrial]:
    task = DesignTask(irma4, equilibria=1)
    mechanism = task.mechanism()
    drawn = pool.draw(mechanism, task, 12, np.random.default_rng(4), lambda _: None)
    return [ProposedTrial(z[:4], z[4:], place(mechanism, task, z).start) for z in drawn.z]


def campaign_of(robot: Robot, trials: list[ProposedTrial]) -> Campaign:
    task = DesignTask(robot, equilibria=1)
    mechanism = task.mechanism()
    t = np.arange(0, 1, 0.01)
    windows = []
    for number, one in enumerate(trials, start=1):
        placed = place(mechanism, task, np.concatenate([one.lengths, one.displacement]))
        rest = placed.rest.position + placed.rest.rotation @ robot.marker
        start = one.start.position + one.start.rotation @ robot.marker
        markers = rest + np.cos(2 * t)[:, None] * (start - rest)
        lengths = np.tile(one.lengths, (len(t), 1))
        windows.append(Window(f"i{number:02d}", Role.IDENTIFY, t, markers[:, None], lengths, None, rest))
    return Campaign("c", robot, 100.0, tuple(windows))


def test_more_windows_separate_an_anchor_from_a_length(irma4: Robot, trials: list[ProposedTrial]):
    claim = Claim("cable-length-bias", 2, (2e-3,), ("anchor-offset",))
    found = separating(KnownRobot(irma4, trials[:2]), claim, trials[2:], more=4)
    values = [found.before.non_centrality, *(odds.non_centrality for odds in found.after)]
    assert all(b > a for a, b in pairwise(values))
    # the first proposal is the best of all single ones
    for one in trials[2:5]:
        alone = separating(KnownRobot(irma4, trials[:2]), claim, [one], more=1)
        assert alone.after[0].non_centrality <= found.after[0].non_centrality * (1 + 1e-9)
    odds = found.after[-1]
    assert odds.probability == pytest.approx(ncx2.sf(10.0, 1, odds.non_centrality))
    assert odds.rival in found.says


def test_twice_the_effect_is_four_times_as_clear_and_noise_undoes_it(irma4: Robot, trials: list[ProposedTrial]):
    def clear(size: float, noise: float = 1.0) -> float:
        claim = Claim("rotational-drag", None, (size,), ("swivel-damping",))
        known = KnownRobot(irma4, trials[:1], noise=noise)
        return separating(known, claim, trials[1:2], more=1).before.non_centrality

    assert clear(0.02) == pytest.approx(4 * clear(0.01), rel=1e-6)
    assert clear(0.02, noise=2.0) == pytest.approx(clear(0.01), rel=1e-2)  # priors of a start stay


@pytest.mark.slow
def test_a_gauge_is_said_to_be_none_that_free_motion_separates(irma4: Robot, trials: list[ProposedTrial]):
    claim = Claim("gravity-tilt", None, (2e-3, 1e-3), ("constant-force",))
    found = to_separate(campaign_of(irma4, trials[:3]), [claim])[0]
    assert not found.separates
    assert "hardly separate" in found.says
    assert found.after[-1].probability < 0.1


def test_a_clock_is_a_force_upwards_to_the_last_digit_that_matters(irma4: Robot, trials: list[ProposedTrial]):
    claim = Claim("clock-rate", None, (3e-3,), ("constant-force",))
    lengths, aside = np.array([1.5975, 0.523, 1.56, 2.1413]), np.array([0.0346, 0.0038])  # it swings quickly there
    task = DesignTask(irma4, equilibria=1)
    quick = ProposedTrial(lengths, aside, place(task.mechanism(), task, np.concatenate([lengths, aside])).start)
    for some in (trials, [*trials[:3], quick]):
        assert evidence(KnownRobot(irma4, some), claim) > 100.0
        assert separating(KnownRobot(irma4, some), claim, []).before.non_centrality < 1.0


def test_what_has_no_score_is_refused_by_name(irma4: Robot, trials: list[ProposedTrial]):
    with pytest.raises(InfeasibleError, match="hand-contact"):
        separating(KnownRobot(irma4, trials[:1]), Claim("hand-contact", None, (1.0,), ("constant-force",)), trials[1:2])
    with pytest.raises(InfeasibleError, match="none of its rivals"):
        separating(KnownRobot(irma4, trials[:1]), Claim("rotational-drag", None, (0.1,), ("unknown",)), trials[1:2])


def test_three_markers_are_three_in_general_position(irma4: Robot):
    one = replace(irma4, extra_markers=())
    markers = with_markers(one).markers
    assert len(markers) == 3
    assert np.linalg.matrix_rank(markers[1:] - markers[0]) == 2
    assert with_markers(with_markers(one)).markers.shape == markers.shape


def test_markers_of_further_windows_tell_nothing_of_those_recorded(irma4: Robot, trials: list[ProposedTrial]):
    robot = replace(irma4, extra_markers=())
    claim = Claim("cable-length-bias", 2, (2e-3,), ("anchor-offset",))
    plain = separating(KnownRobot(robot, trials[:3]), claim, trials[3:5], more=2)
    marked = separating(KnownRobot(robot, trials[:3], marked=with_markers(robot)), claim, trials[3:5], more=2)
    assert marked.before.non_centrality == pytest.approx(plain.before.non_centrality, rel=1e-6)
    assert marked.after[-1].non_centrality > plain.after[-1].non_centrality
    assert (plain.markers, marked.markers) == (1, 3)


def test_after_a_result_the_window_that_tells_most(irma4: Robot, trials: list[ProposedTrial]):
    found = to_know(campaign_of(irma4, trials[:2]))
    assert (found.sd_after <= found.sd_before * (1 + 1e-9)).all()
    assert found.sd_after.sum() < 0.9 * found.sd_before.sum()


@pytest.mark.slow
def test_command_writes_a_plan_that_runs(
    irma4: Robot, trials: list[ProposedTrial], tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    campaign = campaign_of(irma4, trials[:2])
    write_robot(tmp_path / "robot.toml", irma4)
    write_campaign(tmp_path, campaign)
    parameters = {
        name: {"value": float(v), "sd": 1e-5, "nominal": float(v)}
        for name, v in zip(
            ("s_x", "s_y", "s_z", "I_xx", "I_yy", "I_zz", "I_xy", "I_xz", "I_yz"), irma4.nominal.vector, strict=True
        )
    }
    explanation = {
        "format": "fidim-explanation/1",
        "campaign": "c",
        "verdict": "explained",
        "effects": [
            {
                "id": "cable-length-bias",
                "cable": 2,
                "equivalent_to": ["anchor-offset"],
                "parameters": {"bias": {"value": 5e-3, "sd": 1e-4, "unit": "m"}},
            }
        ],
        "where": [],
        "held_out": {"chi2_per_dof": {"before": 9.0, "after": 1.0}, "rms_mm": {"before": 1.0, "after": 0.1}},
        "ranking": [],
        "parameters": parameters,
        "parameters_before": parameters,
        "next_experiment": None,
        "message": "m",
        "seconds": 1.0,
    }
    (tmp_path / "explanation.json").write_text(json.dumps(explanation))
    assert claims_of(ExplanationTable.model_validate(explanation))[0].theta == (5e-3,)
    options = AfterOptions(tmp_path / "explanation.json", None, None, 1, tmp_path / "next", tmp_path / "n.json")
    assert after_command(options) == 0
    table = json.loads((tmp_path / "n.json").read_text())
    assert table["format"] == "fidim-next/1"
    assert table["claims"][0]["windows"]
    plan = read_plan(tmp_path / "next" / "plan.toml", irma4.n)
    assert len(plan.windows) == len(table["claims"][0]["windows"])
    said = capsys.readouterr().out
    for window, row in zip(plan.windows, table["claims"][0]["windows"], strict=True):
        shown = next(line for line in said.splitlines() if f" {window.id} " in line)
        assert all(f"{length:.3f}" in shown for length in row["lengths"])
        assert f"{100 * row['odds']:.0f} %" in shown
    assert "plan.toml --rig RIG.toml" in said
    with pytest.raises(SetupError, match="is not empty"):
        after_command(options)
    unknown = explanation | {"verdict": "unknown-physics", "effects": [], "next_experiment": "Look at the winches."}
    (tmp_path / "explanation.json").write_text(json.dumps(unknown))
    assert after_command(replace(options, out=None, criterion=Criterion.D)) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "The verdict is unknown-physics" in said
    assert "Look at the winches." in said
    assert "No effect is in question" not in said
    assert " next01 " in said
    assert "--out FOLDER makes plan.toml" in said


@pytest.fixture
def explained(irma4: Robot, trials: list[ProposedTrial], tmp_path: Path) -> AfterOptions:
    """A campaign, and an explanation that leaves a tilt in question."""
    write_robot(tmp_path / "robot.toml", irma4)
    write_campaign(tmp_path, campaign_of(irma4, trials[:2]))
    nominal = zip(PARAMETER_NAMES, irma4.nominal.vector.tolist(), strict=True)
    parameters = {name: {"value": v, "sd": 1e-5, "nominal": v} for name, v in nominal}
    table = {
        "format": "fidim-explanation/1",
        "campaign": "c",
        "verdict": "explained",
        "effects": [
            {
                "id": "gravity-tilt",
                "equivalent_to": ["constant-force"],
                "parameters": {"roll": {"value": 5e-3}, "pitch": {"value": 1e-3}},
            }
        ],
        "where": [],
        "held_out": {"chi2_per_dof": {"before": 9.0, "after": 1.0}, "rms_mm": {"before": 1.0, "after": 0.1}},
        "ranking": [],
        "parameters": parameters,
        "parameters_before": parameters,
        "next_experiment": "Use a spirit level.",
        "message": "m",
        "seconds": 1.0,
    }
    (tmp_path / "explanation.json").write_text(json.dumps(table))
    return AfterOptions(tmp_path / "explanation.json", None, None, 1, tmp_path / "next", None)


@pytest.mark.slow
def test_windows_that_hardly_tell_are_no_plan(explained: AfterOptions, capsys: pytest.CaptureFixture[str]):
    assert after_command(explained) == 1
    assert explained.out is not None
    assert [one.name for one in explained.out.iterdir()] == ["next.json"]
    said = " ".join(capsys.readouterr().out.split())
    assert "Use a spirit level." in said
    assert "no plan.toml: no window" in said
    assert "fidim run" not in said


def test_an_explanation_of_another_campaign_is_refused(explained: AfterOptions):
    explained.after.write_text(explained.after.read_text().replace('"c"', '"anchor moved"'))
    with pytest.raises(SetupError, match=r"is about the campaign 'anchor moved', and .* is 'c'"):
        after_command(explained)


@pytest.mark.parametrize(
    ("criterion", "says"), [(Criterion.C, "does not use a body"), (Criterion.D, "effects in question")]
)
def test_a_criterion_without_a_meaning_is_refused(explained: AfterOptions, criterion: Criterion, says: str):
    with pytest.raises(SetupError, match=says):
        after_command(replace(explained, criterion=criterion))


def test_without_a_campaign_it_says_so(tmp_path: Path):
    (tmp_path / "explanation.json").write_text("{}")
    with pytest.raises(SetupError, match="--campaign"):
        after_command(AfterOptions(tmp_path / "explanation.json", None, None, 1, None, None))


def test_odds_know_what_is_clear():
    assert Odds("x", 40.0, 0.95).clear
    assert not Odds("x", 4.0, 0.2).clear


def test_all_rivals_that_the_recorded_windows_leave_open_are_asked_about(irma4: Robot, trials: list[ProposedTrial]):
    """An explanation names the nearest few; the window that tells from these alone may leave another in the place."""
    faint = completed(KnownRobot(irma4, trials[:2]), Claim("rotational-drag", None, (5e-5,), ("umbilical",)))
    assert faint.rivals == ("umbilical",)
    assert {"swivel-damping", "attachment-friction"} <= set(faint.open)
    assert "umbilical" not in faint.open
    evident = completed(KnownRobot(irma4, trials[:2]), Claim("rotational-drag", None, (0.05,), ("umbilical",)))
    assert not evident.open, "what these windows exclude is no rival"


def test_a_rival_needs_a_size_that_is_possible(irma4: Robot, trials: list[ProposedTrial]):
    """No damping pushes: one that would have to is told from a drag of the other sign by any window."""
    drag = Claim("rotational-drag", None, (5e-4,), ("swivel-damping",))
    pushing = replace(drag, theta=(-5e-4,))
    told, opposite = (
        separating(KnownRobot(irma4, trials[:2]), one, []).before.non_centrality for one in (drag, pushing)
    )
    assert opposite > 10 * told


def test_rivals_that_no_window_excludes_are_set_aside(irma4: Robot, trials: list[ProposedTrial]):
    claim = Claim("gravity-tilt", None, (2e-3, 1e-3), ("constant-force", "frame-misalignment"))
    found = separating(KnownRobot(irma4, trials[:1]), claim, trials[1:6], more=3)
    assert found.separates
    assert found.beyond == ("constant-force",)
    assert found.after[-1].rival == "frame-misalignment"
    assert found.says.endswith("Free motion can hardly separate it from constant-force.")


@pytest.mark.slow
def test_a_claim_without_odds_does_not_hide_the_others(irma4: Robot, trials: list[ProposedTrial]):
    hand = Claim("hand-contact", None, (1.0,), ("constant-force",))
    bias = Claim("cable-length-bias", 2, (5e-3,), ("anchor-offset",))
    none, some = to_separate(campaign_of(irma4, trials[:2]), [hand, bias])
    assert "hand-contact" in none.says
    assert not none.separates
    assert some.separates
    assert some.windows
