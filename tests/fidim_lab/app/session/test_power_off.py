"""`fidim power-off` on simulated devices: what is said where a brake does not hold what has no power any more."""

import asyncio
import json
import socket
import sys
from pathlib import Path

import pytest

from fidim_lab.app import compose
from fidim_lab.app.compose.winches import winch_configs
from fidim_lab.data.rigs.rig_file import read_rig

EXAMPLE = Path(__file__).parents[4] / "examples" / "rigs" / "simulated.toml"
MAIN = "from fidim_lab.app.cli import main; main()"


@pytest.fixture
def rig(tmp_path):
    """The example on ports of its own."""
    text = EXAMPLE.read_text()
    for port, kind in ((20100, socket.SOCK_STREAM), (20101, socket.SOCK_DGRAM), (20102, socket.SOCK_STREAM)):
        with socket.socket(socket.AF_INET, kind) as taken:
            taken.bind(("127.0.0.1", 0))
            text = text.replace(str(port), str(taken.getsockname()[1]))
    path = tmp_path / "rig.toml"
    path.write_text(text)
    return path


@pytest.mark.slow
@pytest.mark.parametrize("slips", [False, True])
def test_a_brake_that_does_not_hold_is_told(rig, tmp_path, slips):
    told = tmp_path / "told.json"

    async def main() -> tuple[int | None, str]:
        async with compose.simulated_devices(read_rig(rig), 1, loaded=False) as devices:
            async with compose.real_rig(read_rig(rig), winches=winch_configs(read_rig(rig))) as real:
                await asyncio.gather(*(winch.configure() for winch in real.winches))
                await asyncio.gather(*(winch.enable() for winch in real.winches))
            devices.drives[1].defects.brake_open = slips
            command = (sys.executable, "-c", MAIN, "power-off", str(rig), "--yes", "--json", str(told))
            process = await asyncio.create_subprocess_exec(*command, stderr=asyncio.subprocess.PIPE)
            _, says = await process.communicate()
            return process.returncode, says.decode()

    code, says = compose.run_loop(main(), real_time=True)
    errors = [one["error"] for one in json.loads(told.read_text())["drives"] if "error" in one]
    assert code == (3 if slips else 0)
    assert [error.partition(" (node")[0] for error in errors] == (["winch 2"] if slips else [])
    assert ("winch 2 (node 2) is not seen to stand without power" in says) == slips
