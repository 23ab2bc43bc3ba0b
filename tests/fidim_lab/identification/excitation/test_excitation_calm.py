"""Calming a swing by strokes: limits of tension and length on the way, and what each chain teaches of the next."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from benchmarks.excite.swung import Swung, carry_out
from fidim_lab.data.records import Body, Robot
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.excitation.calm import Calming, _on_its_cables, _pulls, calmed
from fidim_lab.identification.excitation.gains import Gains, Look
from fidim_lab.identification.excitation.motion import at_rest
from fidim_lab.identification.excitation.place import ExcitationPlace, WinchLimits
from fidim_lab.identification.excitation.seen import seen_swing
from fidim_lab.identification.excitation.strokes import Chain, Pattern
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.statics import balance
from sim_backends.plant.plant import Plant
from sim_backends.plant.world import make_world

LIMITS = WinchLimits(speed=0.5, acceleration=1.0)
LOOKING = 2.5
"""s"""
# Where CAD has the slow mode hardly moved by the winches (a third of the truth).
WEAK = np.array([1.5705, 1.2777, 1.2883, 1.5515])
TRUE = Body(com=np.array([1.0e-3, -3.9e-3, 0.1681]), inertia=np.array([0.0451, 0.0672, 0.0318, -9e-6, -8e-5, 7e-4]))


@dataclass
class Swinging:
    """A plant that swings, as a camera sees it."""

    robot: Robot
    place: ExcitationPlace
    plant: Plant
    last: Swung
    t: float = 0.0

    def seen(self, gain: np.ndarray):
        found = seen_swing(self.place.swing, self.last.t, self.last.markers[:, 0], at_end=True)
        assert found is not None
        damping = np.clip(found.damping, 0.0, 0.2)
        swing = replace(self.place.swing, frequencies=found.frequencies, damping=damping, gain=gain)
        return found.states(self.place.swing, float(self.last.t[-1])), swing, float(np.linalg.norm(found.amplitudes))

    def carry_out(self, calming: Calming, seconds: float = LOOKING) -> None:
        chain = calming.chain
        pieces = [(chain.pattern.pieces(), chain.direction, calming.begin - self.t)]
        self.last = carry_out(self.plant, self.place.equilibrium.lengths, pieces, seconds)
        self.t = calming.begin + chain.pattern.seconds + seconds


def swinging(robot: Robot, body: Body, size: float) -> Swinging:
    """The slow mode swings by `size` (m); CAD is the robot file's."""
    mechanism = Mechanism(robot, native=True)
    place, true = ExcitationPlace.at(mechanism, WEAK), ExcitationPlace.at(mechanism, WEAK, body).swing
    plant = Plant(make_world(robot, np.random.default_rng(3), (), body=body))
    plant.settle(WEAK)
    pattern = Pattern(0.5 / true.frequencies[0], 3, 0.9)
    moved = np.abs(true.gain[0] @ true.gain[0] * pattern.response(true.rates)[0] / np.imag(true.rates[0]))
    kick = size / (moved * true.lever[0]) * true.gain[0]
    first = carry_out(plant, WEAK, [(pattern.pieces(), kick, 0.0)], LOOKING)
    return Swinging(robot, place, plant, first, float(first.t[-1]))


@pytest.mark.parametrize("learns", [True, False], ids=["learns", "trusts CAD"])
def test_strokes_that_act_as_cad_does_not_say_are_learnt_from(irma4: Robot, learns: bool):
    platform = swinging(irma4, TRUE, 0.01)
    gains, before = Gains.by(platform.place.swing), None
    for _ in range(5):
        states, swing, _ = platform.seen(gains.mean)
        look = Look(states, platform.t, swing.frequencies)
        if before is not None and learns:
            calming, was = before
            gains = gains.after(calming.chain, calming.end, swing, was, look)
            swing = replace(swing, gain=gains.mean)
        calming = calmed(platform.place, swing, states, platform.t, platform.t + 0.4, LIMITS)
        before = (calming, look)
        platform.carry_out(calming)
    left = platform.seen(gains.mean)[2]
    assert left < 3e-4 if learns else left > 2e-3


def test_no_stroke_breaks_a_tension_limit_that_the_swing_alone_keeps(irma4: Robot):
    """With drives that may do much the calmest way would take cables below their limit."""
    robot = replace(irma4, limits=replace(irma4.limits, tension=(35.0, 120.0)))
    platform = swinging(robot, irma4.nominal, 0.006)
    states, swing, _ = platform.seen(platform.place.swing.gain)
    wild, hasty = WinchLimits(speed=0.5, acceleration=8.0, offset=0.1), platform.place
    unbound = replace(hasty, mechanism=Mechanism(irma4, native=True))
    pulls = []
    for place in (unbound, hasty):
        again = swinging(robot, irma4.nominal, 0.006)
        again.carry_out(calmed(place, swing, states, platform.t, platform.t + 0.4, wild), 0.5)
        pulls.append(again.last.tension)
    (_, careful) = pulls
    assert 35.0 <= careful[0] < careful[1] <= 120.0, pulls
    assert pulls[0][0] < 35.0, "else this shows nothing"


