"""How late motion capture is against the encoders, from a jog that both saw; the platform may swing as it likes.

`closure_at` gives the combination of lengths and of marker coordinates that show the same motion; their lag of best
correlation is what a constant delay of either comes to.
"""

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import CableSeries, PerCable, Series
from fidim_lab.data.alignment import ClockOffset, align_clocks
from fidim_lab.data.records import Pose, Robot
from fidim_lab.errors import RefusedError, SetupError
from fidim_lab.model.closure import Closure, closure_at
from fidim_lab.model.mechanism import Mechanism

STANDS_OUT = 10.0
"""times the marker noise that a jog must show, peak to peak"""


def jog_signal(mechanism: Mechanism, robot: Robot, pose: Pose, change: PerCable) -> Closure:
    """The combination that a change of lengths (n,) m between a jog's ends shows best.

    Raises SetupError where lengths and markers of this robot do not show the same thing twice, or hardly.
    """
    found = closure_at(mechanism, pose, np.array(robot.markers)).seen_by(change)
    seen = abs(float((found.of_lengths @ change).item())) if len(found.of_lengths) else 0.0
    wanted = STANDS_OUT * robot.sensors.marker_noise
    if seen < wanted:
        raise SetupError(
            f"{robot.n} cable lengths and {len(robot.markers)} marker(s) show {1e3 * seen:.1f} mm of this jog twice, "
            f"at least {1e3 * wanted:.1f} mm are needed to compare their clocks.",
            hint="More markers (extra_markers) or a longer way (--set align.amplitude) give more information.",
        )
    return found


def marker_lag(
    signal: Closure, t: Series, lengths: CableSeries, markers: Float[np.ndarray, "N M 3"], longest: float = 0.5
) -> ClockOffset:
    """The lag, s: markers show at t what encoders showed at t - lag. NaN is bridged.

    Raises RefusedError for too short a jog, one that nobody sees, or a lag beyond `longest` (s), which is no delay.
    """
    by_encoders = lengths @ signal.of_lengths.T
    by_markers = markers.reshape(len(markers), -1) @ signal.of_markers.T
    found = align_clocks(t, by_encoders, t, by_markers)
    if abs(found.offset) > longest:
        raise RefusedError(
            f"Markers seem to be {found.offset:+.2f} s late against the encoders; more than {longest:g} s is not a "
            "delay of a camera system. Do both see the same robot?"
        )
    return found
