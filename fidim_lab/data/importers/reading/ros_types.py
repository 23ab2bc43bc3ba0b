"""Message types of motion-capture drivers that bags of ROS 2 Humble and before do not define themselves.

Those of mocap4r2_msgs, mocap_msgs, vicon_receiver, vicon_msgs and motion_capture_tracking_interfaces, with the forms
that a type had: the one is meant of which a message is, to its last byte.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

_HEADER = "std_msgs/Header header\n"
_COUNTED = _HEADER + "uint32 frame_number\n"
_MARKER = "int8 id_type\nint32 marker_index\nstring marker_name\ngeometry_msgs/Point translation\n"
_BODY = "string rigid_body_name\nMarker[] markers\ngeometry_msgs/Pose pose\n"
_VICON = "".join(f"float32 {name}\n" for name in ("x_trans", "y_trans", "z_trans", "x_rot", "y_rot", "z_rot", "w"))
_VICON_EULER = "".join(f"float32 {axis}_rot_euler\n" for axis in "xyz")
_VICON_END = "string segment_name\nstring subject_name\nint32 frame_number\nstring translation_type\n"
_POSE = "string name\ngeometry_msgs/Pose pose\n"

Parts = Mapping[str, str]
"""the text of a message's definition, and of those it is made of, by the full name of each"""


def _mocap(package: str) -> dict[str, Sequence[Parts]]:
    marker, body = f"{package}/msg/Marker", f"{package}/msg/RigidBody"
    markers, bodies = f"{package}/msg/Markers", f"{package}/msg/RigidBodies"
    return {
        markers: ({markers: _COUNTED + "Marker[] markers\n", marker: _MARKER},),
        body: tuple({body: head + _BODY, marker: _MARKER} for head in (_COUNTED, _HEADER)),
        bodies: ({bodies: _COUNTED + "RigidBody[] rigidbodies\n", body: _BODY, marker: _MARKER},),
    }


def _vicon(name: str) -> dict[str, Sequence[Parts]]:
    return {
        name: tuple(
            {name: head + _VICON + euler + _VICON_END} for head in (_HEADER, "") for euler in ("", _VICON_EULER)
        )
    }


_TRACKING = "motion_capture_tracking_interfaces/msg/NamedPose"

DRIVERS: Mapping[str, Sequence[Parts]] = MappingProxyType({
    **_mocap("mocap4r2_msgs"),
    **_mocap("mocap_msgs"),
    **_vicon("vicon_receiver/msg/Position"),
    **_vicon("vicon_msgs/msg/Position"),
    f"{_TRACKING}Array": ({f"{_TRACKING}Array": _HEADER + "NamedPose[] poses\n", _TRACKING: _POSE},),
})  # fmt: skip
"""by full name, the forms to try"""
