"""Recordings without noise, as other simulators write them, beside a robot file that states the noise of cameras."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Body, Campaign, Robot, Window
from fidim_lab.effects.dissipation.drag import AirDragLinear
from fidim_lab.identification.equations.estimators import Method
from fidim_lab.identification.identify import identify
from fidim_lab.identification.mle.fit import fit
from fidim_lab.mismatch.residuals.residual import of_fit
from fidim_lab.mismatch.residuals.whiteness import whiteness
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.slots import Effect

TELLING = ("low-passed", "not white", "bit for bit", "Something is missing", "off its neighbours", "jumps")
Record = Callable[..., list[Window]]


@pytest.fixture
def simulated(four: Robot, record: Record) -> Callable[..., Campaign]:
    """Markers in so many digits of a metre, lengths with an encoder's noise."""

    def make(digits: int | None, effects: Sequence[Effect] = (), theta: Sequence[float] | None = None) -> Campaign:
        windows = record(four, 3, seconds=4.0, noise=0.0, effects=effects, theta=theta)
        rounded = [w if digits is None else replace(w, markers=np.round(w.markers, digits)) for w in windows]
        return Campaign("simulated", four, 100.0, tuple(rounded))

    return make


@pytest.mark.parametrize("digits", [None, 4, 5, 6])
@pytest.mark.sampled(2)
def test_the_right_model_explains_them_and_no_filter_is_told(
    simulated: Callable[..., Campaign], truth: Callable[[Robot], Body], four: Robot, digits: int | None
):
    """Read by encoders of 20 µm, such markers are followed to about 1 µm: far more than they scatter themselves."""
    found = identify(simulated(digits), method=Method.MLE, native=True)
    assert found.outcome.answers
    assert not any(telling in said for telling in TELLING for said in found.warnings)
    every = found.parameters.values()
    error = np.array([one.value for one in every]) - truth(four).vector
    assert (np.abs(error) < 3 * np.array([one.sd for one in every])).all()


@pytest.mark.parametrize("digits", [None, 6])
def test_their_residual_is_white_where_nothing_is_missing(simulated: Callable[..., Campaign], digits: int | None):
    campaign = simulated(digits)
    found = fit(Mechanism(campaign.robot, native=True), list(campaign.windows))
    assert found.explained
    assert whiteness(of_fit(found)).is_white


def test_what_is_missing_is_told_all_the_same(simulated: Callable[..., Campaign]):
    campaign = simulated(None, (AirDragLinear(),), (0.5,))
    found = fit(Mechanism(campaign.robot, native=True), list(campaign.windows))
    assert not found.explained
    assert not whiteness(of_fit(found)).is_white
