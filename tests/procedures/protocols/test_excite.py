"""Winch-driven windows through the real bytes of simulated drives: nobody is asked, lengths end where they began."""

import asyncio
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers.ports import Prompt
from fidim_lab.app import compose
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Plan, Robot
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.excitation.bodies import sizes
from fidim_lab.identification.excitation.seen import Lesson
from fidim_lab.identification.random_plan import Taste, random_plan
from procedures.control import Control, Retried, Skipped, Verb, Word
from procedures.events import Event, StepFinished, StepStarted
from procedures.outcomes import Outcome
from procedures.protocols import calming, excite
from procedures.protocols.catalogue import experiment, never_asks
from procedures.protocols.enough import windows_of
from procedures.protocols.experiment import Lab
from procedures.protocols.listing import Outline
from procedures.report import RunReport
from procedures.run import run_procedure
from procedures.settings import MotionSettings, Settings
from procedures.steps import (
    Accept,
    AfterPause,
    Ask,
    CheckTension,
    CheckWindow,
    GiveUp,
    Hold,
    MoveTo,
    Note,
    ReadEncoders,
    Record,
    Reject,
    Result,
    Settle,
    Step,
    Stop,
)
from procedures.steps.excitation import IdentifyBody, SeeRecordedSwing, Strokes, Think, WatchSwing


class Nobody:
    """An operator who must not be asked."""

    async def answer(self, prompt: Prompt) -> str:
        raise AssertionError(prompt.text)


@pytest.fixture(scope="module")
def plan(irma4: Robot) -> Plan:
    return random_plan(irma4, "alone", 2, 0, 1, Taste(taut=1.0, tight=1.0))


@pytest.fixture(scope="module")
def steps(irma4: Robot, plan: Plan) -> Sequence[Step]:
    """All that excite does with the plan."""
    settings = Settings(motion=MotionSettings(length_limits=compose.length_limits(plan)))
    return Outline(experiment("excite", plan, irma4, settings).procedure).steps


def carried_out(
    robot: Robot, plan: Plan, folder: Path, hide: tuple[str, ...], words: Sequence[tuple[float, Verb]] = ()
) -> tuple[RunReport, list[StepFinished]]:
    """words: said so many seconds after the first strokes that excite have begun."""
    settings = Settings(motion=MotionSettings(length_limits=compose.length_limits(plan)))
    made = experiment("excite", plan, robot, settings)
    world = compose.simulated_world(robot, 1, hide)
    done: list[StepFinished] = []
    control, left = Control(), list(words)

    def listen(event: Event) -> None:
        if isinstance(event, StepFinished):
            done.append(event)
        elif isinstance(event, StepStarted) and isinstance(event.step, Strokes) and event.step.displacement:
            for after, verb in left:
                asyncio.get_running_loop().call_later(after, control.say, Word(verb, "by a test", "a test"))
            left.clear()

    async def run() -> RunReport:
        async with compose.simulated_rig(robot, plan, world, 1, operator=Nobody()) as simulated:
            return await run_procedure(
                made,
                simulated.rig,
                folder,
                wall_time=lambda: "2000-01-01T00:00:00Z",
                listeners=(listen,),
                control=control,
            )

    return compose.run_loop(run(), real_time=False), done


def test_every_step_is_known_before_and_none_asks(steps: Sequence[Step]):
    assert not [step for step in steps if isinstance(step, Ask)]
    assert sum(isinstance(step, Strokes) for step in steps) == 2
    watched = next(k for k, step in enumerate(steps) if isinstance(step, Settle))
    assert not any(isinstance(step, MoveTo) for step in steps[:watched]), "it may swing when a run begins"
    assert never_asks("excite")
    assert not never_asks("identify")


def with_displacement(plan: Plan, aside: float) -> Plan:
    """Of the first window, to x, m."""
    first = replace(plan.windows[0], displacement=np.array([aside, 0.0]))
    return replace(plan, windows=(first, *plan.windows[1:]))


