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
from sim_backends.mocap.server import MocapServer, Timing
from sim_backends.mocap.sockets import TcpServer

pytestmark = pytest.mark.peer
PYTHON = os.environ.get("FIDIM_PEER_PYTHON", sys.executable)
PLACE = (1.25, -0.5, 0.75)


def need(*modules):
    command = [PYTHON, "-c", f"import {', '.join(modules)}"]
    asked = subprocess.run(command, capture_output=True, timeout=60, check=False)
    if asked.returncode:
        pytest.skip(
            f"{PYTHON} has no {' or '.join(modules)}: pip install {' '.join(modules)}, or set FIDIM_PEER_PYTHON"
        )


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


def test_the_vendors_client_reads_our_datastream_at_the_sent_pose():
    need("motioncapture", "numpy")
    encoder = DataStreamEncoder(["main"], subject="platform")
    server = MocapServer(lambda t: [PLACE], encoder, np.random.default_rng(0), Timing(100.0), noise=0.0)
    found = {}

    async def main():
        clock = LoopClock()
        tcp = TcpServer(server, clock, session=DataStreamSession)
        await tcp.start()
        thread = threading.Thread(target=ask, args=(f"127.0.0.1:{tcp.port}",))
        thread.start()
        while thread.is_alive():
            await clock.sleep(0.05)
        await tcp.close()

    def ask(address):
        command = [PYTHON, "-c", READ_VICON, address]
        done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
        found.update(json.loads(done.stdout) if done.returncode == 0 else {"error": done.stderr})

    run_loop(main(), real_time=True)
    assert found == {"platform": pytest.approx(PLACE)}
