"""RIG.home.toml: what is written is read, and the rig's lengths go by it."""

import shutil
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fidim_lab.data.rigs.home_file import WinchHome, home_path, read_homes, write_homes
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.errors import FileError, HardwareError

SIMULATED = Path(__file__).parents[3] / "examples" / "rigs" / "simulated.toml"
HOME = WinchHome(
    node_id=2,
    vendor_id=77,
    product_code=88,
    serial_number=99,
    home_count=-1234,
    home_length=1.4567,
    at="2026-11-21T17:00:00+00:00",
    last_count=5678,
)


@pytest.fixture
def rig(tmp_path):
    shutil.copy(SIMULATED, tmp_path / "rig.toml")
    return tmp_path / "rig.toml"


def test_a_rig_without_one_goes_by_its_own(rig):
    assert read_homes(rig) == {}
    assert read_rig(rig).winches[1].home_length == 1.5


def test_the_winches_it_names_go_by_it(rig):
    write_homes(rig, {"winch 2": HOME})
    first, second, *_ = read_rig(rig).winches
    assert (second.home, second.home_count, second.home_length) == (HOME, -1234, 1.4567)
    assert (first.home, first.home_length) == (None, 1.5)


@given(
    st.dictionaries(
        st.text(st.characters(exclude_categories=("Cc", "Cf", "Cs", "Zl", "Zp")), min_size=1, max_size=10),
        st.builds(
            WinchHome,
            node_id=st.integers(1, 126),
            vendor_id=st.integers(0, 2**32 - 1),
            product_code=st.integers(0, 2**32 - 1),
            serial_number=st.integers(0, 2**32 - 1),
            home_count=st.integers(-(2**31), 2**31 - 1),
            home_length=st.floats(1e-3, 1e3),
            at=st.just("2026-11-21T17:00:00+00:00"),
            last_count=st.none() | st.integers(-(2**31), 2**31 - 1),
        ),
        max_size=4,
    )
)
def test_whatever_is_written_is_read(tmp_path_factory, homes):
    rig = tmp_path_factory.mktemp("home") / "rig.toml"
    write_homes(rig, homes)
    assert read_homes(rig) == homes


def test_a_spoilt_one_is_named(rig):
    write_homes(rig, {"winch 2": HOME})
    path = home_path(rig)
    path.write_text(path.read_text().replace("home_count = -1234", "home_count = 3.5"))
    with pytest.raises(FileError, match=r"rig\.home\.toml: winch 1, home_count"):
        read_rig(rig)


def test_a_disk_that_does_not_take_it(tmp_path):
    with pytest.raises(HardwareError, match="cannot be written"):
        write_homes(tmp_path / "no folder" / "rig.toml", {"winch 2": HOME.model_copy(update={"last_count": None})})
