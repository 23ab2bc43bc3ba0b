"""The drive's object dictionary: typed values, access rights, ranges, and who looks at a write.

`read` and `write` are what the SDO server sees (bytes and abort codes); `number`, `put` and `fix` what the drive itself
uses. A *source* computes a value when it is read (statusword, position); a *guard* may refuse a write; a *watcher*
acts on a value that has been stored.
"""

import struct
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from sim_backends.drive.objects.abort import AbortCode

Value = int | float | bytes
Guard = Callable[[int, int], AbortCode | None]
"""(subindex, value) -> why not, or None"""
Watcher = Callable[[int, int], None]
"""(subindex, value) -> nothing"""


@dataclass(frozen=True)
class ObjectSpec:
    """One entry: where it is, how it looks on the wire, what may be done with it."""

    index: int
    subindex: int
    name: str
    code: str
    """struct letter of the type, little endian; empty for strings and domains"""
    readable: bool = True
    writable: bool = True
    mappable: bool = False
    low: float | None = None
    high: float | None = None
    default: Value = 0

    @property
    def key(self) -> int:
        """Index and subindex in one number."""
        return self.index << 8 | self.subindex

    @property
    def size(self) -> int | None:
        """Bytes on the wire; None where it varies."""
        return struct.calcsize("<" + self.code) if self.code else None

    def encode(self, value: Value) -> bytes:
        """The bytes of a value of this type."""
        return value if isinstance(value, bytes) else struct.pack("<" + self.code, value)

    def decode(self, data: bytes) -> Value | AbortCode:
        """The value of these bytes, or why they cannot be one."""
        if self.size is None:
            return data
        if len(data) != self.size:
            return AbortCode.TOO_LONG if len(data) > self.size else AbortCode.TOO_SHORT
        value = struct.unpack("<" + self.code, data)[0]
        number = float(value) if self.code in "fd" else int(value)
        if self.high is not None and number > self.high:
            return AbortCode.TOO_HIGH
        if self.low is not None and number < self.low:
            return AbortCode.TOO_LOW
        return number


class Dictionary:
    """The entries of one drive and their present values."""

    def __init__(self, specs: Iterable[ObjectSpec]) -> None:
        self._specs = {spec.key: spec for spec in specs}
        self._indices = {key >> 8 for key in self._specs}
        self._defaults: dict[int, Value] = {key: spec.default for key, spec in self._specs.items()}
        self._values = dict(self._defaults)
        self._sources: dict[int, Callable[[], int]] = {}
        self._guards: dict[int, Guard] = {}
        self._watchers: dict[int, Watcher] = {}

    def find(self, index: int, subindex: int = 0) -> ObjectSpec | AbortCode:
        """The entry, or the abort code that says what does not exist."""
        spec = self._specs.get(index << 8 | subindex)
        if spec is not None:
            return spec
        return AbortCode.NO_SUBINDEX if index in self._indices else AbortCode.NO_OBJECT

    def number(self, index: int, subindex: int = 0, default: int = 0) -> int:
        """The stored number, whole; `default` where this device has no such entry."""
        value = self._values.get(index << 8 | subindex)
        return default if value is None or isinstance(value, bytes) else round(value)

    def put(self, index: int, subindex: int, value: int) -> None:
        """Store without guard, range or watcher, where the entry exists."""
        key = index << 8 | subindex
        if key in self._values:
            self._values[key] = value

    def fix(self, index: int, subindex: int, value: int) -> None:
        """As `put`, and the value comes back after a reset: what the factory programmed."""
        self.put(index, subindex, value)
        if index << 8 | subindex in self._defaults:
            self._defaults[index << 8 | subindex] = value

    def attach(
        self,
        index: int,
        subindex: int = 0,
        *,
        source: Callable[[], int] | None = None,
        guard: Guard | None = None,
        watcher: Watcher | None = None,
    ) -> None:
        """Give an index its source (of one subindex), guard (all but subindex 0 of records too) and watcher."""
        if source is not None:
            self._sources[index << 8 | subindex] = source
        if guard is not None:
            self._guards[index] = guard
        if watcher is not None:
            self._watchers[index] = watcher

    def reader(self, key: int) -> Callable[[], Value]:
        """What gives the present value of an entry: for packing PDOs."""
        values = self._values
        return self._sources.get(key) or (lambda: values[key])

    def read(self, index: int, subindex: int) -> bytes | AbortCode:
        """What an SDO upload gives."""
        spec = self.find(index, subindex)
        if isinstance(spec, AbortCode):
            return spec
        return spec.encode(self.reader(spec.key)()) if spec.readable else AbortCode.WRITE_ONLY

    def write(self, index: int, subindex: int, data: bytes) -> AbortCode | None:
        """What an SDO download does: check, store, then let the watcher act."""
        spec = self.find(index, subindex)
        if isinstance(spec, AbortCode):
            return spec
        refusal = self.store(spec, data)
        if refusal is None:
            self.announce(spec)
        return refusal

    def store(self, spec: ObjectSpec, data: bytes) -> AbortCode | None:
        """Check and store, without the watcher: a PDO stores all its values before any of them acts."""
        if not spec.writable:
            return AbortCode.READ_ONLY
        value = spec.decode(data)
        if isinstance(value, AbortCode):
            return value
        guard = self._guards.get(spec.index)
        if guard is not None and isinstance(value, int):
            refusal = guard(spec.subindex, value)
            if refusal is not None:
                return refusal
        self._values[spec.key] = value
        return None

    def announce(self, spec: ObjectSpec) -> None:
        """Let the watcher act on what is stored."""
        watcher = self._watchers.get(spec.index)
        if watcher is not None:
            watcher(spec.subindex, self.number(spec.index, spec.subindex))

    def restore(self, first: int, last: int) -> None:
        """Power-on values for the indices first … last."""
        self._values.update({key: v for key, v in self._defaults.items() if first <= key >> 8 <= last})
