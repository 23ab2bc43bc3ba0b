"""Record, explain, and record the most informative windows, until the verdict is clear or cannot become so.

The plan's windows come first (some of them with the role `validate`, on which explanations are judged), then at most
`FURTHER` windows that the explanation itself asks for. How it explains is not known here: the step `Explain` says.
`compare` has windows displaced as `identify` does, `compare_by_winches` as `excite`: no hand, no prompt.
"""

import numpy as np

from fidim_lab.data.records import PlannedWindow, Role
from fidim_lab.errors import InfeasibleError
from procedures.outcomes import Outcome
from procedures.protocols.beginning import begin
from procedures.protocols.enough import windows_of
from procedures.protocols.experiment import Lab
from procedures.protocols.identify import WindowProtocol
from procedures.steps import Note, Steps, Stop
from procedures.steps.compare import Clarity, Explain

FURTHER = ("more1", "more2", "more3", "more4")
"""ids of windows that are proposed"""
ESTIMATE = 90.0
"""s of an explanation"""


def compare(lab: Lab) -> Steps:
    """The steps."""
    return _compare(lab, WindowProtocol(lab))


def compare_by_winches(lab: Lab) -> Steps:
    """The same without a hand."""
    from procedures.protocols.excite import ExciteProtocol  # scipy's optimizers: nobody else waits for them

    return _compare(lab, ExciteProtocol(lab))


def _compare(lab: Lab, protocol: WindowProtocol) -> Steps:
    at = yield from begin(lab.robot.n, lab.settings, attended=protocol.attended)
    at, swinging = yield from windows_of(lab.plan, protocol, at, lab.recorded, lab.swings)
    left = [id_ for id_ in FURTHER if id_ not in lab.done]
    while True:
        found = yield Explain(number=len(FURTHER) - len(left) + 1, estimate=ESTIMATE)
        if found.answer == Clarity.CLEAR:
            yield Note(remark="the verdict is clear")
            return
        if found.answer != Clarity.UNCLEAR or not left:
            more = f" {len(FURTHER)} further windows have been recorded; a person must decide how to continue."
            yield Stop(outcome=Outcome.FAIL, reason=f"The verdict is not clear: {found.reason}{'' if left else more}")
        id_ = left.pop(0)
        yield Note(window=id_, remark="recorded because the verdict is not clear yet")
        try:
            at, swinging = yield from protocol.window(proposed(id_, lab.robot.n, found.values), at, swinging)
        except InfeasibleError as refusal:  # no safe way from here; the next look proposes another
            yield Note(window=id_, remark=refusal.message)


def proposed(id_: str, n: int, values: tuple[float, ...]) -> PlannedWindow:
    """The window that the values of `Explain` describe: n lengths, two of displacement, three of the marker's place."""
    lengths, displacement, position = np.split(np.array(values), [n, n + 2])
    return PlannedWindow(id_, Role.IDENTIFY, lengths, displacement, position)
