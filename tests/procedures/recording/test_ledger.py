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


def test_a_procedure_that_records_nothing_is_not_told_as_one_that_failed(tmp_path: Path):
    ledger = Ledger(tmp_path, dict.fromkeys(("i01", "i02", "i03"), Role.IDENTIFY))
    for window in ("i01", "i02"):
        reason = f"it hangs at {window}"
        ledger.take(GiveUp(window=window, outcome=Outcome.PASS, reason=reason), Result(reason=reason), 0.0)
    says = "2 of 3 places done; nothing was to be recorded"
    assert ledger.reason == f"{says}. i01: it hangs at i01. i02: it hangs at i02. i03: not reached."


def test_windows_that_were_tried_in_vain_stay_unaccepted(tmp_path: Path):
    ledger = Ledger(tmp_path, {"i01": Role.IDENTIFY})
    ledger.take(GiveUp(window="i01", outcome=Outcome.FAIL, reason="a"), Result(Outcome.FAIL, reason="too small"), 0.0)
    assert ledger.reason == "0 of 1 windows accepted. i01: too small."
