"""Computing during a procedure: the job runs in the background, so that guards and bus continue."""

from collections.abc import Callable, Generator
from typing import TypeVar

from fidim_lab.data.records import PlannedWindow
from fidim_lab.errors import InfeasibleError
from procedures.steps import Result, Step
from procedures.steps.excitation import Think

T = TypeVar("T")


def think(window: PlannedWindow, what: str, job: Callable[[], T]) -> Generator[Step, Result, T]:
    """What a job answers; carried out beside the run, or here by a reader without hardware.

    Raises InfeasibleError where the job does.
    """
    answers: list[T | InfeasibleError] = []

    def work() -> None:
        try:
            answers.append(job())
        except InfeasibleError as refusal:
            answers.append(refusal)

    yield Think(window=window.id, what=what, job=work)
    if not answers:
        work()
    answer = answers[-1]
    if isinstance(answer, InfeasibleError):
        raise answer
    return answer
