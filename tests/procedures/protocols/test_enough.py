"""Recording ends when the plan's accuracy is reached: which windows are left out, and what a real fit says."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from fidim_lab.app import compose
from fidim_lab.data.campaign import write_campaign
from fidim_lab.data.plan_file import read_plan, write_plan
from fidim_lab.data.records import PARAMETER_NAMES, Accuracy, Plan, PlannedWindow, Robot, Role
from fidim_lab.identification import accuracy
from fidim_lab.identification.accuracy import accuracy_of
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.identification.results import result
from procedures.outcomes import Outcome
from procedures.protocols.enough import windows_of
from procedures.steps import GiveUp, Note, Result
from procedures.steps.accuracy import REACHED, CheckAccuracy


def planned(number: int, role: Role) -> PlannedWindow:
    return PlannedWindow(f"w{number}", role, np.ones(4), np.zeros(2), np.zeros(3))


class Recorded:
    attended = True

    def __init__(self) -> None:
        self.ids: list[str] = []

    def window(self, window, at, swinging):
        self.ids.append(window.id)
        yield Note(window=window.id, remark="recorded")
        return at, True


def walked(plan: Plan, answers: list[str], earlier: int = 0) -> tuple[list[str], list[object]]:
    """What was recorded, and the steps; the answers of the looks in turn."""
    recorded, steps = Recorded(), []
    generator = windows_of(plan, recorded, (1.0,) * 4, earlier)
    step = next(generator)
    try:
        while True:
            steps.append(step)
            looks = isinstance(step, CheckAccuracy)
            step = generator.send(Result(answer=answers.pop(0), reason="known") if looks else Result())
    except StopIteration:
        return recorded.ids, steps


@pytest.fixture
def plan() -> Plan:
    roles = [Role.IDENTIFY] * 6 + [Role.VALIDATE] + [Role.IDENTIFY] * 2 + [Role.VALIDATE]
    return Plan("p", tuple(planned(k, role) for k, role in enumerate(roles)), Accuracy(1e-4, 2e-4))


def test_once_known_only_held_out_windows_are_recorded(plan: Plan):
    ids, steps = walked(plan, ["", REACHED])
    assert ids == ["w0", "w1", "w2", "w3", "w4", "w6", "w9"]
    left = [step for step in steps if isinstance(step, GiveUp)]
    assert [step.window for step in left] == ["w5", "w7", "w8"]
    assert all(step.outcome is Outcome.PASS and "not needed" in step.reason for step in left)
    assert len([s for s in steps if isinstance(s, CheckAccuracy)]) == 5 - Accuracy.FEWEST + 1


def test_without_an_accuracy_nothing_is_looked_at(plan: Plan):
    ids, steps = walked(replace(plan, accuracy=None), [])
    assert len(ids) == len(plan.windows)
    assert not [step for step in steps if isinstance(step, CheckAccuracy)]


def test_a_run_that_is_resumed_looks_before_it_records_more(plan: Plan):
    ids, steps = walked(plan, [REACHED], earlier=5)
    assert ids == ["w6", "w9"]
    assert isinstance(steps[0], CheckAccuracy)
    assert walked(plan, ["", "", REACHED], earlier=3)[0] == ["w0", "w1", "w2", "w6", "w9"]


def test_too_few_windows_are_never_enough(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    few = SimpleNamespace(of_role=lambda role: [1, 2, 3])
    monkeypatch.setattr(accuracy, "read_campaign", lambda folder: few)
    known = accuracy_of(tmp_path)
    assert known.problem == "3 windows, 4 are needed"
    assert known.s == float("inf")


def test_plan_files_keep_it(plan: Plan, tmp_path: Path):
    write_plan(tmp_path / "plan.toml", plan)
    assert read_plan(tmp_path / "plan.toml", 4).accuracy == plan.accuracy
    write_plan(tmp_path / "plan.toml", replace(plan, accuracy=None))
    assert read_plan(tmp_path / "plan.toml", 4).accuracy is None


@pytest.mark.slow
def test_a_real_campaign_says_how_well_it_is_known(irma4: Robot, tmp_path: Path):
    plan = random_plan(irma4, "p", 4, 0, 3)
    campaign = compose.simulated_campaign(irma4, plan, irma4.nominal, 1)
    write_campaign(tmp_path, campaign)
    known = accuracy_of(tmp_path)
    assert known.problem == ""
    assert known.windows == 4
    assert 1e-7 < known.s < 1e-3
    assert 1e-7 < known.inertia < 1e-3


def test_what_cannot_be_identified_is_a_problem_and_no_error(tmp_path: Path):
    known = accuracy_of(tmp_path)
    assert known.problem
    assert known.s == float("inf")


def test_a_model_that_does_not_explain_the_recordings_is_never_enough(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    sure = SimpleNamespace(sd=1e-6, spread=None)
    found = SimpleNamespace(outcome=result.ResultOutcome.MISFIT, parameters=dict.fromkeys(PARAMETER_NAMES, sure))
    monkeypatch.setattr(accuracy, "read_campaign", lambda folder: SimpleNamespace(of_role=lambda role: [1, 2, 3, 4]))
    monkeypatch.setattr(accuracy, "identify", lambda *_, **__: found)
    known = accuracy_of(tmp_path)
    assert (known.windows, known.s) == (4, float("inf"))
    assert "does not explain" in known.problem
    found.outcome = result.ResultOutcome.CONVERGED
    assert accuracy_of(tmp_path).s == 1e-6
