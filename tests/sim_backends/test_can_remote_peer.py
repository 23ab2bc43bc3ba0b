"""A bus that somebody else serves: our driver and our drives, two clients of PyPI's `python-can-remote`.

`make peers` installs it (FIDIM_PEER_REMOTE names another folder): its server is a process, its client a plug-in of
python-can, which a rig file names as `interface = "remote"`.
"""

import asyncio
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import can
import pytest

from drivers.canbus.python_can import PythonCanTransport
from drivers.cia402.dictionary import GENERIC_EDS, WinchConfig
from drivers.cia402.motion import Cia402Winch
from drivers.cia402.watch import CanopenMaster
from drivers.clock import LoopClock
from drivers.ports import DriveState, WinchSample
from sim_backends.drive.axis import DrumShaft
from sim_backends.drive.node import SimulatedDrive
from sim_backends.drive.objects import read_eds
from sim_backends.served_bus import ServedBus

pytestmark = pytest.mark.peer
HOME = Path(os.environ.get("FIDIM_PEER_REMOTE", Path(__file__).parents[2] / "build" / "peers" / "remote"))
NODES = (1, 2)
STARTS_WITHIN = 20.0
"""s"""


@pytest.fixture
def bus(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Its address; each client that connects is one more on the same bus."""
    if not (HOME / "can_remote").is_dir():
        pytest.skip(f"{HOME}/can_remote is absent: pip install --no-deps --target {HOME} python-can-remote")
    monkeypatch.syspath_prepend(str(HOME))
    # what python-can makes of the plug-in's entry point where that is installed when Python starts
    monkeypatch.setitem(can.interfaces.BACKENDS, "remote", ("can_remote.client", "RemoteBus"))
    monkeypatch.setattr(can.util, "VALID_INTERFACES", can.util.VALID_INTERFACES | {"remote"})
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "can_remote", "--interface=virtual", "--channel=shared", "--host=127.0.0.1"]
    environment = {**os.environ, "PYTHONPATH": str(HOME)}
    process = subprocess.Popen([*command, f"--port={port}"], stderr=subprocess.DEVNULL, env=environment)
    try:
        until_it_listens(port, process)
        yield f"ws://127.0.0.1:{port}/"
    finally:
        process.kill()
        process.wait(10)


def until_it_listens(port: int, process: "subprocess.Popen[bytes]") -> None:
    for _ in range(int(STARTS_WITHIN / 0.1)):
        with suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1.0):
            return
        if process.poll() is not None:
            pytest.skip(f"its server ended with {process.returncode}")
        threading.Event().wait(0.1)
    pytest.fail(f"its server did not listen within {STARTS_WITHIN:g} s")


def make_winch(node: int, master: CanopenMaster) -> Cia402Winch:
    return Cia402Winch(
        WinchConfig(
            name=f"winch {node}",
            node_id=node,
            counts_per_turn=40_000,
            drum_radius=0.03,
            rated_current=5.0,
            current_limit=4.0,
            max_speed=0.3,
            max_acceleration=2.0,
            length_limits=(0.3, 3.0),
            home_length=1.0,
            heartbeat=1.0,
            host_timeout=3.0,
            sdo_timeout=2.0,
            step_timeout=10.0,
            sample_age=2.0,
        ),
        master,
    )


def test_winches_are_brought_up_moved_and_stopped_over_it(bus):
    drives = [SimulatedDrive(node, read_eds(GENERIC_EDS, node), DrumShaft()) for node in NODES]

    async def main() -> list[WinchSample]:
        transport = PythonCanTransport("remote", bus)
        master = CanopenMaster(transport, LoopClock(), sync_rate=100.0)
        winches = [make_winch(node, master) for node in NODES]
        task = asyncio.create_task(master.run())
        try:
            await asyncio.gather(*(winch.configure() for winch in winches))
            await asyncio.gather(*(winch.enable() for winch in winches))
            await asyncio.gather(*(winch.move_to(1.01, 0.2, 2.0) for winch in winches))
            async with asyncio.timeout(20.0):
                while not all(winch.latest().target_reached for winch in winches):
                    await master.clock.sleep(0.02)
            moved = [winch.latest() for winch in winches]
            for winch in winches:
                winch.quick_stop()
            async with asyncio.timeout(20.0):
                while not all(winch.latest().state is DriveState.QUICK_STOP_ACTIVE for winch in winches):
                    await master.clock.sleep(0.02)
            assert transport.counters.garbled == 0
            assert transport.fault is None
            return moved
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
            transport.close()

    with ServedBus(can.Bus(bus, "remote"), drives) as served:
        moved = asyncio.run(main())
    assert served.failure is None
    assert [sample.length for sample in moved] == pytest.approx([1.01, 1.01], abs=1e-4)
