"""Whether what a session has recorded is explained, and which window is proposed; `compare` end to end."""

import asyncio
import json
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from drivers.clock import LoopClock
from fidim_lab.app import compose
from fidim_lab.app.judging import judgement
from fidim_lab.app.judging.judgement import EXPLANATION, JUDGEMENT, Judgement, judge, main, why_unclear
from fidim_lab.app.service.process.judging import explain_step
from fidim_lab.data.campaign import read_campaign, write_campaign
from fidim_lab.data.records import PARAMETER_NAMES
from fidim_lab.data.robot_file import write_robot
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.design.next_window import NextWindow
from fidim_lab.identification.random_plan import Taste, random_plan
from fidim_lab.mismatch.conclusion.explanation import BodyParameter, Explanation, NamedCause, Verdict
from fidim_lab.mismatch.conclusion.parts import Before, EffectParameter
from fidim_lab.mismatch.next_experiment.proposal import Odds, Proposal, ProposedTrial
from procedures.handlers import HANDLERS
from procedures.outcomes import Outcome
from procedures.protocols.catalogue import experiment
from procedures.protocols.compare import FURTHER
from procedures.run import run_procedure
from procedures.settings import MotionSettings, Settings
from procedures.steps import Result
from procedures.steps.compare import Clarity, Explain
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign

Z = (1.33, 1.97, 1.68, 0.76, 0.02, -0.01)
BIAS = NamedCause("cable-length-bias", 2, ("anchor-offset",), {"bias": EffectParameter(1e-3, 1e-5, "m")}, "")
TILT = NamedCause("gravity-tilt", None, ("constant-force",), {"rx": EffectParameter(1e-3, 1e-5, "rad")}, "")


@pytest.fixture(scope="module")
def campaign(irma4):
    plan = random_plan(irma4, "c", 2, 1, 5)
    world = make_world(irma4, np.random.default_rng(5), ())
    return simulate_campaign(irma4, plan, world, np.random.default_rng(6), recording=Sampling(1.0))[0]


@pytest.fixture
def folder(campaign, tmp_path):
    write_robot(tmp_path / "robot.toml", campaign.robot)
    write_campaign(tmp_path, campaign)
    return tmp_path


def explanation(verdict, *effects, advice=None):
    body = {name: BodyParameter(0.01, 1e-5, 0.01) for name in PARAMETER_NAMES}
    figures = Before(4.0, 4.0), Before(1.0, 1.0)
    return Explanation("c", verdict, effects, (), *figures, (), body, body, advice, "As it is.", 1.0)


def proposal(claim, probability, markers=1, windows=2):
    trial = ProposedTrial(np.array(Z[:4]), np.array(Z[4:]), None)
    odds = tuple(Odds(claim.rivals[0], 1.0, probability) for _ in range(windows))
    return Proposal(claim, (trial,) * windows, Odds(claim.rivals[0], 0.0, 0.0), odds, markers)


def judged(monkeypatch, folder, found, separate=None, know=None, number=1):
    """`judge` with an explanation and proposals that are given; what it asked for."""
    asked = []

    def to_separate(_campaign, claims, _body, **options):
        asked.append(([claim.id for claim in claims], options))
        return tuple(separate(claim, options) for claim in claims)

    def to_know(*_, **options):
        asked.append(("body", options))
        return know()

    monkeypatch.setattr(judgement, "explain", lambda _: found)
    monkeypatch.setattr(judgement, "to_separate", to_separate)
    monkeypatch.setattr(judgement, "to_know", to_know)
    return judge(folder, number, ((0.3, 3.5),) * 4), asked


@pytest.mark.parametrize("verdict", [Verdict.NOTHING_MISSING, Verdict.EXPLAINED, Verdict.SENSOR_FAULT])
def test_a_verdict_that_stands_is_clear(monkeypatch, folder, verdict):
    found, asked = judged(monkeypatch, folder, explanation(verdict, replace(BIAS, equivalent_to=())))
    assert (found.clarity, found.window, asked) == (Clarity.CLEAR, (), [])
    assert found.says == f"{verdict.value}: As it is."
    assert json.loads((folder / EXPLANATION).read_text())["verdict"] == verdict.value


