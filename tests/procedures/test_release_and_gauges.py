"""The protocol with a release device and with load cells: who is asked, what is confirmed, what is recorded."""

from dataclasses import replace

import pytest

from drivers.ports import GaugeReading, PromptKind, ReleaseState
from fidim_lab.data.window_csv import read_window_csv
from fidim_lab.data.window_mcap import read_window_mcap
from fidim_lab.errors import DeviceError
from procedures.control import Control, Verb, Word
from procedures.events import StepFinished, StepStarted, Warned
from procedures.outcomes import Outcome
from procedures.settings import Reaction, ReleaseSettings


class FakeRelease:
    """Holds at once what is brought to it."""

    name = "release"

    def __init__(self, world):
        self.world = world
        self.state = ReleaseState.RELEASED
        self.fault = ""
        self.hung = False
        self.fetches = False
        self.commands = []

    async def hold(self):
        self.commands.append("hold")
        if self.fault:
            raise DeviceError(self.name, self.fault)
        self.state = ReleaseState.HOLDS
        self.hung = self.fetches

    async def release(self):
        self.commands.append("release")
        self.state = ReleaseState.RELEASED
        if self.hung:
            self.hung = False
            self.world.let_go()


class FakeGauge:
    """Four load cells that tell 61, 62, 63, 64 N until they fall silent."""

    name, columns, age, uncertainty = "load cells", ("f1", "f2", "f3", "f4"), 0.3, 0.5

    def __init__(self, world):
        self.world = world
        self.silent_since = float("inf")

    def latest(self):
        return GaugeReading(min(self.world.now(), self.silent_since), (61.0, 62.0, 63.0, 64.0))


def equip(world, *, by_hand=True, gauges=False):
    """A release for the fake laboratory, and load cells."""
    release = FakeRelease(world)
    release.fetches = not by_hand
    cells = FakeGauge(world)
    usual = type(world)

    class Equipped(usual):
        brought = True
        """whether the operator brings the platform to the release"""

        @property
        def rig(self):
            return replace(super().rig, release=release, gauges=(cells,) if gauges else ())

        def marker(self, number):
            x, y, z = super().marker(number)
            return (x + self.displacement, y, z) if release.hung else (x, y, z)

    world.__class__ = Equipped
    usual_answer = world.operator.answer

    async def answer(prompt):
        if prompt.kind is PromptKind.HANG_IN:
            release.hung = world.brought and world.operator.answers.get(prompt.kind) is None
            world.amplitude = 0.0  # a hand has stopped it
        return await usual_answer(prompt)

    world.operator.answer = answer
    world.settings = replace(world.settings, release=ReleaseSettings(by_hand=by_hand, over=0.2, timeout=2.0))
    return release, cells


def steps(world):
    return [type(event.step).__name__ for event in world.events if isinstance(event, StepStarted)]


def test_a_person_hangs_it_in_and_the_device_lets_go(lab, world, tmp_path):
    release, _ = equip(world)
    report = world.run(lab.one, tmp_path / "run")
    assert report.outcome is Outcome.PASS, report.reason
    assert [prompt.kind for prompt in world.operator.asked] == [PromptKind.HANG_IN]
    assert release.commands == ["release", "hold", "release"]
    order = steps(world)
    assert order[:4] == ["Enable", "LetGo", "TryWinches", "MoveTo"]
    begin = order.index("TakeHold")
    assert order[begin : begin + 6] == ["TakeHold", "Ask", "AwaitHeld", "LetGo", "AwaitHandsOff", "Record"]


def test_a_device_that_fetches_the_platform_asks_nobody(lab, world, tmp_path):
    equip(world, by_hand=False)
    report = world.run(lab.one, tmp_path / "run")
    assert report.outcome is Outcome.PASS, report.reason
    assert world.operator.asked == []


