"""The grid's quadrature is exact where it must be."""

import numpy as np
import pytest

from fidim_lab.model.sensitivity.grid import FINE, QUICK, Grid, lobatto


@pytest.mark.parametrize("intervals", [2, 4, 8, 10])
def test_quadrature_is_exact_for_polynomials(intervals):
    x, quadrature = lobatto(intervals)
    assert x[0] == 0
    assert x[-1] == 1
    for power in range(intervals + 1):
        np.testing.assert_allclose(quadrature @ x**power, x ** (power + 1) / (power + 1), atol=1e-14)
    for power in range(2 * intervals):  # over the whole block Lobatto's rule is exact to degree 2 k − 1
        assert quadrature[-1] @ x**power == pytest.approx(1 / (power + 1), abs=1e-13)


def test_simpson_is_the_smallest_one():
    np.testing.assert_allclose(lobatto(2)[1][-1], [1 / 6, 4 / 6, 1 / 6])


def test_a_grid_covers_its_duration():
    assert Grid.covering(10.0, QUICK).blocks == 100
    assert Grid.covering(0.3, FINE).t[-1] == pytest.approx(0.3)
    grid = Grid.covering(0.31, FINE)
    assert len(grid.t) == grid.nodes == 41
    assert np.all(np.diff(grid.t) > 0)
    assert np.diff(grid.t).max() < 0.017
    np.testing.assert_allclose(grid.quadrature[:, 0].sum(), 0.1 * lobatto(10)[1][:, 0].sum())
