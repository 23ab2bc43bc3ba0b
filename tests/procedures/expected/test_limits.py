"""The check before any motion, and ways around what is forbidden."""

import itertools
from functools import partial

import numpy as np
import pytest

from fidim_lab.data.records import Plan, PlannedWindow, Role
from fidim_lab.errors import InfeasibleError, SetupError
from fidim_lab.model.kinematics import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from procedures.expected import NominalRest
from procedures.expected.limits import RestLimits, check_moves, find_route
from procedures.protocols import catalogue
from procedures.protocols.experiment import Lab
from procedures.protocols.identify import identify
from procedures.protocols.listing import Outline
from procedures.settings import MotionSettings, Settings
from procedures.steps import MoveTo
from procedures.steps.excitation import StrokeChain, Strokes

# Table 2 of the paper: cable lengths of its twelve equilibria, m.
TABLE_2 = np.array(
    [
        [1.66, 1.32, 1.30, 1.52, 1.11, 1.38, 1.19, 1.16, 1.46, 1.43, 1.35, 1.52],
        [1.86, 1.58, 1.26, 1.26, 1.68, 1.39, 1.15, 1.17, 1.16, 1.37, 1.45, 1.12],
        [1.68, 1.99, 1.57, 1.27, 2.19, 1.36, 1.65, 1.63, 1.24, 1.27, 1.42, 1.17],
        [1.41, 1.76, 1.56, 1.50, 1.72, 1.32, 1.65, 1.59, 1.50, 1.30, 1.28, 1.54],
    ]
).T


def wall(lengths):
    """Slack in cable 2 where the first two lengths are both in the middle: straight across is forbidden."""
    x, y = lengths[0], lengths[1]
    return np.array([60.0, 5.0 if abs(x - 1.5) < 0.1 and abs(y - 1.5) < 0.1 else 60.0, 60.0, 60.0])


LEFT, RIGHT, ABOVE = (1.2, 1.5, 1.4, 1.4), (1.8, 1.5, 1.4, 1.4), (1.5, 1.9, 1.4, 1.4)


@pytest.fixture
def walled(irma4):
    return RestLimits(irma4, wall)


def plan_of(*sets, displacement=(0.03, 0.01)):
    return Plan(
        "a plan",
        tuple(
            PlannedWindow(f"i{k:02d}", Role.IDENTIFY, np.array(s), np.array(displacement), np.zeros(3))
            for k, s in enumerate(sets, start=1)
        ),
    )


def test_a_slack_cable_on_the_way_is_found_though_both_ends_are_good(walled):
    assert walled.at(LEFT) is None
    assert walled.at(RIGHT) is None
    assert "cable 2 would have 5.0 N by the nominal model, 20 to 200 N is allowed" in walled.between(LEFT, RIGHT)


def test_a_route_leads_around(walled):
    assert find_route(walled, LEFT, RIGHT, lambda: [LEFT, ABOVE, RIGHT]) == (ABOVE, RIGHT)


def test_a_free_way_is_taken_straight(walled):
    assert find_route(walled, LEFT, ABOVE, _never) == (ABOVE,)


def _never():
    raise AssertionError("nobody needs a detour")


def test_no_way_is_refused_with_what_stands_in_it(walled):
    with pytest.raises(InfeasibleError, match=r"No safe path from lengths 1\.200 .* cable 2 would have 5\.0 N"):
        find_route(walled, LEFT, RIGHT, list)


def test_few_windows_get_a_detour_through_the_workspace(irma4):
    """With only these two windows no planned equilibrium leads around; a place between them does."""
    two = [TABLE_2[3], TABLE_2[4]]
    workspace = RestLimits(irma4, NominalRest(irma4).tensions)
    sets = [tuple(float(v) for v in row) for row in two]
    rests = [pose_from_lengths(Mechanism(irma4), irma4.nominal, row).pose.position for row in two]
    plan = Plan("two", tuple(PlannedWindow(f"i{k}", Role.IDENTIFY, two[k], np.zeros(2), rests[k]) for k in range(2)))
    assert workspace.between(*sets) is not None
    moves = [s for s in Outline(catalogue.experiment("identify", plan, irma4).procedure).steps if isinstance(s, MoveTo)]
    assert [m.lengths for m in moves if not m.way_point] == sets
    assert any(m.way_point for m in moves)
    assert all(m.start is None or workspace.between(m.start, m.lengths) is None for m in moves)


def test_the_shortest_of_several_ways_is_taken(walled):
    far, near = (1.5, 2.5, 1.4, 1.4), (1.5, 1.8, 1.4, 1.4)
    assert find_route(walled, LEFT, RIGHT, lambda: [far, near]) == (near, RIGHT)


