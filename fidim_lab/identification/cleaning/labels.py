"""Markers whose names are exchanged, in a whole window or for a while. Their names are corrected.

Distances between markers tell which is which, whatever the motion. Where no order fits the robot file clearly, and for
samples that stay in doubt, nothing is changed: screening then takes out what jumps.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from fidim_lab.data.marker_order import order_of
from fidim_lab.data.records import Campaign, Window
from fidim_lab.data.stitching import stitch
from fidim_lab.errors import RefusedError
from fidim_lab.identification.cleaning.removed import CleanRecordings

FEWEST = 3
"""markers, whose distances tell them apart"""


def with_right_labels(campaign: Campaign) -> CleanRecordings:
    """The campaign with the markers in the robot file's order."""
    windows: list[Window] = []
    ordered: dict[tuple[int, ...], list[str]] = {}
    stitched: dict[str, int] = {}
    for window in campaign.windows:
        body = campaign.robot.markers[: window.markers.shape[1]]
        order = _order(window.markers, body)
        if order is None:
            windows.append(window)
            continue
        markers = window.markers[:, order]
        mended, changed = _stitched(markers, body)
        if order != tuple(range(len(body))):
            ordered.setdefault(order, []).append(window.id)
        if changed.any():
            stitched[window.id] = int(changed.sum())
        windows.append(replace(window, markers=mended))
    if not ordered and not stitched:
        return CleanRecordings(campaign)
    return CleanRecordings(replace(campaign, windows=tuple(windows)), notes=_notes(ordered, stitched))


def _order(markers: Float[np.ndarray, "N M 3"], body: Float[np.ndarray, "M 3"]) -> tuple[int, ...] | None:
    """None where the distances tell no order."""
    if len(body) < FEWEST:
        return None
    try:
        order, _, certain = order_of(markers, body)
    except RefusedError:
        return None
    return order if certain else None


def _stitched(
    markers: Float[np.ndarray, "N M 3"], body: Float[np.ndarray, "M 3"]
) -> tuple[Float[np.ndarray, "N M 3"], Bool[np.ndarray, " N"]]:
    """With each sample's names put right, and where that was: only where a marker stands at another one's name."""
    mended = stitch(markers, markers, body).markers
    alike = (mended[:, :, np.newaxis] == markers[:, np.newaxis]).all(axis=3)
    taken = np.asarray((alike & ~np.eye(len(body), dtype=bool)).any(axis=(1, 2)))
    return np.where(taken[:, np.newaxis, np.newaxis], mended, markers), taken


def _notes(ordered: dict[tuple[int, ...], list[str]], stitched: dict[str, int]) -> tuple[str, ...]:
    said = [
        f"The markers stand in another order than in the robot file in {', '.join(ids)}: its markers 1 to {len(order)} "
        f"are the recorded {', '.join(str(k + 1) for k in order)}, by the distances between them. This order is used."
        for order, ids in ordered.items()
    ]
    if stitched:
        where = ", ".join(f"{name} ({count})" for name, count in stitched.items())
        said.append(
            f"Markers are exchanged in some samples of {where}: by the distances between them, their names are "
            "corrected."
        )
    return tuple(said)
