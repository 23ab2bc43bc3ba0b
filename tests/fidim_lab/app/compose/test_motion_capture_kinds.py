"""From rig file to frames: each kind of motion capture, simulated at its real socket and read from it."""

import asyncio
import socket
from pathlib import Path

import numpy as np
import pytest

from drivers.clock import LoopClock
from drivers.mocap.decoders import describe
from fidim_lab.app.compose.motion_capture import marker_source
from fidim_lab.app.compose.simulated_motion_capture import mocap_sender
from fidim_lab.app.doctor.checks import CheckVerdict
from fidim_lab.app.doctor.mocap_doctor import check_motion_capture
from fidim_lab.data.rigs.rig_file import read_rig
from sim_backends.mocap.server import MocapServer, StreamTiming

RIGS = Path(__file__).parents[4] / "examples" / "rigs"
SIMULATED = RIGS / "simulated.toml"
PLACE = (1.25, -0.5, -0.75)
KINDS = {
    "vicon-udp": 'kind = "vicon-udp"\nhost = "127.0.0.1"\nmarkers = ["a"]',
    "vicon-datastream": 'kind = "vicon-datastream"\nhost = "127.0.0.1"\nsubject = "body"\nmarkers = ["a"]',
    "datastream, y up": 'kind = "vicon-datastream"\nhost = "127.0.0.1"\nmarkers = ["a"]\nup = "y"',
    "qtm": 'kind = "qtm"\nhost = "127.0.0.1"\nmarkers = ["a"]',
    "natnet": 'kind = "natnet"\nhost = "127.0.0.1"\nmarkers = ["1/2"]\nup = "y"',
    "osc": 'kind = "osc"\nhost = "127.0.0.1"\nunit = "mm"\nframe_address = "/f"\nmarkers = ["a"]',
    "lines over tcp": 'kind = "marker-text"\nhost = "127.0.0.1"\ntransport = "tcp"',
    "lines over udp": 'kind = "marker-text"\nhost = "127.0.0.1"',
    "lsl": 'kind = "lsl"\nstream = "fidim-test-kinds"\nmarkers = ["a"]',
}


class OnePlace:
    """A laboratory whose only marker stands still."""

    def mocap_server(self, encoder, rate):
        return MocapServer(lambda t: [PLACE], encoder, np.random.default_rng(0), StreamTiming(rate), noise=1e-6)


def rig(tmp_path, kind):
    text = SIMULATED.read_text()
    start, end = text.index("[motion_capture]"), text.index("[simulated_hand]")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    table = f"[motion_capture]\nrate = 100.0\nport = {port}\n{KINDS[kind]}\n\n"
    path = tmp_path / "rig.toml"
    path.write_text(text[:start] + table + text[end:])
    return read_rig(path)


def run(main):
    async def limited():
        async with asyncio.timeout(40.0):
            return await main()

    return asyncio.run(limited())


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_simulated_is_read(tmp_path, kind):
    file, clock = rig(tmp_path, kind), LoopClock()

    async def main():
        sender, source = mocap_sender(file, OnePlace(), clock), marker_source(file, clock)
        await sender.start()
        await source.start()
        frame = await source.ready(5.0)
        await source.close()
        await sender.close()
        return frame, describe(source.decoder)

    frame, description = run(main)
    assert frame.positions[0] == pytest.approx(PLACE, abs=1e-4)
    assert describe(description.make()) == description


@pytest.mark.slow
def test_the_doctor_shows_the_systems_own_latency(tmp_path):
    file, clock = rig(tmp_path, "vicon-datastream"), LoopClock()

    async def main():
        sender = mocap_sender(file, OnePlace(), clock)
        await sender.start()
        checks, _ = await check_motion_capture(file, clock)
        await sender.close()
        return {check.name: check for check in checks}

    checks = run(main)
    assert checks["system's own latency"].found == "4.0 ms"
    assert checks["stream"].verdict is CheckVerdict.OK
    assert checks["body/a seen"].verdict is CheckVerdict.OK


def test_the_doctor_names_a_server_that_is_not_there(tmp_path):
    file = rig(tmp_path, "vicon-datastream")
    (check,), _ = run(lambda: check_motion_capture(file, LoopClock()))
    assert check.verdict is CheckVerdict.UNREACHABLE
    assert "cannot connect" in check.found
