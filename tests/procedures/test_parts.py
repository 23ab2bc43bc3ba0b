"""Small parts: outcomes, listing, mailbox, operators, waiting."""

import asyncio
import math
import os

import pytest

from drivers.clock import LoopClock, within
from drivers.ports import Prompt, PromptKind
from fidim_lab.errors import OurBugError
from procedures.events import Prompted, Publisher
from procedures.operators import ConsoleOperator
from procedures.outcomes import Measurement, Outcome, worst
from procedures.protocols.experiment import Lab
from procedures.protocols.identify import identify
from procedures.protocols.listing import Outline
from procedures.recording.recorder import Recorder
from procedures.steps import MoveTo, travel_time
from procedures.timing import uninterrupted, wait_until
from sim_backends.jumping_loop import run

P, M, F, U = Outcome.PASS, Outcome.MARGINAL, Outcome.FAIL, Outcome.UNSET


@pytest.mark.parametrize(
    ("value", "outcome"),
    [
        (None, U),
        (math.nan, U),
        (19.9, F),
        (20.0, M),
        (21.9, M),
        (22.0, P),
        (198.0, P),
        (198.1, M),
        (200.0, M),
        (200.1, F),
    ],
)
def test_measurements_are_judged_ends_included(value, outcome):
    assert Measurement("tension", value, "N", low=20.0, high=200.0, margin=2.0).outcome is outcome


def test_a_measurement_says_what_was_found_and_what_is_allowed():
    assert Measurement("tension of cable 3", 12.0, "N", low=20, high=200).sentence == (
        "tension of cable 3 is 12 N (20 to 200 N is allowed)"
    )
    assert Measurement("drift", 0.034171, "m", high=0.029283).sentence == (
        "drift is 34.2 mm (at most 29.3 mm is allowed)"
    )
    assert Measurement("drift", 0.030004, "m", high=0.03).sentence == "drift is 30.004 mm (at most 30 mm is allowed)"
    assert Measurement("drift", 2.5, "m", high=0.03).sentence == "drift is 2.5 m (at most 0.03 m is allowed)"
    near = Measurement("drift", 0.0203, "m", high=0.0453, margin=0.0302)
    assert near.sentence == "drift is 20.3 mm (at most 45.3 mm is allowed, marginal above 15.1 mm)"
    low = Measurement("tension", 0.306, "N", low=0.0, high=50.0, margin=0.5)
    assert low.sentence == "tension is 0.306 N (0 to 50 N is allowed, marginal below 0.5 N)"
    assert Measurement("gap", None, "s", high=0.1).sentence == "gap was not measured (at most 0.1 s is allowed)"


def test_nothing_measured_is_not_a_pass():
    assert worst([]) is U
    assert worst([P, U, M]) is U
    assert worst([P, M]) is M
    assert worst([F, Outcome.ERROR, P]) is Outcome.ERROR


@pytest.mark.parametrize(("way", "seconds"), [(0.0, 0.0), (0.05, 1.0), (1.0, 10.5)])
def test_travel_time_of_triangle_and_trapezium(way, seconds):
    assert travel_time(way, 0.1, 0.2) == pytest.approx(seconds)


def test_the_list_is_printed_without_hardware(lab, irma4):
    outline = Outline(lambda: identify(Lab(lab.plan, irma4)))
    text = outline.text()
    assert outline.windows == ("i01", "i02")
    first = text.splitlines()[0]
    assert first == "   1  0:00:00  configure the winches, read back their limits, power on and hold"
    assert "[i01] move to lengths 1.500 1.400 1.400 1.400 m, at most 0.1 m/s" in text
    assert "[i02] record 10 s" in text
    assert text.splitlines()[-2].endswith("end: 2 windows, all winches held")
    assert "takes 0:01:16 to 0:02:23, depending on how soon the platform rests" in text.splitlines()[-1]
    assert outline.seconds == pytest.approx(sum(step.seconds for step in outline.steps))
    assert [type(s).__name__ for s in outline.steps].count("Record") == 2


def test_time_left_falls_with_each_planned_step_and_is_whole_at_the_first(lab, irma4):
    outline = Outline(lambda: identify(Lab(lab.plan, irma4)))
    left = [sum(outline.left_from(step).values()) for step in outline.steps]
    assert left[0] == pytest.approx(outline.seconds)
    assert left == sorted(left, reverse=True)
    unplanned = MoveTo(window="i09", lengths=(1.0,), speed=1, acceleration=1, tolerance=1)
    assert outline.left_from(unplanned) is None


PROMPT = Prompt(PromptKind.CONFIRM, "Go on?")


def test_a_listener_that_fails_is_told_the_rest_and_what_it_raised_is_kept_once():
    heard: list[float] = []

    def listener(event: Prompted) -> None:
        heard.append(event.t)
        if event.t < 2.0:
            raise KeyError("more1")

    publish = Publisher([listener])
    for t in range(4):
        publish(Prompted(float(t), "i01", PROMPT))
    assert heard == [0.0, 1.0, 2.0, 3.0]
    assert publish.failed == ["KeyError: 'more1'"]


