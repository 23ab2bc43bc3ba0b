"""The rate of false alarms against the law that the largest of many χ² has, and elimination against least squares."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.stats import chi2

from fidim_lab.data.records import Robot
from fidim_lab.effects.catalogue import by_id
from fidim_lab.mismatch.linearised.hypotheses import Hypothesis
from fidim_lab.mismatch.scores.alarms import alarm_rate
from fidim_lab.mismatch.scores.score import Projected, bounded, eliminated


@dataclass(frozen=True)
class Size:
    """How many independent hypotheses of one parameter, and how wide their prior is in sd of the data."""

    count: int
    width: float


def independent(robot: Robot, size: Size, left: float = 1000.0) -> Projected:
    """Hypotheses that do not touch each other, in units from 1e-6 to 1e6 of their standard deviation."""
    effect = by_id(robot, "air-drag-linear")[0]
    units = np.logspace(-6, 6, size.count)
    tried = tuple(Hypothesis(effect, np.zeros(1), (0,), np.array([size.width / unit])) for unit in units)
    return Projected(
        tried=tried,
        slices=tuple(slice(k, k + 1) for k in range(size.count)),
        gradient=np.zeros(size.count),
        curvature=np.diag(units**2),
        left=left,
        dof=1000,
        inflation=max(1.0, left / 1000),
        gram=np.eye(size.count + 1),
    )


@pytest.mark.parametrize("left", [1000.0, 4000.0])
def test_the_rate_is_that_of_the_largest_of_many(irma4: Robot, left: float) -> None:
    size, threshold = Size(count=50, width=30.0), 1.0
    cost = 0.5 * np.log1p(size.width**2 * 1000.0 / left)
    alone = chi2.sf(2 * (threshold + cost), 1)
    expected = 1 - (1 - alone) ** size.count
    found = alarm_rate(independent(irma4, size, left), threshold, draws=40_000)
    assert found.alarms / found.draws == pytest.approx(expected, rel=0.1)
    assert found.at_most > found.alarms / found.draws


def test_at_the_threshold_of_the_search_noise_raises_next_to_no_alarm(irma4: Robot) -> None:
    found = alarm_rate(independent(irma4, Size(count=100, width=1e3)), 5.0)
    assert found.alarms <= 3  # 100 P(χ² > 2 (5 + ln 1000)) = 1e-4 are expected
    assert found.at_most < 1e-3
    assert f"{found.alarms} of 10000" in found.says


def test_elimination_is_least_squares_on_what_is_outside() -> None:
    rng = np.random.default_rng(3)
    columns = rng.standard_normal((60, 7))
    outside, inside = np.array([1, 4, 5]), np.array([0, 2, 6])
    fitted = np.linalg.lstsq(columns[:, outside], columns[:, inside], rcond=None)[0]
    rest = columns[:, inside] - columns[:, outside] @ fitted
    assert eliminated(columns.T @ columns, outside, inside) == pytest.approx(rest.T @ rest, abs=1e-9)


def test_bounded_is_on_the_bound_where_the_free_optimum_is_beyond() -> None:
    curvature, gradient = np.array([[2.0, 1.0], [1.0, 3.0]]), np.array([4.0, -1.0])
    low, high = np.array([0.0, 0.0]), np.array([10.0, 10.0])
    assert bounded(curvature, gradient, low, high) == pytest.approx([2.0, 0.0], abs=1e-6)
    assert bounded(curvature, gradient, -high, high) == pytest.approx(np.linalg.solve(curvature, gradient))
