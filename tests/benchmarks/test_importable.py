"""Benchmarks run by hand still find what they import."""

from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MODULES = sorted(
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for path in (ROOT / "benchmarks").rglob("*.py")
    if path.name != "__main__.py"
)


@pytest.mark.parametrize("name", MODULES)
def test_a_benchmark_can_be_imported(name: str) -> None:
    try:
        import_module(name)
    except ModuleNotFoundError as missing:
        if (missing.name or "").partition(".")[0] in {
            "benchmarks",
            "drivers",
            "fidim_lab",
            "procedures",
            "sim_backends",
        }:
            raise
        pytest.skip(f"needs {missing.name}")
