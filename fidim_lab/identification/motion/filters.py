"""The zero-phase FIR low-pass of §5.2, with differentiators that have exactly its band.

A central difference at 100 Hz is 0.6 % low at 3 Hz in velocity and twice that in an acceleration made by two of them:
as much as the errors that identification is to find. So value, first and second derivative come from three kernels of
one length, least-squares designed for (jω)^d H(ω) with one H: what the low-pass does to a signal it does to its
derivatives too. `differences` keeps the paper's plain numerical differentiation for comparison.

Symmetric (type I and III) kernels, so no phase anywhere. Half-lengths are in seconds: the same filter at any rate.
"""

from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache

import numpy as np

from fidim_lab.errors import SetupError


class Derivatives(StrEnum):
    """How velocity and acceleration are made from the filtered signal."""

    MATCHED = "matched"
    """kernels with the low-pass's own band: no bias inside it"""
    CENTRAL = "central"
    """central differences of the filtered signal, applied twice: the plain reading of §5.2"""


class Edges(StrEnum):
    """What happens within half a kernel of an end."""

    TRIM = "trim"
    """those samples are not used: every sample that is used has its whole neighbourhood (the default)"""
    REFLECT = "reflect"
    """odd reflection about the end value: keeps them, but forces the acceleration at the ends towards zero"""


@dataclass(frozen=True)
class FilterDesign:
    """The low-pass wanted. Default: the paper's stop band, and the widest pass band that the window length allows."""

    stop_band: float = 10.0
    """Hz, from here on the signal is stopped (§5.2)"""
    half_length: float = 0.6
    """s, the longest half kernel; longer is a narrower transition below the stop band"""
    share: float = 0.1
    """of the window that half a kernel may take: 2 s windows get 0.2 s, so that trimming leaves 80 % of any window"""
    derivatives: Derivatives = Derivatives.MATCHED
    edges: Edges = Edges.TRIM

    def half_seconds(self, duration: float) -> float:
        """The half-length for a window of so many seconds, s."""
        return min(self.half_length, self.share * duration)


LOW_PASS = FilterDesign()
"""The 10 Hz low-pass of §5.2."""

WIDE = FilterDesign(stop_band=25.0, half_length=0.2, share=0.05)
"""For signals whose equations are filtered afterwards: keeps every harmonic of a free motion."""

PAPER = FilterDesign(derivatives=Derivatives.CENTRAL, edges=Edges.REFLECT)
"""As near to §5.2 as its words go: FIR low-pass, all samples kept, numerical differentiation."""


@dataclass(frozen=True, eq=False)
class Kernels:
    """Three symmetric or antisymmetric kernels of 2M + 1 taps; index k weighs the sample k − M steps away."""

    value: np.ndarray
    first: np.ndarray
    """1/s"""
    second: np.ndarray
    """1/s²"""
    rate: float
    pass_band: float
    """Hz, up to here the response is 1 within a per mille or so"""

    @property
    def half(self) -> int:
        """M, samples."""
        return len(self.value) // 2

    def response(self, order: int, frequency: np.ndarray) -> np.ndarray:
        """Real response of the kernel of `order` 0, 1, 2 divided by (jω)^order, at frequencies > 0 in Hz."""
        taps = (self.value, self.first, self.second)[order]
        omega = 2 * np.pi * np.asarray(frequency, dtype=float)
        phase = np.exp(1j * np.outer(omega, np.arange(-self.half, self.half + 1)) / self.rate)
        return np.real(phase @ taps / (1j * omega) ** order)


def design(spec: FilterDesign, rate: float, duration: float) -> Kernels:
    """The kernels for a window of `duration` s sampled at `rate` Hz.

    Raises SetupError when the rate is too low for the stop band or the window too short for any filter.
    """
    if rate < 2.5 * spec.stop_band:
        raise SetupError(
            f"A sample rate of {rate:g} Hz is too low for a stop band of {spec.stop_band:g} Hz; "
            f"at least {2.5 * spec.stop_band:g} Hz is needed."
        )
    half = round(spec.half_seconds(duration) * rate)
    if half / rate < 1.2 / spec.stop_band:
        raise SetupError(
            f"{duration:.2f} s is too short to be filtered at {spec.stop_band:g} Hz; "
            f"a window needs at least {1.2 / spec.stop_band / spec.share:.1f} s."
        )
    return _design(spec.stop_band, half, rate)


@lru_cache(maxsize=64)
def _design(stop: float, half: int, rate: float) -> Kernels:
    # A transition of 1.8 divided by the half-length gives about 60 dB in a least-squares design (Kaiser's rule).
    transition = min(1.8 / (half / rate), 0.7 * stop)
    pass_band = stop - transition
    f = np.arange(0.5, 16 * half + 0.5) / (16 * half) * rate / 2
    omega, k = 2 * np.pi * f, np.arange(1, half + 1) / rate
    cosines, sines = np.cos(np.outer(omega, k)), np.sin(np.outer(omega, k))
    # Value: h_0 = 1 − 2 Σ h_k makes the gain at 0 Hz exactly 1, so that a constant passes unchanged.
    # In the pass band an error biases, in the stop band it only lets noise through: weights 10 and 1.
    inside = (f <= pass_band) | (f >= stop)
    weight = np.where(f <= pass_band, 10.0, 1.0)[inside]
    target = np.where(f <= pass_band, 0.0, -1.0)[inside]
    h = np.linalg.lstsq(weight[:, None] * 2 * (cosines[inside] - 1), weight * target, rcond=None)[0]
    H = 1 + 2 * (cosines - 1) @ h
    value = np.concatenate([h[::-1], [1 - 2 * h.sum()], h])
    # Derivatives: response over (jω)^d as near to H as the taps allow. Dividing by ω^d makes the error relative.
    shape = np.where(f <= stop, 10.0, 1.0)
    b1 = np.linalg.lstsq(shape[:, None] * 2 * sines / omega[:, None], shape * H, rcond=None)[0]
    first = np.concatenate([-b1[::-1], [0.0], b1])
    b2 = np.linalg.lstsq(-shape[:, None] * 2 * (cosines - 1) / omega[:, None] ** 2, shape * H, rcond=None)[0]
    second = np.concatenate([b2[::-1], [-2 * b2.sum()], b2])
    for taps in (value, first, second):
        taps.flags.writeable = False
    return Kernels(value, first, second, rate, pass_band)


def convolve(taps: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Σ_k taps[k] values[j + k − M] along the first axis; values (N, …) → (N − 2M, …): whole neighbourhoods only."""
    windows = np.lib.stride_tricks.sliding_window_view(values, len(taps), axis=0)
    return windows @ taps
