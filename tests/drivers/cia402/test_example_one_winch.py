"""The example that uses a winch by itself, run as it stands, against a drive in this process."""

import runpy
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).parents[3] / "examples" / "python" / "one_winch.py"


def test_a_winch_by_itself_pays_out_and_loses_its_power(jump, plain_drive, in_process_bus):
    example = runpy.run_path(str(EXAMPLE))
    drive = plain_drive(3)
    config = example["WINCH"].changed(node_id=3, rated_current=4.0, sdo_timeout=0.05)
    before, after = jump(example["pay_out"](in_process_bus([drive]), config))
    assert before == pytest.approx(1.5)
    assert after - before == pytest.approx(0.05, abs=1e-4)
    assert drive.state == "disabled"
