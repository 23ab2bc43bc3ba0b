"""A mistake in a procedure of somebody's own is told before anything moves, with its file, line and step."""

import re
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from fidim_lab.errors import FidimError, FileError
from procedures.outcomes import Outcome
from procedures.protocols.catalogue import experiment
from procedures.protocols.listing import Outline

OWN = """from procedures.protocols.beginning import begin
from procedures.steps import *
from procedures.outcomes import Outcome; from fidim_lab.data.records import Role

def helper(window):
    yield {step}

def procedure(lab):
    yield from begin(lab.robot.n, lab.settings)
    for window in lab.plan.windows:
        goal = tuple(map(float, window.lengths))
        {line}
        yield GiveUp(window=window.id, outcome=Outcome.PASS, reason="seen")
"""
MOVE = "yield MoveTo(window=window.id, lengths=goal, speed={}, acceleration=0.2, tolerance=1e-3)"
SETTLE = "yield Settle(window=window.id, tolerance={}, over=1.0, timeout=8.0)"
ACCEPT = "yield Accept(window=window.id, attempt=1, role={}, equilibrium=goal, outcome=Outcome.PASS)"
READ = "yield ReadEncoders(window=window.id, lengths={}, tolerance=5e-3, over={})"


def comfortable(lengths):
    return lengths * 0 + 60.0


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (
            "yield Hold(window=window)",
            r"line 12: step \d, Hold: window is a PlannedWindow; its id \('i01', write `.id`\)",
        ),
        ("yield Hold(window='i99')", r"line 12: step \d, Hold: the plan has no window 'i99'; it has i01, "),
        ("yield from helper(window)", r"line 6: step \d, Hold: window is a PlannedWindow"),
        ("Hold(window=window.id)", r"line 12: Hold\(…\) is created but not yielded"),
        ("step = Hold(window=window.id)", r"line 12: Hold\(…\) is created but not yielded"),
        (
            "step = Hold(window=window.id)\n        yield Note(remark=step.reason)",
            r"line 13: .* That is an attribute of its result: write `yield` before Hold\(…\)",
        ),
        ("helper(window)", r"line 12: helper\(…\) is not used, so it does nothing; write `yield from`"),
        ("yield helper(window)", "line 12: .*which is not a step: write `yield from`"),
        (SETTLE.format("'2 mm'"), "tolerance is '2 mm'; a finite number"),
        (SETTLE.format("float('nan')"), "tolerance is nan; a finite"),
        (READ.format("goal", -1.0), "it would take -1 s"),
        (READ.format("goal[:2]", 1.0), "has 2 lengths, the robot"),
        (READ.format("list(goal)", 1.0), "a tuple of finite numbers"),
        (
            MOVE.format(9.0),
            r"own.py: line 12: step \d, window i01, .*speed is 9 m/s, .*",
        ),
        (MOVE.format(-0.1), r"step \d, MoveTo: speed is -0.1; more than 0 is needed"),
        (MOVE.format(0), "speed is 0; more than 0 is needed"),
        ("yield Record(window=window.id, seconds=5.0)", "line 12: .*'seconds'. Record takes window, attempt, duration"),
        ("yield", "line 12: yields None, which is not a step"),
        ("while True:\n            yield Hold(window=window.id)", "line 13: more than 200000 steps without an end"),
        (ACCEPT.format("Role.IDENTIFY"), r"line 12: step \d, Accept: nothing of window i01 was recorded; yield Record"),
        (
            ACCEPT.format("'identify'"),
            r"role is 'identify'; one of Role.IDENTIFY, .* \(fidim_lab.data.records\) is needed",
        ),
        ("yield Note(window=window.id, remark='')\n        continue", "procedure: leaves i01, .* without a verdict"),
    ],
)
def test_a_mistake_is_told_before_anything_moves(line, says, world, lab, tmp_path):
    own = tmp_path / "own.py"
    own.write_text(OWN.format(line=line, step="Hold(window=window)"), encoding="utf-8")
    settings = replace(world.settings, motion=replace(world.settings.motion, highest_speed=0.4))
    with pytest.raises(FidimError, match=says):
        experiment(str(own), lab.plan, world.robot, settings, statics=comfortable)


