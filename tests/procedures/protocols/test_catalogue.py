"""Every procedure can be listed without hardware, runs on the small laboratory, and one's own is a short file."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Role
from fidim_lab.errors import SetupError
from procedures.control import Control, Verb, Word
from procedures.events import StepStarted
from procedures.handlers import HANDLERS
from procedures.outcomes import Outcome
from procedures.protocols.catalogue import CATALOGUE, experiment
from procedures.protocols.excite import ExciteProtocol
from procedures.protocols.identify import WindowProtocol
from procedures.protocols.listing import Outline
from procedures.run import run_procedure
from procedures.settings import ReleaseSettings
from procedures.steps import Result
from procedures.steps.compare import Clarity, Explain
from sim_backends.jumping_loop import run

PAGE = Path(__file__).parents[3] / "docs" / "procedures.md"


def comfortable(lengths):
    return lengths * 0 + 60.0


def plan_for(name, lab):
    """With a window that is held out, or with one window only, where the procedure needs that."""
    if name == "align":
        return replace(lab.plan, windows=lab.plan.windows[:1])
    if not name.startswith("compare"):
        return lab.plan
    first, *others = lab.plan.windows
    return replace(lab.plan, windows=(first, *(replace(window, role=Role.VALIDATE) for window in others)))


def carry_out(name, world, lab, folder, control=None):
    made = experiment(name, plan_for(name, lab), world.robot, world.settings, statics=comfortable)

    async def main():
        return await run_procedure(
            made,
            world.rig,
            folder,
            wall_time=lambda: "2026",
            listeners=(world.hear,),
            control=control,
            handlers={**HANDLERS, Explain: clear},
        )

    return run(main())


async def clear(_stand, _step):
    """Explains in no time."""
    return Result(answer=Clarity.CLEAR)


ELSEWHERE = {"align", "home", "take-up", "commission", "excite", "compare-by-winches"}
"""need drives without power, and physics: see their own tests"""


@pytest.mark.parametrize("name", sorted(set(CATALOGUE) - ELSEWHERE))
def test_each_is_listed_without_hardware_and_runs_as_listed(name, world, lab, tmp_path):
    made = experiment(name, plan_for(name, lab), world.robot, world.settings, statics=comfortable)
    listed = [type(s).__name__ for s in Outline(made.procedure).steps]
    report = carry_out(name, world, lab, tmp_path / "run")
    assert report.outcome.usable, report.reason
    assert [type(e.step).__name__ for e in world.events if isinstance(e, StepStarted)] == listed


@pytest.mark.parametrize("name", sorted(set(CATALOGUE) - {"home", "take-up", "commission"}))
def test_no_winch_moves_before_a_release_has_let_go(name, world, lab, irma4, monkeypatch):
    monkeypatch.setattr(ExciteProtocol, "visit", lambda *_: iter(()))  # excitation is planned elsewhere
    monkeypatch.setattr(ExciteProtocol, "pace", WindowProtocol.pace)
    settings = replace(world.settings, release=ReleaseSettings())
    made = experiment(name, plan_for(name, lab), irma4, settings, statics=comfortable)
    listed = [type(s).__name__ for s in Outline(made.procedure).steps]
    assert listed[:3] == ["Enable", "LetGo", "TryWinches"]
    seen_at_rest = ["Settle"] if name in {"excite", "compare-by-winches"} else []  # nobody is there to see it
    assert listed[3:][: len(seen_at_rest) + 1] == [*seen_at_rest, "MoveTo"]


@pytest.mark.parametrize("role", [Role.IDENTIFY, Role.VALIDATE])
@pytest.mark.parametrize("name", ["compare", "compare-by-winches"])
def test_what_is_judged_on_held_out_windows_refuses_a_plan_without(name, role, world, lab):
    plan = replace(lab.plan, windows=tuple(replace(window, role=role) for window in lab.plan.windows))
    lacking = "validate" if role is Role.IDENTIFY else "identify"
    with pytest.raises(SetupError, match=f"no window of the role {lacking}, which {name} needs"):
        experiment(name, plan, world.robot, world.settings, statics=comfortable)


@pytest.mark.parametrize("name", CATALOGUE)
def test_each_is_on_the_page(name):
    assert f"| `{name}` |" in PAGE.read_text(encoding="utf-8")


def test_windows_of_a_cross_validation_are_held_out(world, lab, tmp_path):
    carry_out("cross-validate", world, lab, tmp_path / "run")
    assert {w.role for w in read_campaign(tmp_path / "run").windows} == {Role.VALIDATE}


def test_a_tension_check_is_listed_in_words_before_there_are_tensions(world, lab, tmp_path):
    made = experiment("tension-check", plan_for("tension-check", lab), world.robot, world.settings, statics=comfortable)
    said = [step.text for step in Outline(made.procedure).steps]
    assert said.count("note the tensions: nothing is recorded here") == 2
    report = carry_out("tension-check", world, lab, tmp_path / "run")
    assert all(row.reason.startswith("tensions ") for row in report.windows)


def test_a_tension_check_says_what_is_wrong_where_and_goes_on(world, lab, tmp_path):
    world.winches[2].tension = 12.0
    report = carry_out("tension-check", world, lab, tmp_path / "run")
    assert [row.outcome for row in report.windows] == [Outcome.FAIL, Outcome.FAIL]
    assert "tension of cable 3 is 12 N" in report.windows[0].reason
    assert all(not winch.commands.count("power_off") for winch in world.winches)


def test_a_place_of_a_tension_check_can_be_skipped(world, lab, tmp_path):
    control = Control()
    world.at("Settle", lambda: control.say(Word(Verb.SKIP, "not here")), after=0.2)
    report = carry_out("tension-check", world, lab, tmp_path / "run", control)
    assert [row.outcome for row in report.windows] == [Outcome.SKIPPED, Outcome.PASS]


@pytest.mark.slow
def test_the_procedure_of_the_page_is_short_and_runs(world, lab, tmp_path):
    code, *_ = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert len(code.splitlines()) < 20
    own = tmp_path / "creep.py"
    own.write_text(code, encoding="utf-8")
    report = carry_out(str(own), world, lab, tmp_path / "run")
    assert [type(e.step).__name__ for e in world.events if isinstance(e, StepStarted)][-1] == "GiveUp"
    assert report.held
    assert (report.exit_code, [row.outcome for row in report.windows]) == (0, [Outcome.PASS, Outcome.PASS])
    assert "mean lengths" in report.windows[0].reason


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (None, "no such Python file"),
        ("x = 1", "no function `procedure"),
        ("1 / 0", "ZeroDivisionError"),
        ("def procedure(lab):\n    return 3", "own.py: procedure: gives 3"),
        ("def procedure(lab):\n    yield 1", "own.py: line 2: yields 1, which is not a step"),
        ("def procedure(lab):\n    x = 2\n    yield lab.nothing", "own.py: line 3: AttributeError: .* 'nothing'"),
        ("import math\ndef procedure(lab):\n    yield math.sqrt(-1.0)", "own.py: line 3: ValueError: math domain"),
    ],
)
def test_what_is_no_procedure_is_told(text, says, world, lab, tmp_path):
    own = tmp_path / "own.py"
    if text is not None:
        own.write_text(text)
    with pytest.raises(SetupError, match=says):
        experiment(str(own), lab.plan, world.robot, statics=comfortable)
    with pytest.raises(SetupError, match="one of identify, "):
        experiment("dance", lab.plan, world.robot, statics=comfortable)
