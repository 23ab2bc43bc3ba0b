"""Our master drives a drive on the C stack CANopenNode, which no package registry has: FIDIM_CANOPENNODE names it.

`$FIDIM_CANOPENNODE 3` is node 3: a CiA 402 drive with the objects of our generic EDS file, profile and cyclic position.
It prints "port N", serves one host at a time on that TCP port in slcan's text, and lives on when the host has gone.
"""

import os
import shutil
import signal
import subprocess
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import canopen
import pytest

from drivers.cia402.motion import Cia402Winch
from drivers.cia402.motion.cyclic import CyclicWinch
from drivers.cia402.profile.machine import state_of
from drivers.cia402.profile.words import Mode
from drivers.cia402.watch import acknowledge_fault
from drivers.cia402.wire.nmt import NmtCommand, NmtState
from drivers.cia402.wire.sdo import SdoRefusedError
from drivers.ports import DriveState
from fidim_lab.errors import DeviceError

pytestmark = pytest.mark.peer
VARIABLE = "FIDIM_CANOPENNODE"


class Node:
    """The running peer."""

    def __init__(self, program: str) -> None:
        self._process = subprocess.Popen([program, "3"], stdout=subprocess.PIPE, text=True)
        assert self._process.stdout is not None
        said = self._process.stdout.readline()
        assert said.startswith("port "), f'{program} said {said!r}, "port N" expected'
        self.port = int(said.split()[1])

    def freeze(self) -> None:
        """As a drive without power: the line stays, and nothing comes."""
        self._process.send_signal(signal.SIGSTOP)

    def end(self) -> None:
        self._process.kill()
        self._process.communicate(timeout=10)


@pytest.fixture
def node() -> Iterator[Node]:
    program = shutil.which(os.environ.get(VARIABLE, ""))
    if program is None:
        pytest.skip(f"{VARIABLE} names no executable: CONTRIBUTING.md says what it must offer")
    peer = Node(program)
    yield peer
    peer.end()


async def until(master: Any, there: Callable[[], bool], what: str) -> None:
    for _ in range(250):
        if there():
            return
        await master.clock.sleep(0.02)
    pytest.fail(f"not within 5 s: {what}")


async def moving(master: Any, winch: Any, target: float) -> None:
    """On its way, far from both ends."""
    start = winch.latest().length
    await winch.move_to(target, 0.2, 1.0)
    await until(master, lambda: abs(winch.latest().length - start) > 0.1, "under way")


async def standing(master: Any, winch: Any, state: DriveState) -> float:
    """Where it stands (m) in this state, by its samples and by its encoder."""
    await until(master, lambda: winch.latest().state is state and winch.latest().velocity == 0.0, f"at rest, {state}")
    first = await winch.ask_length()
    await master.clock.sleep(0.2)
    assert await winch.ask_length() == first == pytest.approx(winch.latest().length)
    return first


def test_it_is_brought_up_moved_held_and_stopped(node, against):
    async def script(transport: Any, master: Any, winch: Any) -> None:
        await winch.configure()
        assert all(check.ok for check in winch.checks)
        assert winch.link.nmt_state is NmtState.OPERATIONAL
        await winch.enable()
        await winch.move_to(1.2, 0.2, 1.0)
        await until(master, lambda: winch.latest().target_reached and winch.latest().length > 1.1, "arrived")
        assert await standing(master, winch, DriveState.OPERATION_ENABLED) == pytest.approx(1.2, abs=1e-4)
        await moving(master, winch, 2.5)
        await winch.hold()
        assert 1.3 < await standing(master, winch, DriveState.OPERATION_ENABLED) < 2.4
        await moving(master, winch, 0.6)
        winch.quick_stop()
        assert 0.7 < await standing(master, winch, DriveState.QUICK_STOP_ACTIVE) < 2.4
        winch.power_off()
        await standing(master, winch, DriveState.SWITCH_ON_DISABLED)
        assert (winch.latest().fault, winch.latest().emergencies) == ("", 0)

    against(node.port, script)


def test_cyclic_targets_are_taken_at_sync(node, against):
    async def script(transport: Any, master: Any, winch: Any) -> None:
        await winch.configure()
        await winch.enable()
        await winch.move_to(1.2, 0.2, 1.0)
        await until(master, lambda: winch.latest().length > 1.19 and winch.latest().target_reached, "arrived")
        assert await standing(master, winch, DriveState.OPERATION_ENABLED) == pytest.approx(1.2, abs=1e-4)
        await moving(master, winch, 2.5)
        winch.quick_stop()
        assert 1.3 < await standing(master, winch, DriveState.QUICK_STOP_ACTIVE) < 2.4

    against(node.port, script, CyclicWinch, mode=Mode.CYCLIC_POSITION)


