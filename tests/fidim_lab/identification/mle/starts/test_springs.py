"""Fits with cables that are springs: stiffness, body and held-out windows, and where rigid cables are as good."""

import json

import numpy as np
import pytest

from benchmarks.identification.elastic_motion import simulate_elastic_motion
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Role, Window
from fidim_lab.effects.cables.cable_elasticity import CableElasticity, CableStiffness, WinchHoldCompliance
from fidim_lab.identification.mle import held_out
from fidim_lab.identification.mle.fit import fit
from fidim_lab.identification.mle.starts.springs import with_springs
from fidim_lab.identification.mle.trajectories.optimise import Ending
from fidim_lab.identification.mle.trajectories.recordings import prepare
from fidim_lab.model.kinematics import equilibrium_at
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import simulate_free_motion

PLACES = [(1.25, -0.15, -0.2), (1.1, 0.1, -0.35), (1.35, -0.35, -0.3)]


def springy(robot, effect, softness, body, *, seconds=1.5, seed=0) -> list[Window]:
    """Windows of the other integrator: struck at rest, springs a little shaken, encoders as they read."""
    mechanism, rigid = Mechanism(robot, (effect,), [softness]), Mechanism(robot)
    random = np.random.default_rng(seed)
    t = np.arange(round(100 * seconds) + 1) / 100
    windows = []
    for k, place in enumerate(PLACES):
        rest = equilibrium_at(rigid, body, np.array(place))
        twist = 0.25 * random.standard_normal(6)
        xi = rigid.structure_matrix(rest.pose.position[None], rest.pose.rotation[None])[0]
        chosen = np.array([effect.concerns(number) for number in range(1, 5)])
        along = xi @ twist * np.where(chosen, 0.98, 1.0)
        twist -= np.linalg.pinv(xi) @ along
        held = simulate_free_motion(rigid, body, rest.pose, twist - np.linalg.pinv(xi) @ xi @ twist, t[:2])
        stretch = softness * held.tensions[0] * robot.mass
        if isinstance(effect, CableElasticity):
            stretch *= rest.lengths - 0.06
        lengths = rest.lengths - np.where(chosen, stretch, 0.0)
        found = simulate_elastic_motion(mechanism, body, rest.pose, twist, t, lengths)
        assert found.slack_time is None
        places = found.motion.positions[:, None] + (found.motion.rotations @ robot.marker)[:, None]
        places = places + robot.sensors.marker_noise * random.standard_normal(places.shape)
        read = lengths + robot.sensors.encoder_resolution * random.standard_normal(4)
        windows.append(Window(f"w{k + 1}", Role.IDENTIFY, t, places, np.tile(read, (len(t), 1)), None))
    return windows


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "softness"),
    [(CableElasticity(), 1.5e-5), (CableStiffness(cable=2), 4e-5)],
    ids=["all", "one"],
)
def test_stiffness_and_body_are_found(effect, softness, four, truth):
    body = truth(four)
    found = fit(Mechanism(four, (effect,)), springy(four, effect, softness, body))
    assert found.ending is Ending.CONVERGED
    assert found.likelihood.mechanism.springs
    assert 0.85 < found.chi2_per_dof < 1.15
    error = (found.values - np.append(body.vector, softness)) / found.sd
    assert np.abs(error).max() < 4


def test_a_window_that_was_not_fitted_is_predicted(four, truth):
    effect, body = CableStiffness(), truth(four)
    windows = springy(four, effect, 1.5e-5, body)
    mechanism = with_springs(Mechanism(four, (effect,)))
    held = prepare(windows[2], four)
    right = held_out.predict(mechanism, np.append(body.vector, 1.5e-5), held, four.sensors)
    wrong = held_out.predict(mechanism, np.append(body.vector, 3e-5), held, four.sensors)
    assert right.remainder.chi2_per_dof < 1.2
    assert wrong.remainder.chi2_per_dof > 2


@pytest.mark.slow
def test_stiff_springs_and_rigid_cables_agree_on_rigid_recordings(four, record):
    windows = record(four, 2, seconds=0.6, markers=3)
    rigid = fit(Mechanism(four), windows)
    stiff = fit(Mechanism(four, (CableStiffness(),), [1e-7]), windows, theta_sd=np.array([1e-9]))
    assert stiff.values[9] == pytest.approx(1e-7, rel=0.05)
    assert np.abs((stiff.values[:9] - rigid.values) / rigid.sd).max() < 1
    assert stiff.chi2_per_dof == pytest.approx(rigid.chi2_per_dof, rel=0.1)


def test_an_absent_compliance_starts_where_its_effect_proposes(four):
    made = with_springs(Mechanism(four, (CableStiffness(cable=2), WinchHoldCompliance(cable=1)), [3e-6, 0.0]))
    assert made.springs
    assert made.theta.tolist() == [3e-6, 1e-5]
    rigid = Mechanism(four)
    assert with_springs(rigid) is rigid


@pytest.mark.shared
@pytest.mark.slow
def test_the_open_campaign_with_elastic_cables_is_explained_to_its_noise(shared):
    campaign = read_campaign(shared / "campaigns" / "open-elastic-cables")
    truth = json.loads((shared / "campaigns" / "truth" / "open-elastic-cables.json").read_text())
    found = fit(Mechanism(campaign.robot, (CableStiffness(),), native=True), campaign.of_role(Role.IDENTIFY))
    error = (found.values - np.array([*truth["s"], *truth["I"], 1 / truth["case"]["par"]["kc"][0]])) / found.sd
    assert np.abs(error).max() < 3.5
    for window in campaign.of_role(Role.VALIDATE):
        held = prepare(window, campaign.robot)
        predicted = held_out.predict(found.likelihood.mechanism, found.values, held, campaign.robot.sensors)
        assert predicted.remainder.chi2_per_dof < 1.1