def test_a_class_of_effects_asks_for_the_window_that_separates_it(monkeypatch, folder, campaign):
    found, asked = judged(monkeypatch, folder, explanation(Verdict.EXPLAINED, BIAS), lambda c, _: proposal(c, 0.8))
    assert found.clarity is Clarity.UNCLEAR
    assert found.window[:6] == pytest.approx(Z)
    assert len(found.window) == campaign.robot.n + 5
    assert "cannot separate cable-length-bias from anchor-offset. 2 more windows, this one and later ones" in found.says
    assert "in 80 % of cases" in found.says
    ((ids, options),) = asked
    assert ids == ["cable-length-bias"]
    assert (options["noise"], options["more"], options["more_markers"]) == (2.0, len(FURTHER), False)
    assert options["reach"] == ((0.3, 3.5),) * 4


def test_as_many_windows_are_planned_as_are_left(monkeypatch, folder):
    _, asked = judged(monkeypatch, folder, explanation(Verdict.EXPLAINED, BIAS), lambda c, _: proposal(c, 0.8), None, 4)
    assert [options["more"] for _, options in asked] == [1]


def test_the_claim_with_the_best_odds_comes_first(monkeypatch, folder):
    odds = {"gravity-tilt": 0.01, "cable-length-bias": 0.9}
    found, _ = judged(
        monkeypatch, folder, explanation(Verdict.EXPLAINED, TILT, BIAS), lambda c, _: proposal(c, odds[c.id])
    )
    assert "separate cable-length-bias from anchor-offset in 90 %" in found.says


def test_what_no_window_separates_ends_it_and_says_what_a_person_could_do(monkeypatch, folder):
    found, asked = judged(
        monkeypatch,
        folder,
        explanation(Verdict.EXPLAINED, TILT, advice="Carry a known payload."),
        lambda c, options: proposal(c, 0.1, 3 if options["more_markers"] else 1),
    )
    assert (found.clarity, found.window) == (Clarity.STUCK, ())
    assert [options["more_markers"] for _, options in asked] == [False, True]
    assert "with 3 markers on the platform" in found.says
    assert found.says.endswith("free motion can hardly separate them. Carry a known payload.")


def test_without_a_name_the_body_is_asked_for(monkeypatch, folder):
    sd = np.full(9, 1e-4)
    after = sd * np.array([1, 1, 1, 1, 1, 0.4, 1, 1, 1])
    found, asked = judged(
        monkeypatch,
        folder,
        explanation(Verdict.UNKNOWN_PHYSICS),
        know=lambda: NextWindow(np.array(Z), sd, after),
        number=3,
    )
    assert found.clarity is Clarity.UNCLEAR
    assert found.says == "As it is. The next window is chosen for I_zz: its sd falls to 40 %."
    assert asked == [("body", {"seed": 3, "reach": ((0.3, 3.5),) * 4})]


def test_a_window_that_would_tell_nothing_is_not_recorded(monkeypatch, folder):
    sd = np.full(9, 1e-4)
    found, _ = judged(
        monkeypatch,
        folder,
        explanation(Verdict.UNKNOWN_PHYSICS, advice="Half the displacement."),
        know=lambda: NextWindow(np.array(Z), sd, 0.99 * sd),
    )
    assert found.clarity is Clarity.STUCK
    no_use = "No window within the limits would improve the accuracy of the body."
    assert found.says == f"As it is. {no_use} Half the displacement."


def test_where_nothing_can_be_proposed_the_reason_is_said(monkeypatch, folder):
    def refuse():
        raise InfeasibleError("No window is within the winches' limits.")

    found, _ = judged(monkeypatch, folder, explanation(Verdict.PARTLY_EXPLAINED), know=refuse)
    assert found.clarity is Clarity.STUCK
    assert found.says.endswith("No further window could be proposed: No window is within the winches' limits.")


def test_both_are_said_where_something_remains_beside_a_class():
    assert why_unclear(explanation(Verdict.PARTLY_EXPLAINED, BIAS)) == (
        "As it is. The data cannot separate cable-length-bias from anchor-offset."
    )


