"""Wire transcripts: what is asked, what the node answers, what comes of it."""

import asyncio
from collections.abc import Awaitable, Callable, Coroutine
from typing import Any, TypeVar

import canopen
import pytest

from drivers.cia402.dictionary import GENERIC_EDS
from drivers.cia402.wire.sdo import SdoChannel, SdoRefusedError
from drivers.clock import LoopClock
from fidim_lab.errors import DeviceError, SetupError

T = TypeVar("T")
Jump = Callable[[Coroutine[Any, Any, Any]], Any]
SILENCE = None


class Transcript:
    """Expects frames to 0x603 in order and gives the written answers."""

    at_once = True
    fault = None

    def __init__(self, *exchanges: tuple[str, str | None]) -> None:
        self.left = [(bytes.fromhex(ask), None if got is None else bytes.fromhex(got)) for ask, got in exchanges]
        self.at: list[float] = []
        self.network = canopen.Network(self)  # type: ignore[arg-type]

    def send(self, message: Any, timeout: float | None = None) -> None:
        if message.data[0] == 0x80:  # the client gives up
            return
        self.at.append(asyncio.get_running_loop().time())
        asked, answer = self.left.pop(0)
        assert (message.arbitration_id, bytes(message.data)) == (0x603, asked)
        if answer is not None:
            self.network.notify(0x583, bytearray(answer), 0.0)

    def call(self, key: int, exchange: Callable[[], T]) -> Awaitable[T]:
        assert key == 3

        async def at_once() -> T:
            return exchange()

        return at_once()


def talk(jump: Jump, wire: Transcript, script: Callable[[SdoChannel], Coroutine[Any, Any, Any]]) -> Any:
    async def main() -> Any:
        node = canopen.RemoteNode(3, canopen.import_od(str(GENERIC_EDS), 3))
        wire.network.add_node(node)
        return await script(SdoChannel(node, wire, LoopClock(), device="w3 (node 3)", timeout=0.01))  # type: ignore[arg-type]

    result = jump(main())
    assert wire.left == [], "not everything was asked"
    return result


@pytest.mark.parametrize(
    ("index", "sub", "ask", "got", "value"),
    [
        (0x605A, 0, "40 5A 60 00 00000000", "4B 5A 60 00 FEFF0000", -2),
        (0x6064, 0, "40 64 60 00 00000000", "43 64 60 00 FFFFFFFF", -1),
        (0x6061, 0, "40 61 60 00 00000000", "4F 61 60 00 01000000", 1),
        (0x1018, 4, "40 18 10 04 00000000", "43 18 10 04 FFFFFFFF", 2**32 - 1),
        (0x6061, 0, "40 61 60 00 00000000", "43 61 60 00 FFFFFFFF", -1),
    ],
)
def test_reads(jump: Jump, index: int, sub: int, ask: str, got: str, value: int) -> None:
    assert talk(jump, Transcript((ask, got)), lambda sdo: sdo.read(index, sub)) == value


def test_a_write_is_read_back(jump: Jump) -> None:
    wire = Transcript(
        ("2B 5A 60 00 06000000", "60 5A 60 00 00000000"), ("40 5A 60 00 00000000", "4B 5A 60 00 06000000")
    )
    talk(jump, wire, lambda sdo: sdo.write_verified(0x605A, 0, 6))


def test_a_write_that_is_not_kept(jump: Jump) -> None:
    wire = Transcript(
        ("2B 5A 60 00 06000000", "60 5A 60 00 00000000"), ("40 5A 60 00 00000000", "4B 5A 60 00 02000000")
    )
    with pytest.raises(DeviceError, match="605A:0 was written 6, and reads back as 2"):
        talk(jump, wire, lambda sdo: sdo.write_verified(0x605A, 0, 6))


