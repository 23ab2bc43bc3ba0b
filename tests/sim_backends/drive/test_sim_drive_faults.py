"""Injected defects, frames of any content, and the EDS as dictionary."""

import contextlib
import struct
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.canbus.transport import CanFrame
from fidim_lab.errors import FileError, OurBugError
from sim_backends.drive.axis import DrumShaft
from sim_backends.drive.node import SimulatedDrive
from sim_backends.drive.objects import read_eds
from sim_backends.drive.objects.dictionary import Dictionary

EDS = Path(__file__).parents[3] / "drivers" / "cia402" / "dictionary" / "eds" / "generic_cia402.eds"
READ_TYPE = "40 00 10 00 00 00 00 00"
TYPE = "43 00 10 00 92 01 02 00"


def test_sdo_silence_leaves_the_rest_alive(bench):
    bench.write(0x1017, 0, "u16", 100)
    bench.drive.faults.sdo_silent = True
    assert bench.sdo(READ_TYPE) in ("", "703: 7f")
    assert bench.run(0.1) == ["703: 7f"]
    bench.drive.faults.sdo_silent = False
    assert bench.sdo(READ_TYPE) == TYPE


def test_a_hung_processor_says_nothing_while_the_servo_goes_on(bench):
    bench.write(0x1017, 0, "u16", 100)
    bench.profile(1000, 10_000, 10_000)
    bench.enable()
    bench.go(5000)
    bench.drive.faults.silent = True
    assert bench.sdo(READ_TYPE) == ""
    assert bench.frame(0x000, "81 03") == []
    assert bench.run(9.0) == []
    assert bench.shaft.motion(bench.t).position == 5000.0
    bench.drive.faults.silent = False
    assert bench.sdo(READ_TYPE) == TYPE


def test_power_that_is_cut_and_comes_back(bench):
    """It boots, stands where the brake has held it, and has forgotten what its host had written."""
    bench.write(0x1017, 0, "u16", 100)
    bench.profile(1000, 10_000, 10_000)
    bench.enable()
    bench.go(5000)
    bench.run(2.0)
    bench.drive.cut_power()
    assert bench.run(3.0) == []
    place = bench.shaft.motion(bench.t).position
    assert 1000.0 < place < 3000.0
    bench.drive.restore_power(bench.t)
    assert bench.run(1.0) == ["703: 00"]
    assert bench.state() == "SWITCH ON DISABLED"
    assert bench.read(0x1017, 0, "u16") == 0
    assert bench.read(0x6064, 0, "i32") == round(place)
    bench.enable()
    assert bench.state() == "OPERATION ENABLED"


def test_slow_answers_come_in_order_at_their_time(bench):
    bench.drive.faults.sdo_delay = 0.15
    assert bench.sdo(READ_TYPE) == ""
    bench.run(0.1)
    assert bench.sdo("40 01 10 00 00 00 00 00") == ""
    assert bench.run(0.049) == []
    assert bench.run(0.002) == [f"583: {TYPE}"]
    assert bench.run(1.0) == ["583: 4f 01 10 00 00 00 00 00"]


def test_a_rejected_mode_never_shows(bench):
    bench.drive.faults.reject_mode(1)
    assert bench.write(0x6060, 0, "i8", 1) == 0
    assert bench.read(0x6061, 0, "i8") == 0


def test_a_wrong_identity_survives_a_reset(bench):
    bench.drive.faults.claim_identity(vendor=0xBAD, product=0xC0DE)
    bench.frame(0x000, "81 03")
    assert bench.read(0x1018, 1, "u32") == 0xBAD
    assert bench.read(0x1018, 2, "u32") == 0xC0DE


def test_only_profile_position_is_claimed(bench):
    assert bench.read(0x6502, 0, "u32") == 0xAD


@settings(max_examples=60, deadline=None)
@given(
    frames=st.lists(
        st.tuples(
            st.one_of(st.sampled_from([0x000, 0x080, 0x203, 0x303, 0x603, 0x77F]), st.integers(0, 0x7FF)),
            st.binary(max_size=8),
            st.floats(0.0, 0.5),
        ),
        max_size=60,
    )
)
def test_any_frames_are_survived_and_answered_as_the_standard_says(frames):
    drive = SimulatedDrive(3, read_once(), DrumShaft())
    drive.od.restore(0x1000, 0x9FFF)
    drive.start(0.0)
    t = 0.0
    for frame_id, data, pause in frames:
        t += pause
        stopped = drive.nmt_state == 4
        answers = drive.receive(CanFrame(frame_id, data, t))
        sdo = [answer for cob_id, answer in answers if cob_id == 0x583]
        expected = frame_id == 0x603 and len(data) == 8 and data[0] >> 5 != 4 and not stopped
        assert len(sdo) == expected
        assert all(0 <= cob_id <= 0x7FF and len(answer) <= 8 for cob_id, answer in answers)
        drive.advance(t + pause / 2)


