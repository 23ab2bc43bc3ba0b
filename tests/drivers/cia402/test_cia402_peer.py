"""Our master drives a CANopen slave that somebody else wrote: npm `canopen`, on slcan over TCP.

Install it once: npm install --prefix build/peers/node canopen (FIDIM_PEER_NODE names another folder).
"""

import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import canopen
import pytest

from drivers.cia402.dictionary import GENERIC_EDS
from drivers.cia402.wire.nmt import NmtCommand, NmtState
from drivers.cia402.wire.sdo import SdoRefusedError
from drivers.ports import DriveState

pytestmark = pytest.mark.peer
HERE = Path(__file__).parent
NODE = 3
HOME = Path(os.environ.get("FIDIM_PEER_NODE", HERE.parents[2] / "build" / "peers" / "node"))


@pytest.fixture
def port(tmp_path: Path) -> Iterator[int]:
    """Where the slave serves one host."""
    node = shutil.which("node")
    if node is None or not (HOME / "node_modules" / "canopen").is_dir():
        pytest.skip(f"node or {HOME}/node_modules/canopen is absent: npm install --prefix {HOME} canopen")
    text = GENERIC_EDS.read_text(encoding="utf-8")  # it knows no $NODEID
    text = re.sub(r"\$NODEID\+(0x[0-9A-Fa-f]+)", lambda m: hex(int(m[1], 16) + NODE), text)
    (tmp_path / "slave.eds").write_text(text, encoding="utf-8")
    command = [node, str(HERE / "peer_slave.js"), str(tmp_path / "slave.eds"), str(NODE)]
    environment = {**os.environ, "NODE_PATH": str(HOME / "node_modules")}
    slave = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment)
    assert slave.stdout is not None
    said = slave.stdout.readline()
    if not said.startswith("port "):
        pytest.skip(f"the slave did not start: {said}{slave.stdout.read()[:500]}")
    yield int(said.split()[1])
    slave.kill()
    slave.communicate(timeout=10)


def test_it_is_brought_up_enabled_moved_and_stopped(port, against):
    async def script(transport: Any, master: Any, winch: Any) -> None:
        await winch.configure()
        assert all(check.ok for check in winch.checks)
        assert winch.link.nmt_state is NmtState.OPERATIONAL
        await winch.enable()
        assert winch.latest().state is DriveState.OPERATION_ENABLED
        await winch.move_to(1.2, 0.2, 1.0)
        for _ in range(200):
            await master.clock.sleep(0.02)
            if abs(winch.latest().length - 1.2) < 1e-4:
                break
        assert winch.latest().length == pytest.approx(1.2, abs=1e-4)
        winch.quick_stop()
        await master.clock.sleep(0.3)
        assert winch.latest().state is DriveState.QUICK_STOP_ACTIVE
        winch.power_off()
        await master.clock.sleep(0.3)
        assert winch.latest().state is DriveState.SWITCH_ON_DISABLED
        assert winch.latest().fault == ""

    against(port, script)


def test_sdo_values_aborts_and_long_transfers(port, against, there_and_back):
    async def script(transport: Any, master: Any, winch: Any) -> None:
        sdo = winch.link.sdo
        await sdo.write_verified(0x6065, 0, 1234)
        assert await sdo.read(0x6065, 0) == 1234
        with pytest.raises(SdoRefusedError, match=r"1018:1"):
            await sdo.write(0x1018, 1, 7)
        text = bytes(range(256)) * 3
        for block in (False, True):
            assert await there_and_back(transport, master, text, block=block) == text
        node = master._network[NODE]
        with pytest.raises(canopen.SdoAbortedError, match="0x06020000"):
            await transport.call(NODE, lambda: node.sdo.upload(0x5FFF, 0))

    against(port, script)


def test_nmt_and_heartbeat(port, against):
    async def script(transport: Any, master: Any, winch: Any) -> None:
        await winch.link.sdo.write(0x1017, 0, 50)
        wanted = {
            NmtCommand.START: NmtState.OPERATIONAL,
            NmtCommand.STOP: NmtState.STOPPED,
            NmtCommand.PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
        }
        for command, state in wanted.items():
            winch.link.send_nmt(command)
            for _ in range(100):
                await master.clock.sleep(0.05)
                if winch.link.nmt_state is state:
                    break
            assert winch.link.nmt_state is state
        first = winch.link.heartbeat.t
        await master.clock.sleep(0.5)
        assert winch.link.heartbeat.t - first >= 0.3

    against(port, script)
