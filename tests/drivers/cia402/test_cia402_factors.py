"""What drives tell of polarity, gear, feed and encoder, against a rig file's numbers."""

import pytest

from drivers.cia402.bring_up.factors import factor_checks
from fidim_lab.errors import DeviceError

MOTOR, GEAR = 4096.0, 5.0
"""counts for one turn of the motor; its turns for one of the drum"""


def ratio(index, above, below=1):
    return {(index, 1): above, (index, 2): below}


ENCODER, GEARED = ratio(0x608F, 4096), ratio(0x6091, 5)
FED = ratio(0x6092, 20480) | GEARED
CASES = {
    "nothing told": ({}, None),
    "defaults of a factory": (ratio(0x608F, 1) | ratio(0x6091, 1) | ratio(0x6092, 1) | ratio(0x6093, 1), None),
    "zeros": (ratio(0x608F, 0, 0) | ratio(0x6092, 0, 0), None),
    "all right": ({(0x607E, 0): 0} | ENCODER | FED, None),
    "reversed": ({(0x607E, 0): 0xC0}, "607E:0"),
    "position reversed alone": ({(0x607E, 0): 0x80}, "607E:0"),
    "other bits of polarity": ({(0x607E, 0): 0x3F}, None),
    "gear doubled": (ENCODER | ratio(0x6091, 10), "6091:1"),
    "feed doubled": (ENCODER | ratio(0x6092, 8192), "6092:1"),
    "feed in the drum's turns": (ENCODER | FED, None),
    "encoder of four times the lines": (ratio(0x608F, 16384), "608F:1"),
    "encoder in several turns": (ratio(0x608F, 12288, 3), None),
    "position factor makes it right": (ratio(0x608F, 8192) | ratio(0x6093, 2), None),
    "position factor makes it wrong": (ENCODER | ratio(0x6093, 2), "608F:1"),
    "user units by 60A8, encoder finer": (ratio(0x608F, 2000) | {(0x60A8, 0): 0xFF410000}, None),
    "increments by 60A8": (ratio(0x608F, 2000) | {(0x60A8, 0): 0x00B50000}, "608F:1"),
    "feed counts, not the encoder": (ratio(0x608F, 65536) | ratio(0x6092, 4096), None),
}


@pytest.mark.parametrize("case", CASES)
def test_what_a_drive_tells_of_its_mechanics(config, case):
    told, wrong = CASES[case]
    checks = factor_checks(told, config(counts_per_turn=MOTOR * GEAR, motor_counts=MOTOR))
    assert [check.object for check in checks if not check.ok] == ([wrong] if wrong else [])


@pytest.mark.parametrize(("polarity", "ok"), [(0x00, False), (0x40, False), (0xC0, True)])
def test_a_drive_that_is_reversed_with_the_rig_files_knowledge(config, polarity, ok):
    (check,) = factor_checks({(0x607E, 0): polarity}, config(reversed=True))
    assert check.ok is ok


@pytest.mark.parametrize(
    ("objects", "says"),
    [
        ({(0x607E, 0): (0xC0, 1)}, "607E:0 polarity.*0xC0 found, 0x00 wanted"),
        ({(0x6092, 1): (40000, 4), (0x6092, 2): (1, 4)}, "counts for one turn.*40000 found, 20000 wanted"),
    ],
)
def test_bring_up_refuses_power_to_another_mechanics(on_bench, objects, says):
    async def script(bench):
        bench.drive.objects |= objects
        with pytest.raises(DeviceError, match=says):
            await bench.ready()
        assert bench.drive.controlwords == []

    on_bench(script)


def test_a_drive_without_these_objects_is_not_asked_for_them(on_bench):
    async def script(bench):
        await bench.ready()

    on_bench(script)
