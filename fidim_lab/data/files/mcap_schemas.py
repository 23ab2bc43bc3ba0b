"""The messages of our MCAP files as protobuf, built without a compiler, each file carrying its own description.

`fidim.*` are ours; `foxglove.*` have the names and field numbers that Foxglove and PlotJuggler know, so that the marker
shows in three dimensions and the events in the log panel. A reader needs nothing but the file.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, timestamp_pb2

from fidim_lab.data.files.mcap_encoder import MessageSchema, nanoseconds

ROW = "fidim.WindowRow"
WINCH = "fidim.WinchState"
GUARD = "fidim.GuardTrip"
POSE = "foxglove.PoseInFrame"
LOG = "foxglove.Log"

_MESSAGES: tuple[tuple[str, tuple[tuple[int, str, str], ...]], ...] = (
    (
        ROW,  # one row of the window's table; NaN where a sample is missing
        (
            (1, "row", "uint32"),
            (2, "t", "double"),  # s since the first frame
            (3, "host_time", "double"),  # s, monotonic, of the frame's arrival; NaN for a lost frame
            (4, "device_time", "double"),  # s by the motion capture's own frame counter
            (5, "device_frame", "uint64"),
            (6, "markers", "double[]"),  # m, x y z of each marker
            (7, "lengths", "double[]"),  # m
            (8, "currents", "double[]"),  # A
            (9, "further", "double[]"),  # columns that the format does not name
        ),
    ),
    (
        WINCH,  # every new sample that was seen
        (
            (1, "cable", "uint32"),  # from 1
            (2, "host_time", "double"),  # s, monotonic, of the SYNC that sampled it
            (3, "state", "string"),
            (4, "length", "double"),  # m
            (5, "velocity", "double"),  # m/s
            (6, "current", "double"),  # A
            (7, "tension", "double"),  # N, from the current; NaN where the robot file has no winches
            (8, "target_reached", "bool"),
            (9, "fault", "string"),
        ),
    ),
    (GUARD, ((1, "host_time", "double"), (2, "guard", "string"), (3, "says", "string"), (4, "reaction", "string"))),
    ("foxglove.Vector3", ((1, "x", "double"), (2, "y", "double"), (3, "z", "double"))),
    ("foxglove.Quaternion", ((1, "x", "double"), (2, "y", "double"), (3, "z", "double"), (4, "w", "double"))),
    ("foxglove.Pose", ((1, "position", "foxglove.Vector3"), (2, "orientation", "foxglove.Quaternion"))),
    (POSE, ((1, "timestamp", "time"), (2, "frame_id", "string"), (3, "pose", "foxglove.Pose"))),
    (
        LOG,
        (
            (1, "timestamp", "time"),
            (2, "level", "foxglove.Log.Level"),
            (3, "message", "string"),
            (4, "name", "string"),
            (5, "file", "string"),
            (6, "line", "fixed32"),
        ),
    ),
)
_LEVELS = ("UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL")
_TIME = "google.protobuf.Timestamp"
INFO, WARNING, ERROR = 2, 3, 4
"""levels of `foxglove.Log`"""

_Field = descriptor_pb2.FieldDescriptorProto
_SCALARS: dict[str, "_Field.Type.ValueType"] = {
    "double": _Field.TYPE_DOUBLE,
    "uint32": _Field.TYPE_UINT32,
    "uint64": _Field.TYPE_UINT64,
    "fixed32": _Field.TYPE_FIXED32,
    "bool": _Field.TYPE_BOOL,
    "string": _Field.TYPE_STRING,
}


@dataclass(frozen=True)
class Messages:
    """Message classes by full name, and what a file has to carry for them to be read."""

    classes: dict[str, Any]
    descriptors: bytes

    def schema(self, name: str) -> MessageSchema:
        """As `McapEncoder.add_channel` takes it."""
        return MessageSchema(name, "protobuf", self.descriptors)

    def encode(self, schema: str, /, **fields: Any) -> bytes:
        """One message, the same bytes for the same fields."""
        message = self.classes[schema](**fields)
        return bytes(message.SerializeToString(deterministic=True))


@lru_cache(maxsize=1)
def messages() -> Messages:
    """All of them; built at the first call."""
    files = _files()
    pool = descriptor_pool.DescriptorPool()
    for file in files.file:
        pool.Add(file)
    classes = {
        name: message_factory.GetMessageClass(pool.FindMessageTypeByName(name)) for name in (m for m, _ in _MESSAGES)
    }
    return Messages(classes, files.SerializeToString(deterministic=True))


def timestamp(t: float) -> dict[str, int]:
    """Seconds as the fields of a protobuf Timestamp."""
    seconds, nanos = divmod(nanoseconds(t), 1_000_000_000)
    return {"seconds": seconds, "nanos": nanos}


def _files() -> descriptor_pb2.FileDescriptorSet:
    files = descriptor_pb2.FileDescriptorSet()
    timestamp_pb2.DESCRIPTOR.CopyToProto(files.file.add())
    for package in ("foxglove", "fidim"):
        file = files.file.add(name=f"{package}.proto", package=package, syntax="proto3")
        if package == "foxglove":
            file.dependency.append("google/protobuf/timestamp.proto")
        for name, fields in _MESSAGES:
            if name.startswith(f"{package}."):
                _add_message(file.message_type.add(name=name.removeprefix(f"{package}.")), fields)
    return files


def _add_message(message: descriptor_pb2.DescriptorProto, fields: tuple[tuple[int, str, str], ...]) -> None:
    for number, name, kind in fields:
        field = message.field.add(name=name, number=number, label=_Field.LABEL_OPTIONAL)
        base = kind.removesuffix("[]")
        if base != kind:
            field.label = _Field.LABEL_REPEATED
        if base in _SCALARS:
            field.type = _SCALARS[base]
        elif base.endswith(".Level"):
            field.type, field.type_name = _Field.TYPE_ENUM, f".{base}"
            levels = message.enum_type.add(name="Level")
            for value, level in enumerate(_LEVELS):
                levels.value.add(name=level, number=value)
        else:
            field.type, field.type_name = _Field.TYPE_MESSAGE, f".{_TIME if base == 'time' else base}"
