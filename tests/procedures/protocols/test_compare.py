"""Record, explain, record where it tells most: until it is clear, or known why it cannot be."""

from dataclasses import replace

import pytest

from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Role
from procedures.handlers import HANDLERS
from procedures.outcomes import Outcome
from procedures.protocols.compare import FURTHER, compare, proposed
from procedures.protocols.experiment import checked_experiment
from procedures.recording.resumption import read_resumption
from procedures.run import run_procedure
from procedures.steps import Result
from procedures.steps.compare import Clarity, Explain
from sim_backends.jumping_loop import run


def explained(answers):
    """A handler that answers one after the other."""
    left = list(answers)

    async def handler(_stand, _step):
        return left.pop(0)

    return handler


def there(lab):
    window = lab.plan.windows[0]
    return (*map(float, window.lengths), *map(float, window.displacement), *map(float, window.position))


def go(world, lab, folder, answers, done=frozenset(), resumption=None):
    def make(made):
        return compare(replace(made, done=done))

    experiment = checked_experiment(
        make, lab.plan, world.robot, world.settings, statics=lambda v: v * 0 + 60.0, resumption=resumption
    )
    handlers = {**HANDLERS, Explain: explained(answers)}

    async def main():
        return await run_procedure(
            experiment,
            world.rig,
            folder,
            wall_time=lambda: "2026",
            listeners=(world.hear,),
            handlers=handlers,
            resumption=resumption,
        )

    return run(main())


def test_a_clear_verdict_ends_it(world, lab, tmp_path):
    report = go(
        world, lab, tmp_path / "run", [Result(answer=Clarity.CLEAR, reason="nothing-missing: all is explained")]
    )
    assert (report.outcome, report.held) == (Outcome.PASS, True)
    assert [row.id for row in report.windows] == ["i01", "i02"]
    assert "nothing-missing" in (tmp_path / "run" / "journal.jsonl").read_text()


def test_an_unclear_one_asks_for_the_window_that_tells_most(world, lab, tmp_path):
    more = Result(answer=Clarity.UNCLEAR, reason="for I_yz", values=there(lab))
    report = go(world, lab, tmp_path / "run", [more, Result(answer=Clarity.CLEAR)])
    assert report.outcome is Outcome.PASS
    assert [(row.id, row.role) for row in report.windows] == [
        ("i01", Role.IDENTIFY),
        ("i02", Role.IDENTIFY),
        (FURTHER[0], Role.IDENTIFY),
    ]
    assert [window.id for window in read_campaign(tmp_path / "run").windows] == ["i01", "i02", FURTHER[0]]


def test_it_ends_and_says_so_where_windows_do_not_help(world, lab, tmp_path):
    stuck = Result(answer=Clarity.STUCK, reason="Nothing of the catalogue fits.")
    report = go(world, lab, tmp_path / "run", [stuck])
    assert (report.outcome, report.exit_code, report.held) == (Outcome.FAIL, 1, True)
    assert "The verdict is not clear: Nothing of the catalogue fits." in report.reason


def test_it_does_not_go_on_for_ever(world, lab, tmp_path):
    more = Result(answer=Clarity.UNCLEAR, reason="for I_yz", values=there(lab))
    report = go(world, lab, tmp_path / "run", [more] * 9)
    assert report.outcome is Outcome.FAIL
    assert "4 further windows have been recorded" in report.reason
    assert len(report.accepted) == 2 + len(FURTHER)


def test_a_resumed_one_explains_and_goes_on_where_it_was(world, lab, tmp_path):
    more = Result(answer=Clarity.UNCLEAR, reason="for I_yz", values=there(lab))
    go(world, lab, tmp_path / "run", [more, Result(answer=Clarity.STUCK, reason="enough for today")])
    roles = {"i01": Role.IDENTIFY, "i02": Role.IDENTIFY}
    known = replace(read_resumption(tmp_path / "run", roles), goes_on=True, place=None)
    assert set(known.rows) == {"i01", "i02", FURTHER[0]}
    again = lab.make_world()
    report = go(again, lab, tmp_path / "run", [more, Result(answer=Clarity.CLEAR)], frozenset(known.rows), known)
    assert report.outcome is Outcome.PASS
    assert [row.id for row in report.accepted] == ["i01", "i02", *FURTHER[:2]]


def test_a_proposal_is_a_window(lab):
    window = proposed("more1", 4, there(lab))
    assert window.lengths.tolist() == pytest.approx(lab.plan.windows[0].lengths.tolist())
    assert len(window.displacement) == 2
    assert len(window.position) == 3
