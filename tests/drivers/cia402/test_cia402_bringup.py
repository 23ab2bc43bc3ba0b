from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from drivers.cia402.dictionary import DriveFamily, Met, TrialPassed
from drivers.cia402.dictionary.requirements import Trial
from fidim_lab.errors import DeviceError

OnBench = Callable[..., None]


def test_everything_is_written_and_read_back(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.winch.configure()
        drive = bench.drive
        assert drive.state == "disabled"
        assert drive.nmt == 0x05
        assert {(0x605A): drive.get(0x605A), 0x605E: drive.get(0x605E), 0x6007: drive.get(0x6007)} == {
            0x605A: 6,
            0x605E: 2,
            0x6007: 3,
        }
        assert drive.get(0x1016, 1) == 127 << 16 | 250
        assert [drive.get(0x1A00, n) for n in range(4)] == [3, 0x60410010, 0x60640020, 0x60610008]
        assert [drive.get(0x1A01, n) for n in range(3)] == [2, 0x606C0020, 0x60780010]
        assert [drive.get(0x1600, n) for n in range(4)] == [3, 0x60400010, 0x60600008, 0x607A0020]
        assert drive.get(0x6061) == 1
        assert all(check.ok for check in bench.winch.checks)
        assert {"605A:0", "1018:1", "607D:1"} <= {check.object for check in bench.winch.checks}

    on_bench(script, vendor_id=77, product_code=88, serial_number=99)


def test_pdos_that_we_do_not_use_are_switched_off(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        bench.drive.put(0x1802, 0x40000383, sub=1)
        await bench.winch.configure()
        assert bench.drive.get(0x1802, 1) == 0xC0000383

    on_bench(script)


@pytest.mark.parametrize(
    ("index", "sub", "value", "complaint"),
    [
        (0x1000, 0, 0x20191, "1000:0 device profile: 0x20191 found, 0x192 in the bits 0xFFFF wanted"),
        (0x1005, 0, 0x40000080, "1005:0 SYNC identifier"),
        (0x1018, 1, 78, "1018:1 vendor: 78 found, 77 wanted"),
        (0x1018, 4, 98, "1018:4 serial number: 98 found, 99 wanted"),
        (0x6502, 0, 0x1A4, "6502:0 profile position mode supported"),
        (0x6075, 0, 4500, "6075:0 rated current, mA: 4500 found, 4000 wanted"),
    ],
)
def test_the_wrong_drive_is_refused(on_bench: OnBench, index: int, sub: int, value: int, complaint: str) -> None:
    async def script(bench: Any) -> None:
        bench.drive.put(index, value, sub=sub)
        with pytest.raises(DeviceError, match=r"winch 3 \(node 3\): refused") as caught:
            await bench.winch.configure()
        assert complaint in str(caught.value)
        assert bench.drive.get(0x605A) == 0, "nothing is written to a drive that is not ours"

    on_bench(script, vendor_id=77, serial_number=99)


@pytest.mark.parametrize(
    ("index", "sub"), [(0x605A, 0), (0x605E, 0), (0x6007, 0), (0x1029, 1), (0x1016, 1), (0x607D, 1), (0x6073, 0)]
)
def test_a_drive_that_keeps_its_own_value_is_refused(on_bench: OnBench, index: int, sub: int) -> None:
    async def script(bench: Any) -> None:
        bench.drive.keeps.add((index, sub))
        with pytest.raises(DeviceError, match=rf"{index:04X}:{sub} .* 0 found, .* wanted"):
            await bench.winch.configure()
        with pytest.raises(DeviceError, match="not configured"):
            await bench.winch.enable()
        assert bench.drive.nmt == 0x7F

    on_bench(script)


def test_all_refusals_are_named_at_once_in_words(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        bench.drive.refuses = {(0x605A, 0): 0x06090030, (0x6066, 0): 0x06020000}
        with pytest.raises(DeviceError) as caught:
            await bench.winch.configure()
        text = str(caught.value)
        assert "605A:0 quick stop option: value not allowed (SDO abort 0x06090030) found, 6 wanted" in text
        assert "6066:0 following error time, ms: the drive has no such object" in text

    on_bench(script)


@pytest.mark.parametrize("entry", [(0x1A00, 2), (0x1801, 2), (0x1600, 0)])
def test_a_mapping_that_does_not_read_back_is_refused(on_bench: OnBench, entry: tuple[int, int]) -> None:
    async def script(bench: Any) -> None:
        bench.drive.keeps.add(entry)
        with pytest.raises(DeviceError, match=rf"{entry[0]:04X}:{entry[1]} PDO mapping"):
            await bench.winch.configure()

    on_bench(script)


def test_a_mapping_that_is_refused(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        bench.drive.refuses = {(0x1A01, 2): 0x06040041}
        with pytest.raises(
            DeviceError, match=r"1A01:0 PDO mapping: this object cannot be mapped .*VELOCITY \+ CURRENT"
        ):
            await bench.winch.configure()

    on_bench(script)


def test_a_mode_that_is_not_taken_is_refused(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        bench.drive.stubborn_mode = True
        with pytest.raises(DeviceError, match=r"6061:0 mode of operation: none \(0\) until .*mode_shown\) found, prof"):
            await bench.winch.configure()

    on_bench(script)


def test_a_mode_that_is_displayed_only_with_power(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        bench.drive.stubborn_mode = True
        await bench.winch.configure()
        assert any(check.found == "none (0) until it is enabled" for check in bench.winch.checks)
        begun = bench.master.clock.now()
        with pytest.raises(DeviceError, match=r"profile position \(1\) displayed \(6061\) expected within 0.05 s"):
            await bench.winch.enable()
        assert bench.drive.state == "disabled", "a drive with power in no mode may let its load go"
        assert bench.master.clock.now() - begun < 0.15

    on_bench(script, family=DriveFamily(mode_shown="enabled"))


def test_a_drive_that_has_restarted_unheard_gets_no_power(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.enabled()
        bench.drive.state = "disabled"
        bench.drive.put(0x1016, 0, 1)
        await bench.cycles(3)
        with pytest.raises(DeviceError, match=r"lost its settings.*1016:1 watch of the host's heartbeat: 0 found"):
            await bench.winch.enable()
        assert bench.drive.state == "disabled"

    on_bench(script)


def test_an_acknowledgement_that_is_high_from_the_beginning(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        await bench.winch.configure()
        bench.drive.acknowledges_early = True
        await bench.winch.enable()
        await bench.winch.move_to(1.2, 0.4, 1.0)
        assert bench.drive.goal == round(0.2 * 20000 / (2 * 3.141592653589793 * 0.03))

    on_bench(script)


def test_an_object_that_a_family_lacks_is_not_asked_for_in_moves(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        bench.drive.refuses = {(0x6084, 0): 0x06020000}
        await bench.enabled()
        await bench.winch.move_to(1.2, 0.4, 1.0)
        line = next(line for line in bench.winch.grades if line.requirement.key == "separate deceleration")
        assert (line.met, line.found) == (Met.HOST, "no 6084:0")

    on_bench(script, family=DriveFamily(absent={"6084:0": "by its EDS file"}))


LACKS = {"6007:0": "reaction to a lost host", "605A:0": "quick-stop reaction", "605E:0": "fault reaction"} | {
    "605D:0": "halt reaction",
}


def test_without_a_following_error_limit_the_host_compares(on_bench: OnBench) -> None:
    """No trial can be made where 6065 cannot be written."""

    async def script(bench: Any) -> None:
        bench.drive.refuses = {(0x6065, 0): 0x06020000}
        await bench.enabled()
        line = next(line for line in bench.winch.grades if line.requirement.key == "following-error limit")
        assert (line.met, line.found) == (Met.HOST, "no 6065:0")
        assert line.requirement.instead == "the motion guard compares encoder and command"

    on_bench(script, family=DriveFamily(absent={"6065:0": "by its EDS file"}))


@pytest.mark.parametrize("lacking", LACKS)
def test_what_cannot_be_configured_must_be_proven_by_trial(on_bench: OnBench, lacking: str) -> None:
    index = int(lacking[:4], 16)
    family = DriveFamily(absent={lacking: "for this test"})

    async def refused(bench: Any) -> None:
        bench.drive.refuses = {(index, 0): 0x06020000}
        with pytest.raises(DeviceError, match=rf"neither configured nor proven .*{LACKS[lacking]} \(no {lacking}\)"):
            await bench.winch.configure()
        assert bench.drive.get(0x6085) == 0, "nothing is written"

    async def accepted(bench: Any) -> None:
        bench.drive.refuses = {(index, 0): 0x06020000}
        await bench.enabled()

    proofs = tuple(TrialPassed(trial, 99, 0.02, 0.1, 1e-4, "A. Name", "2026-11-25") for trial in Trial)
    on_bench(refused, family=family)
    on_bench(refused, family=family, proofs=tuple(replace(proof, serial_number=98) for proof in proofs))
    on_bench(accepted, family=family, proofs=proofs)
    on_bench(accepted, family=family, on_trial=True)


@pytest.mark.parametrize("state", ["on", "enabled", "quick stop"])
def test_a_drive_with_power_is_left_alone(on_bench: OnBench, state: str) -> None:
    async def script(bench: Any) -> None:
        bench.drive.state = state
        with pytest.raises(DeviceError, match="has power already"):
            await bench.winch.configure()
        assert bench.drive.controlwords == []
        assert bench.drive.get(0x605A) == 0

    on_bench(script)


def test_a_drive_that_does_not_answer(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        bench.drive.mute = True
        with pytest.raises(DeviceError) as caught:
            await bench.winch.configure()
        assert str(caught.value) == (
            "winch 3 (node 3): no answer to SDO read of 1000:0 within 0.05 s. "
            "Is the drive powered, and is the node id right?"
        )

    on_bench(script)


def test_a_drive_without_heartbeat(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        bench.drive.heartbeat_t = 1e9
        with pytest.raises(DeviceError, match=r"PRE-OPERATIONAL expected within .*, no heartbeat"):
            await bench.winch.configure()

    on_bench(script)


def test_a_drive_that_sends_one_tpdo_only(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        bench.drive.drops_tpdo = 1
        with pytest.raises(DeviceError, match=r"no sample within 0.2 s of NMT start \(\d+ incomplete, 0 of a wrong"):
            await bench.winch.configure()

    on_bench(script)


@pytest.mark.parametrize(
    ("register", "history", "says"),
    [
        (0x10, 0x1B108130, "0x10 (communication); its last error (1003:1) is 0x8130, heartbeat or node guarding lost."),
        (0x09, 0x4310, "0x09 (temperature); its last error (1003:1) is 0x4310, temperature of the motor."),
        (0x01, None, "0x01 (generic)."),
    ],
)
def test_a_drive_that_does_not_start_while_an_error_stands(
    on_bench: OnBench, register: int, history: int | None, says: str
) -> None:
    """CANopenNode ignores NMT start until its error register is 0, and its version 1 keeps a heartbeat once missed."""

    async def script(bench: Any) -> None:
        bench.drive.starts_without_error_only = True
        bench.drive.put(0x1001, register)
        if history is not None:
            bench.drive.objects[0x1003, 1] = (history, 4)
        with pytest.raises(DeviceError) as caught:
            await bench.winch.configure()
        assert "OPERATIONAL expected within 0.4 s, PRE-OPERATIONAL by its last heartbeat" in caught.value.message
        assert caught.value.message.endswith(f"; its error register (1001) is {says}")
        assert "fidim power-off RIG --acknowledge NAME. If the error stays, switch the drive's" in caught.value.hint
        bench.drive.put(0x1001, 0)
        await bench.winch.configure()

    on_bench(script)


def test_configuring_again_forgets_what_was_latched(on_bench: OnBench) -> None:
    async def script(bench: Any) -> None:
        bench.bus.deliver(0x83, bytes.fromhex("3081110000000000"))
        assert "heartbeat" in bench.winch.link.fault(0.0)
        await bench.winch.configure()
        assert bench.winch.latest().fault == ""
        assert len(bench.winch.link.emergencies) == 1

    on_bench(script)