def test_a_displacement_beyond_the_robot_file_is_refused_before_anything_moves(irma4: Robot, plan: Plan):
    with pytest.raises(InfeasibleError, match=r"window i01, displacement x is 0\.500 m, at most 0\.100 m is allowed"):
        experiment("excite", with_displacement(plan, 0.5), irma4)


def test_a_window_that_will_be_given_up_is_named_where_the_list_ends(irma4: Robot, plan: Plan):
    settings = Settings(motion=MotionSettings(length_limits=compose.length_limits(plan)))
    text = Outline(experiment("excite", with_displacement(plan, 0.0), irma4, settings).procedure).text()
    ended, takes = text.splitlines()[-2:]
    assert ended.endswith("end: 1 of 2 windows, without i01 (see there), all winches held")
    assert takes.lstrip().startswith("takes 0:00:")


@pytest.mark.slow
@pytest.mark.parametrize("hide", [(), ("rotational-drag:c=0.06",)], ids=["undamped", "damped"])
def test_windows_are_recorded_without_a_hand(irma4: Robot, plan: Plan, tmp_path: Path, hide: tuple[str, ...]):
    report, done = carried_out(irma4, plan, tmp_path / "run", hide)
    assert report.outcome.usable, report.reason
    campaign = read_campaign(tmp_path / "run")
    assert [window.id for window in campaign.windows] == [window.id for window in plan.windows]
    seen = {e.step.window: e.result for e in done if isinstance(e.step, SeeRecordedSwing)}
    for window, planned in zip(campaign.windows, plan.windows, strict=True):
        assert window.lengths is not None
        np.testing.assert_allclose(window.lengths.mean(axis=0), planned.lengths, atol=1e-3)
        assert seen[window.id].values
    # at most two tries of each, and the second is what was planned
    again = sum(isinstance(e.step, Reject) for e in done)
    assert again <= len(plan.windows)
    settings = Settings(motion=MotionSettings(length_limits=compose.length_limits(plan)))
    least, most = Outline(experiment("excite", plan, irma4, settings).procedure).between
    assert least <= report.seconds
    assert again or report.seconds <= most, "repeated recordings take extra time"
    assert sum(isinstance(e.step, Accept) for e in done) == len(plan.windows)
    low, high = irma4.limits.tension
    factors = [winch.newton_per_ampere for winch in irma4.winches or ()]
    tensions = np.vstack([np.asarray(window.currents) * factors for window in campaign.windows])
    assert low * 0.9 < np.nanmin(tensions) < np.nanmax(tensions) < high * 1.05


@pytest.mark.parametrize(
    "words",
    [
        pytest.param(((0.5, Verb.PAUSE), (20.0, Verb.RESUME)), id="paused and resumed"),
        pytest.param(((0.5, Verb.RETRY),), id="again", marks=pytest.mark.slow),
    ],
)
@pytest.mark.slow
def test_strokes_that_were_stopped_halfway_are_done_again_from_the_equilibrium(
    irma4: Robot, plan: Plan, tmp_path, words
):
    one = replace(plan, windows=plan.windows[:1])
    report, done = carried_out(irma4, one, tmp_path / "run", ("rotational-drag:c=0.15",), words)
    assert report.outcome.usable, report.reason
    (halfway, *_) = [k for k, e in enumerate(done) if isinstance(e.step, Strokes) and e.step.displacement]
    assert "interrupted" in done[halfway].result.reason
    after = [e.step for e in done[halfway + 1 :] if isinstance(e.step, MoveTo | Strokes | Accept)]
    assert isinstance(after[-1], Accept)
    back = next(step for step in after if isinstance(step, MoveTo))
    np.testing.assert_allclose(back.lengths, one.windows[0].lengths)
    assert any(isinstance(step, Strokes) and step.displacement for step in after)
    (window,) = read_campaign(tmp_path / "run").windows
    np.testing.assert_allclose(window.lengths.mean(axis=0), one.windows[0].lengths, atol=1e-3)


