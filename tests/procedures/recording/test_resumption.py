"""Runs that were cut off at any moment go on: finished windows stay, the open one is recorded again."""

import shutil
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Role
from fidim_lab.errors import RefusedError, SetupError
from procedures.control import Control, Verb, Word
from procedures.events import StepStarted
from procedures.outcomes import Outcome
from procedures.protocols import catalogue
from procedures.recording.journal import LineKind, read_journal
from procedures.recording.resumption import NEAR, LastPlace, read_resumption
from procedures.run import run_procedure
from sim_backends.jumping_loop import run

ROLES = {"i01": Role.IDENTIFY, "i02": Role.IDENTIFY}


def resumed(world, lab, folder, *, accept_place=False):
    """Goes on in `folder` with a new world, whose robot is where the journal says."""
    resumption = read_resumption(folder, ROLES)
    if resumption.place is not None:
        for winch, length in zip(world.winches, resumption.place.end, strict=True):
            winch._from = winch._to = length
    if accept_place:
        resumption = replace(resumption, place=None)
    experiment = catalogue.experiment(
        "identify", lab.plan, world.robot, world.settings, statics=lambda v: v * 0 + 60.0, resumption=resumption
    )

    async def main():
        return await run_procedure(
            experiment,
            world.rig,
            folder,
            wall_time=lambda: "2026-01-01T00:00:00Z",
            listeners=(world.hear,),
            resumption=resumption,
        )

    return run(main())


def copies(world, lab, tmp_path):
    """The folder as a power cut at the begin of each step would have left it."""
    folder, found = tmp_path / "run", []

    def copy(event):
        if isinstance(event, StepStarted):
            to = tmp_path / f"cut-{len(found):02d}-{type(event.step).__name__}"
            shutil.copytree(folder, to)
            found.append(to)

    world.run(lab.plan, folder, listeners=(world.hear, copy))
    return found


@pytest.mark.parametrize("every", [pytest.param(1, marks=pytest.mark.slow), 7])
def test_cut_off_at_the_begin_of_any_step_it_goes_on_to_the_whole_campaign(every, world, lab, tmp_path):
    cuts = copies(world, lab, tmp_path)
    assert len(cuts) > 20
    for cut in cuts[2::every]:
        before = {f.name: f.read_bytes() for f in (cut / "windows").glob("*.csv")}
        kept = set(read_resumption(cut, ROLES).rows)
        again = lab.make_world()
        report = resumed(again, lab, cut)
        assert report.outcome.usable, (cut.name, report.reason)
        assert [w.id for w in read_campaign(cut).windows] == ["i01", "i02"], cut.name
        assert {len(w.t) for w in read_campaign(cut).windows} == {1001}
        for name, data in before.items():
            if name.removesuffix(".csv") in kept:
                assert (cut / "windows" / name).read_bytes() == data, "a finished window stays as it is"
        recorded = {e.step.window for e in again.events if isinstance(e, StepStarted) and e.step.window}
        assert recorded.isdisjoint(kept)
        assert [e.kind for e in read_journal(cut / "journal.jsonl")].count(LineKind.CONTINUED) == 1
        assert not list((cut / "windows").glob("*.part"))


def test_a_question_that_was_open_is_asked_again_before_the_first_move(world, lab, tmp_path):
    """“The platform still swings” was passed over by a resume, which moved."""
    found = copies(world, lab, tmp_path)
    still = [cut for cut in found if "still swings" in read_journal(cut / "journal.jsonl")[-1].text]
    rest = [cut for cut in found if cut.name.endswith("Hold") and not read_resumption(cut, ROLES).swings]
    assert still
    assert rest
    for cut, asks in ((still[-1], True), (rest[-1], False)):
        number = len(read_journal(cut / "journal.jsonl"))
        assert read_resumption(cut, ROLES).swings is asks
        assert resumed(lab.make_world(), lab, cut).outcome is Outcome.PASS
        new = [entry for entry in read_journal(cut / "journal.jsonl")[number:] if entry.kind is LineKind.STEP_STARTED]
        before = [entry.text for entry in new[: [entry.step for entry in new].index("MoveTo")]]
        assert any("still swings" in text for text in before) is asks


def test_a_torn_journal_line_is_cut_off_and_the_run_goes_on(world, lab, tmp_path):
    cut = next(c for c in copies(world, lab, tmp_path) if "Record" in c.name)
    with (cut / "journal.jsonl").open("ab") as journal:
        journal.write(b'{"number": 99, "t": 3.0, "wal')
    assert resumed(lab.make_world(), lab, cut).outcome is Outcome.PASS