def test_an_abort_in_words_is_not_repeated(jump: Jump) -> None:
    wire = Transcript(("40 5A 60 00 00000000", "80 5A 60 00 00000206"))
    with pytest.raises(SdoRefusedError, match=r"w3 \(node 3\): SDO read of 605A:0 refused: the drive has no such"):
        talk(jump, wire, lambda sdo: sdo.read(0x605A))


def test_a_read_is_tried_again_after_a_quiet_time(jump: Jump) -> None:
    wire = Transcript(("40 5A 60 00 00000000", SILENCE), ("40 5A 60 00 00000000", "4B 5A 60 00 06000000"))
    assert talk(jump, wire, lambda sdo: sdo.read(0x605A)) == 6
    assert wire.at[1] - wire.at[0] == pytest.approx(0.01)


def test_a_write_is_never_tried_again(jump: Jump) -> None:
    with pytest.raises(DeviceError, match=r"no answer to SDO write of 605A:0 within 0\.01 s"):
        talk(jump, Transcript(("2B 5A 60 00 06000000", SILENCE)), lambda sdo: sdo.write(0x605A, 0, 6))


def test_a_late_answer_is_not_taken_for_the_next_one(jump: Jump) -> None:
    async def script(sdo: SdoChannel) -> int:
        with pytest.raises(DeviceError):
            await sdo.write(0x605A, 0, 6)
        wire.network.notify(0x583, bytearray.fromhex("4B5A600099990000"), 0.0)  # arrives in the quiet time
        return await sdo.read(0x605A)

    wire = Transcript(("2B 5A 60 00 06000000", SILENCE), ("40 5A 60 00 00000000", "4B 5A 60 00 02000000"))
    assert talk(jump, wire, script) == 2


def test_a_drive_that_answers_late_is_told_apart_from_one_that_does_not(jump: Jump) -> None:
    async def script(sdo: SdoChannel) -> str:
        with pytest.raises(DeviceError) as first:
            await sdo.write(0x605A, 0, 6)
        assert "Is the drive powered" in str(first.value)
        sdo._quiet_until += 0.01  # pyright: ignore[reportPrivateUsage] - here a time-out takes no time
        late = asyncio.get_running_loop().time() + 0.012
        wire.network.notify(0x583, bytearray.fromhex("605A600000000000"), late)
        with pytest.raises(DeviceError) as second:
            await sdo.write(0x605A, 0, 6)
        return str(second.value)

    wire = Transcript(("2B 5A 60 00 06000000", SILENCE), ("2B 5A 60 00 06000000", SILENCE))
    assert "It answers, but late: one came 0.01 s after its question. Raise sdo_timeout." in talk(jump, wire, script)


def test_somebody_elses_answer(jump: Jump) -> None:
    other = ("40 5A 60 00 00000000", "4B 5E 60 00 02000000")
    with pytest.raises(DeviceError, match=r"a wrong answer to SDO read of 605A:0.*Does another program talk"):
        talk(jump, Transcript(other, other), lambda sdo: sdo.read(0x605A))


def test_what_the_eds_does_not_know(jump: Jump) -> None:
    with pytest.raises(DeviceError, match="object 2027:0 is not in the EDS file"):
        talk(jump, Transcript(), lambda sdo: sdo.read(0x2027))


def test_a_number_that_does_not_fit(jump: Jump) -> None:
    with pytest.raises(SetupError, match="70000 does not fit into object 605A:0"):
        talk(jump, Transcript(), lambda sdo: sdo.write(0x605A, 0, 70000))


def test_two_callers_never_mix(jump: Jump) -> None:
    async def script(sdo: SdoChannel) -> list[int]:
        return list(await asyncio.gather(sdo.read(0x605A), sdo.read(0x605E)))

    wire = Transcript(
        ("40 5A 60 00 00000000", "4B 5A 60 00 06000000"), ("40 5E 60 00 00000000", "4B 5E 60 00 02000000")
    )
    assert talk(jump, wire, script) == [6, 2]
