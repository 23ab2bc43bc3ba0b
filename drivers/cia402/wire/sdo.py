"""Service data objects (SDO) of one node: one exchange at a time, explicit time-outs, aborts in words.

`canopen` does the protocol. Around it: a lock (its client has none), a quiet time after a time-out (it would take the
late answer for the next one), read-back after a write, retries for reads only.
"""

import asyncio
import logging
from collections.abc import Callable
from typing import TypeVar, cast

import canopen
from canopen.objectdictionary import ODVariable
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from drivers.canbus.transport import CanTransport
from drivers.cia402.wire.aborts import abort_words
from drivers.ports import Clock
from fidim_lab.errors import DeviceError, SetupError

T = TypeVar("T")

_ANSWER = 0x580

logging.getLogger("canopen").addHandler(logging.NullHandler())  # what it says, our errors say in words


class SdoRefusedError(DeviceError):
    """The drive answered an SDO with an abort code; `reason` has it in words."""

    def __init__(self, device: str, what: str, code: int) -> None:
        self.reason = abort_words(code)
        super().__init__(device, f"{what} refused: {self.reason}.")


class SdoChannel:
    """Reads and writes the object dictionary of one node."""

    def __init__(
        self, node: canopen.RemoteNode, transport: CanTransport, clock: Clock, *, device: str, timeout: float
    ) -> None:
        """`timeout` (s) must be longer than the drive's slowest answer."""
        self._client = node.sdo
        self._client.RESPONSE_TIMEOUT = 0.0 if transport.at_once else timeout
        self._client.MAX_RETRIES = 1  # of canopen: one attempt; we repeat reads ourselves, after a quiet time
        self._dictionary = node.object_dictionary
        self._node_id = cast(int, node.id)
        self._transport = transport
        self._clock = clock
        self._device = device
        self._timeout = timeout
        self._queue = asyncio.Lock()
        self._quiet_until = float("-inf")
        self._asked = float("-inf")
        self._late: float | None = None
        """s from a question that timed out to its answer, where that came after all"""
        node.network.subscribe(_ANSWER + self._node_id, self._heard)

    def knows(self, index: int, sub: int = 0) -> bool:
        """Whether the EDS file describes this object."""
        return self._dictionary.get_variable(index, sub) is not None

    def writable(self, index: int, sub: int = 0) -> bool:
        """Whether the EDS file lets this object be written."""
        variable = self._dictionary.get_variable(index, sub)
        return variable is not None and variable.writable

    def mappable(self, index: int, sub: int = 0) -> bool:
        """Whether the EDS file lets this object be mapped into a PDO."""
        variable = self._dictionary.get_variable(index, sub)
        return variable is not None and bool(variable.pdo_mappable)

    def default(self, index: int, sub: int = 0) -> int:
        """An object's value by its EDS (or DCF) file; 0 without one."""
        variable = self._dictionary.get_variable(index, sub)
        return 0 if variable is None else told_by_file(variable) or 0

    async def read(self, index: int, sub: int = 0) -> int:
        """The number in an object. Raises DeviceError, SdoRefusedError."""
        variable = self._variable(index, sub)
        what = f"SDO read of {index:04X}:{sub:X}"
        try:
            data = await self._exchange(what, lambda: self._client.upload(index, sub))
        except SdoRefusedError:
            raise
        except DeviceError:
            data = await self._exchange(what, lambda: self._client.upload(index, sub))
        try:
            return int(variable.decode_raw(data))
        except (canopen.ObjectDictionaryError, ValueError) as error:
            raise DeviceError(
                self._device, f"{what} gave {len(data)} bytes, not the number that the EDS file promises."
            ) from error

    async def write(self, index: int, sub: int, value: int) -> None:
        """Write a number without reading it back. Raises DeviceError, SdoRefusedError, SetupError."""
        variable = self._variable(index, sub)
        what = f"SDO write of {index:04X}:{sub:X}"
        try:
            data = variable.encode_raw(value)
        except (ValueError, TypeError) as error:
            raise SetupError(
                f"{self._device}: {value} does not fit into object {index:04X}:{sub:X} ({variable.name}).",
                hint="Is the unit that of its family (docs/rig.md, Bring your drive)? Else lower the rig file's value.",
            ) from error
        await self._exchange(what, lambda: self._client.download(index, sub, data))

    def encoded(self, index: int, sub: int, value: int) -> bytes:
        """The bytes of a number in an object; none where the EDS file has no such object, or it does not fit."""
        variable = self._dictionary.get_variable(index, sub)
        try:
            return b"" if variable is None else bytes(variable.encode_raw(value))
        except (ValueError, TypeError):
            return b""

    async def write_verified(self, index: int, sub: int, value: int) -> None:
        """Write a number and read it back. Raises DeviceError where the drive kept another one."""
        await self.write(index, sub, value)
        found = await self.read(index, sub)
        if found != value:
            raise DeviceError(
                self._device, f"object {index:04X}:{sub:X} was written {value}, and reads back as {found}."
            )

    def _variable(self, index: int, sub: int) -> ODVariable:
        variable = self._dictionary.get_variable(index, sub)
        if variable is None:
            raise DeviceError(
                self._device,
                f"object {index:04X}:{sub:X} is not in the EDS file.",
                hint="Use the EDS file of this drive; it must describe every object that is written at bring-up.",
            )
        return variable

    async def _exchange(self, what: str, action: Callable[[], T]) -> T:
        async with self._queue:
            wait = self._quiet_until - self._clock.now()
            if wait > 0.0:
                await self._clock.sleep(wait)
            self._asked = self._clock.now()
            try:
                return await self._transport.call(self._node_id, action)
            except SdoAbortedError as error:
                raise SdoRefusedError(self._device, what, error.code) from error
            except SdoCommunicationError as error:
                self._quiet_until = self._clock.now() + self._timeout
                raise self._no_answer(what, error) from error

    def _heard(self, _can_id: int, _data: bytearray, stamp: float) -> None:
        """An answer, at monotonic s; on the receiving thread."""
        after = stamp - self._asked
        if after >= self._timeout and stamp < self._quiet_until:
            self._late = after

    def _no_answer(self, what: str, error: SdoCommunicationError) -> DeviceError:
        if "No SDO response" in str(error):
            hint = "Is the drive powered, and is the node id right?"
            if self._late is not None:
                hint = f"It answers, but late: one came {self._late:.2f} s after its question. Raise sdo_timeout."
            return DeviceError(self._device, f"no answer to {what} within {self._timeout:g} s.", hint=hint)
        return DeviceError(
            self._device, f"a wrong answer to {what}: {error}.", hint="Does another program talk to this drive?"
        )


def told_by_file(variable: ODVariable) -> int | None:
    """An object's value by its file; None where it is no integer."""
    value = variable.default if variable.value is None else variable.value
    return value if isinstance(value, int) else None
