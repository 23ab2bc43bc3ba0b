"""What chains of strokes teach of the gains, on modes that are linear and known."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Robot
from fidim_lab.identification.excitation.gains import Gains, Look
from fidim_lab.identification.excitation.place import ExcitationPlace
from fidim_lab.identification.excitation.strokes import Chain, Pattern
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.swing import Swing


@pytest.fixture(scope="module")
def swing(irma4: Robot) -> Swing:
    mechanism = Mechanism(irma4)
    rest = equilibrium_at(mechanism, irma4.nominal, np.array([1.25, -0.15, -0.2]))
    return ExcitationPlace.at(mechanism, rest.lengths).swing


def looks(swing: Swing, true: np.ndarray, chain: Chain, size: float) -> tuple[float, Look, Look]:
    """Before and after a chain that begins half a second after the first look."""
    s = swing.rates
    states = size * np.abs(np.imag(s)) / swing.lever * np.exp(1j * np.arange(len(s)))
    end, t = 0.5 + chain.pattern.seconds, 3.5 + chain.pattern.seconds
    left = states * np.exp(s * t) - (true @ chain.direction) * chain.pattern.response(s) * swing.dragged * np.exp(
        s * (t - end)
    )
    return end, Look(states, 0.0, swing.frequencies), Look(left, t, swing.frequencies)


def test_strokes_in_all_directions_tell_the_whole_gain(swing: Swing):
    rng = np.random.default_rng(1)
    true = swing.gain * rng.uniform(-0.5, 2.5, swing.gain.shape)
    gains = Gains.by(swing)
    pattern = Pattern(0.5 / float(swing.frequencies[0]), 2, 0.9)
    for k in range(24):
        chain = Chain(replace(pattern, half=0.5 / float(swing.frequencies[k % 2])), rng.uniform(-6e-3, 6e-3, 4))
        end, before, after = looks(swing, true, chain, 5e-4)
        gains = gains.after(chain, end, swing, before, after)
    off = np.linalg.norm(gains.mean - true, axis=1) / np.linalg.norm(true, axis=1)
    was = np.linalg.norm(swing.gain - true, axis=1) / np.linalg.norm(true, axis=1)
    assert np.all(off < 0.1), (off, was)
    assert np.all(was > 0.4)


def test_of_a_direction_that_was_not_tried_nothing_is_learnt(swing: Swing):
    chain = Chain(Pattern(0.5 / float(swing.frequencies[0]), 2, 0.9), np.array([5e-3, 0.0, 0.0, 0.0]))
    end, before, after = looks(swing, 2 * swing.gain, chain, 5e-4)
    gains = Gains.by(swing).after(chain, end, swing, before, after)
    np.testing.assert_allclose(gains.mean[:, 1:], swing.gain[:, 1:])
    assert abs(gains.mean[0, 0] / swing.gain[0, 0] - 2) < 0.1, "the mode at whose frequency the strokes come"


def test_a_large_swing_whose_frequency_slid_teaches_little(swing: Swing):
    chain = Chain(Pattern(0.5 / float(swing.frequencies[0]), 2, 0.9), np.array([5e-3, 0.0, 0.0, 0.0]))
    end, before, after = looks(swing, swing.gain, chain, 0.04)
    slid = replace(after, states=after.states * np.exp(0.5j), frequencies=1.02 * after.frequencies)
    gains = Gains.by(swing).after(chain, end, swing, before, slid)
    assert np.all(np.linalg.norm(gains.mean - swing.gain, axis=1) < 0.5 * np.linalg.norm(swing.gain, axis=1))