def test_where_even_small_strokes_are_too_much_it_is_said(irma4: Robot):
    platform = swinging(irma4, irma4.nominal, 0.012)
    states, swing, _ = platform.seen(platform.place.swing.gain)
    rest = platform.place.equilibrium.tensions_in_newton(irma4.mass)
    tight = replace(irma4, limits=replace(irma4.limits, tension=(rest.min() / 1.06, rest.max() * 1.06)))
    place = replace(platform.place, mechanism=Mechanism(tight, native=True))
    with pytest.raises(InfeasibleError, match=r"Strokes that calm the platform here would pull cables"):
        calmed(place, _eager(swing), 0.02 * states, 0.0, 0.4, WinchLimits(1.0, 40.0, 0.2))


def test_a_wide_swing_is_looked_at_on_its_cables(irma4: Robot):
    """Modes are straight lines: 7 cm along one leaves the cables, which would pull by hundreds of newtons at once."""
    place = ExcitationPlace.at(Mechanism(irma4, native=True), WEAK)
    states = np.array([0.07 / place.swing.lever[0] * np.imag(place.swing.rates[0]) * 1j, 0.0])
    pose, twist = place.swing.motion(states)
    exact, kept = _on_its_cables(place, pose, twist)
    held = place.equilibrium

    def off(at):
        return np.abs(balance(place.mechanism, place.body, at, held.tensions)[3] - held.lengths).max()

    xi = balance(place.mechanism, place.body, exact, held.tensions)[2]
    assert off(exact) < 1e-9 < 1e-3 < off(pose)
    assert np.abs(xi @ kept).max() < 1e-12
    assert abs(exact.position[0] - pose.position[0]) < 0.1 * 0.07
    still = calmed(place, place.swing, states, 0.0, 0.4, LIMITS).chain.scaled(0.0)
    (low, high), *_ = _pulls(place, place.swing, states, still, ())
    assert 30.0 < low < high < 120.0


@pytest.mark.parametrize(("size", "factor"), [(0.012, 12.0), (0.012, 100.0)], ids=["slack", "not followed"])
def test_to_a_swing_that_pulls_cables_slack_by_itself_nothing_is_added(irma4: Robot, size: float, factor: float):
    platform = swinging(irma4, irma4.nominal, size)
    states, swing, _ = platform.seen(platform.place.swing.gain)
    with pytest.raises(InfeasibleError, match="swings so wildly"):
        calmed(platform.place, swing, factor * states, platform.t, platform.t + 0.4, LIMITS)


def _eager(swing):
    """A model by which winches hardly act, so that all they may do is done."""
    return replace(swing, gain=1e-3 * swing.gain)


def test_a_cable_near_the_end_of_its_winch_is_moved_less(irma4: Robot):
    held = WEAK
    free = WinchLimits(offset=0.06, lengths=((0.5, 2.0),) * 4)
    near = WinchLimits(offset=0.06, lengths=((held[0] - 0.01, 2.0), (0.5, 2.0), (0.5, 2.0), (0.5, held[3] + 0.02)))
    assert free.reach(held, np.array([1.0, 0.2, -0.5, 0.0])) == 0.06
    assert near.reach(held, np.array([1.0, 0.2, -0.5, 0.0])) == pytest.approx(0.01)
    assert near.reach(held, np.array([0.1, 1.0, -0.5, 0.5])) == pytest.approx(0.04)
    assert WinchLimits(offset=0.06).reach(held, np.ones(4)) == 0.06
    beyond = WinchLimits(lengths=((held[0] + 0.01, 2.0),) * 4)
    assert beyond.reach(held, np.ones(4)) == 0.0


def test_the_rest_at_a_strokes_end_counts(irma4: Robot):
    """An emergency stop may leave the platform there."""
    mechanism = Mechanism(irma4, native=True)
    rest = equilibrium_at(mechanism, irma4.nominal, np.array([1.25, -0.15, -0.2]))
    place = ExcitationPlace.at(mechanism, rest.lengths)
    chain = Chain(Pattern(0.3, 2, 0.9), np.array([0.05, 0.0, 0.0, 0.0]))
    low, high = at_rest(place, (chain,))
    still = rest.tensions_in_newton(irma4.mass)
    assert low < still.min()
    assert high > still.max()
    assert at_rest(place, (chain.scaled(40.0),)) == (-np.inf, np.inf)