@pytest.mark.slow
def test_a_window_left_out_halfway_through_strokes_leaves_the_next_one_in_order(irma4: Robot, plan: Plan, tmp_path):
    report, done = carried_out(irma4, plan, tmp_path / "run", ("rotational-drag:c=0.15",), ((0.5, Verb.SKIP),))
    assert [type(e.step) for e in done if isinstance(e.step, GiveUp | Accept)] == [GiveUp, Accept]
    assert [window.id for window in read_campaign(tmp_path / "run").windows] == [plan.windows[1].id]
    assert "Window" not in report.reason


def test_no_stroke_asks_a_winch_for_more_than_it_may_do(steps: Sequence[Step]):
    limits = Settings().excite
    chains = [chain for step in steps if isinstance(step, Strokes) for chain in step.chains]
    assert chains
    assert max(max(chain.speeds) for chain in chains) <= limits.speed
    assert max(max(chain.accelerations) for chain in chains) <= limits.acceleration


def test_moves_are_timed_for_the_modes(steps: Sequence[Step]):
    limits = Settings().excite
    moves = [step for step in steps if isinstance(step, MoveTo) and step.start is not None]
    assert moves
    for move in moves:
        assert move.speed <= limits.speed
        assert move.acceleration <= limits.acceleration


class Player:
    """Plays a protocol's steps without a robot; `answer` says what comes of each."""

    def __init__(self, answer) -> None:
        self.steps: list[Step] = []
        self._answer = answer

    def play(self, steps_of):
        result = None
        while True:
            try:
                step = steps_of.send(result)
            except StopIteration as end:
                return end.value
            self.steps.append(step)
            if isinstance(step, Think):
                step.job()
            if isinstance(step, Stop):
                return None
            result = self._answer(step) or Result()

    def of(self, kind):
        return [step for step in self.steps if isinstance(step, kind)]


def swung(step, amplitudes) -> Result:
    """As if it swung so far (m) in each mode."""
    table = [amplitudes, 0 * amplitudes, step.swing.frequencies, step.swing.damping, amplitudes]
    return Result(values=(0.0, *np.concatenate(table)))


def protocol_of(robot: Robot, plan: Plan, recorded: int = 0) -> excite.ExciteProtocol:
    settings = Settings(motion=MotionSettings(length_limits=compose.length_limits(plan)))
    return excite.ExciteProtocol(Lab(plan, robot, settings, recorded=recorded))


def never_calm(after: type) -> Player:
    """Swings by 5 cm whenever it is watched; it hangs still until the first step of this type."""

    def answer(step):
        if isinstance(step, WatchSwing):
            return swung(step, np.full(2, 0.05))
        if isinstance(step, Settle) and player.of(after):
            return Result(Outcome.FAIL, "The marker still moves 100.0 mm.")
        return None

    player = Player(answer)
    return player


def test_nothing_travels_while_the_platform_swings_and_cannot_be_calmed(irma4: Robot, plan: Plan):
    protocol, window = protocol_of(irma4, plan), plan.windows[0]

    player = never_calm(after=WatchSwing)
    assert player.play(protocol.settle(window)) is not None
    player.play(protocol.window(window, tuple(map(float, window.lengths)), swinging=True))
    (stop,) = player.of(Stop)
    assert "cannot calm it. The marker still moves 100.0 mm" in stop.reason
    assert player.steps[-1] is stop
    assert not player.of(MoveTo)


def test_no_move_begins_after_a_window_that_could_not_be_calmed(irma4: Robot, plan: Plan):
    player = never_calm(after=MoveTo)
    player.play(windows_of(plan, protocol_of(irma4, plan), tuple(map(float, plan.windows[0].lengths))))
    assert [step.window for step in player.of(GiveUp)] == [plan.windows[0].id]
    assert [step.window for step in player.of(Stop)] == [plan.windows[1].id]
    assert not [step for step in player.of(MoveTo) if step.window == plan.windows[1].id]


def test_where_no_modes_are_known_the_platform_is_seen_at_rest_before_a_move(irma4: Robot, plan: Plan):
    protocol, window = protocol_of(irma4, plan), plan.windows[0]
    still = Result(Outcome.FAIL, "The marker still moves 30.0 mm.")
    player = Player(lambda step: still if isinstance(step, Settle) else None)
    player.play(protocol.steady(window, "bring it to rest"))
    assert player.of(Settle)
    assert player.steps[-1] is player.of(Stop)[0]


