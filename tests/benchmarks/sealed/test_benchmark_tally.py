"""What is outside the catalogue, counted by how loud it is."""

import pytest

from benchmarks.sealed.cases import SecretKind
from benchmarks.sealed.scoring import Marked
from benchmarks.sealed.tally import ScoredCampaign, Tally
from benchmarks.sealed.words import page


def outside(excess: float | None, grade: Marked, after: float) -> ScoredCampaign:
    return ScoredCampaign(
        name="b0001",
        kind=SecretKind.OUTSIDE,
        label=("unknown",),
        hidden=({"id": "unknown-cubic", "size": 1.0, "unit": "N s³/m³", "hide": "unknown-cubic:c=1"},),
        cable=None,
        named="unknown-physics",
        named_ids=(),
        grade=grade,
        why="",
        chi2_excess=excess,
        faintest=excess,
        rms_mm=None,
        held_out=(3.0, after),
        errors=None,
        cpu=1.0,
        backend="native",
    )


@pytest.fixture
def tally() -> Tally:
    return Tally(
        (
            outside(5000.0, Marked.RIGHT, 1.5),
            outside(2000.0, Marked.RIGHT, 2.9),
            outside(1000.0, Marked.WRONG, 1.0),
            outside(20.0, Marked.WRONG, 1.0),
        )
    )


def test_what_is_too_faint_to_be_seen_is_counted_apart(tally: Tally) -> None:
    bands = tally.table["outside"]["bands"]
    assert bands["≥ 1000"] == {"right": 2, "wrong": 1}
    assert bands["< 100"] == {"wrong": 1}
    assert bands["100 – 1000"] == {}
    assert tally.outside.good == 2
    assert tally.halved.good == 1


def test_the_page_says_so(tally: Tally) -> None:
    lines = page(tally, "fidim benchmark explain", "00").splitlines()
    (loud,) = (line for line in lines if line.startswith("| ≥ 1000 | 3 | 2/3"))
    assert "1/2 = 50.0 %" in loud
    (faint,) = (line for line in lines if line.startswith("| < 100 | 1 | 0/1"))
    assert faint
