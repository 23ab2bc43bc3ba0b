"""The paper's takes: what has no configuration is named, never passed over."""

from pathlib import Path

import pytest

from fidim_lab.data.importers.grab import read_grab
from fidim_lab.errors import SetupError


def test_a_take_beyond_the_known_ones_is_named(shared: Path, tmp_path: Path):
    source = shared / "recordings" / "grab"
    if not source.is_dir():
        pytest.skip(f"{source} is not here")
    for name in ("config", "markers", "logs"):
        (tmp_path / name).symlink_to(source / name)
    (tmp_path / "vicon").mkdir()
    for take in (60, 71):
        (tmp_path / "vicon" / f"v_nat_f_{take}.txt").symlink_to(source / "vicon" / "v_nat_f_60.txt")
    (takes,) = read_grab(tmp_path)
    assert [take.id for take in takes.takes] == ["k60"]
    assert "takes are 1 to 60" in takes.unread["k71"]
    with pytest.raises(SetupError, match="k71: no configuration is known for it"):
        read_grab(tmp_path, lambda number: number == 71)
