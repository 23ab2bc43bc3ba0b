"""Plan files: what is wrong is named by file, window and key, once."""

from pathlib import Path

import pytest

from fidim_lab.data.plan_file import read_plan
from fidim_lab.errors import FileError

HEAD = 'format = "fidim-plan/1"\nname = "p"\n'
WINDOW = """
[[window]]
id = "{id}"
lengths = [1.3, 1.4, 1.5, 1.4]
displacement = [-0.02, 0.03]
position = [1.111, -0.271, -0.315]
"""


@pytest.fixture
def changed(tmp_path: Path):
    """A plan of twelve windows with a text replaced in all of them."""

    def change(old: str, new: str) -> Path:
        text = HEAD + "".join(WINDOW.format(id=f"w{number}") for number in range(1, 13))
        assert old in text
        path = tmp_path / "plan.toml"
        path.write_text(text.replace(old, new))
        return path

    return change


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            "displacement",
            "displace",
            "window 1, displacement: is missing (the same in 11 more); "
            "window 1, displace: unknown key; the nearest is displacement (the same in 11 more)",
        ),
        (
            "lengths",
            "colour = 1\nlengths",
            "window 1, colour: unknown key; allowed are id, role, lengths, displacement, position, pose (the same in ",
        ),
        (
            "[-0.02, 0.03]",
            "[-0.02]",
            "window 1, displacement: 1 number is too few, 2 are wanted (the same in 11 more)",
        ),
        ("[1.3, ", "[1300, ", "window 1, lengths: holds 1300, which would be metres. Divide millimetres by 1000"),
        ("[1.111,", "[1111,", "window 1, position: holds 1111, which would be metres"),
        ('name = "p"', 'nam = "p"', "nam: unknown key; the nearest is name"),
        ("[1.3, ", "[-1.3, ", "lengths 1: -1.3; more than 0 is allowed (the same in 11 more)"),
        ('"w2"', '"../x"', "window 2, id: '../x' cannot be a file name; use letters, digits, _ . and -."),
        ('"w2"', '"w1"', "window 2, id: 'w1' occurs twice"),
        ('name = "p"', 'name = "p"\naccuracy = { s = 1.0, inertia = 1.0 }', "inertia: unknown key; allowed are s, I"),
        (
            "position = [",
            "pose = { position = [0, 0, 0], rotatoin = [0, 0, 0] }\nposition = [",
            "window 1, pose, rotatoin: unknown key; the nearest is rotation (the same in 11 more)",
        ),
    ],
)
def test_each_mistake_is_named_once_and_with_its_file(changed, old: str, new: str, says: str):
    path = changed(old, new)
    with pytest.raises(FileError) as caught:
        read_plan(path, 4)
    assert str(caught.value).startswith(f"{path}: ")
    assert says in str(caught.value)
