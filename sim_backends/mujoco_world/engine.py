"""MuJoCo itself, imported when it is first needed: it is no dependency of fidim-lab."""

import importlib
from typing import Any

from fidim_lab.errors import SetupError


def engine() -> Any:
    """The `mujoco` module. Raises SetupError where it is not installed."""
    try:
        return importlib.import_module("mujoco")
    except ImportError as error:
        raise SetupError(
            f"The mujoco backend needs MuJoCo, which is not installed here ({error}).",
            hint="pip install mujoco, in the environment of fidim; or take --backend native.",
        ) from error
