"""What the screens say, compared with texts that a person has read (tests/…/tui/pictures); and the pure parts."""

import json
import math
import os
from pathlib import Path

import pytest

from fidim_lab.app.service.messages import (
    EquilibriumState,
    GuardState,
    Happening,
    History,
    PromptClosed,
    Question,
    Samples,
    StepState,
    Welcome,
)
from fidim_lab.app.tui.foresight import Foreseen
from fidim_lab.app.tui.paint import bar, number, text_of, time_span, wrapped
from fidim_lab.app.tui.result_files import ResultFiles, read_result_files
from fidim_lab.app.tui.screens.bars import RESERVED, choice_keys, prompt_lines, state_lines
from fidim_lab.app.tui.screens.log import log_lines
from fidim_lab.app.tui.screens.result import result_lines
from fidim_lab.app.tui.screens.rig import rig_lines, tension_bar
from fidim_lab.app.tui.screens.session import session_lines
from fidim_lab.app.tui.screens.why import why_lines
from fidim_lab.app.tui.screens.window import residuals, window_lines
from fidim_lab.app.tui.view import Connection, ScreenState, Tracker
from fidim_lab.app.tui.widgets.plot import Curve, canvas, limits
from fidim_lab.data.records import PARAMETER_NAMES

PICTURES = Path(__file__).parent / "pictures"
WELCOME = Welcome(you=1, run="two windows", folder="/r", rig="rig", windows=("i01",), winches=("winch 1",))


def compare(name: str, text: str) -> None:
    """With the stored text; FIDIM_PICTURES=new writes it (look at what git says has changed)."""
    file = PICTURES / f"{name}.txt"
    if os.environ.get("FIDIM_PICTURES") == "new":
        file.write_text(text + "\n", encoding="utf-8")
    assert text + "\n" == file.read_text(encoding="utf-8")


@pytest.fixture
def live(fake):
    """A view in the midst of a run, with more to see than the fake service's."""
    fake.become(
        winches=fake.winches(tension=201.0, age=None, temperature=None, following_error=None, fault="0x7500 heartbeat"),
        guards=(
            GuardState(name="marker", state="warning", reaction="hold", why="not seen for 0.4 s"),
            GuardState(name="tension", state="tripped", reaction="quick stop", why="winch 1: 201.0 N, 200 N allowed"),
            *fake.state.guards,
        ),
        equilibria=(
            *fake.state.equilibria,
            EquilibriumState(
                window="v02",
                role="validate",
                state="done",
                verdict="fail",
                reason="the marker was not seen in 14 % of the frames, 5 % are allowed, at the third attempt too",
                attempts=3,
                margin=-1.5,
                amplitude=0.12,
            ),
        ),
    )
    return ScreenState(now=10.0, contact=Connection.LIVE, welcome=WELCOME, status=fake.state, age=0.05)


def lines_of(tracker: Tracker) -> str:
    return text_of(state_lines(tracker.view(20.0), 80))


@pytest.mark.parametrize("width", [79, 120])
def test_session_and_rig_look_as_they_were_approved(live, width):
    compare(f"session-{width}", text_of(session_lines(live, width)))
    compare(f"rig-{width}", text_of(rig_lines(live, width)))


def test_no_line_of_any_screen_is_wider_than_80_columns(live, tmp_path):
    result_files = read_result_files(_run_folder(tmp_path))
    for lines in (
        session_lines(live, 79),
        rig_lines(live, 79),
        result_lines(result_files, 79),
        why_lines(result_files, 79),
        state_lines(live, 80, "something was said"),
    ):
        assert max(len(row) for row in text_of(lines).splitlines()) <= 80


def test_an_old_value_of_one_winch_is_grey_and_says_its_age(fake):
    fake.become(winches=fake.winches(age=0.9))
    rows = rig_lines(ScreenState(contact=Connection.LIVE, status=fake.state, age=0.2), 79)
    old = next(row for row in rows if "winch 1" in text_of([row]))
    assert {span.style for span in old} == {"old"}
    assert "OLD VALUES: 1.1 s" in text_of(rows)