def read_once():
    """A fresh dictionary without parsing the EDS each time."""
    return Dictionary(SPECS)


SPECS = list(read_eds(EDS, 3)._specs.values())


@settings(max_examples=200, deadline=None)
@given(
    writes=st.lists(
        st.tuples(
            st.sampled_from([s for s in SPECS if s.writable and s.size]),
            st.one_of(st.integers(0, 2**32 - 1), st.sampled_from([0, 1, 6, 7, 15, 31, 0x80, 0x183, 0x60640020])),
        ),
        max_size=40,
    )
)
def test_any_configuration_is_survived(writes):
    drive = SimulatedDrive(3, read_once(), DrumShaft())
    drive.start(0.0)
    drive.receive(CanFrame(0x000, b"\x01\x03", 0.01))
    for i, (spec, value) in enumerate(writes):
        size = spec.size or 0
        data = (value & (1 << 8 * size) - 1).to_bytes(size, "little")
        request = struct.pack("<BHB4s", 0x23 | (4 - size) << 2, spec.index, spec.subindex, data)
        t = 0.01 + 0.003 * i
        answer = next(a for c, a in drive.receive(CanFrame(0x603, request, t)) if c == 0x583)
        assert answer[0] in (0x60, 0x80)
        if answer[0] == 0x60 and spec.index not in (0x6040, 0x1003):
            stored = drive.od.read(spec.index, spec.subindex)
            assert stored == data
        drive.receive(CanFrame(0x080, b"", t + 0.001))
    drive.advance(1.0)


def test_every_entry_of_the_eds_can_be_read(bench):
    for spec in SPECS:
        answer = bench.sdo(struct.pack("<BHB4x", 0x40, spec.index, spec.subindex).hex())
        assert answer[:1] == "4", f"{spec.index:04X}:{spec.subindex}"


def test_node_id_is_resolved():
    od = read_eds(EDS, 0x12)
    assert od.number(0x1014) == 0x92
    assert od.number(0x1800, 1) & 0x7FF == 0x192


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (None, "no such file"),
        ("[DeviceInfo]\n", "holds no objects"),
        ("no section\n", "holds no objects"),
        ("[1000]\nDataType=5\n[1000]\nDataType=7\n", r"\[1000\], line 3: DataType 7, but 5"),
    ],
)
def test_a_bad_eds_is_named(tmp_path, text, problem):
    path = tmp_path / "drive.eds"
    if text is not None:
        path.write_text(text)
    with pytest.raises(FileError, match=problem) as caught:
        read_eds(path, 1)
    assert str(path) in str(caught.value)


EDS_LINES = EDS.read_text(encoding="utf-8").splitlines()[:220]
WORDS = [
    "",
    "]",
    "[",
    "[1000]",
    "[1018sub9]",
    "[zz]",
    "DataType=0x0005",
    "DataType=-1",
    "ObjectType=0x9",
    "ObjectType=",
]
WORDS += [
    "DefaultValue=$NODEID+",
    "DefaultValue=-3",
    "DefaultValue=x",
    "AccessType=",
    "LowLimit=1e9",
    "SubNumber=0",
    "é=ü",
]


@settings(max_examples=30, deadline=None)
@given(changes=st.lists(st.tuples(st.integers(15, 219), st.sampled_from(WORDS)), max_size=4), cut=st.integers(20, 220))
def test_a_damaged_eds_is_refused_or_read(tmp_path_factory, changes, cut):
    lines = list(EDS_LINES)
    for place, word in changes:
        lines[place] = word
    path = tmp_path_factory.mktemp("eds") / "damaged.eds"
    path.write_text("\n".join(lines[:cut]), encoding="utf-8")
    with contextlib.suppress(FileError):  # and nothing else
        od = read_eds(path, 3)
        assert all(isinstance(spec.encode(spec.default), bytes) for spec in od._specs.values())


@pytest.mark.parametrize("node", [0, 128])
def test_no_such_node_id(node):
    with pytest.raises(OurBugError, match="1…127"):
        SimulatedDrive(node, read_once(), DrumShaft())
