"""Whose datagrams are taken: one sender's from elsewhere, this user's and root's from this computer."""

import asyncio
import os
import socket

import pytest

from drivers.clock import LoopClock
from drivers.mocap import sender
from drivers.mocap.feeds import UdpFeed
from drivers.mocap.sender import AGE, LOOKS, SILENT, SenderCheck, owners

HERE, TRACKER, OTHER = "127.0.0.1", "192.0.2.7", "192.0.2.66"
NOBODY = 65534


class Now:
    def __init__(self):
        self.t = 0.0

    def __call__(self):
        return self.t


@pytest.fixture
def now():
    return Now()


def nobody_asks(port):
    raise AssertionError(port)


def test_the_configured_address_alone(now):
    check = SenderCheck(now, TRACKER, nobody_asks)
    assert check.takes((TRACKER, 5000))
    assert check.takes((TRACKER, 5001)), "a program that was started again has another port"
    assert not check.takes((OTHER, 5000))
    now.t = 60.0
    assert not check.takes((OTHER, 5000)), "however long the other one was silent"
    assert check.foreign == 2
    assert check.left_out == "192.0.2.66, port 5000"


def test_the_first_that_is_heard_until_it_is_silent(now):
    check = SenderCheck(now, None, nobody_asks)
    for _ in range(20):
        assert check.takes((TRACKER, 5000))
        assert not check.takes((OTHER, 5000))
        now.t += 0.9 * SILENT
    now.t += 0.2 * SILENT
    assert check.takes((OTHER, 5000))
    assert not check.takes((TRACKER, 5000))


@pytest.mark.parametrize(
    ("users", "taken"),
    [({os.getuid()}, True), ({0}, True), ({NOBODY}, False), ({os.getuid(), NOBODY}, False), (set(), False)],
)
def test_whose_socket_it_is_on_this_computer(now, users, taken):
    check = SenderCheck(now, None, lambda _: frozenset(users))
    assert check.takes((HERE, 5000)) is taken


def test_where_the_system_does_not_tell_the_address_must_do(now):
    assert SenderCheck(now, None, lambda _: None).takes((HERE, 5000))


def test_a_port_that_changes_hands_is_noticed(now):
    user = [os.getuid()]
    check = SenderCheck(now, None, lambda _: frozenset(user))
    assert check.takes((HERE, 5000))
    user[0] = NOBODY
    now.t += 1.01 * AGE
    assert not check.takes((HERE, 5000))


def test_a_flood_from_ever_new_ports_costs_little_and_takes_nothing_from_the_stream(now):
    looks = []

    def owner(port):
        looks.append(port)
        return frozenset({os.getuid() if port == 5000 else NOBODY})

    check = SenderCheck(now, None, owner)
    for step in range(5000):
        now.t = step * 1e-3
        assert check.takes((HERE, 5000))
        assert not check.takes((HERE, 10_000 + step))
    assert len(looks) < 5.0 * (LOOKS + 1.0 / AGE) + 3


def test_the_kernel_tells_who_has_a_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ours:
        ours.bind((HERE, 0))
        port = ours.getsockname()[1]
        users = owners(port)
    if users is None:
        pytest.skip("no /proc/net/udp here")
    assert users == {os.getuid()}
    assert owners(port) == frozenset()


def test_a_table_that_cannot_be_read_is_no_answer(monkeypatch, tmp_path):
    monkeypatch.setattr(sender, "TABLES", (tmp_path / "none",))
    assert owners(1) is None


@pytest.mark.skipif(os.getuid() != 0, reason="needs root, to become another user")
def test_another_user_of_this_computer_is_not_heard():
    def forge(port, done):
        """In a child: its socket stays open until the datagram has been looked at."""
        os.setuid(NOBODY)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as theirs:
            theirs.sendto(b"forged", (HERE, port))
            os.read(done, 1)

    async def main():
        feed = UdpFeed(LoopClock(), 0, HERE)
        await feed.open()
        done, say = os.pipe()
        child = os.fork()
        if child == 0:
            try:
                forge(feed.port, done)
            finally:
                os._exit(0)
        try:
            for _ in range(100):
                await LoopClock().sleep(0.02)
                if feed.foreign:
                    break
            await LoopClock().sleep(1.5 / LOOKS)
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ours:
                ours.sendto(b"true", (HERE, feed.port))
                _, data = await asyncio.wait_for(feed.receive(), 5.0)
        finally:
            os.write(say, b"x")
            os.waitpid(child, 0)
            os.close(done)
            os.close(say)
            await feed.close()
        assert data == b"true"
        assert feed.foreign == 1

    asyncio.run(main())
