"""Quiet springs: against springs that are followed at small steps, for any stiffness, and against differences."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.effects.cables.cable_elasticity import CableStiffness, WinchHoldCompliance
from fidim_lab.model.kinematics import equilibrium_at
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity import markers
from fidim_lab.model.sensitivity.grid import FINE, Grid, Resolution, radau
from fidim_lab.model.sensitivity.integrate import States, Trajectories, integrate
from fidim_lab.model.sensitivity.starts import linearised_starts, moved, own_count, quiet_springs, tied
from fidim_lab.model.sensitivity.variation import variations

MARKER = np.array([[0.1, -0.1, 0.2]])
BEGINS = np.array([0.0, 0.0])
LATER = np.arange(0.5, 1.5, 0.037)
"""s, when what rang at first has gone: 40 N s/m on 10 kg leave a hundredth after half a second"""

RING = 3e-6
"""m, of what is left of the ringing then"""


def begun(robot, effect, softness: float) -> tuple[Mechanism, np.ndarray, States]:
    """Two windows, swinging, their springs as quiet as rigid cables say."""
    mechanism = Mechanism(robot, (effect,), [softness], springs=True, quiet=True)
    rigid, body = Mechanism(robot), robot.nominal
    rest = equilibrium_at(rigid, body, np.array([1.25, -0.15, -0.2])).pose
    twists = 0.3 * np.random.default_rng(2).normal(size=(2, 6))
    states = States(np.tile(rest.position, (2, 1)), np.tile(rest.rotation, (2, 1, 1)), twists)
    shared = np.concatenate([body.vector, mechanism.theta])
    held = tied(rigid, body.vector, states, BEGINS)
    return mechanism, shared, tied(mechanism, shared, held, BEGINS)


def followed(mechanism, shared, states, resolution: Resolution, seconds=1.5) -> Trajectories:
    starts = linearised_starts(mechanism, shared, states, BEGINS)
    grid = Grid.covering(seconds, resolution)
    return integrate(mechanism, shared, states, grid, BEGINS, starts.unstretched, starts.extra)


def seen(found: Trajectories, times=LATER) -> np.ndarray:
    index, weights = markers.hermite(found.grid.t, times)
    return np.stack([markers.between(one, index, weights) for one in markers.at_nodes(found, MARKER)])


@pytest.mark.parametrize("softness", [5e-6, 1e-6])
@pytest.mark.parametrize("effect", [CableStiffness(), WinchHoldCompliance(2)])
def test_quiet_springs_move_as_ringing_ones_do_on_the_whole(paper, effect, softness):
    mechanism, shared, states = begun(paper.robot, effect, softness)
    ringing = Mechanism(paper.robot, (effect,), [softness], springs=True)
    fine = FINE.for_frequency(quiet_springs(ringing, shared, states, BEGINS).fastest)
    apart = seen(followed(mechanism, shared, states, FINE.for_stiff)) - seen(followed(ringing, shared, states, fine))
    rigid = Mechanism(paper.robot)
    stretched = seen(followed(ringing, shared, states, fine)) - seen(
        integrate(rigid, shared[:9], replace(states, tensions=None), Grid.covering(1.5, FINE), BEGINS)
    )
    assert np.abs(apart).max() < max(0.02 * np.abs(stretched).max(), RING)


def test_any_stiffness_costs_the_same_and_the_stiffest_is_rigid(paper):
    mechanism, shared, states = begun(paper.robot, CableStiffness(), 1e-10)
    rigid = integrate(
        Mechanism(paper.robot), shared[:9], replace(states, tensions=None), Grid.covering(1.5, FINE), BEGINS
    )
    found = followed(mechanism, shared, states, FINE.for_stiff)
    assert found.grid.nodes == 15 * 12 + 1
    assert np.abs(seen(found) - seen(rigid)).max() < 1e-6
    np.testing.assert_allclose(found.tensions[:, -1], rigid.tensions[:, -1], rtol=1e-3)


def test_derivatives_of_quiet_springs_are_derivatives(paper):
    mechanism, shared, states = begun(paper.robot, CableStiffness(), 2e-6)
    starts = linearised_starts(mechanism, shared, states, BEGINS)
    found = followed(mechanism, shared, states, FINE.for_stiff)
    by = variations(mechanism, found, shared, starts.states_by, unstretched=starts.unstretched_by)
    index, weights = markers.hermite(found.grid.t, LATER)
    exact = markers.between(markers.varied_at_nodes(found, by, MARKER)[0], index, weights)
    own = own_count(mechanism)
    for column, step in [(0, 1e-6), (4, 1e-6), (own + 2, 1e-6), (own + 9, 1e-9)]:
        ends = []
        for sign in (1.0, -1.0):
            there, steps = shared.copy(), np.zeros((2, own))
            if column < own:
                steps[:, column] = sign * step
            else:
                there[column - own] += sign * step
            changed = moved(mechanism, there, states, starts, steps, BEGINS)
            ends.append(seen(followed(mechanism, there, changed, FINE.for_stiff))[0])
        numeric = (ends[0] - ends[1]) / (2 * step)
        assert np.linalg.norm(exact[..., column] - numeric) < 1e-3 * np.linalg.norm(numeric), column


def test_a_motion_that_has_no_solution_is_nan_and_leaves_the_others_be(paper):
    mechanism, shared, states = begun(paper.robot, CableStiffness(), 2e-6)
    alone = followed(mechanism, shared, states, FINE.for_stiff, seconds=0.3)
    broken = replace(states, twists=states.twists * np.array([[1.0], [1e6]]))
    with np.errstate(all="ignore"):
        found = followed(mechanism, shared, broken, FINE.for_stiff, seconds=0.3)
    assert found.breaks_down(1, 0.3)
    assert not found.breaks_down(0, 0.3)
    np.testing.assert_allclose(found.positions[0], alone.positions[0], atol=1e-8)


def test_a_motion_too_quick_for_its_blocks_is_said_to_be(paper):
    """The platform flung and rocking at its window's begin, as between nearly slack cables; the other swings gently."""
    mechanism, shared, states = begun(paper.robot, CableStiffness(), 2e-6)
    flung = replace(states, twists=states.twists * np.array([[1.0], [30.0]]))
    resolution = FINE.for_stiff
    found = followed(mechanism, shared, flung, resolution)
    assert found.is_coarse.tolist() == [False, True]
    finer = followed(mechanism, shared, flung, resolution.halved.halved)
    assert not finer.is_coarse.any()
    apart = np.abs(seen(found) - seen(finer)).max(axis=(1, 2, 3))
    assert apart[0] < RING
    assert apart[1] > 10 * RING


def test_radau_nodes_integrate_polynomials_exactly():
    nodes, matrix = radau(4)
    assert nodes[0] == 0
    assert nodes[-1] == 1
    np.testing.assert_allclose(matrix @ nodes**3, nodes**4 / 4, atol=1e-14)
    assert (matrix[-1] @ nodes**6) == pytest.approx(1 / 7, abs=1e-14)  # order 2 k − 1 at the end
    assert not matrix[:, 0].any()
