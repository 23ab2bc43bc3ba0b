"""What all tests share: where recordings lie beside the checkout, and a robot to work on."""

import os
import shutil
import signal
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from fidim_lab.data.records import Body, Cable, Limits, Robot
from fidim_lab.data.robot_file import read_robot

ROOT = Path(__file__).parents[1]
SHARED = ROOT.parent / "shared"

# Time that an example takes says more of what else the computer does than of the code.
settings.register_profile("busy computer", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("busy computer")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "fault(area, fault, …): a row of docs/faults.md, which the test asserts")
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # started in a shell's background: tests press Ctrl-C
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Cases of a sampled test beyond its first n are slow, so that `-m "not slow"` leaves them to `make bench`."""
    seen = Counter[str]()
    for item in items:
        mark = item.get_closest_marker("sampled")
        if mark is not None:
            name = item.nodeid.split("[")[0]
            seen[name] += 1
            if seen[name] > mark.args[0]:
                item.add_marker("slow")


@pytest.fixture(scope="session", autouse=True)
def own_services() -> Iterator[None]:
    """Services of tests lie apart: `fidim stop` stops all of a user's, and somebody may be at a robot."""
    folder = tempfile.mkdtemp(prefix="ft")
    os.environ["FIDIM_RUNTIME_DIR"] = folder
    yield
    shutil.rmtree(folder, ignore_errors=True)


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


CableRing = Callable[..., Robot]


def _cable_ring(n: int, radius: float = 0.02) -> Robot:
    """A bifilar, a trifilar, or a robot of n cables from a wide ring of anchors; every pulley stands upright."""
    turns = 2 * np.pi * np.arange(n) / n + 0.2
    wide, inner, height = {2: (0.6, 0.15, 1.0), 3: (0.3, 0.28, 1.5)}.get(n, (1.2, 0.2, 1.0))
    cables = []
    for k, turn in enumerate(turns):
        # Neither symmetric nor all through one point: such a robot has dependent cables.
        skewed = turn + (0.1 * k + 0.5 * (-1) ** k if n > 3 else 0.02 * k)
        out = np.array([np.cos(turn), np.sin(turn), 0.0])
        z = np.array([np.sin(turn), -np.cos(turn), 0.0])
        a = np.array([inner * np.cos(skewed), inner * np.sin(skewed), (0.25 if n != 3 else 0.05) + 0.03 * k])
        d = wide * out + np.array([0.0, 0.0, height + 0.02 * k])
        cables.append(Cable(d=d, a=a, radius=radius, x=-out, y=np.cross(z, -out), z=z))
    return Robot(
        cables=tuple(cables),
        mass=12.0,
        nominal=Body(np.array([0.0, 0.0, 0.1]), np.array([0.05, 0.06, 0.04, 0.0, 0.0, 0.0])),
        marker=np.array([0.02, 0.01, 0.0]),
        limits=Limits(tension=(10.0, 250.0), free_displacement=(0.15, 0.15)),
    )


@pytest.fixture(scope="session")
def cable_ring() -> CableRing:
    """Robots of n = 2…5 cables: `cable_ring(n, radius=0.02)`."""
    return _cable_ring
