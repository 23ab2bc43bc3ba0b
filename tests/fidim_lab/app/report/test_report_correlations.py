"""The picture of the parameters' correlations."""

import re
from dataclasses import replace

import numpy as np

from fidim_lab.app.report.drawings.figures import correlations


def test_cells_and_the_strongest_pair_in_words(campaign, result_of):
    sd = np.array([1e-5, 1e-5, 1e-4, 2e-6, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6])
    rho = np.eye(9)
    rho[2, 3] = rho[3, 2] = -0.97
    rho[0, 7] = rho[7, 0] = 0.5
    drawing = correlations(replace(result_of(campaign), covariance=rho * np.outer(sd, sd)))
    assert drawing is not None
    assert drawing.caption.endswith("hardly separable: s_z with I_xx (-97 %).")
    numbers = [int(text) for text in re.findall(r">\s*(-?\d+)\s*</text>", drawing.svg)]
    assert sorted(numbers) == sorted([100] * 9 + [-97] * 2 + [50] * 2 + [0] * 68)
    assert "<image" not in drawing.svg
    free = correlations(replace(result_of(campaign), covariance=np.diag(sd**2)))
    assert free is not None
    assert free.caption.endswith("none beyond 90 %.")


def test_without_a_covariance_there_is_no_picture(campaign, result_of):
    assert correlations(replace(result_of(campaign), covariance=np.zeros((9, 9)))) is None
