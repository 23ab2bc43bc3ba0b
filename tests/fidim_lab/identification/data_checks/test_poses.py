"""Poses of many robots at once are those of each by itself."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.identification.data_checks.poses import misfit, misfits, sampled
from fidim_lab.identification.data_checks.robot_changes import robot_changes
from fidim_lab.model.mechanism import Mechanism


@pytest.mark.parametrize("radius", [None, 0.0])
def test_misfits_of_many_robots_are_those_of_each(recorded, radius: float | None) -> None:
    """Also of one without pulleys, and where a change leaves no pose: an attachment inside its pulley."""
    campaign = recorded(noise=1e-4, cluster=True)
    cables = campaign.robot.cables if radius is None else [replace(c, radius=radius) for c in campaign.robot.cables]
    seen = sampled(replace(campaign.robot, cables=tuple(cables)), campaign.windows)
    assert seen is not None
    robots = [
        seen.robot,
        *[change.robot for change in robot_changes(seen.robot) if change.robot is not seen.robot][::7],
    ]
    huge = tuple(replace(cable, radius=3.0) for cable in cables[:1])
    robots += [replace(seen.robot, cables=(*huge, *cables[1:]))] if radius is None else []
    stretched = np.linspace(1.0, 1.01, len(robots))[:, np.newaxis, np.newaxis]
    lengths, markers = seen.lengths * stretched, np.array([seen.markers] * len(robots))
    found = misfits(robots, lengths, markers)
    alone = [misfit(Mechanism(robot), held, seen.markers) for robot, held in zip(robots, lengths, strict=True)]
    np.testing.assert_allclose(found, alone, rtol=1e-9)
    assert np.isfinite(found[0])
    assert radius is not None or found[-1] == np.inf


def test_where_the_equations_of_one_have_no_solution_each_is_looked_at_by_itself(
    recorded, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = sampled(recorded(noise=1e-4).robot, recorded(noise=1e-4).windows)
    assert seen is not None
    two, lengths, markers = [seen.robot] * 2, np.array([seen.lengths] * 2), np.array([seen.markers] * 2)
    expected, solve = misfits(two, lengths, markers), np.linalg.solve

    def alone(left: np.ndarray, right: np.ndarray) -> np.ndarray:
        if len(left) > len(seen.lengths):
            raise np.linalg.LinAlgError("Singular matrix")
        return solve(left, right)

    monkeypatch.setattr(np.linalg, "solve", alone)
    np.testing.assert_allclose(misfits(two, lengths, markers), expected, rtol=1e-9)
