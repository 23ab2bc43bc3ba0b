"""A whole run on the small laboratory: the happy path, and what it leaves on the disk."""

import itertools

import pytest

from drivers.ports import PromptKind
from fidim_lab.data.campaign import read_campaign
from fidim_lab.errors import InfeasibleError, SetupError
from procedures.events import Prompted, RunFinished, StepFinished, StepProgress, StepStarted, WindowFinished
from procedures.outcomes import Outcome
from procedures.recording.journal import LineKind, read_journal


def test_the_happy_path_gives_a_campaign(world, lab, tmp_path):
    report = world.run(lab.plan, tmp_path / "run")
    assert report.outcome is Outcome.PASS, report.reason
    assert report.exit_code == 0
    assert report.held
    assert report.held_says == "All winches stand still, held."
    assert [row.id for row in report.accepted] == ["i01", "i02"]
    campaign = read_campaign(tmp_path / "run")
    for window in campaign.windows:
        assert len(window.t) == 1001
        assert window.t[-1] == pytest.approx(10.0)
        assert not (window.markers != window.markers).any()
        assert window.equilibrium == pytest.approx([1.2, -0.2, -0.3], abs=1e-4)
        assert window.currents.mean() * 34.0 == pytest.approx(60.0, abs=1.0)
    assert campaign.windows[1].lengths[0] == pytest.approx([1.5, 1.45, 1.4, 1.4], abs=1e-6)
    assert not list((tmp_path / "run").rglob("*.part"))


def test_the_order_of_steps_is_the_protocol(world, lab, tmp_path):
    world.run(lab.one, tmp_path / "run")
    steps = [type(e.step).__name__ for e in world.events if isinstance(e, StepStarted)]
    assert steps == [
        "Enable",
        "TryWinches",
        "MoveTo",
        "Settle",
        "Hold",
        "ReadEncoders",
        "CheckTension",
        "ComparePlace",
        "Ask",
        "AwaitHandsOff",
        "Record",
        "CheckWindow",
        "Accept",
    ]


def test_the_same_run_twice_is_the_same_to_the_byte(lab, tmp_path):
    for name in ("a", "b"):
        lab.make_world().run(lab.plan, tmp_path / name)
    files = sorted(p.relative_to(tmp_path / "a") for p in (tmp_path / "a").rglob("*") if p.is_file())
    assert len(files) == 7  # a window is a .csv and a .mcap
    for file in files:
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes(), file


def test_the_journal_has_every_step_with_its_measurements(world, lab, tmp_path):
    world.run(lab.one, tmp_path / "run")
    entries = read_journal(tmp_path / "run" / "journal.jsonl")
    assert [e.number for e in entries] == list(range(1, len(entries) + 1))
    assert [e.kind for e in entries][-2:] == [LineKind.HELD, LineKind.RUN_FINISHED]
    tension = next(e for e in entries if e.kind is LineKind.STEP_FINISHED and e.step == "CheckTension")
    assert tension.data["values"] == pytest.approx([60.0] * 4, abs=0.1)
    assert {m["outcome"] for m in tension.data["measurements"]} == {"pass"}
    assert all(e.t >= 0 and e.wall == "2026-01-01T00:00:00Z" for e in entries)


def test_listeners_hear_progress_with_a_falling_time_left(world, lab, tmp_path):
    report = world.run(lab.plan, tmp_path / "run")
    assert [e.window for e in world.events if isinstance(e, WindowFinished)] == ["i01", "i02"]
    assert sum(isinstance(e, Prompted) for e in world.events) == 3  # two displacements, one steadying
    progress = [e for e in world.events if isinstance(e, StepProgress) and type(e.step).__name__ == "Record"]
    assert len(progress) == pytest.approx(200, abs=25)
    assert all(0 <= e.fraction <= 1 for e in progress)
    left = [e.left for e in world.events if isinstance(e, StepFinished)]
    assert left[-1] == 0.0
    assert all(b <= a + 5.0 for a, b in itertools.pairwise(left)), "it falls, but for what slow steps have taught"
    assert isinstance(world.events[-1], RunFinished)
    assert world.events[-1].report == report


def test_a_listener_that_raises_disturbs_nothing_and_the_report_says_so(world, lab, tmp_path):
    heard = []

    def broken(event):
        heard.append(event)
        raise ValueError("a bug in a view")

    report = world.run(lab.one, tmp_path / "run", listeners=(broken, world.hear))
    assert report.outcome is Outcome.PASS
    assert isinstance(heard[-1], RunFinished), "the end reaches it all the same"
    assert report.reason.endswith("which is a bug of fidim-lab: ValueError: a bug in a view.")


def test_all_winches_arrive_together(world, lab, tmp_path):
    speeds = []
    for winch in world.winches:
        move = winch.move_to

        async def moved(length, speed, acceleration, move=move):
            speeds.append(speed)
            await move(length, speed, acceleration)

        winch.move_to = moved
    world.run(lab.make_plan([(1.5, 1.45, 1.4, 1.38)]), tmp_path / "run")
    assert speeds == pytest.approx([0.1, 0.05, 0.001, 0.02])


def test_a_folder_with_something_in_it_is_never_overwritten(world, lab, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(SetupError, match="the folder is not empty"):
        world.run(lab.one, tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["notes.txt"]
    assert not world.winches[0].commands


def test_a_plan_outside_the_limits_is_refused_before_anything_is_commanded(world, lab, tmp_path, monkeypatch):
    def statics(lengths):
        return [60.0, 60.0, 12.5 if lengths[0] > 1.45 else 60.0, 60.0]

    monkeypatch.setitem(type(world).carry_out.__globals__, "comfortable", statics)
    with pytest.raises(InfeasibleError, match=r"window i01.*cable 3 would have 12\.5 N.*20 to 200 N"):
        world.run(lab.plan, tmp_path / "run")
    assert not world.winches[0].commands
    assert not (tmp_path / "run").exists()


def test_the_operator_may_skip_a_window(world, lab, tmp_path):
    world.operator.answers[PromptKind.DISPLACE_AND_RELEASE] = "skip"
    report = world.run(lab.plan, tmp_path / "run")
    assert report.outcome is Outcome.SKIPPED
    assert report.exit_code == 1
    assert [row.outcome for row in report.windows] == [Outcome.SKIPPED] * 2
    assert world.stopped


def test_the_operator_may_abort(world, lab, tmp_path):
    world.operator.answers[PromptKind.DISPLACE_AND_RELEASE] = "abort"
    report = world.run(lab.plan, tmp_path / "run")
    assert report.outcome is Outcome.ABORTED
    assert "operator aborted" in report.reason
    assert [row.outcome for row in report.windows] == [Outcome.UNSET] * 2
    assert world.stopped
