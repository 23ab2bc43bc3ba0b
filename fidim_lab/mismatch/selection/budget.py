"""How long a search may take: a late answer is of no use in a laboratory.

CPU time, so that a busy machine changes nothing; where a search is not cut short, nothing depends on it.
"""

from dataclasses import dataclass, field
from time import process_time

PATIENCE = 300.0
"""s of CPU time: of 270 sealed campaigns 94 in 100 took less than 100; the longest that was named, three effects with
elastic cables, took 303"""


@dataclass(frozen=True)
class Patience:
    """From when it is made."""

    cpu: float = PATIENCE
    """s of this process, after which no further fit is begun"""
    begin: float = field(default_factory=process_time)

    @property
    def ended(self) -> bool:
        """Whether it is time to say what there is."""
        return process_time() - self.begin > self.cpu

    @property
    def says(self) -> str:
        """For the answer of a search that it ended."""
        return (
            f"The search was ended after {self.cpu:.0f} s of CPU time before all models were tried; "
            "`fidim explain --patience` gives it more time."
        )
