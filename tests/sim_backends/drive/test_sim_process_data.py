"""PDO mapping rules, SYNC-driven, event-driven and received PDOs, as bytes."""

import pytest

OFF = 1 << 31


def map_tpdo(bench, number, entries, kind=1):
    cob_id = 0x183 + 0x100 * number
    codes = [
        bench.write(0x1800 + number, 1, "u32", cob_id | OFF),
        bench.write(0x1800 + number, 2, "u8", kind),
        bench.write(0x1A00 + number, 0, "u8", 0),
        *(bench.write(0x1A00 + number, sub, "u32", entry) for sub, entry in enumerate(entries, 1)),
        bench.write(0x1A00 + number, 0, "u8", len(entries)),
        bench.write(0x1800 + number, 1, "u32", cob_id),
    ]
    assert codes == [0] * len(codes)


def map_rpdo(bench, entries, kind=255):
    for index, sub, size, value in (
        (0x1400, 1, "u32", 0x203 | OFF),
        (0x1400, 2, "u8", kind),
        (0x1600, 0, "u8", 0),
        *((0x1600, sub, "u32", entry) for sub, entry in enumerate(entries, 1)),
        (0x1600, 0, "u8", len(entries)),
        (0x1400, 1, "u32", 0x203),
    ):
        assert bench.write(index, sub, size, value) == 0


def start(bench):
    bench.frame(0x000, "01 03")
    bench.heard.clear()


def test_sync_sends_what_is_mapped(bench):
    map_tpdo(bench, 0, [0x60410010, 0x60640020, 0x60610008])
    map_tpdo(bench, 1, [0x606C0020, 0x60780010])
    assert bench.frame(0x080, "") == []  # pre-operational: no PDO
    start(bench)
    assert bench.frame(0x080, "") == ["183: 50 02 e8 03 00 00 00", "283: 00 00 00 00 00 00"]
    bench.shaft.set_load(2.5)
    bench.enable()
    assert bench.frame(0x080, "") == ["183: 37 06 e8 03 00 00 01", "283: 00 00 00 00 f4 01"]
    assert bench.frame(0x080, "07")  # with a SYNC counter
    assert bench.frame(0x080, "00 00") == []  # too long to be a SYNC


def test_values_are_those_at_the_sync(bench):
    map_tpdo(bench, 0, [0x60640020, 0x606C0020])
    start(bench)
    bench.enable()
    bench.profile(10_000, 10_000, 10_000)
    bench.go(1_000_000)
    bench.t += 0.5037  # nobody lets the drive live meanwhile
    position, velocity = round(1000 + 5000 * 0.5037**2), round(10_000 * 0.5037)
    expected = position.to_bytes(4, "little") + velocity.to_bytes(4, "little")
    assert bench.frame(0x080, "")[0] == f"183: {expected.hex(' ')}"


def test_every_third_sync(bench):
    map_tpdo(bench, 1, [0x60410010], kind=3)
    start(bench)
    assert [len(bench.frame(0x080, "")) for _ in range(7)] == [0, 0, 1, 0, 0, 1, 0]


def test_acyclic_at_a_sync_after_a_change(bench):
    map_tpdo(bench, 1, [0x60610008], kind=0)
    start(bench)
    assert [len(bench.frame(0x080, "")) for _ in range(3)] == [1, 0, 0]
    bench.write(0x6060, 0, "i8", 1)
    assert bench.frame(0x080, "") == ["283: 01"]


def test_event_driven_on_start_on_change_and_by_timer(bench):
    assert bench.frame(0x000, "01 03") == ["183: 50 02"]  # the EDS's TPDO 1: statusword, type 255
    assert bench.run(1.0) == []
    assert "183: 31 02" in bench.frame(0x603, "2b 40 60 00 06 00 00 00")
    bench.frame(0x000, "80 03")
    bench.write(0x1800, 1, "u32", OFF | 0x183)
    bench.write(0x1800, 5, "u16", 100)
    bench.write(0x1800, 1, "u32", 0x183)
    bench.frame(0x000, "01 03")
    assert bench.run(0.25) == ["183: 31 02"] * 2
    assert bench.frame(0x080, "") == []


