"""sin and cos of one frequency with free amplitudes: what a periodic force and a swaying frame have in common.

The amplitudes of sin and cos are linear parameters, so that a score exists at 0; the frequency has none there and is
scanned. A recording has no absolute time, only that since the start of each window:
- *same phase*: every window begins at the same phase (triggered, or whole periods between the windows);
- *own phase*: every window begins at a phase φ of its own, an extra state with φ̇ = 0 that counts as part of the
  window's start; amplitudes and frequency are shared. φ has no score at amplitude 0: there the amplitudes of every
  window stand for it (`of_each_window`).
"""

import casadi as ca
import numpy as np

from fidim_lab.effects.effect import Parameter
from fidim_lab.model.slots import ExtraState

SCAN = 0.1
"""Hz from one frequency of the scan to the next: 10 s of recording tell them apart"""
FREQUENCIES = tuple(float(f) for f in np.round(np.arange(0.2, 10.05, SCAN), 3))
"""Hz"""

PHASE = ExtraState("phase", "rad", spread=np.inf, tries=(0.0, 0.5 * np.pi, np.pi, -0.5 * np.pi))


def oscillation_parameters(unit: str, says: str, *, scale: float, most: float) -> tuple[Parameter, ...]:
    """Amplitudes sx sy sz of sin, cx cy cz of cos, and f."""
    amplitudes = tuple(
        Parameter(f"{part}{axis}", unit, f"{says}, {axis}, of {wave}", scale=scale, low=-most, high=most, start=0.0)
        for part, wave in (("s", "sin"), ("c", "cos"))
        for axis in "xyz"
    )
    frequency = Parameter("f", "Hz", "frequency", scale=0.1, low=0.05, high=20.0, start=1.0, scan=FREQUENCIES)
    return (*amplitudes, frequency)


def oscillation(time: ca.SX, extra: ca.SX, theta: ca.SX) -> ca.SX:
    """s sin(2π f t + φ) + c cos(2π f t + φ) (3); φ is the extra state, or 0 where there is none."""
    phase = 2 * np.pi * theta[6] * time + (extra[0] if extra.numel() else 0)
    return theta[:3] * ca.sin(phase) + theta[3:6] * ca.cos(phase)
