"""Windows one after another, until all are recorded or the plan's accuracy is reached: `windows_of`."""

from collections.abc import Generator
from typing import Protocol

from fidim_lab.data.records import Plan, PlannedWindow, Role
from procedures.outcomes import Outcome
from procedures.steps import GiveUp, Lengths, Note, Result, Step
from procedures.steps.accuracy import REACHED, CheckAccuracy


class Records(Protocol):
    """The steps that record one window: a `WindowProtocol`."""

    @property
    def attended(self) -> bool:
        """Whether somebody is there who sees if the platform swings when the run begins."""
        ...

    def window(
        self, planned: PlannedWindow, at: Lengths, swinging: bool
    ) -> Generator[Step, Result, tuple[Lengths, bool]]:
        """Returns where the robot is, and whether it swings."""
        ...


def windows_of(
    plan: Plan, protocol: Records, at: Lengths, earlier: int = 0, swings: bool = False
) -> Generator[Step, Result, tuple[Lengths, bool]]:
    """All windows; once the accuracy is reached, those to identify from are left out, held-out ones are not.

    earlier: windows to identify from that an earlier process has kept; swings: how it left the platform.
    Returns where the robot is, and whether it swings: after a crash or a power cut it may do so already.
    """
    swinging = swings or not protocol.attended
    recorded, enough = earlier, ""
    looked = 0
    for planned in plan.windows:
        identifies = planned.role is Role.IDENTIFY
        if (
            plan.accuracy is not None
            and identifies
            and not enough
            and recorded >= max(plan.accuracy.FEWEST, looked + 1)
        ):
            looked = recorded
            result = yield CheckAccuracy(window=planned.id, accuracy=plan.accuracy)
            if result.answer == REACHED:
                enough = result.reason
                yield Note(remark=enough)
        if identifies and enough:
            yield GiveUp(window=planned.id, outcome=Outcome.PASS, reason=f"not needed: {enough}")
            continue
        at, swinging = yield from protocol.window(planned, at, swinging)
        recorded += identifies
    return at, swinging
