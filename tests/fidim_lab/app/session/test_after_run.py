"""A stopped run on an overloaded computer: the probable cause and the cure are said; otherwise nothing."""

import json
from pathlib import Path

import pytest

from fidim_lab.app.formats.run_spec import RunSpec
from fidim_lab.app.session.after_run import load_advice

REHEARSAL = RunSpec(plan=Path("/p"), rig=Path("/r"), out=Path("my runs/r1"), embedded=True)


def test_the_load_is_named_with_what_to_do() -> None:
    first, *_, last = load_advice(REHEARSAL, 3, load=9.13, cores=2)
    assert first.startswith("This computer was busy, too: in the last minute 9.1 processes competed for its 2 cores")
    assert "simulated drives run on it" in first
    assert last == "    fidim resume 'my runs/r1'"
    assert "simulated" not in load_advice(REHEARSAL.model_copy(update={"embedded": False}), 3, load=9.13, cores=2)[0]


def test_nothing_is_said_of_an_idle_computer_or_of_a_run_that_no_guard_stopped() -> None:
    assert load_advice(REHEARSAL, 3, load=1.9, cores=2) == ()
    assert load_advice(REHEARSAL, 1, load=9.0, cores=2) == ()
    assert load_advice(REHEARSAL, 2, load=9.0, cores=2) == ()


@pytest.mark.parametrize(
    ("reason", "told"),
    [
        ("The stale winch guard stopped the run while recording i01: winch 2 has sent nothing for 0.3 s.", True),
        ("winch 1: did not start its move within 3 s of the others.", True),
        ("The emergency stop guard stopped the run: somebody pressed F12.", False),
    ],
)
def test_it_is_not_blamed_for_what_a_person_did(reason: str, told: bool, tmp_path: Path) -> None:
    (tmp_path / "summary.json").write_text(json.dumps({"reason": reason}))
    spec = REHEARSAL.model_copy(update={"out": tmp_path})
    assert bool(load_advice(spec, 3, load=9.0, cores=2)) is told