def ask_console(typed, prompts=1, early=b""):
    """Answers of a person who types on a pipe, and what was shown."""
    reader, writer = os.pipe()
    shown = []

    async def main():
        operator = ConsoleOperator(shown.append, reader)
        answers = []
        for _ in range(prompts):
            task = asyncio.ensure_future(operator.answer(PROMPT))
            while not shown or not shown[-1].endswith("] "):
                await LoopClock().sleep(0.001)
            os.write(writer, typed)
            answers.append(await task)
            shown.append("answered")
        return answers

    os.write(writer, early)
    try:
        if not typed:
            os.close(writer)
            writer = None
            return asyncio.run(ConsoleOperator(shown.append, reader).answer(PROMPT)), shown
        return asyncio.run(main()), shown
    finally:
        if writer is not None:
            os.close(writer)


@pytest.mark.parametrize(
    ("typed", "answer"), [(b"\n", "done"), (b"s\n", "skip"), (b"ABORT\n", "abort"), (b"x\nd\n", "done")]
)
def test_a_person_answers_at_the_console(typed, answer):
    answers, shown = ask_console(typed)
    assert answers == [answer]
    assert shown[0] == "Go on? [done, skip, abort] "
    if typed.startswith(b"x"):
        assert "“x” is not one of done, skip, abort.\n" in shown


def test_the_end_of_the_input_aborts():
    assert ask_console(b"")[0] == "abort"


def test_the_console_asks_again_and_again():
    assert ask_console(b"s\n", prompts=3)[0] == ["skip"] * 3


def test_within_gives_the_result_or_a_time_out():
    clock = LoopClock()

    async def work(seconds):
        await clock.sleep(seconds)
        return seconds

    assert run(within(clock, 2.0, work(1.0))) == 1.0
    with pytest.raises(TimeoutError):
        run(within(clock, 2.0, work(3.0)))


def test_wait_until_looks_until_the_time_is_over():
    clock = LoopClock()

    async def main():
        seen = await wait_until(clock, 5.0, lambda: clock.now() > 3.0)
        return seen, clock.now(), await wait_until(clock, 1.0, lambda: False), clock.now()

    seen, first, missed, second = run(main())
    assert (seen, missed) == (True, False)
    assert first == pytest.approx(3.0, abs=0.02)
    assert second == pytest.approx(first + 1.0, abs=0.02)


def test_what_must_not_be_interrupted_goes_on_to_its_end():
    clock, done = LoopClock(), []

    async def work():
        for k in range(5):
            await clock.sleep(1.0)
            done.append(k)

    async def main():
        task = asyncio.ensure_future(uninterrupted(work()))
        for _ in range(3):
            await clock.sleep(0.5)
            task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    run(main())
    assert done == [0, 1, 2, 3, 4]


def test_what_fails_inside_comes_out_even_when_cancelled():
    clock = LoopClock()

    async def work():
        await clock.sleep(1.0)
        raise ValueError("inside")

    async def main():
        task = asyncio.ensure_future(uninterrupted(work()))
        await clock.sleep(0.5)
        task.cancel()
        with pytest.raises(ValueError, match="inside"):
            await task

    run(main())


def test_a_recorder_keeps_one_recording_apart_from_another(world, tmp_path):
    for name in ("windows", "rejected"):
        (tmp_path / name).mkdir()

    async def main():
        for winch in world.winches:
            await winch.configure()
        recorder = Recorder(tmp_path, world.clock, world.markers, world.winches, 1, 0.2)
        made = await recorder.record("i01", 1, 0.5, lambda _: None)
        assert len(made.markers) == 51
        assert recorder.last("i01", 1) is made
        with pytest.raises(OurBugError):
            recorder.last("i02", 1)
        assert await recorder.reject("i01", 1) == tmp_path / "rejected" / "i01-attempt1.csv"
        with pytest.raises(OurBugError):
            await recorder.accept("i01")
        assert await recorder.abandon() is None

    run(main())


def test_an_open_window_is_on_the_disk_ten_times_a_second(world, tmp_path):
    (tmp_path / "windows").mkdir()
    (tmp_path / "rejected").mkdir()
    seen = []

    async def main():
        for winch in world.winches:
            await winch.configure()
        recorder = Recorder(tmp_path, world.clock, world.markers, world.winches, 1, 0.2)
        task = asyncio.ensure_future(recorder.record("i01", 1, 2.0, lambda _: None))
        for _ in range(18):
            await world.clock.sleep(0.1)
            seen.append((tmp_path / "windows" / "i01.csv.part").read_bytes().count(b"\n"))
        await task

    run(main())
    assert [lines - 1 for lines in seen[1:]] == pytest.approx([10 * k for k in range(2, 19)], abs=11)
