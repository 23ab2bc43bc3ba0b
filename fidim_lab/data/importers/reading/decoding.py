"""Messages of ROS 2 (CDR), protobuf and JSON as plain dicts, lists and numbers. ROS 2 needs the package rosbags.

The types of a ROS 2 message are taken from the definition that the file itself brings; without one from the standard
messages of ROS 2 and of drivers (`ros_types`). What holds no point and no pose by its definition is not decoded at all:
pictures, scans, text. What is passed over is named with the reason.
"""

import importlib
import json
import re
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from mcap.records import Channel, Schema
from mcap_protobuf.decoder import DecoderFactory

from fidim_lab.data.files.input_file import check_values
from fidim_lab.data.importers.reading.ros_types import DRIVERS
from fidim_lab.errors import SetupError

GEOMETRY = re.compile(rb"\b(Pose|[Pp]oint|Transform|position|translation|x_trans)\w*\b")
"""stands in the definition of what may hold a point or a pose"""
LONGEST_DEFINITION = 1 << 18
"""bytes"""
LONGEST_MESSAGE = 1 << 22
"""bytes"""
LONGEST_LIST = 2000

Plain = Callable[[bytes], Any]


class UnknownEncodingError(ValueError):
    """A message that is in no encoding read here."""


class MessageDecoder:
    """Decodes the wanted topics of one file; keeps the types that it has seen."""

    def __init__(self, wanted: Callable[[str], bool] = lambda _: True) -> None:
        self._wanted = wanted
        self._protobuf = DecoderFactory()
        self._known: dict[tuple[int, str], Plain | None] = {}
        self.passed: dict[str, str] = {}
        """topics that were not decoded: why"""

    def mcap(self, channel: Channel, schema: Schema | None, data: bytes) -> Any:
        """A message of an MCAP file; None where it holds no geometry. Raises what damaged bytes raise."""
        key = (channel.id, channel.topic)
        if key not in self._known:
            self._known[key] = self._of(channel, schema) if self._wanted(channel.topic) else None
        decode = self._known[key]
        return None if decode is None or len(data) > LONGEST_MESSAGE else decode(data)

    def _of(self, channel: Channel, schema: Schema | None) -> Plain | None:
        if channel.message_encoding == "json":
            return _json
        if schema is None:
            return None
        if channel.message_encoding == "cdr":
            return self.of_topic(channel.topic, schema.name, schema.encoding, schema.data)
        if not GEOMETRY.search(schema.data + schema.name.encode()):
            return self._pass(channel.topic, f"{schema.name} holds no point and no pose")
        if channel.message_encoding == "protobuf":
            found = self._protobuf.decoder_for("protobuf", schema)
            return None if found is None else lambda data: _of_protobuf(found(data), 0)
        raise UnknownEncodingError(
            f"messages encoded as {channel.message_encoding[:20]!r}; cdr, protobuf, json are read"
        )

    def _pass(self, topic: str, why: str) -> None:
        self.passed[topic] = why[:100]

    def of_topic(self, topic: str, name: str, encoding: str, definition: bytes) -> Plain | None:
        """What decodes a ROS 2 topic; None where it is not wanted, shows no place, or nobody knows its type."""
        if not self._wanted(topic):
            return None
        name = name if "/msg/" in name else name.replace("/", "/msg/", 1)
        if definition:
            if not GEOMETRY.search(definition + name.encode()):
                return self._pass(topic, f"{name} holds no point and no pose")
            return self.cdr(name, encoding, definition)
        if name in DRIVERS:
            return self._by_forms(name)
        types, stores = _rosbags()
        if name not in types.get_typestore(stores.LATEST).types:
            return self._pass(topic, f"{name}, whose definition the bag does not bring")
        return self.cdr(name, encoding, definition)

    def _by_forms(self, name: str) -> Plain:
        """What decodes a driver's type by the first of its forms that the first message has."""
        types, stores = _rosbags()
        forms: list[Any] = []
        for parts in DRIVERS[name]:
            store = types.get_typestore(stores.LATEST)
            for part, text in parts.items():
                store.register(types.get_types_from_msg(text, part))
            forms.append(store)

        def decode(data: bytes) -> Any:
            while len(forms) > 1:
                try:
                    return _of_object(forms[0].deserialize_cdr(data, name), 0)
                except Exception:  # rosbags answers bytes of another form with errors of many kinds
                    del forms[0]
            return _of_object(forms[0].deserialize_cdr(data, name), 0)

        return decode

    def cdr(self, name: str, encoding: str, definition: bytes) -> Plain:
        """What decodes one ROS 2 type. Raises UnknownEncodingError, and what a wrong definition raises."""
        types, stores = _rosbags()
        store = self._with(types, name, encoding, definition) if definition else types.get_typestore(stores.LATEST)
        return lambda data: _of_object(store.deserialize_cdr(data, name), 0)

    def _with(self, types: Any, name: str, encoding: str, definition: bytes) -> Any:
        if len(definition) > LONGEST_DEFINITION or encoding not in {"ros2msg", "ros2idl"}:
            raise UnknownEncodingError(f"a definition of {name[:60]!r} as {encoding[:20]!r}; ros2msg is read")
        text = definition.decode("utf-8", "replace")
        found = types.get_types_from_msg(text, name) if encoding == "ros2msg" else types.get_types_from_idl(text)
        if any(not members for _, members in found.values()):  # a list of 2³² of them has no bytes
            raise UnknownEncodingError(f"a definition of {name[:60]!r} with a type without fields")
        store = types.get_typestore(types.Stores.EMPTY)
        store.register(found)
        return store


def _rosbags() -> tuple[Any, Any]:
    try:
        types = importlib.import_module("rosbags.typesys")
    except ImportError as error:
        hint = "pip install 'fidim-lab[ros]'"
        raise SetupError(f"ROS 2 messages need the package rosbags: {error}", hint=hint) from None
    return types, types.Stores


def _json(data: bytes) -> Any:
    found = json.loads(data)
    check_values(found)
    return found


def _of_protobuf(message: Any, depth: int) -> Any:
    if depth > 8:
        return None
    found: dict[str, Any] = {}
    for field in message.DESCRIPTOR.fields:
        value = getattr(message, field.name)
        if field.message_type is None:
            found[field.name] = value
        elif hasattr(value, "DESCRIPTOR"):
            if message.HasField(field.name):
                found[field.name] = _of_protobuf(value, depth + 1)
        elif not field.message_type.GetOptions().map_entry:
            found[field.name] = [_of_protobuf(item, depth + 1) for item in value[:LONGEST_LIST]]
    return found


def _of_object(value: Any, depth: int) -> Any:
    if isinstance(value, np.ndarray):
        return value.tobytes() if value.dtype == np.uint8 else None
    if depth > 8:
        return None
    if isinstance(value, list | tuple):
        return [_of_object(item, depth + 1) for item in value[:LONGEST_LIST]]
    if is_dataclass(value):
        return {name: _of_object(getattr(value, name), depth + 1) for name in _names(type(value))}
    return value


@lru_cache(maxsize=256)
def _names(kind: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind) if not field.name.startswith("__"))
