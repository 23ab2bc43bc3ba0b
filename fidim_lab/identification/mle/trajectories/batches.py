"""Windows integrated together: recordings of similar length, as many at once as memory allows."""

from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Robot
from fidim_lab.identification.mle.trajectories.recordings import FollowedSamples
from fidim_lab.model.sensitivity.grid import Grid, Resolution
from fidim_lab.model.sensitivity.measurement import MarkerMeasurement
from fidim_lab.model.side_by_side import cores

BATCH = 12
"""windows integrated together, if they have one or two markers; fewer with more"""
NODES = 3000
"""of all of these together, if they are more than one: what long ones need stays in a core's cache"""
LONG = 30.0
"""s of all recordings together, from which they are shared out among the cores"""


def in_batches(
    recordings: Sequence[FollowedSamples],
    measurement: MarkerMeasurement,
    ends: Float[np.ndarray, " W"],
    resolution: Resolution,
) -> Iterator[tuple[np.ndarray, Grid]]:
    """Indices of recordings of similar length, each batch with a grid that reaches its longest end (s)."""
    most = max(recording.markers.shape[1] for recording in recordings)
    longest = Grid.covering(measurement.latest(float(ends.max())), resolution)
    size = max(1, min(BATCH // max(1, most // 2), NODES // longest.nodes))
    if float(ends.sum()) > LONG:
        size = min(size, -(-len(ends) // cores()))
    order = np.argsort(ends, kind="stable")
    for first in range(0, len(order), size):
        members = order[first : first + size]
        yield members, Grid.covering(measurement.latest(float(ends[members].max())), resolution)


def body_markers(
    recordings: Sequence[FollowedSamples], robot: Robot, members: Sequence[int] | np.ndarray
) -> Float[np.ndarray, "M 3"]:
    """As many of the robot's markers (body frame, m) as the windows of a batch have at most."""
    return robot.markers[: max(recordings[w].markers.shape[1] for w in members)]


def rows_of(values: np.ndarray | None, members: np.ndarray) -> np.ndarray | None:
    """Those rows of an array that may not be there."""
    return None if values is None else values[members]
