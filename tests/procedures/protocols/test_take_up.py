"""Slack taken up by torque: by itself and before homing, the platform fixed, one cable after another."""

from dataclasses import replace

import numpy as np
import pytest

from drivers.ports import DriveState, PromptKind
from fidim_lab.data.records import Plan, PlannedWindow, Role
from fidim_lab.errors import DeviceError, SetupError
from procedures.expected.tensions import by_current, current_for
from procedures.outcomes import Outcome
from procedures.protocols.catalogue import experiment
from procedures.protocols.listing import Outline
from procedures.run import run_procedure
from procedures.settings import TensionBand
from sim_backends.jumping_loop import run

JIG = Plan(
    "jig", (PlannedWindow("jig", Role.IDENTIFY, np.full(4, 1.4), np.zeros(2), np.array([1.2, -0.2, -0.3]), None),)
)
NEWTON_PER_AMPERE = 34.0


class Slack:
    """Cables that are wound by 10 mm more each; what was asked of them, and what happens meanwhile."""

    def __init__(self, world):
        self.world = world
        self.asked = []
        self.meanwhile = lambda cable: None
        self.raises = {}
        self.pulls = tuple(self._of(k) for k in range(4))
        for winch in world.winches:
            winch.power_off = self._power_off(winch)
            winch.set_length = self._set_length(winch)
        self.set_with_power = []

    def _of(self, cable):
        async def pull(current, speed, way):
            self.asked.append((cable, current, speed, way, [w.state for w in self.world.winches]))
            self.meanwhile(cable)
            await self.world.clock.sleep(0.5)
            if cable in self.raises:
                raise self.raises[cable]
            return 0.01 * (cable + 1)

        return pull

    def _power_off(self, winch):
        def power_off():
            winch.commands.append("power_off")
            winch.state, winch.commanded, winch.powered = DriveState.SWITCH_ON_DISABLED, None, False

        return power_off

    def _set_length(self, winch):
        async def set_length(length):
            self.set_with_power.append(winch.state is DriveState.OPERATION_ENABLED)

        return set_length


@pytest.fixture
def slack(world):
    return Slack(world)


def carry_out(world, slack, folder, name="take-up", **settings):
    changed = replace(
        world.settings, **{key: replace(getattr(world.settings, key), **v) for key, v in settings.items()}
    )
    made = experiment(name, JIG, world.robot, changed, statics=lambda lengths: np.full(len(lengths), 60.0))
    rig = replace(world.rig, pulls=slack.pulls)
    return run(run_procedure(made, rig, folder, wall_time=lambda: "now", listeners=(world.hear,)))


def test_each_cable_is_pulled_in_turn_and_the_power_is_taken(world, slack, tmp_path):
    report = carry_out(world, slack, tmp_path / "run")
    assert report.outcome is Outcome.PASS, report.reason
    assert report.windows[0].reason == "10, 20, 30, 40 mm wound"
    assert [cable for cable, *_ in slack.asked] == [0, 1, 2, 3]
    lowest = world.robot.limits.tension[0]
    assert [current for _, current, *_ in slack.asked] == pytest.approx([lowest / _factor(world)] * 4)
    assert all(states == [DriveState.OPERATION_ENABLED] * 4 for *_, states in slack.asked)
    assert [winch.state for winch in world.winches] == [DriveState.SWITCH_ON_DISABLED] * 4
    assert [prompt.kind for prompt in world.operator.asked] == [PromptKind.CONFIRM]


def _factor(world):
    return world.robot.winches[0].newton_per_ampere


def test_the_operator_may_leave_it(world, slack, tmp_path):
    world.operator.answers[PromptKind.CONFIRM] = "abort"
    report = carry_out(world, slack, tmp_path / "run")
    assert (report.outcome, slack.asked) == (Outcome.ABORTED, [])
    assert all(winch.commands == ["configure"] for winch in world.winches)


def test_another_winch_that_faults_meanwhile_ends_it(world, slack, tmp_path):
    def fail(cable):
        if cable == 1:
            world.winches[3].fault = "overcurrent"

    slack.meanwhile = fail
    report = carry_out(world, slack, tmp_path / "run")
    assert report.outcome is Outcome.ERROR
    assert "overcurrent while slack is taken up at winch 2" in report.reason
    assert [cable for cable, *_ in slack.asked] == [0, 1]


def test_a_cable_that_does_not_become_taut_ends_it_held(world, slack, tmp_path):
    slack.raises = {2: DeviceError("winch 3", "the cable is not taut after 0.200 m; 0.2 m was allowed.")}
    report = carry_out(world, slack, tmp_path / "run")
    assert report.outcome is Outcome.ERROR
    assert "not taut" in report.reason
    assert "power_off" not in world.winches[0].commands
    assert world.winches[0].commands[-1] in ("hold", "quick_stop")


def test_a_rig_whose_winches_cannot_is_told_before_power(world, slack, tmp_path):
    slack.pulls = ()
    report = carry_out(world, slack, tmp_path / "run")
    assert report.outcome is Outcome.FAIL
    assert "cannot take up slack in torque mode" in report.reason
    assert all("enable" not in winch.commands for winch in world.winches)


def test_a_brake_that_lets_go_is_told(world, slack, tmp_path):
    def slips():
        world.winches[1].creep = 0.05

    world.at("TakePower", slips, after=0.01)
    report = carry_out(world, slack, tmp_path / "run")
    assert report.outcome is Outcome.FAIL
    assert "cable 2 moved without power" in report.windows[0].reason
    assert "do the brakes hold?" in report.windows[0].reason


def test_homing_takes_the_counts_while_the_motors_pull(world, slack, tmp_path):
    report = carry_out(world, slack, tmp_path / "run", "home", home={"taut": True}, taut={"tension": 34.0})
    assert report.outcome is Outcome.PASS, report.reason
    assert [current for _, current, *_ in slack.asked] == pytest.approx([34.0 / _factor(world)] * 4)
    assert slack.set_with_power == [True] * 4
    assert [winch.state for winch in world.winches] == [DriveState.SWITCH_ON_DISABLED] * 4
    assert len(world.operator.asked) == 2


def test_what_it_lists(world):
    made = experiment("take-up", JIG, world.robot, world.settings, statics=lambda lengths: np.full(len(lengths), 60.0))
    listed = [type(step).__name__ for step in Outline(made.procedure).steps]
    assert listed == ["Configure", "AskWithoutPower", "TakeUp", "TakePower", "GiveUpWithoutPower"]
    two = replace(JIG, windows=(JIG.windows[0], replace(JIG.windows[0], id="other")))
    with pytest.raises(SetupError, match="slack is taken up at one place"):
        experiment("take-up", two, world.robot, world.settings, statics=lambda lengths: np.full(len(lengths), 60.0))


@pytest.mark.parametrize(
    ("band", "expected"),
    [(None, 20.0), (TensionBand(3.0), 20.0), (TensionBand(3.0, 0.1, 1.0), 25.0)],
)
def test_the_current_of_a_winch_that_winds_is_the_tension_it_tells(band, expected):
    newton = current_for(20.0, band)
    assert newton == pytest.approx(expected)
    assert by_current(newton, -1, band).value == pytest.approx(20.0)
