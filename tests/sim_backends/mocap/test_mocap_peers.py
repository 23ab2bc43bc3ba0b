"""Other people's clients read our simulated servers, from the Python that FIDIM_PEER_PYTHON names, else from ours."""

import json
import os
import subprocess
import sys
import threading

import numpy as np
import pytest

from drivers.clock import LoopClock
from fidim_lab.app.compose.loop import run_loop
from sim_backends.mocap.datastream import DataStreamEncoder, DataStreamSession
from sim_backends.mocap.qtm import QtmEncoder, QtmSession
from sim_backends.mocap.server import MocapServer, Timing
from sim_backends.mocap.sockets import TcpServer

pytestmark = pytest.mark.peer
PYTHON = os.environ.get("FIDIM_PEER_PYTHON", sys.executable)
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


def read_by(script, server, session):
    """What another Python's client prints of a server of ours."""
    found = {}

    def ask(address):
        command = [PYTHON, "-c", script, address]
        done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
        found.update(json.loads(done.stdout) if done.returncode == 0 else {"error": done.stderr})

    async def main():
        clock = LoopClock()
        tcp = TcpServer(server, clock, session=session)
        await tcp.start()
        thread = threading.Thread(target=ask, args=(f"127.0.0.1:{tcp.port}",))
        thread.start()
        while thread.is_alive():
            await clock.sleep(0.05)
        await tcp.close()

    run_loop(main(), real_time=True)
    return found


def serving(encoder):
    return MocapServer(lambda t: [PLACE], encoder, np.random.default_rng(0), Timing(100.0), noise=0.0)


def test_the_vendors_client_reads_our_datastream_at_the_sent_pose():
    need("motioncapture", "numpy")
    server = serving(DataStreamEncoder(["main"], subject="platform"))
    assert read_by(READ_VICON, server, DataStreamSession) == {"platform": pytest.approx(PLACE)}


def test_qualisys_own_client_reads_our_server_at_the_sent_place():
    need("qtm_rt")
    found = read_by(READ_QUALISYS, serving(QtmEncoder()), QtmSession.maker(["main"]))
    assert found == {"main": pytest.approx(PLACE)}
