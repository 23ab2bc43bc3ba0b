"""A run that is left alone: answers stated, hours kept, and told how it ended."""

import json
from dataclasses import replace
from datetime import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from fidim_lab.app.formats.run_records import bytes_a_second
from fidim_lab.app.formats.run_spec import RunSpec, overridden, read_spec, write_spec
from fidim_lab.app.service.main import prepare, write_inputs
from fidim_lab.app.service.process.unattended import PatienceGuard, quiet, run_hook, write_summary
from fidim_lab.app.session.run import RunOptions, make_spec, require_answers, run_command
from fidim_lab.app.session.run_process import said_at_end
from fidim_lab.data.records import Alignment, Role
from fidim_lab.data.rigs.alignment_file import alignment_path, read_alignment, write_alignment
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.errors import FileError, HardwareError, SetupError
from procedures.guards.guard import Observation
from procedures.outcomes import Outcome
from procedures.report import RunReport, WindowRow
from procedures.settings import Settings
from procedures.steps import Phase

RIG = Path(__file__).parents[4] / "examples" / "rigs" / "simulated.toml"
PLAN = (Path(__file__).parents[3] / "one_window.toml").read_text(encoding="utf-8")


def options(tmp_path, **more):
    plan = tmp_path / "plan.toml"
    plan.write_text(PLAN)
    rest = {
        "out": tmp_path / "run",
        "embedded": True,
        "listing": False,
        "unattended": True,
        "answers": (),
        "settings": (),
        "max_hours": None,
        "quiet_hours": None,
        "on_finish": "",
        "on_fault": "",
        "seed": 1,
        "hide": (),
        "procedure": "identify",
        "stay": False,
        "tcp": None,
    }
    return RunOptions(**{"plan": plan, "rig": RIG, **rest, **more})


BOTH = ("displace-and-release=done", "steady=done@2")


def test_a_disk_without_room_for_the_run_is_said_before_the_bus_is_opened(tmp_path):
    wanting = options(tmp_path, answers=BOTH, settings=("guard.disk_spare=1e18",))
    with pytest.raises(HardwareError, match=r"MB free; 10000000000\d\d MB are required: \d+ MB for a run of \d+ min"):
        prepare(make_spec(wanting))
    assert not list(tmp_path.rglob("journal.jsonl"))


def test_the_expected_size_of_a_run_is_more_than_it_takes(tmp_path):
    """Measured in a rehearsal of four winches at 100 Hz: 48 kB/s of frames, 52 kB/s of a window."""
    assert 1e5 < bytes_a_second(read_rig(RIG)) < 2e5


def test_a_prompt_without_a_stated_answer_refuses_to_start(tmp_path):
    work = prepare(make_spec(options(tmp_path, answers=BOTH[:1])))
    with pytest.raises(SetupError, match="these prompts have no answer: steady"):
        require_answers(work)
    require_answers(prepare(make_spec(options(tmp_path, answers=BOTH))))
    require_answers(prepare(make_spec(options(tmp_path, unattended=False))))
    with pytest.raises(SetupError, match="the choices are done, skip, abort"):
        require_answers(prepare(make_spec(options(tmp_path, answers=(BOTH[0], "steady=perhaps")))))


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ({"answers": ("steady=perhaps",), "unattended": False}, "the choices are done, skip, abort"),
        (
            {"answers": ("confirm=done",), "unattended": False},
            "identify has no such prompt; its prompts are displace-and-re",
        ),
        ({"answers": ("hang-in=done", *BOTH)}, "--answer hang-in=done: identify has no such prompt"),
        ({"answers": BOTH, "procedure": "align"}, "align has no such prompt; it has no prompts"),
    ],
)
def test_an_answer_that_no_prompt_offers_is_refused_attended_and_listed_too(more, says, tmp_path):
    with pytest.raises(SetupError, match=says):
        require_answers(prepare(make_spec(options(tmp_path, **more))))
    with pytest.raises(SetupError, match=says):
        run_command(options(tmp_path, **more, listing=True))


def test_a_procedure_of_ones_own_may_ask_what_its_list_does_not_show(tmp_path):
    own = tmp_path / "own.py"
    own.write_text("from procedures.steps import Enable\n\n\ndef procedure(lab):\n    yield Enable()\n")
    require_answers(prepare(make_spec(options(tmp_path, answers=("confirm=done",), procedure=str(own)))))


def test_what_align_has_measured_with_this_rig_goes_with_the_run(tmp_path):
    rig = tmp_path / "rig.toml"
    rig.write_text(RIG.read_text())
    known = Alignment(0.004, 2e-4, 0.99, "2026-01-01T00:00:00Z", "vicon-udp", 100.0, 100.0)
    write_alignment(alignment_path(rig), known)
    spec = make_spec(options(tmp_path, answers=BOTH, rig=rig, embedded=False))
    work = prepare(spec)
    spec.out.mkdir(parents=True)
    write_inputs(work)
    assert read_alignment(spec.out / "alignment.toml") == known
    assert prepare(spec.model_copy(update={"embedded": True})).alignment is None  # other cameras
    assert prepare(spec.model_copy(update={"procedure": "align"})).alignment is None  # its own
    write_alignment(alignment_path(rig), replace(known, source="osc"))
    with pytest.raises(SetupError, match=r"measured with motion_capture\.kind osc"):
        prepare(spec)


