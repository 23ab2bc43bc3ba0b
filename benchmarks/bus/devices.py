"""Simulated devices of a bus benchmark, in a process of their own: drives and the bus they are on, markers by UDP.

    python -m benchmarks.bus.devices tcp MARKER_PORT RATE WITNESS.npy

It says where its bus is in one line of JSON, serves until its standard input ends, then says what it has seen.
"""

import asyncio
import json
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import can
import numpy as np

from drivers.canbus.transport import CanFrame
from drivers.cia402.dictionary import GENERIC_EDS, WinchConfig
from drivers.cia402.profile import Mode
from drivers.clock import LoopClock, precise_loop
from sim_backends.can_node import Outgoing
from sim_backends.drive.axis import DrumShaft
from sim_backends.drive.node import SimulatedDrive
from sim_backends.drive.objects import read_eds
from sim_backends.mocap.encoders import ViconEncoder
from sim_backends.mocap.server import MocapServer, StreamTiming
from sim_backends.mocap.sockets import UdpSender
from sim_backends.served_bus import ServedBus
from sim_backends.slcan_pty import SlcanPtyBus
from sim_backends.slcan_server import SlcanServerBus

NODES = (1, 2, 3, 4)
SYNC, HEARTBEAT = 0x080, 0x77F
TARGETS = {0x300 + node: node for node in NODES}
MARKERS = ("marker1",)


def winch_config(node: int, mode: Mode = Mode.CYCLIC_POSITION, **change: object) -> WinchConfig:
    """Of one simulated drive, 1 m of cable at count 0; host and drives share a computer, so answers may be late."""
    usual: dict[str, object] = {"heartbeat": 0.3, "host_timeout": 1.5, "sdo_timeout": 3.0, "sample_age": 1.0}
    return WinchConfig(
        name=f"winch {node}",
        node_id=node,
        counts_per_turn=40_000,
        drum_radius=0.03,
        rated_current=5.0,
        current_limit=12.0,
        max_speed=0.5,
        max_acceleration=2.0,
        length_limits=(0.3, 3.0),
        home_length=1.0,
        direction=1 if node % 2 else -1,
        mode=mode,
        **{**usual, **change},  # type: ignore[arg-type]
    )


@dataclass
class Witness:
    """A node that only listens: when SYNCs and the host's heartbeats reached the drives, and how many targets."""

    syncs: list[float] = field(default_factory=list[float])
    """monotonic s"""
    heartbeat: float = -math.inf
    """monotonic s, the last"""
    targets: dict[int, int] = field(default_factory=lambda: dict.fromkeys(NODES, 0))
    listens = frozenset({SYNC, HEARTBEAT, *TARGETS})
    due = math.inf

    def start(self, t: float) -> list[Outgoing]:
        return []

    def advance(self, t: float) -> list[Outgoing]:
        return []

    def receive(self, frame: CanFrame) -> list[Outgoing]:
        if frame.id == SYNC:
            self.syncs.append(frame.t)
        elif frame.id == HEARTBEAT:
            self.heartbeat = frame.t
        else:
            self.targets[TARGETS[frame.id]] += 1
        return []


def simulated_drives(shafts: "list[DrumShaft] | None" = None) -> list[SimulatedDrive]:
    """Four drives, each with a shaft without load."""
    made = shafts or [DrumShaft() for _ in NODES]
    return [SimulatedDrive(node, read_eds(GENERIC_EDS, node), shaft) for node, shaft in zip(NODES, made, strict=True)]


def marker_server(rate: float, timing: StreamTiming | None = None) -> MocapServer:
    """A marker that swings."""

    def truth(t: float) -> np.ndarray:
        return np.array([[0.1 * math.sin(2.0 * t), 0.1 * math.cos(2.0 * t), 1.0]])

    return MocapServer(truth, ViconEncoder(MARKERS), np.random.default_rng(1), timing or StreamTiming(rate=rate))


@dataclass(frozen=True)
class Devices:
    """Where a host finds them."""

    channel: str
    """as python-can's slcan takes it; empty where the drives are in the host's own process"""
    process: "subprocess.Popen[str]"
    witness: Path

    def end(self) -> tuple[dict[str, float], np.ndarray]:
        """What they have seen: counts, and the monotonic times (s) at which SYNCs reached the drives."""
        said = self.process.communicate(timeout=60)[0]
        return json.loads(said.splitlines()[-1]), np.load(self.witness)


@contextmanager
def devices(over: str, port: int, rate: float) -> Generator[Devices]:
    """Devices in a process of their own; `over` is tcp, slcan or inprocess (then only the markers are there)."""
    with tempfile.TemporaryDirectory() as folder:
        witness = Path(folder) / "witness.npy"
        command = [sys.executable, "-m", "benchmarks.bus.devices", over, str(port), str(rate), str(witness)]
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        try:
            said = process.stdout.readline() if process.stdout else ""
            if not said:
                sys.exit("the simulated devices did not start")
            yield Devices(json.loads(said)["channel"], process, witness)
        finally:
            process.kill()
            process.wait()


def adapter(over: str) -> tuple[can.BusABC, str]:
    """The drives' end of a bus, and the channel at which a host finds it."""
    if over == "slcan":
        bus = SlcanPtyBus()
        return bus, bus.path
    server = SlcanServerBus("127.0.0.1", 0)
    return server, f"socket://127.0.0.1:{server.port}"


async def _serve(over: str, port: int, rate: float, file: Path) -> None:
    clock, witness = LoopClock(), Witness()
    with ExitStack() as stack:
        channel = ""
        if over != "inprocess":
            bus, channel = adapter(over)
            stack.enter_context(ServedBus(bus, [*simulated_drives(), witness]))
        sender = UdpSender(marker_server(rate), clock, port)
        await sender.start()
        print(json.dumps({"channel": channel}), flush=True)
        begun, spent = time.monotonic(), time.process_time()
        await asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)
        share = (time.process_time() - spent) / (time.monotonic() - begun)
        await sender.close()
    np.save(file, np.array(witness.syncs))
    print(json.dumps({"cpu": share, **{str(node): count for node, count in witness.targets.items()}}), flush=True)


if __name__ == "__main__":
    with asyncio.Runner(loop_factory=precise_loop) as runner:
        runner.run(_serve(sys.argv[1], int(sys.argv[2]), float(sys.argv[3]), Path(sys.argv[4])))
