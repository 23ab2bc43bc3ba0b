"""What a window's encoders say of its start."""

import numpy as np
import pytest

from fidim_lab.data.records import Robot, Role, Window
from fidim_lab.identification.mle.trajectories.recordings import prepare


def recorded(lengths: np.ndarray, t: np.ndarray) -> Window:
    return Window(
        id="i01",
        role=Role.IDENTIFY,
        t=t,
        markers=np.zeros((len(t), 1, 3)),
        lengths=lengths,
        currents=None,
        equilibrium=np.zeros(3),
    )


def test_an_encoder_that_follows_the_tension_is_read_where_it_began(irma4: Robot) -> None:
    """From rest tensions change with the square of time; a line through 0.1 s would say 58 µm less."""
    t = np.arange(0.0, 2.0, 0.01)
    true = 1.4 + 0.3e-3 * np.cos(2 * np.pi * 2.4 * t)
    lengths = np.tile(1.3, (len(t), irma4.n))
    lengths[:, 2] = np.round(true / 2e-5) * 2e-5
    found = prepare(recorded(lengths, t), irma4)
    assert found.first_lengths[2] == pytest.approx(true[0], abs=1.2e-5)
    assert found.read([2])[2] == found.first_lengths[2]
    assert found.read([])[2] == pytest.approx(1.4, abs=5e-5)


def test_with_few_readings_the_mean_is_taken(irma4: Robot) -> None:
    t = np.arange(0.0, 1.0, 0.04)
    lengths = np.tile(1.3, (len(t), irma4.n))
    lengths[:, 1] += 1e-3 * t
    found = prepare(recorded(lengths, t), irma4)
    assert found.first_lengths[1] == pytest.approx(lengths[:, 1].mean(), abs=1e-9)
    assert found.first_lengths[0] == pytest.approx(1.3)
