"""A rehearsal changes where devices are and how late they may be, and nothing else."""

from dataclasses import replace
from pathlib import Path

import pytest

from fidim_lab.app.compose.embedded import HOST, PATIENCE, Ports, free_ports, rehearsal_file
from fidim_lab.app.compose.real import rig_settings
from fidim_lab.app.compose.winches import winch_configs
from fidim_lab.app.session.simulators import SimulatorOptions, simulators_command
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.errors import SetupError

RIGS = sorted((Path(__file__).parents[4] / "examples" / "rigs").glob("*.toml"))


@pytest.mark.parametrize("path", RIGS, ids=lambda path: path.stem)
def test_every_example_can_be_rehearsed_with_its_own_limits(path):
    file = read_rig(path)
    made = rehearsal_file(file, Ports(1001, 1002, 1003))
    assert made.bus.channel == f"socket://{HOST}:1001"
    assert (made.motion_capture.port, made.hand.port) == (1002, 1003)
    assert len(made.motion_capture.markers) == len(file.robot.markers)
    assert all(winch.host_timeout >= PATIENCE and winch.sdo_timeout >= PATIENCE for winch in made.winches)
    ours, theirs = rig_settings(made), rig_settings(file)
    assert ours.motion.length_limits == theirs.motion.length_limits
    assert ours.guard.slack == theirs.guard.slack
    assert ours.guard.reactions == theirs.guard.reactions
    assert [c.scale for c in winch_configs(made)] == [c.scale for c in winch_configs(file)]
    assert rehearsal_file(made, Ports(1001, 1002, 1003)).winches == made.winches


def test_ports_are_free_and_different():
    ports = free_ports()
    assert ports.bus != ports.hand
    assert all(int(part) > 0 for part in ports.text.split(","))


@pytest.mark.parametrize("text", ["1,2", "a,b,c", "0,1,2", "1,2,70000"])
def test_wrong_ports_are_refused(text):
    with pytest.raises(SetupError, match="three ports are expected"):
        simulators_command(SimulatorOptions(RIGS[0], 1, (), None, ports=text))


def test_no_step_is_planned_faster_than_a_slow_winch():
    """Trials and slack, too: a drive would refuse the speed, and the check before a run now says so."""
    file = read_rig(RIGS[0])
    weak = {"max_speed": 0.02, "max_acceleration": 0.1}
    slow = replace(file, winches=tuple(winch.model_copy(update=weak) for winch in file.winches))
    told = rig_settings(slow)
    assert (told.motion.highest_speed, told.motion.highest_acceleration) == (0.02, 0.1)
    assert {told.motion.speed, told.commission.speed, told.taut.speed, told.align.speed} == {0.02}
    assert told.commission.acceleration == 0.1
