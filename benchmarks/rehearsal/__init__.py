"""Rehearsals of faults: the real drivers on simulated drives and cameras, with faults planted at steps.

Everything passes as protocol bytes, on a clock that jumps. End-to-end tests and `benchmarks.safety` share it:
`Rehearsal` is one run to come, `Stage` what a fault may break, `Ended` all that was seen from outside.
"""

from benchmarks.rehearsal.ended import Ended, places
from benchmarks.rehearsal.plans import FIRST, ONE, RATE, SECOND, STANDS, START, TWO, short
from benchmarks.rehearsal.rehearsal import AFTERWARDS, Rehearsal
from benchmarks.rehearsal.stage import MocapFaults, Stage

__all__ = [
    "AFTERWARDS",
    "FIRST",
    "ONE",
    "RATE",
    "SECOND",
    "STANDS",
    "START",
    "TWO",
    "Ended",
    "MocapFaults",
    "Rehearsal",
    "Stage",
    "places",
    "short",
]
