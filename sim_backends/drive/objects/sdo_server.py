"""SDO server of CiA 301: expedited and segmented transfers, eight bytes in, eight bytes or nothing out. No I/O."""

import struct
from dataclasses import dataclass

from sim_backends.drive.objects.abort import AbortCode
from sim_backends.drive.objects.dictionary import Dictionary

_LONGEST = 4096
"""bytes that a segmented download may have"""


@dataclass
class _Transfer:
    """A segmented transfer under way."""

    index: int
    subindex: int
    uploading: bool
    data: bytearray
    announced: int | None = None
    toggle: int = 0


class SdoServer:
    """Serves one dictionary to one client.

    Not simulated: block transfer (aborted with 0504 0001, as a small drive does), a time-out of the server's own.
    """

    def __init__(self, dictionary: Dictionary) -> None:
        self._dictionary = dictionary
        self._transfer: _Transfer | None = None

    def reset(self) -> None:
        """Forget a transfer under way."""
        self._transfer = None

    def answer(self, request: bytes) -> bytes | None:
        """The response to one request; None where the standard wants silence (wrong length, client's abort)."""
        if len(request) != 8:
            return None
        command = request[0] >> 5
        if command == 4:  # the client aborts: no answer
            self._transfer = None
            return None
        if command == 0:
            return self._download_segment(request)
        if command == 3:
            return self._upload_segment(request)
        self._transfer = None  # a new request ends what was under way
        index, subindex = struct.unpack_from("<HB", request, 1)
        if command == 1:
            return self._download(request, index, subindex)
        if command == 2:
            return self._upload(index, subindex)
        return _abort(index, subindex, AbortCode.COMMAND)

    def _upload(self, index: int, subindex: int) -> bytes:
        data = self._dictionary.read(index, subindex)
        if isinstance(data, AbortCode):
            return _abort(index, subindex, data)
        if 1 <= len(data) <= 4:
            return struct.pack("<BHB4s", 0x43 | (4 - len(data)) << 2, index, subindex, data)
        self._transfer = _Transfer(index, subindex, uploading=True, data=bytearray(data))
        return struct.pack("<BHBI", 0x41, index, subindex, len(data))

    def _download(self, request: bytes, index: int, subindex: int) -> bytes:
        sized = bool(request[0] & 1)
        if request[0] & 2:
            spec = self._dictionary.find(index, subindex)
            unsized = 4 if isinstance(spec, AbortCode) or spec.size is None else min(spec.size, 4)
            length = 4 - (request[0] >> 2 & 3) if sized else unsized
            refusal = self._dictionary.write(index, subindex, request[4 : 4 + length])
        else:
            announced = int.from_bytes(request[4:], "little") if sized else None
            refusal = self._may_download(index, subindex, announced)
            if refusal is None:
                self._transfer = _Transfer(index, subindex, uploading=False, data=bytearray(), announced=announced)
        return struct.pack("<BHB4x", 0x60, index, subindex) if refusal is None else _abort(index, subindex, refusal)

    def _may_download(self, index: int, subindex: int, announced: int | None) -> AbortCode | None:
        spec = self._dictionary.find(index, subindex)
        if isinstance(spec, AbortCode):
            return spec
        if not spec.writable:
            return AbortCode.READ_ONLY
        if announced is None:
            return None
        if announced > _LONGEST:
            return AbortCode.OUT_OF_MEMORY
        if spec.size is not None and announced != spec.size:
            return AbortCode.TOO_LONG if announced > spec.size else AbortCode.TOO_SHORT
        return None

    def _upload_segment(self, request: bytes) -> bytes:
        transfer = self._expect(request, uploading=True)
        if isinstance(transfer, bytes):
            return transfer
        part, toggle = bytes(transfer.data[:7]), transfer.toggle
        del transfer.data[:7]
        transfer.toggle ^= 0x10
        last = not transfer.data
        if last:
            self._transfer = None
        return struct.pack("<B7s", toggle | (7 - len(part)) << 1 | last, part)

    def _download_segment(self, request: bytes) -> bytes:
        transfer = self._expect(request, uploading=False)
        if isinstance(transfer, bytes):
            return transfer
        toggle = transfer.toggle
        transfer.data += request[1 : 8 - (request[0] >> 1 & 7)]
        transfer.toggle ^= 0x10
        refusal = AbortCode.OUT_OF_MEMORY if len(transfer.data) > _LONGEST else None
        if refusal is None and request[0] & 1:
            refusal = self._finish(transfer)
            self._transfer = None
        if refusal is not None:
            self._transfer = None
            return _abort(transfer.index, transfer.subindex, refusal)
        return struct.pack("<B7x", 0x20 | toggle)

    def _finish(self, transfer: _Transfer) -> AbortCode | None:
        if transfer.announced is not None and len(transfer.data) != transfer.announced:
            return AbortCode.TOO_LONG if len(transfer.data) > transfer.announced else AbortCode.TOO_SHORT
        return self._dictionary.write(transfer.index, transfer.subindex, bytes(transfer.data))

    def _expect(self, request: bytes, *, uploading: bool) -> _Transfer | bytes:
        """The transfer that this segment belongs to, or the abort to answer."""
        transfer = self._transfer
        if transfer is None or transfer.uploading is not uploading:
            self._transfer = None
            return _abort(0, 0, AbortCode.COMMAND)
        if request[0] & 0x10 != transfer.toggle:
            self._transfer = None
            return _abort(transfer.index, transfer.subindex, AbortCode.TOGGLE)
        return transfer


def _abort(index: int, subindex: int, code: AbortCode) -> bytes:
    return struct.pack("<BHBI", 0x80, index, subindex, code)
