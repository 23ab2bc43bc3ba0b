"""ROS 2 bags (folder, .db3, .mcap) and other MCAP files: points and poses of any message type that has them.

Lengths are metres and z is up, by ROS's convention (REP 103). Stamps are those of the messages; where these say
nothing, those of the recording. Every mistake is a FileError with file and topic.
"""

import fnmatch
import sqlite3
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from fidim_lab.data.files.input_file import MIB, open_input
from fidim_lab.data.files.mcap_file import read_mcap
from fidim_lab.data.importers.reading.cells import EPOCH, MIN_FRAMES
from fidim_lab.data.importers.reading.clock import even_times
from fidim_lab.data.importers.reading.decoding import LONGEST_MESSAGE, MessageDecoder
from fidim_lab.data.importers.reading.frames import (
    FrameTrack,
    in_each_frame,
    in_still_frame,
    still_above,
    without_still,
)
from fidim_lab.data.importers.reading.labels import apart
from fidim_lab.data.importers.reading.messages import Sighting, sightings
from fidim_lab.data.importers.reading.poses import by_quaternions
from fidim_lab.data.importers.reading.signatures import refuse_empty
from fidim_lab.data.importers.recording import MarkerLog
from fidim_lab.errors import FidimError, FileError

LIMIT = 512 * MIB
SQLITE, ZSTD = b"SQLite format 3\0", b"\x28\xb5\x2f\xfd"
"""with which a bag, and a packed message, begin"""
MOST_STEPS = 20_000
"""times 100 000 steps of SQLite's machine: a bag of 512 MiB takes under 1000; a view may be made to run for ever"""
MOST_TRACKS = 200
CORNERS = 3
"""points show a pose, fewer do not"""


@dataclass(frozen=True)
class BagMessage:
    """One message as plain values."""

    topic: str
    logged: float
    """s, since 1970 as a rule"""
    value: Any


def read_bag(path: Path, topics: Sequence[str] = ()) -> MarkerLog:
    """Read one bag. Raises FileError, SetupError.

    topics: patterns of those to take, or of TOPIC/NAME for one of several things on a topic; all of them where empty.
    """
    seen: dict[str, list[tuple[float, Sighting]]] = defaultdict(list)

    def is_wanted(*names: str) -> bool:
        return not topics or any(fnmatch.fnmatchcase(name, wanted) for name in names for wanted in topics)

    decoder = MessageDecoder(lambda topic: is_wanted(topic) or any(one.startswith(f"{topic}/") for one in topics))
    try:
        for message in _messages(path, decoder):
            if message.value is not None:
                for sighting in sightings(message.value):
                    if is_wanted(message.topic, f"{message.topic}/{sighting.name}"):
                        seen[message.topic].append((sighting.stamp or message.logged, sighting))
    except FidimError:
        raise
    except Exception as error:  # rosbags, protobuf and sqlite3 each have errors of their own
        what = f"is damaged, or of a type that cannot be read ({type(error).__name__}: {str(error)[:120]})"
        raise FileError(path, "", what) from None
    if not seen:
        raise _nothing(path, topics, decoder)
    moving, still = without_still(seen)
    return _log(path, _chosen(path, moving), still)


def _nothing(path: Path, topics: Sequence[str], decoder: MessageDecoder) -> FileError:
    """That a bag shows no place, and what it has instead."""
    wanted = f" of topic {', '.join(topics)[:80]}" if topics else ""
    found = "; ".join(f"{topic}: {why}" for topic, why in list(decoder.passed.items())[:8])
    hint = "Record points or poses."
    if any("definition" in why for why in decoder.passed.values()):
        hint = "ros2 bag convert to mcap, where that package is installed, writes definitions into the bag."
    return FileError(
        path, "", f"no message{wanted} with a point or a pose{f' ({found[:400]})' if found else ''}.", hint=hint
    )


