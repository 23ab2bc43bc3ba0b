"""What cameras report: derivatives by θ against finite differences, and recovery from another simulator's data."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Robot, Role
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.effects.geometry.frames import ClockRate, FrameMisalignment
from fidim_lab.effects.geometry.markers import MarkerOffset
from fidim_lab.effects.loads.oscillation import FrameSwayOwnPhase
from fidim_lab.identification.mle.fit import Fit, fit
from fidim_lab.identification.mle.trajectories.likelihood import linearised, simulate, stepped
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.model.sensitivity.grid import FINE
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign

EFFECTS = (
    (MarkerOffset(), (4e-3, -3e-3, 2e-3)),
    (FrameMisalignment(), (4e-3, -3e-3, 5e-3, 2e-3, -2e-3, 1e-3)),
    (ClockRate(), (2e-3,)),
)


def fitted(robot: Robot, hidden: str, effect: NamedEffect, theta: tuple[float, ...], seconds: float) -> Fit:
    plan = random_plan(robot, "short", 3, 0, 31)
    world = make_world(robot, np.random.default_rng(31), (parse_effect(hidden, robot.n),))
    campaign, _ = simulate_campaign(robot, plan, world, np.random.default_rng(32), recording=Sampling(seconds))
    sd = np.array([10 * parameter.scale for parameter in effect.parameters])
    return fit(Mechanism(robot, (effect,), theta, native=True), campaign.of_role(Role.IDENTIFY), theta_sd=sd)


@pytest.mark.parametrize(("effect", "theta"), EFFECTS, ids=lambda x: getattr(x, "id", ""))
def test_derivatives_agree_with_finite_differences(irma4: Robot, effect: NamedEffect, theta) -> None:
    found = fitted(irma4, f"{effect.id}", effect, theta, 0.6)
    likelihood, now = found.likelihood, found.journey.optimum.simulation
    point = now.point
    lines = {one.window: one for one in linearised(likelihood, now)}
    for k in range(len(theta)):
        step = 1e-5
        ends = []
        for sign in (1, -1):
            shared = point.shared.copy()
            shared[BODY + k] += sign * step
            ends.append(simulate(likelihood, replace(point, shared=shared), now.ends, FINE))
        for w, line in lines.items():
            difference = (ends[0].residuals[w].markers - ends[1].residuals[w].markers) / (2 * step)
            ours = line.by_shared[: len(difference), BODY + k]
            assert ours == pytest.approx(difference, abs=1e-4 * np.abs(difference).max())


def test_cameras_that_see_a_phase_of_each_window_have_its_derivative(irma4: Robot) -> None:
    theta = (4e-4, -2e-4, 1e-4, 3e-4, 5e-4, -1e-4, 1.7)
    found = fitted(irma4, "frame-sway", FrameSwayOwnPhase(), theta, 0.6)
    likelihood, now = found.likelihood, found.journey.optimum.simulation
    step = 1e-5
    own, count = likelihood.own, len(likelihood.recordings)
    for column in (own - 1, 0):  # the phase, and x
        ends = []
        for sign in (1, -1):
            steps = np.zeros((count, own))
            steps[:, column] = sign * step
            ends.append(simulate(likelihood, stepped(likelihood, now, steps, np.zeros(BODY + 7)), now.ends, FINE))
        alone = {one.window: one for one in linearised(likelihood, now, held=True)}
        for line in linearised(likelihood, now):
            assert alone[line.window].by_own == pytest.approx(line.by_own)
            assert alone[line.window].by_shared.shape[1] == 0
            difference = (ends[0].residuals[line.window].markers - ends[1].residuals[line.window].markers) / (2 * step)
            ours = line.by_own[: len(difference), column]
            assert ours == pytest.approx(difference, abs=1e-4 * np.abs(difference).max())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "hidden", "truth"),
    [
        (MarkerOffset(), "marker-offset:dx=0.004,dy=-0.003,dz=0.002", (4e-3, -3e-3, 2e-3)),
        (FrameMisalignment(), "frame-misalignment", (4e-3, -3e-3, 5e-3, 2e-3, -2e-3, 1e-3)),
    ],
    ids=lambda x: getattr(x, "id", ""),
)
def test_what_another_simulator_hid_comes_back(irma4: Robot, effect: NamedEffect, hidden: str, truth) -> None:
    found = fitted(irma4, hidden, effect, tuple(np.zeros(len(truth))), 6.0)
    assert found.chi2_per_dof == pytest.approx(1.0, abs=0.07)
    assert np.abs((found.values[BODY:] - truth) / found.sd[BODY:]).max() < 4.5


@pytest.mark.slow
def test_a_fast_clock_is_told_as_gravity_and_clock_together_allow(irma4: Robot) -> None:
    found = fitted(irma4, "clock-rate:rate=0.002", ClockRate(), (0.0,), 6.0)
    assert found.chi2_per_dof == pytest.approx(1.0, abs=0.07)
    assert found.values[BODY] == pytest.approx(2e-3, abs=4 * found.sd[BODY])
