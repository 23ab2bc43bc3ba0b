"""How long a search may take: a late answer is of no use in a laboratory.

Counted is work, in nodes of integrated motions, so that a search ends at the same model on every computer; nearly all
CPU time is spent on integrating them and on what follows from them.
"""

from dataclasses import dataclass, field
from time import process_time

from fidim_lab.model.sensitivity.work import IntegrationWork, work_done

WORK = 4_000_000
"""nodes; some 300 s of CPU time on a core of 2020. Of 270 sealed campaigns 94 in 100 took less than a third"""
WHOLE_WINDOWS = 3.0
"""times as much for a search through whole windows: the paper's takes with three cables take 5 million nodes"""


@dataclass(frozen=True)
class Budget:
    """From when it is made."""

    effort: float = 1.0
    """times `WORK`, after which no further fit is begun"""
    patience: float | None = None
    """s of CPU time of this process, after which it is not either: a slower computer then tries less. None: no limit"""
    begun: IntegrationWork = field(default_factory=work_done)
    since: float = field(default_factory=process_time)

    @property
    def is_spent(self) -> bool:
        """Whether it is time to say what there is."""
        return self._is_worked_off or (self.patience is not None and process_time() - self.since > self.patience)

    @property
    def work(self) -> IntegrationWork:
        """Since it was made."""
        return work_done() - self.begun

    @property
    def _is_worked_off(self) -> bool:
        return self.work.nodes > self.effort * WORK

    @property
    def for_whole_windows(self) -> "Budget":
        """From now, for a search whose every model is fitted to whole windows."""
        return Budget(self.effort * WHOLE_WINDOWS, self.patience)

    @property
    def says(self) -> str:
        """For the answer of a search that it ended."""
        if self._is_worked_off:
            return (
                f"The search was ended by its limit of work ({self.effort:g} × the usual) before all models were "
                "tried; `fidim explain --effort` gives it more."
            )
        return (
            f"The search was ended after {self.patience:g} s of CPU time before all models were tried; "
            "`fidim explain --patience` gives it more time."
        )
