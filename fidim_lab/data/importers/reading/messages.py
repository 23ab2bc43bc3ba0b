"""Points and poses inside a message of any type, by the names that its fields have.

    pose     {position: {x, y, z}, orientation: {x, y, z, w}} or {translation: …, rotation: …}
    point    {point: {x, y, z}}, {position: …} or {translation: …} without a rotation beside it
    name     child_frame_id, marker_name, name, id, marker_index of this level or above; or the place in a list
    time     stamp or timestamp {sec or seconds, nanosec, nsec or nanos} of the same level or above, or of its header

So geometry_msgs, nav_msgs, tf2_msgs, visualization_msgs, mocap4r2_msgs and Foxglove's own schemas are read alike.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

DEEPEST = 8
"""levels; nav_msgs/Odometry has four"""
MOST = 1000
"""of one message"""
NAMES = ("child_frame_id", "marker_name", "name", "id", "marker_index")
PAIRS = (("position", "orientation"), ("translation", "rotation"))
POINTS = ("point", "position", "translation")


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


def sightings(message: Any) -> Iterator[Sighting]:
    """All that a decoded message of plain dicts, lists and numbers shows. Raises ValueError beyond `MOST`."""
    for count, found in enumerate(_walk(message, "", None, 0)):
        if count >= MOST:
            raise ValueError(f"a message with more than {MOST} points")
        yield found


def _walk(node: Any, name: str, stamp: float | None, depth: int) -> Iterator[Sighting]:
    if depth > DEEPEST:
        return
    if isinstance(node, list):
        for index, item in enumerate(node):
            yield from _walk(item, f"{name}/{index}" if name else str(index), stamp, depth + 1)
    elif isinstance(node, Mapping):
        name, stamp = _named(node) or name, _stamp(node) or stamp
        for place, turn in PAIRS:
            if (at := _numbers(node.get(place), "xyz")) and (quaternion := _numbers(node.get(turn), "xyzw")):
                yield Sighting(name, stamp, at, quaternion)  # type: ignore[arg-type]
                return
        for key, item in node.items():
            at = _numbers(item, "xyz") if key in POINTS else None
            if at:
                yield Sighting(name, stamp, at, None)  # type: ignore[arg-type]
            else:
                yield from _walk(item, name, stamp, depth + 1)


def _named(node: Mapping[str, Any]) -> str:
    for key in NAMES:
        value = node.get(key)
        if (isinstance(value, str) and value.strip()) or (isinstance(value, int) and not isinstance(value, bool)):
            return str(value).strip()[:80]
    return ""


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
    """The numbers of a dict that has all these keys."""
    if not isinstance(node, Mapping) or not all(isinstance(node.get(key), int | float) for key in keys):
        return None
    if len(keys) == 3 and "w" in node:
        return None
    return tuple(float(node[key]) for key in keys)
