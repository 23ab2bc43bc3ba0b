"""What a robot waits for when its service is started or resumed: nothing that this needs not is imported."""

import subprocess
import sys

HEAVY = (
    "scipy",
    "pandas",
    "matplotlib",
    "pyarrow",
    "textual",
    "mujoco",
    "distributed",
    "fidim_lab.mismatch.online_monitor",
)
SAYS = f"""
import sys
import fidim_lab.app.service.main
print(*(name for name in {HEAVY!r} if name in sys.modules))
"""


def test_the_service_starts_without_what_it_does_not_need():
    done = subprocess.run([sys.executable, "-c", SAYS], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.split() == []
