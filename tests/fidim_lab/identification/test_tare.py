"""What was added to a platform: against sums of moments, and against draws."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import PARAMETER_NAMES, Body
from fidim_lab.errors import SetupError
from fidim_lab.identification.equations.estimators import Method
from fidim_lab.identification.results.result import (
    Estimated,
    IdentificationResult,
    InertialParameter,
    ResultOutcome,
    ShortAnswer,
)
from fidim_lab.identification.tare import difference

EMPTY = Body.from_about_com(np.array([0.002, -0.003, -0.02]), np.diag([0.02, 0.03, 0.045]))
ADDED = Body.from_about_com(np.array([0.05, 0.02, 0.10]), np.diag([0.004, 0.006, 0.005]))
MASSES = (3.0, 2.0)
"""kg, of the empty one and of what is added"""
SD = 1e-4 * np.arange(1, 10)


def known(values: np.ndarray, unseen: str = "") -> IdentificationResult:
    """An answer with these values and SD."""
    parameters = {
        name: InertialParameter(float(v), float(sd), None, None, float(v), seen=name != unseen)
        for name, v, sd in zip(PARAMETER_NAMES, values, SD, strict=True)
    }
    return IdentificationResult(
        "one", Method.MLE, ResultOutcome.CONVERGED, ShortAnswer(""), parameters, (), None, None, (), (), 0.0,
        covariance=np.diag(SD**2),
    )  # fmt: skip


def whole() -> np.ndarray:
    return (MASSES[0] * EMPTY.vector + MASSES[1] * ADDED.vector) / sum(MASSES)


def test_moments_of_the_parts_are_found_again() -> None:
    found = difference(known(whole()), known(EMPTY.vector), Estimated(5.0, 0.0), Estimated(3.0, 0.0))
    assert found.mass.value == pytest.approx(2.0)
    assert [p.value for p in found.parameters.values()] == pytest.approx(ADDED.vector.tolist())
    about = [found.about_com[name].value for name in ("I_xx", "I_yy", "I_zz", "I_xy", "I_xz", "I_yz")]
    assert about == pytest.approx([0.004, 0.006, 0.005, 0, 0, 0], abs=1e-12)
    assert found.possible


def test_its_sd_is_that_of_draws() -> None:
    rng = np.random.default_rng(5)
    mass_sd = 0.01
    found = difference(known(whole()), known(EMPTY.vector), Estimated(5.0, mass_sd), Estimated(3.0, mass_sd))
    draws: list[np.ndarray] = []
    for _ in range(4000):
        one, other = whole() + SD * rng.normal(size=9), EMPTY.vector + SD * rng.normal(size=9)
        m1, m0 = 5.0 + mass_sd * rng.normal(), 3.0 + mass_sd * rng.normal()
        draws.append((m1 * one - m0 * other) / (m1 - m0))
    assert [p.sd for p in found.parameters.values()] == pytest.approx(np.std(draws, axis=0).tolist(), rel=0.06)


def test_what_one_campaign_does_not_show_is_not_seen() -> None:
    found = difference(known(whole(), "I_yy"), known(EMPTY.vector, "s_y"), Estimated(5.0, 0.0), Estimated(3.0, 0.0))
    assert [name for name, p in found.parameters.items() if not p.seen] == ["s_y", "I_yy"]
    assert not found.about_com["I_yy"].seen


def test_a_platform_that_is_not_heavier_and_a_difference_that_is_not_a_body() -> None:
    with pytest.raises(SetupError, match="nothing was added"):
        difference(known(whole()), known(EMPTY.vector), Estimated(3.0, 0.0), Estimated(3.0, 0.0))
    light = replace(EMPTY, inertia=0.3 * EMPTY.inertia)
    assert not difference(known(light.vector), known(EMPTY.vector), Estimated(3.5, 0.0), Estimated(3.0, 0.0)).possible
