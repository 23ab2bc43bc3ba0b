"""Plans of excitation, carried out by the independent plant: swing, tensions, what a second try learns, calming."""

import numpy as np
import pytest

from benchmarks.excite.swung import Swung, carry_out
from fidim_lab.data.records import Robot
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.excitation.bodies import Bodies
from fidim_lab.identification.excitation.calm import calmed
from fidim_lab.identification.excitation.knowledge import Knowledge
from fidim_lab.identification.excitation.place import ExcitationPlace, WinchLimits, wanted_amplitudes
from fidim_lab.identification.excitation.plan import Excitation, planned
from fidim_lab.identification.excitation.seen import learnt, seen_swing
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.mechanism import Mechanism
from sim_backends.plant.hidden import HiddenEffect
from sim_backends.plant.plant import Plant
from sim_backends.plant.world import World, make_world

LIMITS = WinchLimits(speed=0.5, acceleration=3.0)


@pytest.fixture(scope="module")
def place(irma4: Robot) -> ExcitationPlace:
    mechanism = Mechanism(irma4, native=True)
    rest = equilibrium_at(mechanism, irma4.nominal, np.array([1.25, -0.15, -0.2]))
    return ExcitationPlace.at(mechanism, rest.lengths)


def world_of(robot: Robot, place: ExcitationPlace, hidden: tuple[HiddenEffect, ...] = ()) -> World:
    return make_world(robot, np.random.default_rng(3), hidden, body=place.body)


def swung(world: World, place: ExcitationPlace, excitation: Excitation, seconds: float = 6.0) -> Swung:
    plant = Plant(world)
    held = place.equilibrium.lengths
    plant.settle(held)
    pieces = [
        (chain.pattern.pieces(), chain.direction, begin)
        for chain, begin in zip(excitation.chains, excitation.begins, strict=True)
    ]
    return carry_out(plant, held, pieces, seconds)


def none_known(damping: float) -> Knowledge:
    return Knowledge(np.full(2, damping), np.ones(2), np.ones(2), np.full(2, damping))


def test_no_displacement_is_refused_in_words(place: ExcitationPlace):
    with pytest.raises(InfeasibleError, match="displacement is zero"):
        planned(place, np.zeros(2))


def test_the_plant_swings_as_planned(irma4: Robot, place: ExcitationPlace):
    wanted = wanted_amplitudes(place, np.array([0.02, 0.01]))
    excitation = planned(place, wanted, none_known(0.0), LIMITS)
    found = swung(world_of(irma4, place), place, excitation)
    seen = seen_swing(place.swing, found.t, found.markers[:, 0])
    assert seen is not None
    assert excitation.why_less == ""
    np.testing.assert_allclose(seen.amplitudes, wanted, atol=0.1 * float(np.linalg.norm(wanted)))
    np.testing.assert_allclose(seen.frequencies, place.swing.frequencies, rtol=0.06)  # large swings are slower
    low, high = irma4.limits.tension
    assert low <= found.tension[0] < found.tension[1] <= high
    mass = world_of(irma4, place).mass / irma4.mass
    np.testing.assert_allclose(found.tension, np.array(excitation.tension) * mass, rtol=0.05)


def test_a_second_try_learns_the_damping(irma4: Robot, place: ExcitationPlace):
    wanted = wanted_amplitudes(place, np.array([0.015, 0.01]))
    world = world_of(irma4, place, (HiddenEffect("rotational-drag", None, (("c", 0.15),)),))
    knowledge = none_known(0.0)
    first = planned(place, wanted, knowledge, LIMITS)
    found = swung(world, place, first)
    seen = seen_swing(place.swing, found.t, found.markers[:, 0])
    assert seen is not None
    assert np.linalg.norm(seen.amplitudes) < 0.9 * np.linalg.norm(wanted)
    knowledge = learnt(place, first, seen, knowledge)
    assert knowledge.damping == pytest.approx(seen.damping, rel=0.15)
    second = planned(place, wanted, knowledge, LIMITS)
    again = swung(world, place, second)
    seen = seen_swing(place.swing, again.t, again.markers[:, 0])
    assert seen is not None
    np.testing.assert_allclose(np.linalg.norm(seen.amplitudes), np.linalg.norm(second.reached), rtol=0.15)


