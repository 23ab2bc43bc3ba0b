"""Frames of a bag that are given in other frames: transforms (parent → child) put together, as tf2 does.

A place is given in the frame that its message names. Where transforms place that frame in another one, it may be meant
there as well: which of them is the robot's frame no bag says, so that a body is read in each of them.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.arrays import Positions, Rotations
from fidim_lab.data.importers.reading.messages import Sighting
from fidim_lab.data.importers.recording import BodyTrack, PlacedFrame

Seen = Mapping[str, Sequence[tuple[float, Sighting]]]
"""by topic: stamps, s, and what was seen then"""


@dataclass(frozen=True, eq=False)
class FrameTrack:
    """A frame by the numbers of its transforms in its parent."""

    parent: str
    positions: Positions
    """(N, 3) m"""
    rotations: Rotations
    """(N, 3, 3) child → parent"""


def without_still(seen: Seen) -> tuple[dict[str, list[tuple[float, Sighting]]], dict[str, Sighting]]:
    """What moves, and by its name each frame that always has the same place: as /tf_static says it, or repeated.

    A camera's noise makes no two poses of a body alike. A frame of one message counts only where something else moves.
    """
    transforms: dict[str, list[Sighting]] = {}
    for rows in seen.values():
        for _, one in rows:
            if one.child and one.quaternion is not None:
                transforms.setdefault(one.child, []).append(one)
    still = {
        child: ones[0]
        for child, ones in transforms.items()
        if all(
            (one.frame, one.place, one.quaternion) == (ones[0].frame, ones[0].place, ones[0].quaternion) for one in ones
        )
    }
    moving = {topic: [row for row in rows if row[1].child not in still] for topic, rows in seen.items()}
    moving = {topic: rows for topic, rows in moving.items() if rows}
    return (moving, still) if moving else ({topic: list(rows) for topic, rows in seen.items()}, {})


def in_each_frame(body: BodyTrack, frame: str, frames: Mapping[str, FrameTrack]) -> Iterator[BodyTrack]:
    """The body as it is given in its frame, and in every frame in which that one is placed, directly or not."""
    above = list(_chain(frame, frames))
    yield replace(body, read_as=f"in frame {frame}") if above else body
    for name in above:
        found = frames[name]
        places = found.positions + np.einsum("nij,nj->ni", found.rotations, body.positions)
        body = replace(body, positions=places, rotations=found.rotations @ body.rotations)
        yield replace(body, read_as=f"in frame {found.parent}")


def in_still_frame(points: Positions, frame: str, frames: Mapping[str, FrameTrack]) -> tuple[Positions, str]:
    """(N, 3) places as they are given, or as long as their frame moves, in the one in which it moves; and its name."""
    chain = list(_chain(frame, frames))
    moving = max((k for k, name in enumerate(chain, start=1) if not _stands(frames[name])), default=0)
    for name in chain[:moving]:
        found = frames[name]
        points, frame = found.positions + np.einsum("nij,nj->ni", found.rotations, points), found.parent
    return points, frame


def still_above(frame: str, frames: Mapping[str, FrameTrack]) -> tuple[PlacedFrame, ...]:
    """The still frames in which a still one is placed, directly or not."""
    found: list[PlacedFrame] = []
    turn, shift = np.eye(3), np.zeros(3)
    for name in _chain(frame, frames):
        above = frames[name]
        turn, shift = above.rotations[0] @ turn, above.rotations[0] @ shift + above.positions[0]
        found.append(PlacedFrame(above.parent, turn, shift))
    return tuple(found)


def _stands(frame: FrameTrack) -> bool:
    return bool((frame.positions == frame.positions[0]).all() and (frame.rotations == frame.rotations[0]).all())


def _chain(frame: str, frames: Mapping[str, FrameTrack]) -> Iterator[str]:
    """The frame and those in which it is placed in turn, as far as they are placed themselves, each once."""
    known: set[str] = set()
    while frame in frames and frame not in known:
        known.add(frame)
        yield frame
        frame = frames[frame].parent