@pytest.mark.parametrize(
    ("what", "says"),
    [
        ({"answers": ("dance=done",)}, "kinds are displace-and-release"),
        ({"answers": ("steady=done@soon",)}, "KIND=CHOICE@SECONDS"),
        ({"settings": ("record.seconds=long",)}, "TABLE.KEY=NUMBER"),
        ({"settings": ("record.seconds=nan",)}, "TABLE.KEY=NUMBER"),
        ({"settings": ("guard.slip=inf",)}, "TABLE.KEY=NUMBER"),
        ({"settings": ("guard.slip=1e999",)}, "TABLE.KEY=NUMBER"),
        ({"quiet_hours": "ten to six"}, "HH:MM-HH:MM"),
        ({"quiet_hours": "25:00-06:00"}, "from 00:00 to 23:59"),
        ({"quiet_hours": "22:00-22:00"}, "begin and end are the same"),
    ],
)
def test_wrong_options_are_told(what, says, tmp_path):
    with pytest.raises(SetupError, match=says):
        make_spec(options(tmp_path, **what))


def test_hours_count_without_answers_too(tmp_path):
    """Somebody answers, and the run must end all the same."""
    spec = make_spec(options(tmp_path, unattended=False, max_hours=2.0, quiet_hours="22:00-06:00"))
    assert spec.unattended is not None
    assert (spec.unattended.max_hours, spec.unattended.quiet_hours) == (2.0, ("22:00", "06:00"))
    assert (spec.alone, spec.unattended.answers) == (False, {})


def test_a_missing_answer_is_asked_for_with_its_choices(tmp_path):
    with pytest.raises(SetupError) as caught:
        require_answers(prepare(make_spec(options(tmp_path))))
    assert "--answer displace-and-release=done or skip or abort" in caught.value.hint
    assert "--answer steady=done or skip or abort" in caught.value.hint


def test_what_the_service_says_after_the_run_is_passed_on(tmp_path):
    place = SimpleNamespace(log=tmp_path / "log")
    assert said_at_end(place) == []
    place.log.write_text("noise\nfidim: the hook “x” ended with exit code 7\n")
    assert said_at_end(place) == ["the hook “x” ended with exit code 7"]


def test_settings_are_changed_by_name(tmp_path):
    changed = overridden(Settings(), {"record.seconds": 4.0, "record.repeats": 1.0})
    assert (changed.record.seconds, changed.record.repeats) == (4.0, 1)
    with pytest.raises(SetupError, match=r"--set record\.secs: no such number; there are amplitude"):
        overridden(Settings(), {"record.secs": 1.0})
    with pytest.raises(SetupError, match=r"there are .*guard, hand, hold, .*motion, place, record, .*tension"):
        overridden(Settings(), {"speed": 1.0})


def test_a_specification_is_read_back(tmp_path):
    spec = make_spec(
        options(tmp_path, answers=BOTH, max_hours=8.0, quiet_hours="22:00-06:00", hide=("swivel-friction",))
    )
    write_spec(tmp_path, spec)
    assert read_spec(tmp_path) == spec
    (tmp_path / "run.json").write_text("{}")
    with pytest.raises(FileError, match="plan"):
        read_spec(tmp_path)
    with pytest.raises(FileError, match="Only what `fidim run` began"):
        read_spec(tmp_path / "nowhere")


@pytest.mark.parametrize(
    ("span", "now", "still"),
    [
        (("22:00", "06:00"), time(23, 0), True),
        (("22:00", "06:00"), time(5, 59), True),
        (("22:00", "06:00"), time(6, 0), False),
        (("22:00", "06:00"), time(12, 0), False),
        (("12:00", "13:00"), time(12, 0), True),
        (("12:00", "13:00"), time(13, 0), False),
    ],
)
def test_quiet_hours_may_go_over_midnight(span, now, still):
    assert quiet(span, now) is still


def test_a_run_that_takes_too_long_is_ended():
    guard = PatienceGuard(2.0)
    assert guard.look(Observation(100.0, Phase.RESTING, (), None)) is None
    assert guard.look(Observation(100.0 + 7199.0, Phase.RESTING, (), None)) is None
    assert "2 h are allowed" in guard.look(Observation(100.0 + 7260.0, Phase.RESTING, (), None))


def report(folder, outcome):
    row = WindowRow("i01", Role.IDENTIFY, outcome, "because", 2)
    return RunReport("one", folder, outcome, "a reason", (row,), held=True, held_says="held", seconds=12.0)


def test_the_summary_and_the_hooks_tell_how_it_ended(tmp_path):
    write_summary(tmp_path, report(tmp_path, Outcome.FAIL))
    said = json.loads((tmp_path / "summary.json").read_text())
    assert (said["outcome"], said["exit_code"], said["windows"][0]["attempts"]) == ("fail", 1, 2)
    spec = RunSpec(
        plan=tmp_path,
        rig=tmp_path,
        out=tmp_path,
        on_finish='echo "$FIDIM_OUTCOME" > "$FIDIM_RUN/finish"',
        on_fault='echo "$FIDIM_EXIT_CODE $FIDIM_REASON" > "$FIDIM_RUN/fault"; exit 7',
    )
    assert run_hook(spec, report(tmp_path, Outcome.PASS)) == ""
    assert (tmp_path / "finish").read_text() == "pass\n"
    assert run_hook(spec, report(tmp_path, Outcome.ERROR)).endswith("ended with exit code 7")
    assert (tmp_path / "fault").read_text() == "3 a reason\n"
