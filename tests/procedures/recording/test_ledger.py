"""What a report says of windows that are not there."""

from pathlib import Path

from fidim_lab.data.records import Role
from procedures.outcomes import Outcome
from procedures.recording.ledger import Ledger
from procedures.steps import Accept, GiveUp, Result


def test_a_reason_that_several_windows_share_is_said_once(tmp_path: Path):
    ledger = Ledger(tmp_path, dict.fromkeys(("i01", "i02", "i03", "i04"), Role.IDENTIFY))
    accept = Accept(window="i01", attempt=1, role=Role.IDENTIFY, equilibrium=(), outcome=Outcome.PASS)
    ledger.take(accept, Result(), 0.0)
    for window in ("i02", "i03"):
        reason = "not needed: it is accurate."
        ledger.take(GiveUp(window=window, outcome=Outcome.PASS, reason=reason), Result(reason=reason), 0.0)
    assert ledger.reason == "1 of 4 windows accepted. i02, i03: not needed: it is accurate. i04: not reached."
