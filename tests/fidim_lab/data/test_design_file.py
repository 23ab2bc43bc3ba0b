"""A design is a plan: as `fidim design --json` writes it, and as others may."""

import json

import numpy as np
import pytest

from fidim_lab.data.design_file import read_plan_or_design
from fidim_lab.data.plan_file import write_plan
from fidim_lab.data.records import Role
from fidim_lab.errors import FileError

DESIGN = {
    "format": "fidim-design/1",
    "criterion": "C",
    "C": 4.4,
    "starts": [{"C": 5.1, "seconds": 0.9}],
    "seconds": 80.0,
    "equilibria": [
        {
            "lengths": [1.30283, 1.39119, 1.52772, 1.41231],
            "displacement": [0.031, -0.012],
            "position": [1.27, -0.17, -0.32],
            "tension": [22.0, 181.0],
            "conditioning": 14.0,
        }
    ],
    "predicted_sd": {"s_x": 2e-6},
}


def written(folder, changes=None, name="best.json"):
    file = folder / name
    file.write_text(json.dumps({**DESIGN, **(changes or {})}), encoding="utf-8")
    return file


def test_a_design_is_a_plan(tmp_path):
    plan = read_plan_or_design(written(tmp_path), 4)
    (window,) = plan.windows
    assert (plan.name, window.id, window.role) == ("best", "d01", Role.IDENTIFY)
    np.testing.assert_array_equal(window.displacement, [0.031, -0.012])
    write_plan(tmp_path / "plan.toml", plan)
    again = read_plan_or_design(tmp_path / "plan.toml", 4)
    np.testing.assert_allclose(again.windows[0].lengths, window.lengths)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"format": "fidim-design/2"}, "format: is 'fidim-design/2'; this version reads \"fidim-design/1\""),
        ({"equilibria": []}, "equilibria"),
        ({"equilibria": [{**DESIGN["equilibria"][0], "lengths": [1.0]}]}, "1 values for a robot of 4 cables"),
        ({"equilibria": [{**DESIGN["equilibria"][0], "lengths": [1.0, -1.0, 1.0, 1.0]}]}, "equilibria 1, lengths 2"),
        ({"equilibria": [{"lengths": [1.0] * 4}]}, "displacement: is missing"),
        ({"colour": "red"}, "colour: unknown key"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, changes, says):
    with pytest.raises(FileError) as caught:
        read_plan_or_design(written(tmp_path, changes), 4)
    assert says in str(caught.value)


@pytest.mark.parametrize("text", ["[1, 2]", "{", "null"])
def test_what_is_no_design(tmp_path, text):
    (tmp_path / "x.json").write_text(text, encoding="utf-8")
    with pytest.raises(FileError, match=r"x\.json"):
        read_plan_or_design(tmp_path / "x.json", 4)
