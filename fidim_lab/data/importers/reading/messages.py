"""Points and poses inside a message of any type, by the names that its fields have.

    pose     {position: {x, y, z}, orientation: {x, y, z, w}} or {translation: …, rotation: …}
    point    {point: {x, y, z}}, {position: …} or {translation: …} without a rotation beside it; {name, x, y, z}
    points   {points: [{x, y, z}, …]}: few places in a list, without a pose or with one that moves nothing
    cloud    {fields, point_step or point_stride, data}: points packed in bytes, of any datatype and order of bytes
    vicon    {x_trans, y_trans, z_trans, x_rot, y_rot, z_rot, w}, in Vicon's unit, which no message says
    list     numbers of a place or a rotation in a list, as JSON has them
    name     child_frame_id, marker_name, name, id, marker_index of this level, behind those above; else the place in
             a list
    unseen   {occluded: true} or {tracking_valid: false}
    time     stamp or timestamp {sec or seconds, nanosec, nsec or nanos} of the same level or above, or of its header
    frame    frame_id of a header, or parent_frame_id or frame_id, of the same level or above: in which places are given

So geometry_msgs, nav_msgs, tf2_msgs, sensor_msgs/PointCloud2, visualization_msgs, mocap4r2_msgs, vicon_receiver and
Foxglove's own schemas are read alike.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

DEEPEST = 8
"""levels; nav_msgs/Odometry has four"""
MOST = 1000
"""of one message"""
MOST_OF_CLOUD = 200
"""points; a cloud of more is what a scanner saw, no markers"""
NAMES = ("child_frame_id", "marker_name", "rigid_body_name", "segment_name", "name", "id", "marker_index")
PAIRS = (("position", "orientation"), ("translation", "rotation"))
POINTS = ("point", "position", "translation")
VICON = (("x_trans", "y_trans", "z_trans"), ("x_rot", "y_rot", "z_rot", "w"))
FRAMES = ("parent_frame_id", "frame_id")
CHILD = "child_frame_id"
UNSEEN = (("occluded", True), ("tracking_valid", False))
DATATYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""of sensor_msgs/PointField; Foxglove's have signed and unsigned ones exchanged"""


@dataclass(frozen=True)
class Sighting:
    """One place, with a rotation or without."""

    name: str
    """within its topic; empty where the message names nothing"""
    stamp: float | None
    """s, as the message says it; None where it does not, or says 0"""
    place: tuple[float, float, float]
    """in the message's unit"""
    quaternion: tuple[float, float, float, float] | None
    """x, y, z, w"""
    metric: bool = True
    """whether places are in metres by the convention of the message"""
    frame: str = ""
    """in which it is given; empty where the message does not say"""
    child: str = ""
    """the frame that it places, where the message is a transform"""


@dataclass(frozen=True)
class Level:
    """What a level of a message, and those above it, say of what is below."""

    owner: str = ""
    """what levels above are called"""
    name: str = ""
    """alike, or the place in a list where they say nothing"""
    stamp: float | None = None
    frame: str = ""
    child: str = ""
    depth: int = 0

    def below(self, node: Mapping[str, Any]) -> "Level":
        """With what a node of the message says itself."""
        own = _named(node)
        owner = "/".join(filter(None, (self.owner, own)))
        frame = _text(node.get("header"), FRAMES) or _text(node, FRAMES) or self.frame
        child = _text(node, (CHILD,)) or self.child
        stamp = _stamp(node) or self.stamp
        return replace(self, owner=owner, name=owner if own else self.name, stamp=stamp, frame=frame, child=child)

    def saw(
        self, place: Sequence[float], quaternion: Sequence[float] | None = None, *, metric: bool = True
    ) -> Sighting:
        """Something at this level."""
        x, y, z = place
        turn = None if quaternion is None else (quaternion[0], quaternion[1], quaternion[2], quaternion[3])
        return Sighting(self.name, self.stamp, (x, y, z), turn, metric, self.frame, self.child)


def sightings(message: Any) -> Iterator[Sighting]:
    """All that a decoded message of plain dicts, lists and numbers shows. Raises ValueError beyond `MOST`."""
    named: Counter[tuple[str, float | None]] = Counter()
    for count, found in enumerate(_walk(message, Level())):
        if count >= MOST:
            raise ValueError(f"a message with more than {MOST} points")
        named[found.name, found.stamp] += 1
        again = named[found.name, found.stamp]  # things without a name of their own are told apart by their order
        yield found if again == 1 else replace(found, name=f"{found.name}#{again}")


def _walk(node: Any, above: Level) -> Iterator[Sighting]:
    if above.depth > DEEPEST:
        return
    deeper = replace(above, depth=above.depth + 1)
    if isinstance(node, list):
        for index, item in enumerate(node):
            yield from _walk(item, replace(deeper, name=f"{above.name}/{index}" if above.name else str(index)))
    elif isinstance(node, Mapping) and not any(node.get(key) is value for key, value in UNSEEN):
        level = deeper.below(node)
        if isinstance(node.get("data"), bytes) and isinstance(node.get("fields"), list):
            yield from _cloud(node, level)
            return
        if (at := _under(node, VICON[0])) and (quaternion := _under(node, VICON[1])):
            yield level.saw(at, quaternion, metric=False)
            return
        if few := _few(node):
            for name, place in few:
                yield replace(level, name="/".join(filter(None, (level.owner, name)))).saw(place)
            return
        for place, turn in PAIRS:
            if (at := _numbers(node.get(place), "xyz")) and (quaternion := _numbers(node.get(turn), "xyzw")):
                yield level.saw(at, quaternion)
                return
        if _named(node) and (at := _numbers(node, "xyz")):
            yield level.saw(at)
            return
        for key, item in node.items():
            at = _numbers(item, "xyz") if key in POINTS else None
            if at:
                yield level.saw(at)
            else:
                yield from _walk(item, level)


