"""Poses on the surface of held lengths where the rest is far away and other poses pass near the marker."""

import numpy as np

from fidim_lab.data.records import Pose, Role, Window
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.identification.mle.starts.start import first_guess
from fidim_lab.identification.mle.trajectories.recordings import prepare
from fidim_lab.identification.motion import surface
from fidim_lab.model.kinematics import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import simulate_free_motion

LENGTHS = np.array([1.90395, 1.92609, 1.76089, 1.69871])
PLACE = (1.18648, 0.01361, -0.95871)


def test_samples_that_end_in_another_valley_begin_again_beside_a_neighbour():
    robot = read_robot(PAPERS_ROBOT)
    mechanism = Mechanism(robot)
    t = np.arange(50) / 100
    held = np.tile(PLACE, (50, 1))[:, np.newaxis]
    window = Window("i02", Role.IDENTIFY, t, held, np.tile(LENGTHS, (50, 1)), None, np.array(PLACE))
    guess = first_guess(mechanism, robot.nominal, prepare(window, robot))
    start = Pose(guess.position, guess.rotation)
    lengths = mechanism.lengths(start.position[np.newaxis], start.rotation[np.newaxis])[0]
    times = np.linspace(0.0, 2.0, 101)
    motion = simulate_free_motion(mechanism, robot.nominal, start, np.zeros(6), times, 0.005).motion
    markers = (motion.positions + motion.rotations @ robot.marker)[:, np.newaxis]
    rest = pose_from_lengths(mechanism, robot.nominal, lengths).pose
    each = [surface.poses(mechanism, lengths, robot.markers[:1], one[np.newaxis], rest) for one in markers]
    assert max(one.misfit[0] for one in each) > 1e-3  # some, alone, are led elsewhere
    found = surface.poses(mechanism, lengths, robot.markers[:1], markers, rest)
    assert found.misfit.max() < 1e-6
    assert np.abs(found.rotations - motion.rotations).max() < 1e-3