@pytest.mark.parametrize(
    "line",
    ["pass", MOVE.format(0.3), "yield Stop(outcome=Outcome.FAIL, reason='')", "yield from helper(window)"],
)
def test_one_without_a_mistake_is_listed(line, world, lab, tmp_path):
    own = tmp_path / "own.py"
    own.write_text(OWN.format(line=line, step="Hold(window=window.id)"), encoding="utf-8")
    made = experiment(str(own), lab.plan, world.robot, world.settings, statics=comfortable)
    assert Outline(made.procedure).steps


READ_LATE = READ.replace("yield ReadEncoders", "seen = yield ReadEncoders") + "\n        {use}"


@pytest.mark.parametrize(
    ("use", "file", "says"),
    [
        ("seen.values and seen.values[9]", "own.py", r"line 13: IndexError: tuple index out of range"),
        ("mean(seen.values)", "figures.py", r"line 2: TypeError: "),
        (
            "seen.values and (" + MOVE.format(9.0) + ")",
            "own.py",
            r"line 13: step \d+, window i01, move .*: speed is 9 m/s, the rig's winches may do up to 0.4 m/s",
        ),
        ("seen.values and (yield Settle(window=window))", "own.py", r"line 13: TypeError: Settle"),
        ("seen.values and (yield Hold(window='i99'))", "own.py", r"line 13: step \d+, Hold: the plan has no window"),
    ],
)
def test_a_mistake_that_only_the_run_meets_is_bad_input_of_its_file(use, file, says, world, lab, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "figures", raising=False)
    figures = "def mean(values):\n    return values and sum(values) / str(len(values))\n"
    (tmp_path / "figures.py").write_text(figures, encoding="utf-8")
    own = tmp_path / "own.py"
    text = OWN.format(line=READ_LATE.format("goal", 1.0, use=use), step="Hold(window=window.id)")
    own.write_text(text.replace("from procedures.outcomes", "from figures import *; from procedures.outcomes"))
    world.settings = replace(world.settings, motion=replace(world.settings.motion, highest_speed=0.4))
    report = world.run(lab.one, tmp_path / "run", procedure=str(own))
    assert report.exit_code == 2, report.reason
    assert report.outcome is Outcome.ERROR
    assert report.held
    assert re.match(re.escape(str(tmp_path / file)) + ": " + says, report.reason)


def test_a_mistake_in_what_it_imports_is_told_of_that_file(world, lab, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "wrong_figures.py").write_text("\nfactor = 1 / 0\n", encoding="utf-8")
    own = tmp_path / "own.py"
    own.write_text("import wrong_figures\n", encoding="utf-8")
    with pytest.raises(FileError, match=r"wrong_figures.py: line 2: cannot be imported: ZeroDivisionError"):
        experiment(str(own), lab.plan, world.robot, world.settings, statics=comfortable)
    own.write_text("def procedure(lab)\n", encoding="utf-8")
    with pytest.raises(FileError, match=r"own.py: line 1: cannot be imported: SyntaxError"):
        experiment(str(own), lab.plan, world.robot, world.settings, statics=comfortable)


PAGE = (Path(__file__).parents[3] / "docs" / "procedures.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("shown", re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL))
def test_what_the_docs_show_is_a_procedure(shown, world, lab, tmp_path):
    own = tmp_path / "shown.py"
    own.write_text(shown, encoding="utf-8")
    made = experiment(str(own), lab.plan, world.robot, world.settings, statics=comfortable)
    assert {step.window for step in Outline(made.procedure).steps} >= {window.id for window in lab.plan.windows}