def test_a_platform_that_was_not_brought_to_it_is_asked_for_again(lab, world, tmp_path):
    release, _ = equip(world)
    world.brought = False
    report = world.run(lab.one, tmp_path / "run")
    assert report.outcome is Outcome.FAIL
    asked = [prompt.text for prompt in world.operator.asked if prompt.kind is PromptKind.HANG_IN]
    assert len(asked) == 4
    assert "Not accepted: not held still away from rest after 2 s: displacement is" in asked[1]
    assert release.state is ReleaseState.RELEASED
    assert "Record" not in steps(world)


def test_skipped_at_the_release_it_lets_go_before_the_next_move(lab, world, tmp_path):
    release, _ = equip(world)
    world.operator.answers[PromptKind.HANG_IN] = "skip"
    world.run(lab.plan, tmp_path / "run")
    assert release.commands == ["release", "hold", "release", "hold", "release"]
    order = steps(world)
    moves = [k for k, name in enumerate(order) if name == "MoveTo"]
    assert "LetGo" in order[order.index("TakeHold") : moves[1]]


@pytest.mark.parametrize("at", ["Ask", "AwaitHeld"])
def test_skipped_by_word_it_lets_go_before_the_next_move(lab, world, tmp_path, at):
    release, _ = equip(world)
    control = Control()
    world.at(at, lambda: control.say(Word(Verb.SKIP, "not today")), after=0.05)
    world.run(lab.plan, tmp_path / "run", control=control)
    order = steps(world)
    moves = [k for k, name in enumerate(order) if name == "MoveTo"]
    assert "LetGo" in order[order.index(at) : moves[1]], order
    assert release.state is ReleaseState.RELEASED


def test_a_release_that_fails_while_it_holds_ends_the_run_held(lab, world, tmp_path):
    release, _ = equip(world)
    world.at("Ask", lambda: setattr(release, "fault", "while it held the platform, it was unplugged"), after=0.5)
    report = world.run(lab.one, tmp_path / "run")
    assert report.outcome is Outcome.ERROR
    assert "The release guard stopped the run" in report.reason
    assert "it was unplugged" in report.reason
    assert report.held
    assert world.stopped


def test_load_cells_are_columns_of_the_window(lab, world, tmp_path):
    equip(world, gauges=True)
    report = world.run(lab.one, tmp_path / "run")
    assert report.outcome is Outcome.PASS, report.reason
    table = read_window_csv(tmp_path / "run" / "windows" / "i01.csv", 4)
    assert list(table.further) == ["f1", "f2", "f3", "f4"]
    assert (table.further["f3"] == 63.0).all()
    log = read_window_mcap(tmp_path / "run" / "windows" / "i01.mcap", 4)
    assert (log.further["f4"] == 64.0).all()
    assert log.currents.shape == (1001, 4)


@pytest.mark.parametrize("reaction", [Reaction.WARN, Reaction.REJECT_WINDOW])
def test_load_cells_that_fall_silent_leave_blanks_and_are_told_of(lab, world, tmp_path, reaction):
    _, cells = equip(world, gauges=True)
    world.settings = replace(world.settings, guard=replace(world.settings.guard, reactions={"gauges": reaction}))
    world.at("Record", lambda: setattr(cells, "silent_since", world.now()), after=5.0)
    world.at("Reject", lambda: setattr(cells, "silent_since", float("inf")))
    report = world.run(lab.one, tmp_path / "run")
    assert report.outcome is Outcome.PASS, report.reason
    told = [event.trip.says for event in world.events if isinstance(event, Warned)]
    assert "load cells has sent nothing for 0.3" in told[0]
    rejected = reaction is Reaction.REJECT_WINDOW
    file = "rejected/i01-attempt1.csv" if rejected else "windows/i01.csv"
    f1 = read_window_csv(tmp_path / "run" / file, 4).further["f1"]
    assert f1[:500] == pytest.approx(61.0)
    assert (f1[540:] != f1[540:]).all()  # blank
    reasons = [e.result.reason for e in world.events if isinstance(e, StepFinished) and "check" in e.step.text]
    assert any("load cells has sent nothing" in reason for reason in reasons) == rejected
