"""Chains by linear theory: within all limits, the best there are, and gentler than they would have to be."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Robot
from fidim_lab.identification.excitation.candidates import ChainCandidate, Hanging, begins_of, candidates
from fidim_lab.identification.excitation.motion import line_of
from fidim_lab.identification.excitation.place import ExcitationPlace, WinchLimits, wanted_amplitudes
from fidim_lab.identification.excitation.strokes import Chain
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import driven_motions

LIMITS = WinchLimits(speed=0.5, acceleration=3.0)
ONES = np.ones(2)


@pytest.fixture(scope="module")
def place(irma4: Robot) -> ExcitationPlace:
    mechanism = Mechanism(irma4, native=True)
    rest = equilibrium_at(mechanism, irma4.nominal, np.array([1.25, -0.15, -0.2]))
    made = ExcitationPlace.at(mechanism, rest.lengths)
    return replace(made, swing=made.swing.damped(np.full(2, 0.03)))


def hanging(place: ExcitationPlace, part: float) -> Hanging:
    """Tensions may change by this part of those at rest."""
    rest = place.equilibrium.tensions
    return Hanging(place.swing.damped(np.zeros(2)), part * np.array([rest, rest]))


def found(
    place: ExcitationPlace, displacement: tuple[float, float], part: float, limits: WinchLimits = LIMITS
) -> ChainCandidate:
    wanted = wanted_amplitudes(place, np.array(displacement))
    return candidates(place, wanted, ONES, ONES, limits, [hanging(place, part)])[0]


def pulled(place: ExcitationPlace, chains: tuple[Chain, ...], size: float) -> np.ndarray:
    """Change of each tension over that at rest (N samples × n) by the nonlinear model, for chains this much smaller."""
    line = line_of(chains, 2.0)
    accelerations = line.accelerations(np.array([size * chain.direction for chain in chains]))[np.newaxis]
    motion = driven_motions(place.mechanism, place.body, place.equilibrium.pose, accelerations, line.steps)
    return (motion.tensions[0] - place.equilibrium.tensions) / size


def test_tensions_and_winches_keep_their_limits_by_linear_theory(place: ExcitationPlace):
    candidate = found(place, (0.05, 0.03), 0.25)
    assert candidate.share < 0.9, "else nothing limits it"
    changes = np.abs(pulled(place, candidate.chains, 0.02)).max(axis=0) / place.equilibrium.tensions
    assert changes.max() == pytest.approx(0.25, rel=0.05)
    for chain in candidate.chains:
        assert chain.speed <= LIMITS.speed
        assert chain.acceleration <= LIMITS.acceleration
        assert chain.longest <= LIMITS.offset


def test_no_other_directions_swing_it_farther(place: ExcitationPlace):
    """Directions at random with the same turns, as large as they may be: none reaches as much."""
    candidate = found(place, (0.05, 0.0), 0.25)
    own = candidate.chains
    rng, swing = np.random.default_rng(2), place.swing
    wanted = float(np.linalg.norm(wanted_amplitudes(place, np.array([0.05, 0.0]))))
    best = 0.0
    for _ in range(60):
        chains = tuple(
            replace(chain, direction=chain.direction + 0.5 * chain.longest * rng.normal(size=4)) for chain in own
        )
        room = np.abs(pulled(place, chains, 0.02)).max(axis=0) / (0.25 * place.equilibrium.tensions)
        y = np.zeros(2, dtype=complex)
        for chain, begin in zip(chains, begins_of(chains), strict=True):
            left = candidate.seconds - begin - chain.pattern.seconds
            y += (
                chain.pattern.response(swing.rates)
                * swing.dragged
                * np.exp(swing.rates * left)
                * (swing.gain @ chain.direction)
            )
        best = max(best, float(swing.amplitudes(y)[candidate.modes[0]]) / room.max() / wanted)
    assert 0.3 * candidate.share < best < 1.02 * candidate.share


@pytest.mark.slow
def test_more_room_for_tensions_swings_it_farther_until_winches_are_the_limit(place: ExcitationPlace):
    shares = [found(place, (0.05, 0.03), part) for part in (0.1, 0.2, 5.0)]
    assert shares[0].share < shares[1].share < shares[2].share
    assert shares[2].share == pytest.approx(shares[2].by_winches, rel=0.06)
    slow = found(place, (0.05, 0.03), 5.0, WinchLimits(speed=0.02, acceleration=3.0))
    assert slow.by_winches < shares[2].by_winches


def test_where_all_is_in_reach_strokes_are_no_larger_than_wanted(place: ExcitationPlace):
    candidate = found(place, (0.004, 0.003), 0.5)
    assert candidate.share == 1.0
    twice = found(place, (0.008, 0.006), 0.5)
    assert twice.share == 1.0
    assert max(c.longest for c in twice.chains) < 2.5 * max(c.longest for c in candidate.chains)


def test_a_cable_near_its_shortest_length_moves_little(place: ExcitationPlace):
    held = place.equilibrium.lengths
    lengths = ((held[0] - 0.002, held[0] + 1.0), *((one - 1.0, one + 1.0) for one in held[1:]))
    candidate = found(place, (0.05, 0.03), 5.0, replace(LIMITS, lengths=lengths))
    assert max(abs(chain.direction[0]) for chain in candidate.chains) <= 0.002
    assert max(chain.longest for chain in candidate.chains) > 0.004


def test_quicker_candidates_come_after_the_best(place: ExcitationPlace):
    wanted = wanted_amplitudes(place, np.array([0.05, 0.03]))
    all_of_them = candidates(place, wanted, ONES, ONES, LIMITS, [hanging(place, 0.25)])
    best = all_of_them[0]
    assert len(all_of_them) > 1
    for other in all_of_them[1:]:
        assert other.seconds <= 0.7 * best.seconds
        assert other.share <= best.share / 0.95
