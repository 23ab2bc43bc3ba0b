"""An adapter on a bus that is full: TPDOs of four drives at the pace of the wire, in a process of its own.

    python -m benchmarks.bus.flood tcp|slcan SECONDS

It waits for a host that opens the adapter, then sends. Each TPDO1 carries its number in the place of the position, each
TPDO2 the moment of sending (monotonic µs, 31 bits) in the place of the velocity.
"""

import contextlib
import json
import os
import select
import socket
import struct
import sys
import threading
import time
import tty
from collections.abc import Callable

import numpy as np

from benchmarks.bus.devices import NODES
from drivers.canbus.load import frame_bits

BITRATE = 1e6
PATIENCE = 0.002
"""s between two bursts; an adapter on USB hands over what it has once a millisecond"""
SIZES = (7, 6)
"""bytes of TPDO1 and TPDO2"""
FRAMES_PER_SECOND = BITRATE / float(np.mean([frame_bits(size) for size in SIZES]))
"""that fit the bus at worst-case stuffing; of 8 bytes they would be 7407"""
STATUS_ENABLED, CYCLIC_POSITION = 0x1237, 8
MICROSECONDS = 0x7FFFFFFF


def line(identifier: int, data: bytes) -> bytes:
    return b"t%03X%d%s\r" % (identifier, len(data), data.hex().upper().encode())


def burst(first: int, count: int) -> bytes:
    """Frames `first` …: TPDO1 and TPDO2 of one node after the other."""
    out: list[bytes] = []
    now = int(time.monotonic() * 1e6) & MICROSECONDS
    for number in range(first, first + count):
        node = NODES[(number // 2) % len(NODES)]
        if number % 2 == 0:
            out.append(line(0x180 + node, struct.pack("<Hib", STATUS_ENABLED, number // 8, CYCLIC_POSITION)))
        else:
            out.append(line(0x280 + node, struct.pack("<ih", now, 0)))
    return b"".join(out)


def flood(write: Callable[[bytes], None], seconds: float) -> dict[str, float]:
    """Send for so long, whole groups of eight frames."""
    begun, sent, spent = time.monotonic(), 0, time.process_time()
    pause = threading.Event()
    while (elapsed := time.monotonic() - begun) < seconds:
        due = 8 * int(elapsed * FRAMES_PER_SECOND / 8)
        if due > sent:
            write(burst(sent, due - sent))
            sent = due
        pause.wait(PATIENCE)
    elapsed = time.monotonic() - begun
    return {"sent": sent, "seconds": elapsed, "cpu": (time.process_time() - spent) / elapsed}


def _tcp(seconds: float) -> dict[str, float]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        print(json.dumps({"channel": f"socket://127.0.0.1:{server.getsockname()[1]}"}), flush=True)
        link, _ = server.accept()
        with link:
            link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            _discard(lambda: link.recv(1 << 16))
            sys.stdin.readline()
            told = flood(link.sendall, seconds)
            print(json.dumps(told), flush=True)
            sys.stdin.read()  # the host hangs up first: what is under way arrives
    return told


def _pty(seconds: float) -> dict[str, float]:
    end, host = os.openpty()
    tty.setraw(host)
    os.set_blocking(end, False)

    def write(data: bytes) -> None:
        while data:
            try:
                data = data[os.write(end, data) :]
            except BlockingIOError:  # the terminal's few kilobytes are full: the host has not been scheduled
                select.select([], [end], [], 1.0)

    def read() -> bytes:
        select.select([end], [], [])
        return os.read(end, 1 << 16)

    print(json.dumps({"channel": os.ttyname(host)}), flush=True)
    _discard(read)
    sys.stdin.readline()
    told = flood(write, seconds)
    print(json.dumps(told), flush=True)
    sys.stdin.read()
    return told


def _discard(read: Callable[[], bytes]) -> None:
    """Nobody is interested in what the host says."""

    def drain() -> None:
        with contextlib.suppress(OSError):
            while read():
                pass

    threading.Thread(target=drain, daemon=True).start()


if __name__ == "__main__":
    {"tcp": _tcp, "slcan": _pty}[sys.argv[1]](float(sys.argv[2]))
    os._exit(0)  # not by way of the thread that reads