@pytest.mark.parametrize(
    ("tension", "says"), [(10.0, "TOO LOW"), (250.0, "TOO HIGH"), (None, "????"), (110.0, "──────┃─────")]
)
def test_a_tension_stands_between_its_limits(tension, says):
    assert says in tension_bar(tension, (20.0, 200.0)).text


def test_a_tension_bar_moves_with_the_tension():
    places = [tension_bar(t, (20.0, 200.0)).text.index("┃") for t in (20.0, 60.0, 110.0, 160.0, 200.0)]
    assert places == sorted(places)
    assert places[0] == 0
    assert places[-1] == 11


def test_choices_have_keys_of_their_own_that_command_nothing():
    choices = ("done", "skip", "abort", "repeat", "go on", "exit", "quit")
    keys = choice_keys(choices)
    assert tuple(keys.values()) == choices
    assert not set(keys) & set(RESERVED)
    assert choice_keys(("done", "skip", "abort")) == {"d": "done", "s": "skip", "a": "abort"}


def test_a_prompt_that_answers_itself_counts_down():
    question = Question(
        number=1, kind="confirm", window="", text="Go on?", choices=("done",), default="done", default_after=30.0
    )
    shown = text_of(prompt_lines(ScreenState(now=12.0, contact=Connection.LIVE, question=question, asked=2.0), 80))
    assert "“done” automatically in 20 s" in shown


def test_the_hand_at_the_platform_sees_how_far_the_marker_is_displaced(fake):
    tracker = Tracker()
    tracker.take(WELCOME, 0.0)
    tracker.take(fake.state, 4.0)
    tracker.take(
        Question(
            number=1, kind="displace-and-release", window="i02", text="x", choices=("done",), displacement=(0.02,)
        ),
        5.0,
    )
    mocap = fake.state.mocap.model_copy(update={"position": (1.115, -0.28, -0.31)})
    tracker.take(fake.state.model_copy(update={"mocap": mocap, "prompt": 1}), 5.1)
    assert "NOW  x +15 mm  y -10 mm  z +0 mm" in text_of(prompt_lines(tracker.view(5.1), 80))


def test_who_comes_late_to_a_prompt_is_not_told_a_displacement_that_nobody_knows(fake):
    tracker = Tracker()
    tracker.take(WELCOME, 4.9)
    tracker.take(fake.state, 4.9)
    tracker.take(Question(number=1, kind="x", window="", text="x", choices=("done",), displacement=(0.02,)), 5.0)
    assert "NOW" not in text_of(prompt_lines(tracker.view(5.1), 80))


def test_the_tracker_keeps_events_in_order_and_forgets_prompts_that_are_closed():
    tracker = Tracker()
    tracker.take(WELCOME, 0.0)
    events = [Happening(number=k, t=0.0, wall="2026-01-02T10:11:12", kind="paused") for k in (1, 2, 3)]
    tracker.take(History(events=tuple(events[:2]), forgotten=5), 0.0)
    tracker.take(events[2], 0.0)
    tracker.take(Question(number=4, kind="confirm", window="", text="x", choices=("done",)), 0.0)
    assert [event.number for event in tracker.view(0.0).events] == [1, 2, 3]
    assert tracker.view(0.0).question is not None
    tracker.take(PromptClosed(number=4), 0.0)
    assert tracker.view(0.0).question is None
    assert "5 older events are only in the journal" in text_of(log_lines(tracker.view(0.0), 80))


def test_an_old_state_is_never_live(fake):
    tracker = Tracker()
    tracker.take(WELCOME, 10.0)
    assert not tracker.view(10.0).fresh
    tracker.take(fake.state, 10.0)
    assert tracker.view(10.9).fresh
    assert not tracker.view(11.1).fresh
    assert "ALL VALUES ARE 10 s OLD" in lines_of(tracker)
    tracker.lose("killed")
    assert not tracker.view(10.1).fresh
    assert "SERVICE LOST" in lines_of(tracker)
    tracker.take(WELCOME, 20.0)
    assert tracker.view(20.0).status is None, "what the dead service said is not the new one's state"