def test_sdo_aborts_mapping_rules_and_long_transfers(node, against, there_and_back):
    async def script(transport: Any, master: Any, winch: Any) -> None:
        sdo = winch.link.sdo
        await sdo.write_verified(0x6065, 0, 1234)
        with pytest.raises(SdoRefusedError, match=r"1018:1"):
            await sdo.write(0x1018, 1, 7)
        with pytest.raises(SdoRefusedError, match=r"1A00:1"):  # it is still on, and its entries count
            await sdo.write(0x1A00, 1, 0x60640020)
        text = bytes(range(256)) * 3
        for block in (False, True):
            assert await there_and_back(transport, master, text, block=block) == text
        client = master._network[3].sdo
        with pytest.raises(canopen.SdoAbortedError, match="0x06020000"):
            await transport.call(3, lambda: client.upload(0x5FFF, 0))
        await winch.configure()

    against(node.port, script)


def test_a_host_that_is_lost_stops_it(node, against):
    """Its own reaction by 1016 and 6007, and its emergency; then it starts again, or we say why it does not."""

    async def script(transport: Any, master: Any, winch: Any) -> None:
        await winch.configure()
        await winch.enable()
        await moving(master, winch, 2.5)
        master.without_heartbeat = True
        await until(master, lambda: winch.link.latched is not None, "an emergency")
        assert winch.link.latched.code == 0x8130
        await master.clock.sleep(0.5)
        first = await winch.ask_length()
        assert first < 2.4
        assert state_of(await winch.link.sdo.read(0x6041)) is DriveState.QUICK_STOP_ACTIVE
        await master.clock.sleep(0.2)
        assert await winch.ask_length() == first
        assert "heartbeat or node guarding lost" in winch.latest().fault

        master.without_heartbeat = False
        winch.power_off()
        await master.clock.sleep(0.5)
        assert state_of(await winch.link.sdo.read(0x6041)) is DriveState.SWITCH_ON_DISABLED
        if await winch.link.sdo.read(0x1001):  # as version 1 keeps it
            with pytest.raises(DeviceError, match=r"1001\) is 0x1.* \(communication\).*0x8130.*supply off and on"):
                await winch.configure()
            winch.link.send_nmt(NmtCommand.RESET_NODE)
            await until(master, lambda: winch.link.nmt_state is NmtState.BOOT_UP, "restarted")
        await winch.configure()
        await winch.enable()

    against(node.port, script)


def test_a_fault_is_named_and_reset_by_a_person(node, against):
    """Whether or not the node stays operational in it."""

    async def script(transport: Any, master: Any, winch: Any) -> None:
        await winch.configure()
        await winch.enable()
        await moving(master, winch, 2.5)
        await winch.link.sdo.write(0x6066, 0, 0)
        await winch.link.sdo.write(0x6065, 0, 1)
        await until(master, lambda: "following error" in winch.latest().fault, "its emergency")
        await master.clock.sleep(0.5)
        first = await winch.ask_length()
        assert state_of(await winch.link.sdo.read(0x6041)) is DriveState.FAULT
        with pytest.raises(DeviceError, match="following error"):
            await winch.enable()
        await acknowledge_fault(winch.link, master.clock, winch.config.device, "A. Person")
        assert state_of(await winch.link.sdo.read(0x6041)) is DriveState.SWITCH_ON_DISABLED
        await winch.configure()
        await winch.enable()
        assert await winch.ask_length() == first

    against(node.port, script)


def test_a_host_that_comes_back_finds_it_held(node, against):
    """Refused as a new drive; taken over where its node starts again, and told why not where it does not."""
    held: list[float] = []

    async def left(transport: Any, master: Any, winch: Any) -> None:
        await winch.configure()
        await winch.enable()
        await moving(master, winch, 2.5)

    async def refused(transport: Any, master: Any, winch: Any) -> None:
        await master.clock.sleep(0.5)
        with pytest.raises(DeviceError, match=r"has power already \(quick stop active\)"):
            await winch.configure()
        held.append(await winch.ask_length())

    async def taken_over(transport: Any, master: Any, winch: Any) -> None:
        await master.clock.sleep(0.2)  # a heartbeat of ours, at which version 4 takes its error back
        if await winch.link.sdo.read(0x1001):
            with pytest.raises(DeviceError, match=r"error register \(1001\) is 0x10"):
                await winch.configure()
            assert state_of(await winch.link.sdo.read(0x6041)) is DriveState.QUICK_STOP_ACTIVE
        else:
            await winch.configure()
            await winch.enable()
            await standing(master, winch, DriveState.OPERATION_ENABLED)
        assert await winch.ask_length() == held[0]
        winch.power_off()
        await master.clock.sleep(0.3)
        assert state_of(await winch.link.sdo.read(0x6041)) is DriveState.SWITCH_ON_DISABLED

    against(node.port, left)
    against(node.port, refused)
    against(node.port, taken_over, partial(Cia402Winch, takes_over=True))


def test_a_drive_that_restarts_or_dies_is_seen(node, against):
    async def script(transport: Any, master: Any, winch: Any) -> None:
        await winch.configure()
        await winch.enable()
        winch.link.send_nmt(NmtCommand.RESET_NODE)
        await until(master, lambda: "restarted by itself" in winch.latest().fault, "its restart")
        await winch.configure()
        await winch.enable()
        node.freeze()
        await until(master, lambda: "no heartbeat for" in winch.latest().fault, "its silence")
        await until(master, lambda: winch.latest().state is DriveState.UNKNOWN, "its samples too old")

    against(node.port, script)
