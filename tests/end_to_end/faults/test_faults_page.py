"""docs/faults.md is what the tests say."""

import runpy
from pathlib import Path

ROOT = Path(__file__).parents[3]


def test_the_page_is_current():
    faults = runpy.run_path(str(ROOT / "docs" / "faults.py"))
    rows = faults["rows"]()
    assert len({row.fault for row in rows}) == len(rows) >= 40
    assert faults["PAGE"].read_text(encoding="utf-8") == faults["page"](rows), "make outputs"
