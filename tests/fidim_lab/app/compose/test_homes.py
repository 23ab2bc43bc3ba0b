"""Zeros over sessions and power cuts: made, kept beside the rig file, believed where something proves them."""

import asyncio
import socket
from pathlib import Path

import numpy as np
import pytest

from fidim_lab.app import compose
from fidim_lab.app.compose.winches import winch_configs
from fidim_lab.data.records import Plan, PlannedWindow, Role
from fidim_lab.data.rigs.home_file import home_path, read_homes
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.errors import DeviceError

EXAMPLE = Path(__file__).parents[4] / "examples" / "rigs" / "simulated.toml"
HERE, THERE = (1.30283, 1.39119, 1.52772, 1.41231), (1.36283, 1.37119, 1.49772, 1.46231)
TRUE = 0.0123
"""m by which the rig file's lengths are wrong"""


def plan(lengths):
    return Plan("rest", (PlannedWindow("i01", Role.IDENTIFY, np.array(lengths), np.zeros(2), np.zeros(3)),))


@pytest.fixture
def rig(tmp_path):
    """The example on ports of its own, with serial numbers; a function that changes its text."""
    text = EXAMPLE.read_text()
    for port, kind in ((20100, socket.SOCK_STREAM), (20101, socket.SOCK_DGRAM), (20102, socket.SOCK_STREAM)):
        with socket.socket(socket.AF_INET, kind) as taken:
            taken.bind(("127.0.0.1", 0))
            text = text.replace(str(port), str(taken.getsockname()[1]))
    for node in range(1, 5):
        text = text.replace(f"node_id = {node}\n", f"node_id = {node}\nserial_number = {900 + node}\n")
    path = tmp_path / "rig.toml"

    def write(change=lambda text: text):
        path.write_text(change(text))
        return path

    write()
    write.path = path
    return write


async def session(path, *, homing=False, work=None):
    """Open the rig, configure every winch, do `work`; gives the lengths."""
    file = read_rig(path)
    async with compose.real_rig(file, winches=winch_configs(file, homing=homing)) as real:
        await asyncio.gather(*(winch.configure() for winch in real.winches))
        if work is not None:
            await work(real)
        return [winch.latest().length for winch in real.winches]


async def home(real):
    before = [winch.latest().length for winch in real.winches]
    await asyncio.gather(*(w.set_length(length + TRUE) for w, length in zip(real.winches, before, strict=True)))
    await asyncio.gather(*(winch.configure() for winch in real.winches))


@pytest.mark.slow
def test_kept_while_the_drives_have_power_and_refused_after_a_power_cut(rig):
    async def main():
        async with compose.simulated_devices(read_rig(rig.path), 1, plan=plan(HERE)):
            assert await session(rig.path) == pytest.approx(HERE, abs=1e-4)
            assert not home_path(rig.path).exists()
            homed = await session(rig.path, homing=True, work=home)
            assert homed == pytest.approx(np.array(HERE) + TRUE, abs=1e-4)
            homes = read_homes(rig.path)
            assert [homes[f"winch {k}"].serial_number for k in range(1, 5)] == [901, 902, 903, 904]
            assert all(one.last_count == one.home_count for one in homes.values())
            again = await session(rig.path)
            assert again == pytest.approx(homed, abs=1e-6)
        async with compose.simulated_devices(read_rig(rig.path), 1, plan=plan(THERE)):
            with pytest.raises(DeviceError, match="its power was off, or the drum was turned; home it"):
                await session(rig.path)

    compose.run_loop(main(), real_time=True)


@pytest.mark.slow
def test_a_multi_turn_encoder_keeps_it_and_another_drive_does_not(rig):
    def multi_turn(text):
        return text.replace("[every_winch]", '[every_winch]\nencoder = "multi-turn"\n#', 1)

    async def main():
        rig(multi_turn)
        async with compose.simulated_devices(read_rig(rig.path), 1, plan=plan(HERE)):
            await session(rig.path, homing=True, work=home)
        async with compose.simulated_devices(read_rig(rig.path), 1, plan=plan(THERE)):
            assert await session(rig.path) == pytest.approx(THERE, abs=1e-4)
        rig(lambda text: multi_turn(text).replace("serial_number = 903", "serial_number = 999"))
        async with compose.simulated_devices(read_rig(rig.path), 1, plan=plan(HERE)):
            with pytest.raises(DeviceError, match=r"winch 3.* drive 999: home it found, drive 903 wanted"):
                await session(rig.path)

    compose.run_loop(main(), real_time=True)


def test_a_rehearsal_keeps_nothing(rig):
    file = compose.rehearsal_file(read_rig(rig.path), compose.Ports(1, 2, 3))
    assert not file.keeps_homes
    assert all(winch.home is None for winch in file.winches)
