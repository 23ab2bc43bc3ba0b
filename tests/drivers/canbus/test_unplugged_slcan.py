"""An SLCAN adapter that goes away: the fault is latched and named, sending is refused, closing frees the port."""

import threading

import pytest

from drivers.canbus.python_can import PythonCanTransport
from fidim_lab.errors import BusError
from sim_backends.slcan_server import SlcanServerBus


def test_a_server_that_hangs_up_is_a_latched_fault_and_nothing_is_left_open():
    ending = threading.Event()
    with SlcanServerBus("127.0.0.1", 0) as server:

        def serve():
            while not ending.is_set():
                server.recv(0.01)

        thread = threading.Thread(target=serve)
        thread.start()
        transport = PythonCanTransport("slcan", f"socket://127.0.0.1:{server.port}", sleep_after_open=0.0)
        transport.send(0x80, b"")
        assert transport.fault is None
        ending.set()
        thread.join()
        server.plugged = False
        server.recv(0.1)  # the client's next words find nobody
        for _ in range(100):
            if transport.fault is not None:
                break
            ending.clear()
            try:
                transport.send(0x80, b"")
            except BusError:
                break
            server.recv(0.02)
        assert transport.fault is not None
        assert "slcan" in transport.fault
        transport.close()
        transport.close()
        with pytest.raises(BusError, match="is closed"):
            transport.send(0x80, b"")
