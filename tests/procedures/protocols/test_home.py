"""Homing: at a known pose, at known lengths, by markers; without power, and nothing moves."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from drivers.ports import DriveState, MarkerFrame, PromptKind
from fidim_lab.data.plan_file import read_plan, write_plan
from fidim_lab.data.records import Plan, PlannedWindow, Pose, Role
from fidim_lab.errors import SetupError
from fidim_lab.model.mechanism import Mechanism
from procedures.outcomes import Outcome
from procedures.protocols.catalogue import CATALOGUE, experiment
from procedures.protocols.home import known_lengths
from procedures.protocols.listing import Outline
from procedures.run import run_procedure
from sim_backends.jumping_loop import run
from sim_backends.plant.mechanics.pulley import tangent

POSE = Pose(np.array([1.27, -0.17, -0.32]), Rotation.from_rotvec([0.05, -0.03, 0.1]).as_matrix())


def plan_at(pose=None, lengths=(1.41, 1.42, 1.43, 1.44)):
    return Plan(
        "jig",
        (PlannedWindow("jig", Role.IDENTIFY, np.array(lengths), np.zeros(2), np.array([1.2, -0.2, -0.3]), pose),),
    )


def carry_out(world, plan, folder, **home):
    settings = replace(world.settings, home=replace(world.settings.home, **home))
    told = {}

    def set_length_of(winch):
        async def set_length(length):
            assert winch.state is DriveState.SWITCH_ON_DISABLED
            told[winch.name] = length

        return set_length

    for winch in world.winches:
        winch.set_length = set_length_of(winch)
    made = experiment("home", plan, world.robot, settings, statics=lambda lengths: np.full(len(lengths), 60.0))
    report = run(run_procedure(made, world.rig, folder, wall_time=lambda: "now", listeners=(world.hear,)))
    return report, list(told.values())


def test_known_lengths_are_taken_and_nothing_is_powered(world, tmp_path):
    report, told = carry_out(world, plan_at(), tmp_path / "run")
    assert report.outcome is Outcome.PASS, report.reason
    assert told == [1.41, 1.42, 1.43, 1.44]
    assert [prompt.kind for prompt in world.operator.asked] == [PromptKind.CONFIRM]
    assert all(winch.commands == ["configure"] for winch in world.winches)
    assert "+10.0, +20.0, +30.0, +40.0 mm" in report.windows[0].reason


def test_lengths_of_a_known_pose_go_by_the_robot_file(world, tmp_path):
    report, told = carry_out(world, plan_at(POSE), tmp_path / "run")
    assert report.outcome is Outcome.PASS, report.reason
    assert told == pytest.approx([_length(cable, POSE) for cable in world.robot.cables], abs=1e-9)


def _length(cable, pose):
    """By the simulated plant's pulley, which shares nothing with the model that homing uses."""
    from_entry = pose.position + pose.rotation @ cable.a - cable.d
    return float(ca.evalf(tangent(ca.SX(ca.DM(from_entry)), cable).length))


def test_the_operator_may_leave_it(world, tmp_path):
    world.operator.answers[PromptKind.CONFIRM] = "abort"
    report, told = carry_out(world, plan_at(), tmp_path / "run")
    assert (report.outcome, told) == (Outcome.ABORTED, [])


def test_a_winch_that_creeps_is_not_homed(world, tmp_path):
    world.winches[2].creep = 0.01
    report, told = carry_out(world, plan_at(), tmp_path / "run")
    assert (report.outcome, told) == (Outcome.FAIL, [])
    assert "movement of the encoder of cable 3" in report.reason


class ThreeMarkers:
    """A source of whole frames of the platform in one pose."""

    rate = 100.0

    def __init__(self, world, body, pose, noise=1e-4):
        self.world, self.noise, self.rng = world, noise, np.random.default_rng(3)
        self.places = pose.position + body @ pose.rotation.T

    def latest(self):
        number = int(self.world.now() * self.rate)
        places = self.places + self.rng.normal(0.0, self.noise, self.places.shape)
        return MarkerFrame(self.world.now(), number, tuple(tuple(place) for place in places))

    async def frames(self):
        while True:
            await self.world.clock.sleep(0.01)
            yield self.latest()

    def counters(self):
        return {}


@pytest.fixture
def marked(world):
    body = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.02], [0.0, 0.12, 0.0], [-0.05, -0.05, 0.1]])
    world.robot = replace(world.robot, marker=body[0], extra_markers=tuple(body[1:]))
    world.markers = ThreeMarkers(world, body, POSE)
    return world


def test_a_measured_pose(marked, tmp_path):
    report, told = carry_out(marked, plan_at(), tmp_path / "run", by_markers=True)
    assert report.outcome is Outcome.PASS, report.reason
    truth = Mechanism(marked.robot).lengths(POSE.position[None], POSE.rotation[None])[0]
    assert told == pytest.approx(truth, abs=1e-4)


@pytest.mark.parametrize("wrong", ["swing", "cluster", "hidden"])
def test_a_pose_that_cannot_be_measured(marked, tmp_path, wrong):
    source = marked.markers
    if wrong == "swing":
        source.noise = 5e-3
    elif wrong == "cluster":
        source.places[1] += [0.02, 0.0, 0.0]
    else:
        whole = source.latest
        source.latest = lambda: replace(whole(), positions=(*whole().positions[:3], None))
    report, told = carry_out(marked, plan_at(), tmp_path / "run", by_markers=True)
    says = {"swing": "markers peak to peak", "cluster": "from those of the robot file", "hidden": "with all 4 markers"}
    assert (report.outcome, told) == (Outcome.FAIL, [])
    assert says[wrong] in report.reason


def test_one_marker_tells_no_pose(world):
    settings = replace(world.settings, home=replace(world.settings.home, by_markers=True))
    with pytest.raises(SetupError, match=r"has 1 marker\(s\); a pose is measured by 3 or more"):
        experiment("home", plan_at(), world.robot, settings)


def test_one_place_only(lab):
    with pytest.raises(SetupError, match="has 2 windows; homing is done at one place"):
        experiment("home", lab.plan, lab.make_world().robot)


def test_it_is_listed(lab):
    assert "home" in CATALOGUE
    world = lab.make_world()
    text = Outline(experiment("home", plan_at(POSE), world.robot).procedure).text()
    lengths = " ".join(f"{length:.4f}" for length in known_lengths(plan_at(POSE).windows[0], world.robot))
    assert "configure the winches, without power" in text
    assert f"present counts to lengths {lengths} m" in text
    assert "power on" not in text


def test_a_plan_file_keeps_its_pose(tmp_path):
    write_plan(tmp_path / "plan.toml", plan_at(POSE))
    (window,) = read_plan(tmp_path / "plan.toml", 4).windows
    assert window.pose.position == pytest.approx(POSE.position)
    assert window.pose.rotation == pytest.approx(POSE.rotation)
    write_plan(tmp_path / "plain.toml", plan_at())
    assert read_plan(tmp_path / "plain.toml", 4).windows[0].pose is None
