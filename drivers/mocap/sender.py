"""Which datagrams are accepted: UDP names only an address, which proves nothing.

    from another computer      only the address that the rig file names (`sender`), or the first that is heard; another
                               one gets its turn once that has been silent for `SILENT`
    from this computer         only sockets of this user or of root, as Linux tells in /proc/net/udp: every other user
                               can send to any port of it, with its own address

An address can be forged on a network by who is on it: it keeps out other programs, not an attacker in the laboratory's
network, who needs one of its own for motion capture (or `vicon-datastream`, `qtm`, over TCP).
"""

import os
import socket
from collections.abc import Callable
from pathlib import Path

SILENT = 1.0
"""s after which another sender may take over: as long as a stream must be silent to be reported so"""
TABLES = (Path("/proc/net/udp"), Path("/proc/net/udp6"))
KNOWN = 256
"""ports of this computer that are remembered"""
AGE = 1.0
"""s after which it is looked again who has a port"""
LOOKS = 20.0
"""a second, for who sends from ever new ports: each reads a table of the kernel"""
ROOT = 0

Address = tuple[str, int]


class SenderCheck:
    """One for each socket. `takes` is asked for every datagram."""

    def __init__(
        self,
        now: Callable[[], float],
        wanted: str | None = None,
        owner: Callable[[int], frozenset[int] | None] | None = None,
    ) -> None:
        """now: monotonic s. wanted: the only address that counts. owner: users with a UDP socket at a local port."""
        self.foreign = 0
        """datagrams that were left out"""
        self.left_out = ""
        """where the newest of them came from, in words"""
        self._now = now
        self._wanted = wanted
        self._owner = owner or owners
        self._present: str | None = None
        self._heard = float("-inf")
        self._local: dict[str, bool] = {}
        self._ports: dict[int, tuple[bool, float]] = {}
        """whether they are ours, and when that was looked up"""
        self._next_look = float("-inf")

    def takes(self, sender: Address) -> bool:
        """Whether a datagram counts."""
        address, port = sender[:2]
        if not (self._is_the_stream(address) and (not self._is_local(address) or self._is_ours(port))):
            self.foreign += 1
            self.left_out = f"{address}, port {port}"
            return False
        self._present, self._heard = address, self._now()
        return True

    def _is_the_stream(self, address: str) -> bool:
        if self._wanted is not None:
            return address == self._wanted
        return self._present in (None, address) or self._now() - self._heard > SILENT

    def _is_local(self, address: str) -> bool:
        """Only an address of this computer can be bound to."""
        if address not in self._local:
            if len(self._local) >= KNOWN:
                self._local.clear()
            family = socket.AF_INET6 if ":" in address else socket.AF_INET
            try:
                with socket.socket(family, socket.SOCK_DGRAM) as probe:
                    probe.bind((address, 0))
                self._local[address] = True
            except OSError:
                self._local[address] = False
        return self._local[address]

    def _is_ours(self, port: int) -> bool:
        now = self._now()
        ours, looked = self._ports.get(port, (False, float("-inf")))
        if now - looked < AGE:
            return ours
        if not ours:  # so that a flood from ever new ports costs little, and takes nothing from a stream that is known
            if now < self._next_look:
                return False
            self._next_look = now + 1.0 / LOOKS
        users = self._owner(port)
        if len(self._ports) >= KNOWN:
            self._ports.clear()
        ours = users is None or (bool(users) and users <= {os.getuid(), ROOT})
        self._ports[port] = ours, now
        return ours


def owners(port: int) -> frozenset[int] | None:
    """User ids of the UDP sockets at a port of this computer; None where the system does not tell."""
    found: set[int] = set()
    told = False
    for table in TABLES:
        try:
            lines = table.read_text(encoding="ascii", errors="replace").splitlines()[1:]
        except OSError:
            continue
        told = True
        fields = (line.split() for line in lines)
        found |= {int(row[7]) for row in fields if len(row) > 7 and int(row[1].rpartition(":")[2], 16) == port}
    return frozenset(found) if told else None
