"""Ten takes of the paper's robot: what nobody hid, and no model follows to the noise."""

from pathlib import Path

import pytest

from fidim_lab.data.campaign import read_campaign
from fidim_lab.mismatch.conclusion.explanation import Verdict
from fidim_lab.mismatch.explain import explain

CASE = "cases/explain/grab-6-and-4-takes"
NEVER = {"air-drag-linear", "air-drag-quadratic", "loose-mass", "periodic-force", "umbilical", "hand-contact"}
"""what the study of these takes rules out (GRAB.md, beside the recordings)"""


@pytest.mark.slow
@pytest.mark.shared
def test_dissipation_of_rotation_and_geometry_are_named_and_nothing_else(shared: Path):
    told = explain(read_campaign(shared / CASE))
    assert told.verdict is Verdict.PARTLY_EXPLAINED
    first, *others = told.effects
    assert first.id == "attachment-friction"
    assert "swivel-friction" in first.equivalent_to
    assert not first.single
    assert {cause.id for cause in others} <= {"anchor-offset", "attachment-offset"}
    assert not NEVER & {cause.id for cause in told.effects}
    assert told.rms_mm.before is not None
    assert told.rms_mm.after is not None
    assert told.rms_mm.after < 0.5 * told.rms_mm.before
