import re
from pathlib import Path

import numpy as np
import pytest

from fidim_lab.data.records import Robot
from fidim_lab.data.robot_file import read_robot, write_robot
from fidim_lab.errors import FileError


def test_reads_the_papers_robot(irma4: Robot) -> None:
    assert irma4.n == 4
    assert irma4.freedoms == 2
    np.testing.assert_allclose(irma4.cables[2].d, [2.153, 0.973, 0.560])
    np.testing.assert_allclose(irma4.nominal.vector, [0, 0, 0.19, 0.051, 0.069, 0.037, 0, 0, 0])
    assert irma4.winches is not None
    # 0.12 N m/A × 10 × 0.85 / 0.03 m
    assert irma4.winches[3].newton_per_ampere == pytest.approx(34.0)


def test_written_file_reads_back_the_same(irma4: Robot, tmp_path: Path) -> None:
    write_robot(tmp_path / "r.toml", irma4, comment="two\nlines")
    back = read_robot(tmp_path / "r.toml")
    write_robot(tmp_path / "r2.toml", back, comment="two\nlines")
    assert (tmp_path / "r.toml").read_bytes() == (tmp_path / "r2.toml").read_bytes()
    assert back.winches == irma4.winches
    assert back.limits == irma4.limits
    for ours, theirs in zip(back.cables, irma4.cables, strict=True):
        for name in ("d", "a", "x", "y", "z"):
            np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('format = "fidim-robot/1"', 'format = "fidim-robot/2"', "format: is 'fidim-robot/2'"),
        ('format = "fidim-robot/1"', "", "format: is missing"),
        (
            'format = "fidim-robot/1"',
            'format = "fidim-plan/1"',
            "format: is 'fidim-plan/1'; another kind of file; \"fidim-robot/1\" is wanted here",
        ),
        ("mass = 11.0", "mass = -1", "platform, mass: -1; more than 0 is allowed"),
        ("mass = 11.0", "mass = 11.0\ncolour = 1", "platform, colour: unknown key"),
        ("mass = 11.0", "", "platform, mass: is missing"),
        ("d = [0.0532, 0.796, 0.532]", "d = [0.0532, 0.796]", "cable 4, d: 2 numbers are too few, 3 are wanted"),
        ("nominal_com = [", "nominal_com = [0.0] #", "platform, nominal_com: 1 number is too few, 3 are wanted"),
        ("x = [0, -1, 0]", "x = [0, 1, 0]", "cable 3: x × y is not z"),
        ("x = [0, -1, 0]", "x = [0, -1, 0.1]", "cable 3: x, y, z are not unit vectors"),
        (
            "x = [0, -1, 0]",
            "x = [0, -0.99, 0.05]",
            "cable 3: x, y, z are not unit vectors at right angles; by z and x: "
            "x = [0, -0.9987271, 0.05044076], y = [0, -0.05044076, -0.9987271], z = [1, 0, 0]",
        ),
        ("tension = [20.0, 200.0]", "tension = [200.0, 20.0]", "limits: tension: the lower limit 200.0 N"),
        ("mass = 11.0", "mass = [", "is not TOML"),
        ("efficiency = 0.85", "efficiency = 1.2", "efficiency"),
    ],
)
def test_each_mistake_is_named(irma4_file: Path, tmp_path: Path, old: str, new: str, expected: str) -> None:
    text = irma4_file.read_text()
    assert old in text
    path = tmp_path / "bad.toml"
    path.write_text(text.replace(old, new))
    with pytest.raises(FileError, match=re.escape(expected)) as error:
        read_robot(path)
    assert str(path) in str(error.value)


def test_axes_rounded_to_three_digits_are_squared(irma4_file: Path, tmp_path: Path) -> None:
    path = tmp_path / "rounded.toml"
    text = irma4_file.read_text()
    exact = "x = [0, -1, 0]\ny = [0, 0, -1]"
    assert text.count(exact) == 1
    path.write_text(text.replace(exact, "x = [0, -0.999, 0.05]\ny = [0, -0.05, -0.999]"))
    cable = read_robot(path).cables[2]
    axes = np.array([cable.x, cable.y, cable.z])
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.cross(cable.x, cable.y), cable.z, atol=1e-12)
    np.testing.assert_allclose(cable.x, [0, -0.999, 0.05], atol=1e-3)


def test_all_mistakes_are_reported_at_once(irma4_file: Path, tmp_path: Path) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(irma4_file.read_text().replace("mass = 11.0", "mas = 11.0").replace("gear_ratio", "gear"))
    with pytest.raises(FileError) as error:
        read_robot(path)
    for place in ("platform, mass: is missing", "platform, mas: unknown key", "gear"):
        assert place in str(error.value)


def test_a_missing_file_is_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="no such file"):
        read_robot(tmp_path / "none.toml")
    with pytest.raises(FileError, match="is a folder"):
        read_robot(tmp_path)
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileError, match="not UTF-8"):
        read_robot(tmp_path / "binary")
