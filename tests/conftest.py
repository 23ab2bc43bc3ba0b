"""What all tests share: where recordings lie beside the checkout, and a robot to work on."""

from pathlib import Path

import pytest

from fidim_lab.data.records import Robot
from fidim_lab.data.robot_file import read_robot

ROOT = Path(__file__).parents[1]
SHARED = ROOT.parent / "shared"


@pytest.fixture(scope="session")
def irma4() -> Robot:
    """The four-cable robot of the paper's Table 1."""
    return read_robot(ROOT / "fidim_lab" / "data" / "robots" / "irma4.toml")


@pytest.fixture(scope="session")
def irma4_file() -> Path:
    return ROOT / "fidim_lab" / "data" / "robots" / "irma4.toml"


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder with recordings; tests that need it are skipped where it is absent."""
    if not SHARED.is_dir():
        pytest.skip(f"{SHARED} is absent: its recordings never enter the project")
    return SHARED