def _samples(tracker: Tracker, window: str, attempt: int, times: list[float]) -> None:
    positions = tuple((math.sin(6.0 * t), 0.1 * t, 0.0) for t in times)
    none = tuple(() for _ in times)
    said = Samples(window=window, attempt=attempt, t=tuple(times), positions=positions, tensions=none, lengths=none)
    tracker.take(said, 0.0)


def test_a_recording_grows_and_a_new_attempt_begins_anew():
    tracker = Tracker()
    _samples(tracker, "i01", 1, [0.0, 0.1])
    _samples(tracker, "i01", 1, [0.2])
    assert tracker.view(0.0).trace.t == [0.0, 0.1, 0.2]
    _samples(tracker, "", 0, [0.3])
    assert not tracker.view(0.0).recording
    assert len(tracker.view(0.0).trace.t) == 3
    _samples(tracker, "i01", 2, [0.4, 0.5])
    assert tracker.view(0.0).trace.t == [0.4, 0.5]


def test_the_window_shows_recording_prediction_and_residual():
    tracker = Tracker()
    _samples(tracker, "i01", 1, [0.01 * k for k in range(300)])
    view = tracker.view(0.0)
    off = [(math.sin(0.06 * k) + 0.003, 0.001 * k, 0.0) for k in range(400)]
    foreseen = Foreseen(("i01", 1), 2.0, "CAD", [0.01 * k for k in range(400)], off)
    assert residuals(view.trace, foreseen)[150] == pytest.approx(0.003)
    text = text_of(window_lines(view, 79, 18, foreseen))
    assert "rms 3.00" in text
    assert "CAD" in text
    assert len(text.splitlines()) <= 18
    compare("window-79", text)
    assert residuals(view.trace, Foreseen(("i01", 1), 2.0, "CAD", [9.0, 10.0], off[:2])) == [None] * 300


def test_a_curve_lies_where_its_values_are():
    drawn = text_of(canvas([Curve([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, None, 0.0])], (0.0, 4.0), (0.0, 1.0), 2, 1))
    assert drawn == chr(0x2800 + 0x40 + 0x08) + chr(0x2800 + 0x80)
    assert limits([None, float("nan")], 0.002) == (-0.001, 0.001)
    low, high = limits([1.0, 2.0], 0.1)
    assert low < 1.0 < 2.0 < high


@pytest.mark.parametrize(
    ("found", "wanted"),
    [
        (bar(0.0, 4), "····"),
        (bar(0.5, 4), "██··"),
        (bar(2.0, 4), "████"),
        (number(None, 2), "–"),
        (number(1.005, 1, "N"), "1.0 N"),
        (time_span(45), "45 s"),
        (time_span(754), "12:34"),
        (time_span(3725), "1:02:05"),
        (wrapped("one two three", 7), ["one two", "three"]),
        (wrapped("", 7), []),
    ],
)
def test_words_and_numbers(found, wanted):
    assert found == wanted


def _run_folder(base: Path) -> Path:
    for name, factor in (("before", 1.02), ("today", 1.0)):
        folder = base / name
        folder.mkdir()
        (folder / "result.json").write_text(json.dumps(_result(factor)))
        os.utime(folder / "result.json", (1e9 + (name == "today"), 1e9 + (name == "today")))
    explanation = {
        "format": "fidim-explanation/1",
        "verdict": "partly-explained",
        "message": "Something is named.",
        "effects": [
            {
                "id": "air-drag",
                "says": "c v",
                "cable": 2,
                "parameters": {"c": {"value": 0.4, "sd": 0.01, "unit": "Ns/m"}},
            }
        ],
        "where": [{"window": "v01", "t": [0, 9], "channel": "x", "share": 0.6, "says": "v01, x, 60 % of the excess"}],
        "held_out": {"chi2_per_dof": {"before": 12.0, "after": 1.3}, "rms_mm": {"before": 2.5, "after": 0.3}},
        "ranking": [{"effects": ["air-drag"], "held_out_chi2_per_dof": 1.3, "plausible": True, "why": "best"}],
        "next_experiment": "Record a window with twice the amplitude.",
    }
    (base / "today" / "explanation.json").write_text(json.dumps(explanation))
    return base / "today"