def _messages(path: Path, decoder: MessageDecoder) -> Iterator[BagMessage]:
    if path.is_dir():
        files = [one for one in sorted(path.iterdir()) if one.suffix in {".db3", ".mcap"}]
        if not files:
            packed = any(one.suffix == ".zstd" for one in path.iterdir())
            hint = "Unpack it first: ros2 bag convert, or zstd -d." if packed else "A bag's folder holds .db3 or .mcap."
            raise FileError(path, "", "a folder without a .db3 or .mcap file.", hint=hint)
        for one in files:
            yield from _messages(one, decoder)
        return
    with open_input(path, LIMIT) as file:
        begin = file.read(len(SQLITE))
    refuse_empty(path, begin)
    if begin == SQLITE:
        yield from _of_sqlite(path, decoder)
    elif begin.startswith(b"#ROSBAG"):
        raise FileError(path, "", "is a bag of ROS 1.", hint="Convert it: rosbags-convert --src FILE --dst FOLDER.")
    else:
        for one in read_mcap(path, LIMIT, decoder.mcap).messages:
            yield BagMessage(one.topic, one.log_time, one.value)


def _of_sqlite(path: Path, decoder: MessageDecoder) -> Iterator[BagMessage]:
    """Messages of a bag's database, opened to read only, with bounds on what a made-up one may cost."""
    connection = sqlite3.connect(f"file:{quote(str(path.absolute()))}?mode=ro&immutable=1", uri=True)
    try:
        connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, 2 * LONGEST_MESSAGE)
        connection.execute("PRAGMA trusted_schema = OFF")
        steps = iter(range(MOST_STEPS))
        connection.set_progress_handler(lambda: int(next(steps, None) is None), 100_000)
        tables = {name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if not {"topics", "messages"} <= tables:
            raise FileError(path, "", "a database without topics and messages: is it a ROS 2 bag?")
        definitions = _definitions(connection) if "message_definitions" in tables else {}
        decoders = {}
        for number, name, kind, encoding in connection.execute(
            "SELECT id, name, type, serialization_format FROM topics"
        ).fetchall():
            if encoding != "cdr":
                raise FileError(path, f"topic {str(name)[:60]}", f"is encoded as {str(encoding)[:20]!r}; cdr is read")
            decoders[number] = (str(name), decoder.of_topic(str(name), str(kind), *definitions.get(kind, ("", b""))))
        for number, stamp, data in connection.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY id"):
            topic, decode = decoders[number]
            if decode is not None and data[: len(ZSTD)] == ZSTD:
                hint = "Unpack it first: ros2 bag convert."
                raise FileError(path, f"topic {topic[:60]}", "messages are packed with zstd.", hint=hint)
            yield BagMessage(topic, stamp * 1e-9, None if decode is None else decode(data))
    finally:
        connection.close()


def _definitions(connection: sqlite3.Connection) -> dict[str, tuple[str, bytes]]:
    rows = connection.execute("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions")
    return {str(kind): (str(encoding), str(text).encode()) for kind, encoding, text in rows}


def _chosen(path: Path, seen: dict[str, list[tuple[float, Sighting]]]) -> dict[str, list[tuple[float, Sighting]]]:
    """All topics where they share their stamps; else the only one with even ones, or the only such thing on a topic.

    Raises FileError naming them.
    """
    if len(seen) == 1 and len({sighting.name for rows in seen.values() for _, sighting in rows}) == 1:
        return seen
    if _is_even(path, [stamp for rows in seen.values() for stamp, _ in rows]):
        return seen
    parts: dict[str, list[tuple[float, Sighting]]] = {}
    for topic, rows in seen.items():
        whole = _is_even(path, [stamp for stamp, _ in rows])
        for stamp, sighting in rows:
            parts.setdefault(topic if whole or not sighting.name else f"{topic}/{sighting.name}", []).append(
                (stamp, sighting)
            )
    even = [name for name, rows in parts.items() if _is_even(path, [stamp for stamp, _ in rows])]
    if len(even) == 1 and _is_take(parts[even[0]]):
        return {even[0]: parts[even[0]]}
    stamps = [np.unique([stamp for stamp, _ in rows]) for rows in parts.values()]
    if all(np.array_equal(stamps[0], others) for others in stamps) and len(stamps[0]) >= MIN_FRAMES:
        even_times(path, stamps[0])  # they share their stamps: what is uneven in these is the cause
    found = ", ".join(f"{name} ({len(rows)})" for name, rows in list(parts.items())[:8])
    if not any(_is_take(rows) for rows in parts.values()) and len(parts) >= CORNERS:
        what = f"places on topics with their own stamps, so that no sample has all of them: {found[:200]}."
        hint = "Record them in one message, or with the camera's own stamp in each header."
        raise FileError(path, "", what, hint=hint)
    raise FileError(path, "", f"topics with their own stamps: {found[:200]}.", hint="Say which with --topic.")


def _is_take(rows: Sequence[tuple[float, Sighting]]) -> bool:
    """Whether these alone show a pose: a rotation, or places of enough points."""
    names = {sighting.name for _, sighting in rows}
    return len(names) >= CORNERS or any(sighting.quaternion is not None for _, sighting in rows)


def _is_even(path: Path, stamps: Iterable[float]) -> bool:
    distinct = np.unique(np.array(list(stamps)))
    try:
        even_times(path, distinct)
    except (FileError, IndexError):
        return False
    return len(distinct) >= MIN_FRAMES


def _log(path: Path, seen: dict[str, list[tuple[float, Sighting]]], still: Mapping[str, Sighting]) -> MarkerLog:
    """still: frames that do not move, by their names."""
    stamps = np.unique(np.array([stamp for rows in seen.values() for stamp, _ in rows]))
    if len(stamps) < MIN_FRAMES:
        raise FileError(path, "", f"{len(stamps)} stamps; a recording has at least {MIN_FRAMES}")
    t, rate, clock = even_times(path, stamps)
    points: dict[str, np.ndarray] = {}
    poses: dict[str, np.ndarray] = {}
    kinds: dict[str, Sighting] = {}
    for topic, rows in seen.items():
        for stamp, sighting in rows:
            tracks, values = (points, sighting.place) if sighting.quaternion is None else (poses, _seven(sighting))
            name = f"{topic}/{sighting.name}" if sighting.name and len(seen) > 1 else sighting.name or topic
            if name not in tracks:
                if len(points) + len(poses) >= MOST_TRACKS:
                    raise FileError(path, f"topic {topic[:60]}", f"more than {MOST_TRACKS} points and poses")
                tracks[name] = np.full((len(stamps), len(values)), np.nan)
                kinds[name] = sighting
            tracks[name][np.searchsorted(stamps, stamp)] = values
    bodies = {name: by_quaternions(path, name, track[:, :3], track[:, 3:]) for name, track in poses.items()}
    frames = {kinds[name].child: (kinds[name].frame, body) for name, body in bodies.items() if kinds[name].child}
    for name, sighting in still.items():
        values = np.tile(_seven(sighting), (len(stamps), 1))
        frames[name] = (sighting.frame, by_quaternions(path, name, values[:, :3], values[:, 3:]))
    placed = {name: FrameTrack(parent, one.positions, one.rotations) for name, (parent, one) in frames.items()}
    places = [in_still_frame(track, kinds[name].frame, placed) for name, track in points.items()]
    positions = np.stack([place for place, _ in places], axis=1) if points else np.zeros((len(t), 0, 3))
    above = still_above(places[0][1], placed) if len({frame for _, frame in places}) == 1 else ()
    labelled, positions, loose = apart(tuple(points), positions)
    tracked = tuple(way for name, one in bodies.items() for way in in_each_frame(one, kinds[name].frame, placed))
    return MarkerLog(
        path, labelled, rate, t, positions, 1.0, "z", (*_said(seen, rate), *clock.says), tracked, loose,
        unit_said=all(sighting.metric for rows in seen.values() for _, sighting in rows),
        began=float(stamps[0]) if stamps[0] > EPOCH else None, frames=above, breaks=clock.breaks,
    )  # fmt: skip


def _seven(sighting: Sighting) -> tuple[float, ...]:
    """Place and quaternion."""
    return (*sighting.place, *(sighting.quaternion or ()))


def _said(seen: dict[str, list[tuple[float, Sighting]]], rate: float) -> tuple[str, ...]:
    own = all(sighting.stamp is not None for rows in seen.values() for _, sighting in rows)
    metres = all(sighting.metric for rows in seen.values() for _, sighting in rows)
    said = [
        f"topics {', '.join(seen)[:200]}; {'metres and ' if metres else ''}z upwards by ROS's convention",
        f"{rate:.4g} Hz by the stamps of the {'messages' if own else 'recording, for the messages have none'}",
    ]
    return tuple(said)
