import numpy as np
import pytest

from fidim_lab.errors import SetupError
from fidim_lab.identification.motion.filters import FilterDesign, convolve, design


@pytest.mark.parametrize("rate", [50.0, 100.0, 240.0])
def test_response_is_one_below_the_pass_band_and_nothing_beyond_the_stop_band(rate):
    kernels = design(FilterDesign(), rate, 10.0)
    low = np.linspace(0.05, kernels.pass_band, 50)
    high = np.linspace(10.0, 0.49 * rate, 50)
    for order in range(3):
        assert np.abs(kernels.response(order, low) - 1).max() < 2e-3
    assert np.abs(kernels.response(0, high)).max() < 8e-3


def test_derivatives_have_exactly_the_low_pass_of_the_value():
    kernels = design(FilterDesign(), 100.0, 10.0)
    f = np.linspace(0.1, 12.0, 100)
    assert np.abs(kernels.response(1, f) - kernels.response(0, f)).max() < 1e-3
    assert np.abs(kernels.response(2, f) - kernels.response(0, f)).max() < 1e-3


def test_constants_and_slopes_pass_exactly():
    kernels = design(FilterDesign(), 100.0, 10.0)
    t = np.arange(200) / 100
    line = 3.0 - 2.0 * t
    inside = slice(kernels.half, -kernels.half)
    np.testing.assert_allclose(convolve(kernels.value, line), line[inside], atol=1e-12)
    np.testing.assert_allclose(convolve(kernels.second, line), 0.0, atol=1e-9)
    np.testing.assert_allclose(convolve(kernels.first, line), -2.0, rtol=2e-3)


def test_a_central_difference_would_be_worse():
    """The reason for the matched kernels: bias at 3 Hz."""
    f, rate = 3.0, 100.0
    central = np.sin(2 * np.pi * f / rate) / (2 * np.pi * f / rate) - 1
    matched = design(FilterDesign(), rate, 10.0).response(1, np.array([f]))[0] - 1
    assert abs(central) > 5e-3 > 20 * abs(matched)


def test_short_windows_get_a_shorter_kernel():
    long, short = design(FilterDesign(), 100.0, 10.0), design(FilterDesign(), 100.0, 2.0)
    assert (long.half, short.half) == (60, 20)
    assert short.response(0, np.array([1.0, 2.0])) == pytest.approx([1.0, 1.0], abs=2e-3)


@pytest.mark.parametrize(("rate", "duration", "says"), [(20.0, 10.0, "at least 25 Hz"), (100.0, 1.0, "at least 1.2 s")])
def test_what_cannot_be_filtered_is_refused_with_the_limit(rate, duration, says):
    with pytest.raises(SetupError, match=says):
        design(FilterDesign(), rate, duration)