def test_received_target_and_mode_count_before_the_controlword(bench):
    map_rpdo(bench, [0x60400010, 0x607A0020, 0x60600008])
    bench.profile(10_000, 100_000, 100_000)
    start(bench)
    for word in ("06 00", "07 00", "0f 00", "1f 00"):
        assert all(answer[:3] == "183" for answer in bench.frame(0x203, word + " d0 07 00 00 01"))
    bench.run(1.0)
    assert bench.read(0x6064, 0, "i32") == 2000


def test_synchronous_rpdo_waits_for_the_sync(bench):
    map_rpdo(bench, [0x60400010], kind=1)
    start(bench)
    bench.frame(0x203, "06 00")
    assert bench.state() == "SWITCH ON DISABLED"
    bench.frame(0x080, "")
    assert bench.state() == "READY"


def test_wrong_lengths_are_told_once(bench):
    map_rpdo(bench, [0x60400010])
    start(bench)
    assert bench.frame(0x203, "04") == ["083: 10 82 11 00 00 00 00 00"]
    assert bench.frame(0x203, "") == []
    assert bench.state() == "SWITCH ON DISABLED"
    assert "083: 00 00 00 00 00 00 00 00" in bench.frame(0x203, "06 00")
    assert bench.state() == "READY"
    assert "083: 20 82 11 00 00 00 00 00" in bench.frame(0x203, "07 00 00")  # too long: told, but used
    assert bench.state() == "SWITCHED ON"


def test_an_unsupported_mode_by_pdo_is_ignored(bench):
    map_rpdo(bench, [0x60600008])
    start(bench)
    bench.frame(0x203, "02")
    assert bench.read(0x6061, 0, "i8") == 0
    bench.frame(0x203, "01")
    assert bench.read(0x6061, 0, "i8") == 1


NO_OBJECT, NOT_MAPPABLE, TOO_LONG, UNSUPPORTED, VALUE = 0x06020000, 0x06040041, 0x06040042, 0x06010000, 0x06090030


@pytest.mark.parametrize(
    ("entry", "code"),
    [
        (0x60410010, 0),
        (0x60410008, NOT_MAPPABLE),  # wrong width
        (0x10180120, NOT_MAPPABLE),
        (0x12340010, NO_OBJECT),
        (0x60410110, NO_OBJECT),
    ],
)
def test_what_may_be_mapped(bench, entry, code):
    bench.write(0x1801, 1, "u32", 0x283 | OFF)
    bench.write(0x1A01, 0, "u8", 0)
    assert bench.write(0x1A01, 1, "u32", entry) == code


def test_order_of_mapping_is_enforced(bench):
    assert bench.write(0x1A00, 0, "u8", 0) == UNSUPPORTED  # the PDO is on
    assert bench.write(0x1800, 1, "u32", 0x1C3) == VALUE  # moved while on
    assert bench.write(0x1800, 1, "u32", 0x1C3 | OFF) == 0
    assert bench.write(0x1A00, 1, "u32", 0x60640020) == UNSUPPORTED  # subindex 0 is not 0
    assert bench.write(0x1A00, 0, "u8", 0) == 0
    assert [bench.write(0x1A00, sub, "u32", 0x60640020) for sub in (1, 2, 3)] == [0, 0, 0]
    assert bench.write(0x1A00, 0, "u8", 3) == TOO_LONG  # 96 bits
    assert bench.write(0x1A00, 0, "u8", 9) == NO_OBJECT
    assert bench.write(0x1A00, 0, "u8", 4) == NO_OBJECT  # nothing there
    assert bench.write(0x1A00, 0, "u8", 2) == 0
    assert bench.write(0x1800, 2, "u8", 241) == VALUE
    assert bench.write(0x1800, 2, "u8", 253) == VALUE
    assert bench.write(0x1800, 1, "u32", 0x603) == VALUE  # restricted identifier
    assert bench.write(0x1800, 1, "u32", 0x1C3) == 0
    bench.write(0x1800, 2, "u8", 1)
    start(bench)
    assert bench.frame(0x080, "") == ["1c3: e8 03 00 00 e8 03 00 00"]


def test_only_writable_objects_into_an_rpdo(bench):
    bench.write(0x1400, 1, "u32", 0x203 | OFF)
    bench.write(0x1600, 0, "u8", 0)
    assert bench.write(0x1600, 1, "u32", 0x60410010) == NOT_MAPPABLE
    assert bench.write(0x1600, 1, "u32", 0x60400010) == 0