def test_lengths_beyond_a_winch_are_refused(irma4):
    workspace = RestLimits(irma4, wall, [(0.5, 2.0), (0.5, 2.0), (0.5, 1.3), (0.5, 2.0)])
    assert "cable 3 would be 1.400 m long, its winch allows 0.500 to 1.300 m" in workspace.at(LEFT)


def test_every_wrong_step_is_named(irma4):
    def tight(lengths):
        return np.array([60.0, 60.0, 60.0, 250.0 if lengths[3] > 1.45 else 60.0])

    plan = plan_of(LEFT, (1.2, 1.5, 1.4, 1.5), (1.2, 1.5, 1.4, 1.6))
    with pytest.raises(InfeasibleError) as refused:
        catalogue.experiment("identify", plan, irma4, statics=tight)
    assert "window i02, move to lengths 1.200 1.500 1.400 1.500 m" in str(refused.value)
    assert "window i03" in str(refused.value)
    assert "cable 4 would have 250.0 N by the nominal model, 20 to 200 N is allowed" in str(refused.value)
    assert "window i01" not in str(refused.value)


def test_a_displacement_beyond_the_limit_is_refused(irma4):
    with pytest.raises(InfeasibleError, match=r"displacement x is 0\.150 m, at most 0\.100 m is allowed"):
        catalogue.experiment("identify", plan_of(LEFT, displacement=(0.15, 0.0)), irma4, statics=wall)


def test_a_way_that_nothing_leads_around_names_its_window(irma4):
    with pytest.raises(InfeasibleError, match="Window i02: No safe path"):
        catalogue.experiment("identify", plan_of(LEFT, RIGHT), irma4, statics=wall)


def test_length_limits_come_from_the_settings(irma4):
    settings = Settings(motion=MotionSettings(length_limits=((0.5, 1.0),) * 4))
    with pytest.raises(InfeasibleError, match=r"its winch allows 0\.500 to 1\.000 m"):
        catalogue.experiment("identify", plan_of(LEFT), irma4, settings, statics=wall)


@pytest.mark.parametrize("id_", ["../i01", "", "a b"])
def test_an_id_that_is_no_file_name_is_refused(irma4, id_):
    plan = Plan("p", (PlannedWindow(id_, Role.IDENTIFY, np.array(LEFT), np.zeros(2), np.zeros(3)),))
    with pytest.raises(SetupError, match="cannot be a file name"):
        catalogue.experiment("identify", plan, irma4, statics=wall)


def test_no_equilibrium_is_refused_with_the_models_sentence(irma4):
    def none(_lengths):
        raise InfeasibleError("Cable 2 hangs slack at these lengths.")

    with pytest.raises(InfeasibleError, match="no equilibrium: Cable 2 hangs slack"):
        check_moves(
            [MoveTo(window="i01", lengths=LEFT, speed=0.1, acceleration=0.1, tolerance=1e-3)],
            irma4,
            RestLimits(irma4, none),
        )


def test_table_2_is_feasible_by_a_detour_that_the_nominal_model_asks_for(irma4):
    """The straight way from k = 4 to k = 5 leaves 20 N (a separate solver found 5.9 N); all others are free."""
    sets = [tuple(float(v) for v in row) for row in TABLE_2]
    workspace = RestLimits(irma4, NominalRest(irma4).tensions)
    wrong = [k for k, (a, b) in enumerate(itertools.pairwise(sets), start=1) if workspace.between(a, b)]
    assert wrong == [4]
    moves = [s for s in Outline(partial(identify, Lab(plan_of(*sets), irma4))).steps if isinstance(s, MoveTo)]
    assert len(moves) == 12  # without a router: straight
    way = find_route(workspace, sets[3], sets[4], lambda: sets)
    assert len(way) == 2
    assert way[-1] == sets[4]
    assert all(workspace.between(a, b) is None for a, b in zip((sets[3], *way), way, strict=False))


def strokes(to, displacement=()):
    held = LEFT
    chain = StrokeChain(
        begin=0.0, starts=(0.0, 0.4), targets=(to, held), speeds=(0.1,) * 4, accelerations=(1.0,) * 4, seconds=0.8
    )
    return Strokes(window="i01", lengths=held, chains=(chain,), why="excite", displacement=displacement, tolerance=1e-3)


def test_strokes_are_checked_before_any_motion(irma4, walled):
    check_moves([strokes((1.25, 1.5, 1.4, 1.4), (0.03, 0.01))], irma4, walled)
    with pytest.raises(InfeasibleError, match=r"window i01, excite.*cable 2 would have 5\.0 N"):
        check_moves([strokes((1.45, 1.5, 1.4, 1.4))], irma4, walled)
    with pytest.raises(InfeasibleError, match=r"displacement y is 0\.300 m, at most"):
        check_moves([strokes((1.25, 1.5, 1.4, 1.4), (0.0, 0.3))], irma4, walled)
