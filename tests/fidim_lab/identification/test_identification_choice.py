"""Which method suits a campaign."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Campaign, Robot, Role, Window
from fidim_lab.identification.choice import soft_mode, suited_method
from fidim_lab.identification.equations.estimators import Method
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.mechanism import Mechanism

SHAPE = tuple(np.array(m) for m in ([0.1, 0.0, 0.3], [-0.1, 0.1, 0.25], [0.0, -0.2, 0.2], [0.2, 0.2, 0.1]))


def meeting(robot: Robot, share: float) -> Robot:
    """The robot with its attachments drawn together to a part of their distance from the middle line."""
    cables = tuple(replace(c, a=c.a * np.array([share, share, 1.0])) for c in robot.cables)
    return replace(robot, cables=cables, extra_markers=SHAPE)


def resting(robot: Robot, markers: int) -> Campaign:
    """A window in which nothing moves: enough to look at Ξ."""
    rest = equilibrium_at(Mechanism(robot), robot.nominal, np.array([1.1, -0.2, -0.4]))
    seen = rest.pose.position + robot.markers[:markers] @ rest.pose.rotation.T
    t = np.arange(60) * 0.01
    window = Window("i01", Role.IDENTIFY, t, np.tile(seen, (60, 1, 1)), np.tile(rest.lengths, (60, 1)), None)
    return Campaign("at rest", robot, 100.0, (window,))


@pytest.mark.parametrize("markers", [1, 5])
def test_firm_cables_take_maximum_likelihood(irma4: Robot, markers: int) -> None:
    choice = suited_method(resting(meeting(irma4, 1.0), markers))
    assert choice.method is Method.MLE
    assert choice.why == ""


def test_cables_that_meet_in_a_point_take_elastic_ones(irma4: Robot) -> None:
    campaign = resting(meeting(irma4, 0.02), 5)
    choice = suited_method(campaign)
    assert choice.method is Method.MLE
    assert "rigid cables are the wrong model" in choice.why
    assert "singular values" in (soft_mode(campaign) or "")
    assert soft_mode(resting(meeting(irma4, 1.0), 5)) is None


def test_without_the_whole_pose_it_is_at_least_said(irma4: Robot) -> None:
    campaign = resting(meeting(irma4, 0.02), 1)
    choice = suited_method(replace(campaign, robot=replace(campaign.robot, extra_markers=())))
    assert choice.method is Method.MLE
    assert "assumes rigid cables" in choice.why


@pytest.mark.shared
def test_the_recorded_campaigns_have_firm_cables(shared) -> None:
    for name in ("open-nothing-left-out", "open-two-at-once"):
        assert suited_method(read_campaign(shared / "campaigns" / name)).method is Method.MLE