@pytest.mark.parametrize("second", [Skipped, Retried])
def test_a_word_said_twice_ends_no_run(irma4: Robot, plan: Plan, second):
    """The second comes while the robot is held because of the first."""
    window = plan.windows[0]
    steps = protocol_of(irma4, plan).window(window, tuple(map(float, window.lengths)), swinging=False)
    next(steps)
    step = steps.throw(Skipped("by a key"))
    while not isinstance(step, Hold):
        step = steps.send(Result())
    step = steps.throw(second("by the same key"))
    at = tuple(map(float, window.lengths))
    player = Player(lambda step: Result(values=at) if isinstance(step, Hold) else None)
    assert player.play(_going_on(step, steps)) == (at, True)
    assert [given.outcome for given in player.of(GiveUp)] == [Outcome.SKIPPED]


def _going_on(step, steps):
    """A generator of steps from its present one on."""
    result = yield step
    while True:
        try:
            step = steps.send(result)
        except StopIteration as end:
            return end.value
        result = yield step


@pytest.mark.slow
def test_after_strokes_were_interrupted_the_new_rest_is_what_counts(irma4: Robot, plan: Plan):
    """The winches have come back within a millimetre: the platform rests elsewhere, and lengths are checked again."""
    window, rests = plan.windows[0], iter([(0.1, 0.0, 0.0), (0.2, 0.0, 0.0), (0.3, 0.0, 0.0), (0.4, 0.0, 0.0)])

    def answer(step):
        if isinstance(step, Settle):
            return Result(values=next(rests))
        return swung(step, np.array([0.03, 0.02])) if isinstance(step, SeeRecordedSwing) else None

    protocol, player = protocol_of(irma4, plan), Player(answer)
    rest = player.play(protocol.settle(window))
    steps = protocol.record(window, rest.values)

    def interrupted():
        step = next(steps)
        while True:
            if isinstance(step, Strokes) and step.displacement:
                return (yield from _going_on(steps.throw(Retried("paused")), steps))
            step = steps.send((yield step))

    player.play(interrupted())
    (taken,) = player.of(Accept)
    assert taken.equilibrium == player.of(CheckWindow)[-1].equilibrium
    assert taken.equilibrium[0] > 0.15
    assert player.of(ReadEncoders)
    assert player.of(CheckTension)


@pytest.mark.slow
def test_nothing_between_a_recording_and_its_verdict_is_interrupted(irma4: Robot, plan: Plan):
    """A recording that is not yet accepted is given up at an interruption."""

    def answer(step):
        return swung(step, np.array([0.003, 0.002])) if isinstance(step, SeeRecordedSwing) else None

    protocol, player = protocol_of(irma4, plan), Player(answer)
    rest = player.play(protocol.settle(plan.windows[0]))
    player.play(protocol.record(plan.windows[0], rest.values or (0.0, 0.0, 0.0)))
    inside, between = False, []
    for step in player.steps:
        if isinstance(step, Record):
            inside = True
        elif inside:
            between.append(step)
            inside = not isinstance(step, Accept | Reject)
    assert any(isinstance(step, Think) for step in between)
    assert {step.after_pause for step in between} == {AfterPause.NOT_INTERRUPTED}


@pytest.mark.slow
def test_a_run_that_begins_on_a_swinging_platform_calms_it_before_the_first_move(irma4: Robot, plan: Plan):
    def answer(step):
        if isinstance(step, WatchSwing):
            return swung(step, np.full(2, 0.001 if player.of(Strokes) else 0.02))
        return None

    protocol, player = protocol_of(irma4, plan, 3), Player(answer)
    player.play(protocol.window(plan.windows[0], tuple(map(float, plan.windows[1].lengths)), swinging=True))
    kinds = [type(step) for step in player.steps]
    assert kinds.index(WatchSwing) < kinds.index(Strokes) < kinds.index(MoveTo)
    calming_ = player.of(Strokes)[0]
    np.testing.assert_allclose(calming_.lengths, plan.windows[1].lengths, atol=1e-9)