def test_only_kept_windows_to_identify_from_count_as_recorded(world, lab, tmp_path):
    first, second = lab.plan.windows
    windows = (first, replace(second, role=Role.VALIDATE), replace(second, id="i03"))
    control = Control()
    world.at("Ask", lambda: control.say(Word(Verb.SKIP, "no")), after=0.1)
    world.run(replace(lab.plan, windows=windows), tmp_path / "run", control=control)
    found = read_resumption(tmp_path / "run", {window.id: window.role for window in windows})
    assert sorted(found.rows) == ["i01", "i02", "i03"]
    assert found.recorded == 1


def test_what_was_skipped_stays_skipped_and_nothing_left_is_refused(world, lab, tmp_path):
    control = Control()
    world.at("Ask", lambda: control.say(Word(Verb.SKIP, "no")), after=0.1)
    world.at("Record", lambda: control.say(Word(Verb.ABORT, "lunch")), after=1.0)
    assert world.run(lab.plan, tmp_path / "run", control=control).outcome is Outcome.ABORTED
    report = resumed(lab.make_world(), lab, tmp_path / "run")
    assert [(row.id, row.outcome) for row in report.windows] == [("i01", Outcome.SKIPPED), ("i02", Outcome.PASS)]
    assert report.windows[1].attempts == 2, "numbers go on, so that no file is overwritten"
    kept = {f.name for f in (tmp_path / "run" / "rejected").glob("*.csv")}
    assert kept == {"i02-attempt1.csv"}
    with pytest.raises(RefusedError, match="nothing to resume"):
        resumed(lab.make_world(), lab, tmp_path / "run")


def test_nothing_moves_where_the_robot_is_not_where_the_journal_left_it(lab, tmp_path):
    cut = next(c for c in copies(lab.make_world(), lab, tmp_path) if "Record" in c.name)
    moved = lab.make_world()
    resumption = read_resumption(cut, ROLES)
    experiment = catalogue.experiment(
        "identify", lab.plan, moved.robot, moved.settings, statics=lambda v: v * 0 + 60.0, resumption=resumption
    )

    async def main():
        rig = moved.rig  # its robot is at 1.4 m, the journal has it at 1.5 m
        return await run_procedure(experiment, rig, cut, wall_time=lambda: "2026", resumption=resumption)

    report = run(main())
    assert report.outcome is Outcome.ERROR
    assert "cable 1 is 1.4000 m long, -100.0 mm from where the journal left it" in report.reason
    assert all({"enable", "move_to"}.isdisjoint(winch.commands) for winch in moved.winches), "not even powered"
    assert resumed(lab.make_world(), lab, cut, accept_place=True).outcome is Outcome.PASS


def test_encoders_that_fit_do_not_hide_a_platform_that_hangs_elsewhere(lab, tmp_path):
    cut = next(c for c in copies(lab.make_world(), lab, tmp_path) if "Record" in c.name)
    world = lab.make_world()
    there = read_resumption(cut, ROLES).place.marker
    assert there == pytest.approx(world.marker(0), abs=0.05)
    world.marker = lambda number: (there[0] + 0.4, *there[1:])
    report = resumed(world, lab, cut)
    assert report.outcome is Outcome.ERROR
    assert "the main marker is at" in report.reason
    assert "400 mm from" in report.reason
    assert all({"enable", "move_to"}.isdisjoint(winch.commands) for winch in world.winches)


@pytest.mark.parametrize(
    ("marker", "says"),
    [((0.0, 0.0, -0.059), ""), ((0.0, 0.0, -0.061), "61 mm from (0.000, 0.000, 0.000) m"), (None, "")],
)
def test_a_marker_may_swing_and_may_be_hidden(marker, says):
    place = LastPlace((1.0,), (1.0,), (0.0, 0.0, 0.0))
    said = place.marker_wrong(marker, 0.01)
    assert bool(said) == bool(says)
    assert says in said
    assert LastPlace((1.0,), (1.5,), (0.0, 0.0, 0.0)).marker_wrong((9.0, 9.0, 9.0), 0.01) == "", "it was on its way"


def test_a_folder_without_a_run_is_wrong_use(tmp_path):
    with pytest.raises(SetupError, match="no run has begun here"):
        read_resumption(tmp_path, ROLES)


lengths = st.tuples(*[st.floats(0.5, 3.0)] * 4)


@given(lengths, lengths, st.floats(0.0, 1.0))
def test_anywhere_on_the_way_is_right_and_off_it_is_not(start, end, part):
    place = LastPlace(start, end)
    here = tuple(a + part * (b - a) for a, b in zip(start, end, strict=True))
    assert place.wrong(here) == ""
    assert LastPlace(end, end).wrong(end) == ""
    beyond = (end[0] + 2 * NEAR, *end[1:])
    assert "cable 1" in LastPlace(end, end).wrong(beyond)