def _result(factor: float) -> dict[str, object]:
    parameters = {
        name: {"value": factor * (0.01 + 0.001 * k), "sd": 2e-5 if k else 0.005, "sd_bootstrap": None, "nominal": 0.011}
        for k, name in enumerate(PARAMETER_NAMES)
    }
    return {
        "format": "fidim-result/1",
        "campaign": "x",
        "method": "mle",
        "outcome": "converged",
        "message": "The inertial parameters are identified.",
        "parameters": parameters,
        "non_essential": [],
        "sigma_W": 1.0,
        "C": 1.0,
        "windows": [
            {"id": "i01", "role": "identify", "chi2_per_dof": 1.1, "rms_mm": 0.2, "sigma_perp": 0.01, "used": True},
            {"id": "v01", "role": "validate", "chi2_per_dof": 12.0, "rms_mm": 2.0, "sigma_perp": 0.1, "used": False},
        ],
        "seconds": 1.0,
    }


def test_result_and_why_look_as_they_were_approved(tmp_path):
    result_files = read_result_files(_run_folder(tmp_path))
    compare("result-79", text_of(result_lines(result_files, 79)))
    compare("why-79", text_of(why_lines(result_files, 79)))
    assert result_files.last_folder == "before"


def test_a_file_that_cannot_be_read_is_said(tmp_path):
    folder = tmp_path / "run"  # alone in its folder: sessions beside it would be read too
    folder.mkdir()
    (folder / "result.json").write_text("{}")
    (folder / "explanation.json").write_text("[")
    result_files = read_result_files(folder)
    assert len(result_files.problems) == 2
    assert "result.json" in text_of(result_lines(result_files, 79))
    assert "explanation.json" in text_of(why_lines(result_files, 79))


def test_nothing_identified_yet_says_which_key_does_it():
    assert "Press i to identify" in text_of(result_lines(ResultFiles(), 79))
    assert "Press e" in text_of(why_lines(ResultFiles(), 79, "fidim explain: computing …"))


def test_a_step_that_nobody_has_begun(fake):
    fake.become(phase="idle", step=None, equilibria=(), latched=True)
    assert "Press r to reset" in text_of(session_lines(ScreenState(status=fake.state), 79))
    fake.become(phase="idle", step=None, equilibria=(), latched=False)
    assert "The run has not started. Press g to start the run." in text_of(
        session_lines(ScreenState(status=fake.state), 79)
    )
    fake.become(step=StepState(number=1, step="Hold", window="", text="", phase="preparing", fraction=0, left=1))
    assert "Hold" in text_of(session_lines(ScreenState(status=fake.state), 79))


def test_a_run_that_was_cut_off_says_how_it_goes_on_and_one_that_is_whole_does_not(fake):
    fake.become(phase="ended", step=None, latched=True, latched_why="by hand")
    ended = ScreenState(contact=Connection.ENDED, welcome=replace_folder("/r/a run"), status=fake.state, age=3.0)
    assert "Continue with r, or: fidim resume '/r/a run'" in text_of(session_lines(ended, 79))
    assert "r starts the service again" in text_of(state_lines(ended, 80))  # there is none to reset
    fake.become(equilibria=fake.state.equilibria[:1])
    whole = ScreenState(contact=Connection.ENDED, welcome=WELCOME, status=fake.state, age=3.0)
    assert "fidim resume" not in text_of(session_lines(whole, 79))


def replace_folder(folder: str) -> Welcome:
    return WELCOME.model_copy(update={"folder": folder})
