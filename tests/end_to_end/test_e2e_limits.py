"""A plan that leaves the robot's limits: refused with window, cable and value named, before a single controlword."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Plan
from fidim_lab.errors import InfeasibleError
from procedures.expected import NominalRest
from procedures.expected.limits import RestLimits
from procedures.protocols import catalogue
from procedures.settings import MotionSettings

FAR = (1.20283, 1.39119, 1.52772, 1.41231)
"""a shorter first cable: two cables carry nearly everything"""


def moved(window, lengths):
    return replace(window, lengths=np.array(lengths))


def controlwords(frames):
    return [f for f in frames if f.id & 0x780 in (0x200, 0x600) or f.id == 0x000]


@pytest.fixture
def far(scene):
    first, second = scene.two.windows
    return Plan("too far", (first, moved(second, FAR)))


def test_an_equilibrium_outside_the_limits(scene, far):
    with pytest.raises(InfeasibleError) as refused:
        catalogue.experiment("identify", far, scene.robot, scene.short())
    said = str(refused.value)
    assert "window i02, move to lengths 1.203 1.391 1.528 1.412 m" in said
    assert "window i01" not in said
    assert "20 to 200 N is allowed" in said or "no equilibrium" in said
    assert "Nothing was moved." in said


def test_lengths_beyond_what_a_winch_may_wind(scene):
    limits = ((0.5, 1.31), *((0.5, 2.0),) * 3)
    settings = replace(scene.short(), motion=MotionSettings(length_limits=limits))
    with pytest.raises(
        InfeasibleError, match=r"window i02.*cable 1 would be 1\.363 m long, its winch allows 0\.500 to"
    ):
        catalogue.experiment("identify", scene.two, scene.robot, settings)


def test_a_displacement_beyond_the_limits(scene):
    first = replace(scene.two.windows[0], displacement=np.array([0.4, 0.0]))
    with pytest.raises(InfeasibleError, match=r"window i01.*displacement x is 0\.400 m, at most 0\.100 m is allowed"):
        catalogue.experiment("identify", Plan("a long pull", (first,)), scene.robot, scene.short())


def test_nothing_reaches_a_drive_and_no_folder_is_made(scene, rehearsal):
    """Also where the experiment was made under other limits than those that hold when it is to be run."""
    experiment = catalogue.experiment("identify", scene.two, scene.robot, scene.short())
    limits = replace(scene.robot.limits, tension=(20.0, 65.0))
    strict = replace(scene.robot, limits=limits)
    experiment = replace(experiment, workspace=RestLimits(strict, NominalRest(strict).tensions))
    frames = []
    rehearsal.at("", lambda stage: stage.rig.transport.tap(frames.append))
    with pytest.raises(InfeasibleError, match=r"window i01.*cable 1 would have 73\.\d N.*20 to 65 N is allowed"):
        rehearsal.run(experiment)
    assert not controlwords(frames)
    assert not rehearsal.folder.exists()


def test_a_robot_that_stands_where_no_safe_way_begins_is_not_moved(scene, rehearsal):
    """The plan is fine, but not the way from where the robot happens to be."""

    def narrow(lengths):
        tensions = np.array(NominalRest(scene.robot).tensions(lengths))
        return tensions if lengths[0] < 1.32 else tensions * 10.0  # where it stands now is out of bounds

    experiment = catalogue.experiment("identify", rehearsal.plan, scene.robot, scene.short(), statics=narrow)
    rehearsal.at("Enable", lambda stage: None)
    ended = rehearsal.run(experiment)
    report = ended.check()
    assert report.reason.startswith("Window i01, move to lengths 1.303 1.391 1.528 1.412 m")
    assert "on the way to it: at lengths 1.343 1.431 1.568 1.452 m cable" in report.reason
    assert report.exit_code == 1
    assert ended.rest == pytest.approx([0.0] * 4, abs=1.0)