def _few(node: Mapping[str, Any]) -> list[tuple[str, tuple[float, ...]]]:
    """Names and places of a list of points, where all of it are some; none where a pose beside it moves them."""
    points, pose = node.get("points"), node.get("pose")
    if not isinstance(points, list) or not 0 < len(points) <= MOST_OF_CLOUD:
        return []
    if isinstance(pose, Mapping):
        at, turn = _numbers(pose.get("position"), "xyz"), _numbers(pose.get("orientation"), "xyzw")
        if any(at or ()) or any((turn or ())[:3]):
            return []
    places = [_numbers(point, "xyz") if isinstance(point, Mapping) else None for point in points]
    if not all(places):
        return []
    named = [(_named(points[index]) or str(index), place) for index, place in enumerate(places) if place]
    return [(name, place) for name, place in named if np.isfinite(place).all()]


def _cloud(node: Mapping[str, Any], level: Level) -> Iterator[Sighting]:
    """The points of a small cloud. Raises ValueError where its bytes are not what its fields say."""
    foxglove = "point_stride" in node
    step = int(node["point_stride" if foxglove else "point_step"])
    order = ">" if node.get("is_bigendian") is True else "<"
    kinds = {one["name"]: _datatype(one, foxglove=foxglove) for one in node["fields"] if one["name"] in {*"xyz", "id"}}
    offsets = [int(one["offset"]) for one in node["fields"] if one["name"] in kinds]
    if not {*"xyz"} <= kinds.keys():
        raise ValueError("a cloud whose points have no x, y, z")
    point = np.dtype(
        {
            "names": list(kinds),
            "formats": [order + kind for kind in kinds.values()],
            "offsets": offsets,
            "itemsize": step,
        }
    )
    data = node["data"]
    width = len(data) // step if foxglove else int(node["width"])
    height = 1 if foxglove else int(node["height"])
    if not 0 < width * height <= MOST_OF_CLOUD:
        return
    pitch = width * step if foxglove or height == 1 else int(node["row_step"])
    rows = [np.frombuffer(data, point, count=width, offset=row * pitch) for row in range(height)]
    for index, one in enumerate(np.concatenate(rows)):
        own = str(int(one["id"])) if "id" in kinds else str(index)
        if np.isfinite(place := tuple(float(one[axis]) for axis in "xyz")).all():
            yield replace(level, name=f"{level.name}/{own}" if level.name else own).saw(place)


def _datatype(field: Mapping[str, Any], *, foxglove: bool) -> str:
    number = int(field["type" if foxglove else "datatype"])
    swapped = foxglove and 1 <= number <= 6
    kind = DATATYPES.get((number - 1 ^ 1) + 1 if swapped else number)
    if kind is None:
        raise ValueError(f"a cloud's {field['name']} of datatype {number}; 1 to 8 are known")
    return kind


def _under(node: Mapping[str, Any], keys: Sequence[str]) -> tuple[float, ...] | None:
    """The numbers under these keys, where all are there."""
    if not all(isinstance(node.get(key), int | float) for key in keys):
        return None
    return tuple(float(node[key]) for key in keys)


def _named(node: Mapping[str, Any]) -> str:
    for key in NAMES:
        value = node.get(key)
        if (isinstance(value, str) and value.strip()) or (isinstance(value, int) and not isinstance(value, bool)):
            return str(value).strip()[:80]
    return ""


def _text(node: Any, keys: Sequence[str]) -> str:
    """The first of these keys under which a text stands; a frame's name without the slash that ROS 1 put before it."""
    found = [node.get(key) for key in keys] if isinstance(node, Mapping) else []
    return next((one.strip().lstrip("/")[:80] for one in found if isinstance(one, str) and one.strip()), "")


def _stamp(node: Mapping[str, Any]) -> float | None:
    for owner in (node, node.get("header")):
        found = owner.get("stamp", owner.get("timestamp")) if isinstance(owner, Mapping) else None
        if isinstance(found, Mapping):
            whole = found.get("sec", found.get("seconds", 0))
            part = found.get("nanosec", found.get("nsec", found.get("nanos", 0)))
            if isinstance(whole, int | float) and isinstance(part, int | float) and (whole or part):
                return float(whole) + 1e-9 * float(part)
    return None


def _numbers(node: Any, keys: str) -> tuple[float, ...] | None:
    """The numbers of a dict that has all these keys, or of a list with as many."""
    if isinstance(node, list) and len(node) == len(keys) and all(isinstance(one, int | float) for one in node):
        return tuple(map(float, node))
    if not isinstance(node, Mapping) or (len(keys) == 3 and "w" in node):
        return None
    return _under(node, tuple(keys))