def test_the_process_says_on_standard_error_why_there_is_no_judgement(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(judgement.os, "nice", lambda _: 0)
    assert main([str(tmp_path), "2", "null"]) == 2
    assert "campaign.toml" in capsys.readouterr().err
    assert not (tmp_path / JUDGEMENT).exists()


def recorded(world, plan, robot, folder, seed, explained, name="compare"):
    """A procedure on simulated drives and cameras, in time that jumps."""

    async def explain_here(stand, step):
        found = judge(stand.folder.path, step.number, stand.settings.motion.length_limits)
        explained.append(found)
        return Result(reason=found.says, answer=found.clarity, values=found.window)

    settings = Settings(motion=MotionSettings(length_limits=compose.length_limits(plan)))
    made = experiment(name, plan, robot, settings)

    async def work():
        async with compose.simulated_rig(robot, plan, world, seed, real_time=False) as simulated:
            handlers = {**HANDLERS, Explain: explain_here}
            return await run_procedure(made, simulated.rig, folder, wall_time=lambda: "2026", handlers=handlers)

    return compose.run_loop(work(), real_time=False)


@pytest.mark.slow
def test_a_hidden_cause_that_two_windows_leave_open_gets_clear(irma4, tmp_path):
    """A cable 1 mm longer than its encoder says: an anchor that is elsewhere would do the same in two windows."""
    world = compose.simulated_world(irma4, 5, ("cable-length-bias:cable=2,bias=0.001",))
    plan, explained = random_plan(irma4, "c", 2, 3, 5), []
    report = recorded(world, plan, irma4, tmp_path / "run", 5, explained)
    assert report.outcome.usable, report.reason
    assert any("cannot separate cable-length-bias from anchor-offset" in found.says for found in explained[:-1])
    assert [found.clarity for found in explained[:-1]] == [Clarity.UNCLEAR] * (len(explained) - 1)
    assert explained[-1].clarity is Clarity.CLEAR
    assert len(explained) > 1
    assert [window.id for window in read_campaign(tmp_path / "run").windows][5:] == list(FURTHER[: len(explained) - 1])
    told = json.loads((tmp_path / "run" / EXPLANATION).read_text())
    (cause,) = told["effects"]
    assert (cause["id"], cause["cable"], cause["equivalent_to"]) == ("cable-length-bias", 2, [])
    assert abs(cause["parameters"]["bias"]["value"]) == pytest.approx(1e-3, rel=0.1)


@pytest.mark.slow
def test_without_a_hand_it_goes_the_same_way(irma4, tmp_path, monkeypatch):
    """The first look is told that all is open; the window that it proposes is excited by the winches."""
    world = compose.simulated_world(irma4, 5, ("rotational-drag:c=0.02",))
    plan = random_plan(irma4, "c", 2, 1, 1, Taste(taut=1.0, tight=1.0))
    looks = []

    def known(folder, number, reach):
        looks.append((read_campaign(folder).windows[-1].id, reach is not None))
        z = plan.windows[0]
        if number == 1:
            return Judgement(Clarity.UNCLEAR, "open", (*z.lengths, *z.displacement, *z.position))
        return Judgement(Clarity.CLEAR, "explained")

    monkeypatch.setattr(sys.modules[__name__], "judge", known)
    report = recorded(world, plan, irma4, tmp_path / "run", 1, [], "compare-by-winches")
    assert report.outcome.usable, report.reason
    assert looks == [(plan.windows[-1].id, True), ("more1", True)]
    assert report.windows[-1].id == "more1"
    lines = (tmp_path / "run" / "journal.jsonl").read_text().splitlines()
    assert not [line for line in lines if json.loads(line).get("step") == "Ask"]


@pytest.mark.slow
def test_the_service_has_it_judged_by_a_process_beside_the_held_robot(folder):
    told = []
    stand = SimpleNamespace(
        folder=SimpleNamespace(path=folder),
        rig=SimpleNamespace(clock=LoopClock()),
        settings=Settings(),
        progress=told.append,
    )
    result = asyncio.run(explain_step(stand, Explain(number=1, estimate=30.0)))
    assert result.outcome.usable, result.reason
    assert result.answer in tuple(Clarity)
    assert json.loads((folder / JUDGEMENT).read_text())["says"] == result.reason
    assert told[0] < told[-1]
    (folder / "campaign.toml").write_text("no campaign")
    result = asyncio.run(explain_step(stand, Explain(number=2, estimate=30.0)))
    assert (result.outcome, result.answer) == (Outcome.FAIL, Clarity.STUCK)
    assert "could not be explained" in result.reason
    assert "campaign.toml" in result.reason
