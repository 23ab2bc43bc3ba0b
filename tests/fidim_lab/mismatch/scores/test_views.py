"""What is worth fitting beside a model."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from fidim_lab.mismatch.fitting.baseline import Baseline
from fidim_lab.mismatch.scores.views import view


@pytest.fixture(scope="module")
def dragged(baseline_of: Callable[..., Baseline]) -> Baseline:
    """Six windows with a faint drag."""
    return baseline_of("rotational-drag:c=6e-4", seed=41, windows=6, seconds=3.0)


@pytest.mark.sampled(1)
@pytest.mark.parametrize(("scatter", "asked"), [(0.06, True), (1e-4, False)], ids=["doubtful", "sure"])
def test_what_lower_noise_leaves_counts_as_far_as_windows_agree_on_it(dragged: Baseline, scatter: float, asked: bool):
    """Residuals that show less noise than there is leave more than an evident effect takes; windows tell how sure."""
    model, stated = dragged.as_it_is, dragged.fit.likelihood.noise
    by_turns = [0.9 * stated * (1 + scatter * (-1) ** k) for k in range(len(model.fit.remainders))]
    left = tuple(replace(one, noise=seen) for one, seen in zip(model.fit.remainders, by_turns, strict=True))
    fit = replace(model.fit, remainders=left)
    seen = view(replace(model, fit=fit), dragged.tried, dragged.context)
    assert bool(seen.additions(3)) == asked