@pytest.mark.slow
def test_wide_bodies_and_tight_limits_make_the_swing_smaller(irma4: Robot, place: ExcitationPlace):
    wanted = wanted_amplitudes(place, np.array([0.05, 0.04]))
    free = planned(place, wanted, none_known(0.0), LIMITS)
    bound = planned(place, wanted, none_known(0.0), LIMITS, Bodies.around(irma4.nominal).others, (45.0, 130.0))
    assert "tensions" in bound.why_less
    assert np.linalg.norm(bound.reached) < 0.8 * np.linalg.norm(free.reached)
    assert 45.0 <= bound.tension[0] < bound.tension[1] <= 130.0


def test_what_winches_cannot_do_is_refused_in_words(place: ExcitationPlace):
    with pytest.raises(InfeasibleError, match="cannot make the platform swing"):
        planned(place, np.array([0.08, 0.08]), none_known(0.1), WinchLimits(0.02, 0.02))


def test_a_second_try_repeats_its_strokes_larger(place: ExcitationPlace):
    """What was seen of strokes tells what the same ones do; what others do, the model tells."""
    wanted = wanted_amplitudes(place, np.array([0.01, 0.005]))
    first = planned(place, wanted, none_known(0.02), LIMITS)
    weak = Knowledge(np.full(2, 0.02), np.ones(2), np.full(2, 0.8), np.full(2, 0.02))
    second = planned(place, wanted, weak, LIMITS, before=first)
    assert second.modes == first.modes
    assert second.reached == pytest.approx(wanted, rel=0.03)
    for before, now in zip(first.chains, second.chains, strict=True):
        assert now.pattern.turns == before.pattern.turns
        ratio = now.direction / before.direction
        assert ratio == pytest.approx(1 / 0.8, rel=0.1)
    # strokes that cannot be made so large give way to others, and these are not said to be weak
    deaf = Knowledge(np.full(2, 0.02), np.ones(2), np.full(2, 0.5), np.full(2, 0.02))
    hardly = WinchLimits(speed=0.5, acceleration=1.3 * max(chain.acceleration for chain in first.chains))
    other = planned(place, wanted, deaf, hardly, before=first)
    alone = planned(place, wanted, none_known(0.02), hardly)
    assert other.reached == pytest.approx(alone.reached, rel=0.05)
    assert all(chain.acceleration <= hardly.acceleration for chain in other.chains)


def test_winches_take_a_swing_away(irma4: Robot, place: ExcitationPlace):
    wanted = wanted_amplitudes(place, np.array([0.01, 0.008]))
    excitation = planned(place, wanted, none_known(0.0), LIMITS)
    plant, held = Plant(world_of(irma4, place)), place.equilibrium.lengths
    plant.settle(held)
    pieces = [(c.pattern.pieces(), c.direction, b) for c, b in zip(excitation.chains, excitation.begins, strict=True)]
    found = carry_out(plant, held, pieces, 4.0)
    before = np.ptp(found.markers[-150:, 0], axis=0).max()
    for _ in range(4):
        seen = seen_swing(place.swing, found.t, found.markers[:, 0], at_end=True)
        assert seen is not None
        now = float(found.t[-1])
        swing = place.swing
        calming = calmed(place, swing, seen.states(swing, now), now, now + 0.3, LIMITS)
        pieces = [(calming.chain.pattern.pieces(), calming.chain.direction, calming.begin - now)]
        found = carry_out(plant, held, pieces, 4.0)
    assert np.ptp(found.markers[-150:, 0], axis=0).max() < 0.05 * before
