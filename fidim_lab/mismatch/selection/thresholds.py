"""Thresholds for trying and preferring models: unit and reason of each."""

from dataclasses import dataclass


@dataclass(frozen=True)
class SelectionThresholds:
    """One field for each decision."""

    # additions
    additions_scanned: int = 6
    """values of a scanned parameter that are tried, as long as none leaves only noise"""
    additions_finalists: int = 4
    """of those that raced"""

    # search
    search_same: float = 1.0
    """χ² between two fits of one optimum"""
    search_simple: int = 2
    """parameters of a term that takes the share of no other"""
    search_siblings: float = 0.15
    """of a term's evidence, that another in its place may miss where structure stays"""
    push_cost: float = 20.0
    """nats: what the freedom of another start costs, as a few terms of a wide prior do"""

    # trials
    trials_farther: float = 4.0
    """times the nats that doing without terms costs to first order, and some: a fit without them that leaves as much
    has ended before its optimum"""
    trials_droppable: float = 200.0
    """nats, to first order, above which nobody tries to do without a term"""


SELECTION = SelectionThresholds()
