"""A campaign of numbers that nobody swung, quick to write: for what is not about physics."""

import numpy as np
import pytest

from fidim_lab.data.records import Campaign, Role, Window
from fidim_lab.data.robot_file import read_robot


@pytest.fixture
def tiny(irma4_file) -> Campaign:
    t = np.arange(50) / 100.0
    rng = np.random.default_rng(1)
    windows = tuple(
        Window(name, role, t, rng.normal(0.0, 0.01, (50, 1, 3)), None, None, np.zeros(3))
        for name, role in (("i01", Role.IDENTIFY), ("v01", Role.VALIDATE))
    )
    return Campaign("b0001", read_robot(irma4_file), 100.0, windows)
