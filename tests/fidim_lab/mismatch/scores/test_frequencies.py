"""At which frequencies tones are tried."""

import numpy as np
import pytest

from fidim_lab.data.records import Robot
from fidim_lab.mismatch.linearised.columns import frequency_of
from fidim_lab.mismatch.linearised.hypotheses import hypotheses
from fidim_lab.mismatch.scores.frequencies import between
from fidim_lab.mismatch.scores.score import Score
from fidim_lab.mismatch.scores.views import view


@pytest.mark.parametrize(
    ("seconds", "offsets"),
    [
        (10.0, (-0.08, -0.06, -0.04, -0.02, 0.02, 0.04, 0.06, 0.08)),
        (3.0, (-0.05, 0.05)),
        (2.0, ()),  # that tells no finer frequencies than the scan has
    ],
)
def test_the_best_tone_is_looked_at_between_its_neighbours(
    irma4: Robot, seconds: float, offsets: tuple[float, ...]
) -> None:
    scanned = hypotheses(irma4).periodic
    two = [next(h for h in scanned if h.effect.id == "periodic-force" and frequency_of(h) == f) for f in (1.3, 1.8)]
    tones = [Score((h,), (np.zeros(6),), 2 * said, said) for h, said in zip(two, (20.0, 50.0), strict=True)]
    found = between(scanned, tones, seconds)
    np.testing.assert_allclose([frequency_of(h) - 1.8 for h in found], offsets, atol=1e-9)
    assert all(h.effect == two[1].effect for h in found)


def test_without_a_tone_nothing_is_looked_at_more_finely(irma4: Robot) -> None:
    assert between(hypotheses(irma4).periodic, [], 10.0) == ()


@pytest.mark.slow
def test_a_force_between_two_frequencies_of_the_scan_is_heard_at_its_own(baseline_of) -> None:
    start = baseline_of("periodic-force:ax=0.01,ay=0.02,az=0.02,f=1.846,psi=0.4", seed=12, windows=4, seconds=10.0)
    best = view(start.as_it_is, start.tried, start.context).singles[0]
    assert best.tried[0].effect.id == "periodic-force"
    assert frequency_of(best.tried[0]) == pytest.approx(1.846, abs=0.0101)
    assert best.phases is not None
