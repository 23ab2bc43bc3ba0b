"""The drive's errors: error register 1001, history 1003, error code 603F, and the EMCY messages that announce them."""

import struct

from sim_backends.drive.objects.dictionary import Dictionary

HEARTBEAT_LOST, FOLLOWING_ERROR, PDO_TOO_SHORT, PDO_TOO_LONG = 0x8130, 0x8611, 0x8210, 0x8220
"""emergency codes that the drive finds by itself"""
_HISTORY = 8
_REGISTER_BITS = {0x2: 0x02, 0x3: 0x04, 0x4: 0x08, 0x81: 0x10, 0x82: 0x10, 0x8: 0x20, 0xFF: 0x80}
"""1001 by the code's leading digits: current, voltage, temperature, communication, device profile, manufacturer"""


def register_bits(code: int) -> int:
    """Error register bits of an emergency code; bit 0 (generic) is always set."""
    return 1 | _REGISTER_BITS.get(code >> 8, _REGISTER_BITS.get(code >> 12, 0))


class ErrorLog:
    """Errors that are active now, the last eight that were, and EMCY payloads not sent yet.

    Not simulated: the inhibit time 1015.
    """

    def __init__(self, dictionary: Dictionary) -> None:
        self._dictionary = dictionary
        self._active: dict[int, int] = {}
        self._lasting: set[int] = set()
        self._messages: list[bytes] = []

    @property
    def lasting(self) -> bool:
        """Whether something is active that a fault reset cannot clear."""
        return bool(self._lasting)

    def report(self, code: int, *, register: int | None = None, lasting: bool = False) -> None:
        """An error appears; one that is active already is not announced again.

        A `lasting` one survives a fault reset, until `withdraw`.
        """
        if lasting:
            self._lasting.add(code)
        if code in self._active:
            return
        self._active[code] = register_bits(code) if register is None else register
        self._remember(code)
        self._announce(code)

    def withdraw(self, code: int) -> None:
        """The cause of an error has gone."""
        self._lasting.discard(code)
        if self._active.pop(code, None) is not None:
            self._announce(0)

    def acknowledge(self) -> None:
        """Fault reset: everything but lasting errors is over."""
        gone = [code for code in self._active if code not in self._lasting]
        for code in gone:
            del self._active[code]
        if gone:
            self._announce(0)

    def clear_history(self) -> None:
        """Write of 0 to 1003:0."""
        for subindex in range(_HISTORY + 1):
            self._dictionary.put(0x1003, subindex, 0)

    def discard(self) -> None:
        """Communication is reset: what was to be announced is not."""
        self._messages.clear()

    def take(self) -> list[bytes]:
        """EMCY payloads since the last call."""
        messages, self._messages = self._messages, []
        return messages

    def _remember(self, code: int) -> None:
        stored = self._dictionary
        count = min(stored.number(0x1003, 0) + 1, _HISTORY)
        for subindex in range(count, 1, -1):
            stored.put(0x1003, subindex, stored.number(0x1003, subindex - 1))
        stored.put(0x1003, 1, code)
        stored.put(0x1003, 0, count)

    def _announce(self, code: int) -> None:
        register = 0
        for bits in self._active.values():
            register |= bits
        self._dictionary.put(0x1001, 0, register)
        self._dictionary.put(0x603F, 0, next(reversed(self._active), 0))
        self._messages.append(struct.pack("<HB5x", code, register))
