"""A window written by an independent simulator: the true body reproduces it down to its noise."""

import json

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import least_squares

from fidim_lab.data.records import Body, Pose
from fidim_lab.errors import InfeasibleError
from fidim_lab.model.geometry import rotation_matrix
from fidim_lab.model.kinematics import dependent_pose, pose_from_lengths
from fidim_lab.model.motion import best_axes, free_twist_basis, marker_selector, simulate_free_motion

MARKER_NOISE, LENGTH_NOISE = 1e-4, 2e-5

pytestmark = [pytest.mark.shared, pytest.mark.slow]


@pytest.fixture(scope="module")
def truth(shared):
    hidden = json.loads((shared / "campaigns/truth/open-nothing-left-out.json").read_text())
    return Body(com=np.array(hidden["s"]), inertia=np.array(hidden["I"]))


class Start:
    """An initial state with locked motors from eight numbers: small shifts of a pose, and free rates."""

    def __init__(self, mechanism, rest, first, rates):
        at = rest.pose.position[None], rest.pose.rotation[None]
        self.mechanism = mechanism
        self.axes = best_axes(mechanism.structure_matrix(*at), at[1], mechanism.robot.marker)
        values = first[None, list(self.axes)]
        found = dependent_pose(mechanism, rest.lengths, mechanism.robot.marker, self.axes, values, rest.pose)
        self.pose = Pose(found[0][0], found[1][0])
        self.guess = np.concatenate([np.zeros(6), rates[list(self.axes)]])

    def state(self, unknown):
        position = self.pose.position + unknown[:3]
        rotation = rotation_matrix(unknown[3:6] / 2) @ self.pose.rotation
        xi = self.mechanism.structure_matrix(position[None], rotation[None])
        selector = marker_selector(rotation[None], self.mechanism.robot.marker, self.axes)
        return Pose(position, rotation), free_twist_basis(xi, selector)[0] @ unknown[6:]


@pytest.mark.parametrize("name", ["i03", "v14"])
def test_a_recorded_window_is_reproduced_to_its_noise(paper, shared, truth, name):
    table = pd.read_csv(shared / f"campaigns/open-nothing-left-out/windows/{name}.csv")
    t, markers = table["t"].to_numpy(), table[["x", "y", "z"]].to_numpy()
    lengths = table[["l1", "l2", "l3", "l4"]].to_numpy().mean(axis=0)
    rest = pose_from_lengths(paper, truth, lengths)
    start = Start(paper, rest, markers[0], (markers[4] - markers[0]) / (t[4] - t[0]))

    def residual(unknown, samples):
        pose, twist = start.state(unknown)
        found = simulate_free_motion(paper, truth, pose, twist, t[:samples])
        if found.slack_time is not None:
            raise InfeasibleError("slack while fitting")
        missed = (found.motion.positions + found.motion.rotations @ paper.robot.marker - markers[:samples]).ravel()
        kept = paper.lengths(pose.position[None], pose.rotation[None])[0] - lengths
        return np.concatenate([missed / MARKER_NOISE, kept / LENGTH_NOISE])

    unknown = start.guess
    for samples in (30, 150, len(t)):
        fit = least_squares(residual, unknown, x_scale="jac", args=(samples,))
        unknown = fit.x
    left = fit.fun[:-4].reshape(-1, 3)
    dof = fit.fun.size - 8
    assert 2 * fit.cost / dof == pytest.approx(1.0, abs=4 * np.sqrt(2 / dof))
    assert left.std(axis=0) == pytest.approx(1.0, abs=0.1)
    slow = left[:1000].reshape(10, 100, 3).mean(axis=1)  # a second's mean of noise is a tenth of it
    assert np.abs(slow).max() < 0.45
