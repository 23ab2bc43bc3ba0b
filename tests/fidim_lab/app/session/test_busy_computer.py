"""A stopped run on an overloaded computer: the probable cause and the cure are said; otherwise nothing."""

from pathlib import Path

from fidim_lab.app.service.spec import RunSpec
from fidim_lab.app.session.busy_computer import load_advice

REHEARSAL = RunSpec(plan=Path("/p"), rig=Path("/r"), out=Path("my runs/r1"), embedded=True)


def test_the_load_is_named_with_what_to_do() -> None:
    first, *_, last = load_advice(REHEARSAL, 3, load=9.13, cores=2)
    assert first.startswith("This computer is overloaded: in the last minute 9.1 processes wanted its 2 cores.")
    assert "simulated drives share it" in first
    assert last == "    fidim resume 'my runs/r1'"
    assert "simulated" not in load_advice(REHEARSAL.model_copy(update={"embedded": False}), 3, load=9.13, cores=2)[0]


def test_nothing_is_said_of_an_idle_computer_or_of_a_run_that_no_guard_stopped() -> None:
    assert load_advice(REHEARSAL, 3, load=1.9, cores=2) == ()
    assert load_advice(REHEARSAL, 1, load=9.0, cores=2) == ()
    assert load_advice(REHEARSAL, 2, load=9.0, cores=2) == ()
