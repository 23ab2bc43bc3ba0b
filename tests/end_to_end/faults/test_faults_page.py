"""docs/faults.md is what the tests say."""

import importlib.util
from pathlib import Path

ROOT = Path(__file__).parents[3]


def test_the_page_is_current():
    spec = importlib.util.spec_from_file_location("docs_faults", ROOT / "docs" / "faults.py")
    faults = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(faults)
    rows = faults.rows()
    assert len({row.fault for row in rows}) == len(rows) >= 40
    assert faults.PAGE.read_text(encoding="utf-8") == faults.page(rows), "make outputs"
