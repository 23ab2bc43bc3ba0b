"""Other people's clients read our simulated servers, from the Python of `make peers` (or FIDIM_PEER_PYTHON)."""

import json
import os
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from drivers.clock import LoopClock
from fidim_lab.app.compose.loop import run_loop
from sim_backends.mocap.datastream import DataStreamEncoder, DataStreamSession
from sim_backends.mocap.faults import During, Faults, Occlusion
from sim_backends.mocap.natnet import NatNetEncoder, NatNetServer
from sim_backends.mocap.qtm import QtmEncoder, QtmSession
from sim_backends.mocap.server import MocapServer, StreamTiming
from sim_backends.mocap.sockets import TcpServer

pytestmark = pytest.mark.peer
MADE = Path(__file__).parents[3] / "build" / "peers" / "python" / "bin" / "python"
PYTHON = os.environ.get("FIDIM_PEER_PYTHON", str(MADE) if MADE.exists() else sys.executable)
PLACE = (1.25, -0.5, 0.75)


def need(*modules):
    command = [PYTHON, "-c", f"import {', '.join(modules)}"]
    asked = subprocess.run(command, capture_output=True, timeout=60, check=False)
    if asked.returncode:
        missing = " or ".join(modules).replace("_", "-")
        pytest.skip(f"{PYTHON} has no {missing}: install it there, or set FIDIM_PEER_PYTHON to a Python that has it")


READ_VICON = """
import json, motioncapture, os, sys
stream = motioncapture.connect("vicon", {"hostname": sys.argv[1]})
for _ in range(50):
    stream.waitForNextFrame()
    bodies = stream.rigidBodies
    if bodies:
        break
print(json.dumps({name: [float(v) for v in body.position] for name, body in bodies.items()}), flush=True)
os._exit(0)  # its threads do not end by themselves
"""


READ_QUALISYS = """
import asyncio, json, qtm_rt, sys
async def main():
    host, port = sys.argv[1].split(":")
    connection = await qtm_rt.connect(host, port=int(port), version="1.19")
    names = (await connection.get_parameters(parameters=["3d"])).decode()
    got = asyncio.get_running_loop().create_future()
    def packet(packet):
        header, markers = packet.get_3d_markers()
        if not got.done():
            got.set_result([[m.x / 1e3, m.y / 1e3, m.z / 1e3] for m in markers])
    await connection.stream_frames(frames="allframes", components=["3d"], on_packet=packet)
    places = await asyncio.wait_for(got, 10)
    print(json.dumps({name: place for name, place in zip([n for n in ("main", "hidden") if n in names], places)}))
asyncio.run(main())
"""


READ_NATNET = """
import json, sys
from natnet import NatNetClient
host, port = sys.argv[1].split(":")
client = NatNetClient(server_ip_address=host, local_ip_address=host, command_port=int(port), use_multicast=False)
found = []
client.on_data_frame_received_event.handlers.append(found.append)
client.connect(timeout=10)
import time
end = time.time() + 10
while not found and time.time() < end:
    client.update_sync()
    time.sleep(0.02)
frame = found[-1]
print(json.dumps({
    "protocol": [client.protocol_version.major, client.protocol_version.minor],
    "markers": {f"{m.model_id}/{m.marker_id}": [*m.pos, m.occluded] for m in frame.labeled_markers},
    "set": [s.model_name for s in frame.marker_sets], "body": list(frame.rigid_bodies[0].pos),
    "recording": frame.suffix.is_recording, "number": frame.prefix.frame_number,
}))
client.shutdown()
"""


def read_by(script, server, session):
    """What another Python's client prints of a server of ours."""
    return asked_of(script, lambda clock: TcpServer(server, clock, session=session))


def asked_of(script, make):
    """The same of whatever `make` makes of a clock."""
    found = {}

    def ask(address):
        command = [PYTHON, "-c", script, address]
        done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
        found.update(json.loads(done.stdout) if done.returncode == 0 else {"error": done.stderr})

    async def main():
        clock = LoopClock()
        tcp = make(clock)
        await tcp.start()
        thread = threading.Thread(target=ask, args=(f"127.0.0.1:{tcp.port}",))
        thread.start()
        while thread.is_alive():
            await clock.sleep(0.05)
        await tcp.close()

    run_loop(main(), real_time=True)
    return found


def serving(encoder):
    return MocapServer(lambda t: [PLACE], encoder, np.random.default_rng(0), StreamTiming(100.0), noise=0.0)


def test_the_vendors_client_reads_our_datastream_at_the_sent_pose():
    need("motioncapture", "numpy")
    server = serving(DataStreamEncoder(["main"], subject="platform"))
    assert read_by(READ_VICON, server, DataStreamSession) == {"platform": pytest.approx(PLACE)}


def test_qualisys_own_client_reads_our_server_at_the_sent_place():
    need("qtm_rt")
    found = read_by(READ_QUALISYS, serving(QtmEncoder()), QtmSession.maker(["main"]))
    assert found == {"main": pytest.approx(PLACE)}


@pytest.mark.parametrize("version", [(3, 0), (3, 1), (4, 1)])
def test_another_client_reads_our_natnet_server_at_the_sent_places(version):
    need("natnet")
    encoder = NatNetEncoder([(1, 1), (7, 3)], version)
    hidden = Faults(occlusions=[Occlusion(During(0.0, 1e9), 1)])
    places = [PLACE, (0.0, 0.0, 1.0)]
    server = MocapServer(
        lambda t: places, encoder, np.random.default_rng(0), StreamTiming(100.0), noise=0.0, faults=hidden
    )
    found = asked_of(READ_NATNET, lambda clock: NatNetServer(server, encoder.about(), clock))
    assert found.pop("number") > 0
    assert found == {
        "protocol": list(version),
        "markers": {"1/1": [*PLACE, False], "7/3": [0.0, 0.0, 0.0, True]},
        "set": ["all"],
        "body": [*PLACE],
        "recording": False,
    }
