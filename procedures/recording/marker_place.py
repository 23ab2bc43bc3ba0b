"""The mean place of a swing compared with the rest before it: what slipped or slid since. Pure.

A cable that slips on its drum, or a marker or motion capture's origin that moves, while a person displaces the platform
is seen by no encoder. Locked lengths leave the marker of four cables a surface; a survey that is wrong shifts it, too,
but at rest as well as in the swing.
"""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from fidim_lab.arrays import Positions, Vector3
from procedures.expected.nominal_rest import NominalRest
from procedures.outcomes import Measurement
from procedures.settings import PlaceSettings
from procedures.steps import Lengths

APART = 0.05
"""s between the places of a window that are looked at: 80 milliseconds of computing for ten seconds"""
OVER = 10
"""places in a mean, half a second: of 144 honest windows the largest such mean has 2.5 mm, that of a quarter 3.4 mm; a
cable that slips by 30 mm half a second before the end is found as often as one that slips at the beginning"""
BESIDE = "change of the marker's distance from the places that the cable lengths allow"
MIDDLE, MIDDLE_OF_FEW = 0.25, 0.5
"""of the amplitude, by which the middle of an honest swing may be away from the rest before it: of 147 windows of eight
campaigns on four cables (10 s) none has more; their first 1.5 s have 4 mm more. On three cables, where soft directions
swing unevenly, of 247 windows of three simulated robots (amplitudes 13 to 149 mm) one has 0.40 besides `change`, the
others at most 0.23; on two at most 0.06"""
FOUR = 4
"""cables, that leave a platform two freedoms"""
SURVEY = 0.5
"""of what the marker was off at rest: anchors, attachments and zeros that are 5 to 20 mm off leave up to as much"""


def place_measurements(
    rest: NominalRest, lengths: Lengths, place: Positions, rate: float, rested: Vector3, settings: PlaceSettings
) -> tuple[Measurement, ...]:
    """lengths, m; place: (N, 3) m, NaN where unseen; rate: Hz; rested: where the marker was before, m.

    Of those honest windows, with an anchor 9 mm off and cables that stretch, none changes its distance by more than a
    third of what is allowed. Of 564 slips by 30 mm before the window 560 are found on four cables, half on three with
    `MIDDLE` (fewer with `MIDDLE_OF_FEW`, not counted), none on two: those move the marker along with its swing. Raises
    InfeasibleError.
    """
    seen = place[~np.isnan(place).any(axis=1)]
    names = (BESIDE, "distance of the swing's centre from the rest position before it")
    if not len(seen):
        return tuple(Measurement(name, None, "m", high=settings.change) for name in names)
    few = np.vstack([rested, seen[:: max(1, round(APART * rate))]])
    off = few - rest.allowed(lengths, few)
    changed = sliding_window_view(off[1:] - off[0], min(OVER, len(few) - 1), axis=0).mean(axis=2)
    values = (np.linalg.norm(changed, axis=1).max(), np.linalg.norm(seen.mean(axis=0) - rested))
    amplitude = float(np.ptp(seen, axis=0).max())
    survey = SURVEY * float(np.linalg.norm(rested - rest.at(lengths).marker))
    middle = MIDDLE if len(lengths) >= FOUR else MIDDLE_OF_FEW
    rooms = (settings.part * amplitude + survey, middle * amplitude)
    return tuple(
        Measurement(name, float(value), "m", high=settings.change + room)
        for name, value, room in zip(names, values, rooms, strict=True)
    )
