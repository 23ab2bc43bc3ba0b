"""Winch-driven windows through the real bytes of simulated drives: nobody is asked, lengths end where they began."""

from pathlib import Path

import numpy as np
import pytest

from drivers.ports import Prompt
from fidim_lab.app import compose
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Plan, Robot
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.excitation.seen import Lesson
from fidim_lab.identification.random_plan import Taste, random_plan
from procedures import excite
from procedures.catalogue import experiment, never_asks
from procedures.events import Event, StepFinished
from procedures.listing import Outline
from procedures.outcomes import Outcome
from procedures.report import RunReport
from procedures.run import run_procedure
from procedures.settings import MotionSettings, Settings
from procedures.steps import Accept, Ask, GiveUp, MoveTo, Reject, Result
from procedures.steps.excitation import SeeRecordedSwing, Strokes, Think


class Nobody:
    """An operator who must not be asked."""

    async def answer(self, prompt: Prompt) -> str:
        raise AssertionError(prompt.text)


@pytest.fixture(scope="module")
def plan(irma4: Robot) -> Plan:
    return random_plan(irma4, "alone", 2, 0, 1, Taste(taut=1.0, tight=1.0))


def carried_out(robot: Robot, plan: Plan, folder: Path, hide: tuple[str, ...]) -> tuple[RunReport, list[StepFinished]]:
    settings = Settings(motion=MotionSettings(length_limits=compose.length_limits(plan)))
    made = experiment("excite", plan, robot, settings)
    world = compose.simulated_world(robot, 1, hide)
    done: list[StepFinished] = []

    def listen(event: Event) -> None:
        if isinstance(event, StepFinished):
            done.append(event)

    async def run() -> RunReport:
        async with compose.simulated_rig(robot, plan, world, 1, operator=Nobody()) as simulated:
            return await run_procedure(
                made, simulated.rig, folder, wall_time=lambda: "2000-01-01T00:00:00Z", listeners=(listen,)
            )

    return compose.run_loop(run(), real_time=False), done


def test_every_step_is_known_before_and_none_asks(irma4: Robot, plan: Plan):
    settings = Settings(motion=MotionSettings(length_limits=compose.length_limits(plan)))
    steps = Outline(experiment("excite", plan, irma4, settings).procedure).steps
    assert not [step for step in steps if isinstance(step, Ask)]
    assert sum(isinstance(step, Strokes) for step in steps) == 2
    assert never_asks("excite")
    assert not never_asks("identify")


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
    assert sum(isinstance(e.step, Reject) for e in done) <= len(plan.windows)
    assert sum(isinstance(e.step, Accept) for e in done) == len(plan.windows)
    low, high = irma4.limits.tension
    factors = [winch.newton_per_ampere for winch in irma4.winches or ()]
    tensions = np.vstack([np.asarray(window.currents) * factors for window in campaign.windows])
    assert low * 0.9 < np.nanmin(tensions) < np.nanmax(tensions) < high * 1.05


def test_no_stroke_asks_a_winch_for_more_than_it_may_do(irma4: Robot, plan: Plan):
    settings = Settings(motion=MotionSettings(length_limits=compose.length_limits(plan)))
    steps = Outline(experiment("excite", plan, irma4, settings).procedure).steps
    chains = [chain for step in steps if isinstance(step, Strokes) for chain in step.chains]
    assert chains
    assert max(max(chain.speeds) for chain in chains) <= settings.excite.speed
    assert max(max(chain.accelerations) for chain in chains) <= settings.excite.acceleration


def test_moves_are_timed_for_the_modes(irma4: Robot, plan: Plan):
    settings = Settings(motion=MotionSettings(length_limits=compose.length_limits(plan)))
    steps = Outline(experiment("excite", plan, irma4, settings).procedure).steps
    moves = [step for step in steps if isinstance(step, MoveTo) and step.start is not None]
    assert moves
    for move in moves:
        assert move.speed <= settings.excite.speed
        assert move.acceleration <= settings.excite.acceleration


@pytest.mark.parametrize("again", [True, False], ids=["planned again", "no second plan"])
def test_a_swing_that_was_missed_is_kept_where_it_cannot_be_done_better(irma4: Robot, plan: Plan, monkeypatch, again):
    settings = Settings(motion=MotionSettings(length_limits=compose.length_limits(plan)))
    protocol, window, steps = excite.ExciteProtocol(irma4, settings), plan.windows[0], []
    first, plans = excite.planned, []

    def planned(*arguments):
        if plans and not again:
            raise InfeasibleError("The winches cannot.")
        plans.append(first(*arguments))
        return plans[-1]

    monkeypatch.setattr(excite, "planned", planned)
    monkeypatch.setattr(excite, "taught", lambda place, bodies, _plan, _seen, known: Lesson(place, bodies, known))

    def played(steps_of):
        result = None
        while True:
            try:
                step = steps_of.send(result)
            except StopIteration as end:
                return end.value
            steps.append(step)
            if isinstance(step, Think):
                step.job()
            if isinstance(step, SeeRecordedSwing):  # half of what was planned
                swing = 0.5 * plans[-1].reached
                table = [swing, 0 * swing, step.swing.frequencies, step.swing.damping, swing]
                result = Result(values=(0.0, *np.concatenate(table)))
            else:
                result = Result()

    assert played(protocol.settle(window)) is not None
    assert played(protocol.record(window, (0.0, 0.0, 0.0)))
    (accepted,) = [step for step in steps if isinstance(step, Accept)]
    assert accepted.outcome is Outcome.MARGINAL
    assert "were planned" in accepted.reason
    assert sum(isinstance(step, Reject) for step in steps) == int(again)
    assert not [step for step in steps if isinstance(step, GiveUp)]
