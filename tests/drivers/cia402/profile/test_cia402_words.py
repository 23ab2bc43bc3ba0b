import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.cia402.profile.machine import Command
from drivers.cia402.profile.words import controlword, mode_name, remarks, set_point
from drivers.cia402.wire.aborts import abort_words
from drivers.cia402.wire.emcy import Emergency, decode_emergency, emergency_words
from drivers.cia402.wire.nmt import Heartbeat, NmtCommand, NmtState, decode_heartbeat, heartbeat_frame, nmt_frame


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (0x0000, "no error"),
        (0x2310, "continuous over-current"),
        (0x2320, "short circuit or earth leakage"),
        (0x2399, "current on the output side"),
        (0x2999, "current"),
        (0x3210, "DC link over-voltage"),
        (0x4310, "temperature of the motor"),
        (0x7305, "encoder"),
        (0x8110, "CAN overrun, messages lost"),
        (0x8130, "heartbeat or node guarding lost"),
        (0x8611, "following error"),
        (0xFF01, "vendor-specific"),
        (0x9999, "unnamed error"),
    ],
)
def test_emergency_codes_in_words(code: int, words: str) -> None:
    assert emergency_words(code) == words


def test_an_emergency_frame() -> None:
    emergency = decode_emergency(bytes.fromhex("11 86 21 01 02 00 00 00"), 3.5)
    assert emergency is not None
    assert emergency == Emergency(3.5, 0x8611, 0x21, bytes([1, 2, 0, 0, 0]))
    assert str(emergency) == "emergency 0x8611 (following error), vendor bytes 01 02 00 00 00"
    assert not emergency.cleared


def test_short_emergencies_count_as_far_as_they_go() -> None:
    assert decode_emergency(bytes.fromhex("3081"), 0.0) == Emergency(0.0, 0x8130, 0, b"")
    cleared = decode_emergency(bytes(3), 0.0)
    assert cleared is not None
    assert cleared.cleared
    assert decode_emergency(b"\x30", 0.0) is None


@given(st.binary(max_size=12))
def test_no_bytes_upset_the_decoders(data: bytes) -> None:
    emergency = decode_emergency(data, 1.0)
    assert (emergency is not None) == (2 <= len(data) <= 8)
    if emergency is not None:
        assert emergency.code == data[0] + 256 * data[1]
        assert str(emergency)
    heartbeat = decode_heartbeat(data, 1.0)
    assert (heartbeat is not None) == (len(data) == 1 and data[0] & 0x7F in (0, 4, 5, 0x7F))


@pytest.mark.parametrize(
    ("byte", "state"),
    [(0x00, "BOOT_UP"), (0x05, "OPERATIONAL"), (0x85, "OPERATIONAL"), (0x7F, "PRE_OPERATIONAL"), (0x04, "STOPPED")],
)
def test_heartbeats(byte: int, state: str) -> None:
    assert decode_heartbeat(bytes([byte]), 2.0) == Heartbeat(2.0, NmtState[state])


def test_frames_of_the_host() -> None:
    assert nmt_frame(NmtCommand.START, 3) == b"\x01\x03"
    assert nmt_frame(NmtCommand.PRE_OPERATIONAL, 3) == b"\x80\x03"
    assert heartbeat_frame() == b"\x05"


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (0x06020000, "the drive has no such object (SDO abort 0x06020000)"),
        (0x06090030, "value not allowed (SDO abort 0x06090030)"),
        (0x12345678, "unnamed reason (SDO abort 0x12345678)"),
    ],
)
def test_aborts_in_words(code: int, words: str) -> None:
    assert abort_words(code) == words


def test_controlwords_of_profile_position_mode() -> None:
    assert controlword(Command.ENABLE_OPERATION, halt=True) == 0x010F
    assert controlword(Command.QUICK_STOP) == 0x0002
    assert set_point(new=False) == 0x2F
    assert set_point(new=True) == 0x3F
    assert set_point(new=False, halt=True) == 0x12F


def test_modes() -> None:
    assert mode_name(1) == "profile position (1)"
    assert mode_name(-3) == "mode -3"


def test_remarks_on_a_statusword() -> None:
    assert remarks(0x0637) == []
    assert remarks(0x2A80) == [
        "with a warning",
        "at an internal limit",
        "with a following error",
        "no supply voltage at the power stage",
    ]