def test_strokes_that_would_break_tensions_are_not_made(irma4: Robot, plan: Plan, monkeypatch):
    protocol, window = protocol_of(irma4, plan), plan.windows[0]

    def refused(*_):
        raise InfeasibleError("Strokes would pull too much.")

    monkeypatch.setattr(calming, "calmed", refused)
    player = Player(lambda step: swung(step, np.full(2, 0.02)) if isinstance(step, WatchSwing) else None)
    player.play(protocol.settle(window))
    player.play(protocol.steady(window, "bring it to rest"))
    assert [note.remark for note in player.of(Note)] == [f"{window.id}: Strokes would pull too much."]
    assert not player.of(Strokes)


@pytest.mark.slow
def test_the_body_is_identified_from_the_first_windows_until_it_is_known(irma4: Robot, plan: Plan):
    body, told = irma4.nominal.vector * 1.02, []

    def answer(step):
        if isinstance(step, SeeRecordedSwing):
            return swung(step, np.array([0.03, 0.02]))
        if isinstance(step, IdentifyBody):
            part = (0.04, 1e-4)[len(told)]
            told.append(step)
            return Result(values=(*body, *np.diag(part * sizes(irma4.nominal)).ravel()))
        return None

    protocol, player = protocol_of(irma4, plan), Player(answer)
    for _ in range(3):
        for window in plan.windows:
            player.play(protocol.settle(window))
            player.play(protocol.record(window, (0.0, 0.0, 0.0)))
    assert len(player.of(Accept)) == 6
    assert len(told) == 2, "known after the second"


@pytest.mark.parametrize("recorded", [0, 6])
@pytest.mark.slow
def test_a_run_that_goes_on_plans_with_the_body_that_its_windows_show(irma4: Robot, plan: Plan, recorded: int):
    body = irma4.nominal.vector * 1.02

    def answer(step):
        if isinstance(step, IdentifyBody):
            return Result(values=(*body, *np.diag(1e-4 * sizes(irma4.nominal)).ravel()))
        return swung(step, np.array([0.03, 0.02])) if isinstance(step, SeeRecordedSwing) else None

    protocol, player = protocol_of(irma4, plan, recorded), Player(answer)
    at = tuple(map(float, plan.windows[0].lengths))
    for window in plan.windows:
        player.play(protocol.window(window, at, swinging=False))
    kinds = [type(step) for step in player.steps]
    assert kinds.count(IdentifyBody) == 1
    assert (kinds.index(IdentifyBody) < kinds.index(Settle)) is (recorded > 0)


@pytest.mark.parametrize("again", ["planned again", "no second plan", "a worse one"])
@pytest.mark.sampled(1)
def test_a_swing_that_was_missed_is_kept_where_it_cannot_be_done_better(irma4: Robot, plan: Plan, monkeypatch, again):
    protocol, window = protocol_of(irma4, plan), plan.windows[0]
    first, plans = excite.planned, []

    def planned(*arguments, before=None):
        if plans and again == "no second plan":
            raise InfeasibleError("The winches cannot.")
        found = first(*arguments, before=before)
        if plans and again == "a worse one":
            return replace(found, reached=0.4 * plans[-1].reached)
        plans.append(found)
        return plans[-1]

    monkeypatch.setattr(excite, "planned", planned)
    monkeypatch.setattr(excite, "taught", lambda place, bodies, _plan, _seen, known: Lesson(place, bodies, known))

    # half of what was planned
    player = Player(lambda step: swung(step, 0.5 * plans[-1].reached) if isinstance(step, SeeRecordedSwing) else None)
    played, steps = player.play, player.steps
    assert played(protocol.settle(window)) is not None
    assert played(protocol.record(window, (0.0, 0.0, 0.0)))
    (accepted,) = [step for step in steps if isinstance(step, Accept)]
    assert accepted.outcome is Outcome.MARGINAL
    assert "were planned" in accepted.reason
    assert sum(isinstance(step, Reject) for step in steps) == (again == "planned again")
    assert not [step for step in steps if isinstance(step, GiveUp)]
