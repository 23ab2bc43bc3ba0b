"""How long the rest of a run will take, estimated from the steps so far."""

from collections.abc import Mapping

from procedures.steps import Step

LEARNING = 0.3
"""weight of the newest step against all before it"""
RANGE = (0.2, 5.0)
"""ratios beyond this are accidents (a coffee break at a prompt), not a pace"""


class Pace:
    """For each type of step, how much longer than estimated it takes here. Starts from the estimates themselves."""

    def __init__(self) -> None:
        self._ratios: dict[type[Step], float] = {}

    def learn(self, step: Step, seconds: float) -> None:
        """One step took so long, s."""
        if step.seconds <= 0.0:
            return
        ratio = min(max(seconds / step.seconds, RANGE[0]), RANGE[1])
        before = self._ratios.get(type(step))
        self._ratios[type(step)] = ratio if before is None else before + LEARNING * (ratio - before)

    def seconds(self, step: Step) -> float:
        """The expected duration of one step, s."""
        return step.seconds * self._ratios.get(type(step), 1.0)

    def total(self, estimates: Mapping[type[Step], float]) -> float:
        """What steps should take whose estimates are summed up by type, s."""
        return sum(seconds * self._ratios.get(kind, 1.0) for kind, seconds in estimates.items())
