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

    # confounders
    confounders_fitted: int = 2
    """of those that may stand for one term"""

    # generalise
    generalise_as_good: float = 1.1
    """times what the simple form leaves: a wider one that leaves more has not found its way"""

    # general geometry
    geometry_takes: float = 0.5
    """of what a model leaves beyond noise, that an open geometry may leave at most where it does not leave noise alone:
    what has no name is taken up by 24 offsets in part, too"""

    # search
    search_close: float = 25.0
    """nats: how near the best over the first seconds a model must be to be fitted to whole windows too"""
    search_shortlist: int = 3
    search_same: float = 1.0
    """χ² between two fits of one optimum"""
    search_simple: int = 2
    """parameters of a term that takes the share of no other"""
    search_siblings: float = 0.15
    """of a term's evidence, that another in its place may miss where structure stays"""
    push_cost: float = 20.0
    """nats: what the freedom of another start costs, as a few terms of a wide prior do"""

    # select
    select_fits: float = 1.05
    """χ²/dof of a fit that leaves next to nothing"""

    # trials
    most_terms: int = 3
    trials_widened: float = 0.5
    """of the rest: a term that leaves more is not tried in a wider form"""
    trials_nearly: float = 25.0
    """nats by which a further term beats a simpler model, within which a wider form of that one may do the same"""
    trials_farther: float = 4.0
    """times the nats that doing without terms costs to first order, and some: a fit without them that leaves as much
    has ended before its optimum"""
    more_turns: int = 4
    trials_helps: float = 0.99
    """how often such a fit goes on; times what χ² was before, that it must reach each time"""
    trials_droppable: float = 200.0
    """nats, to first order, above which nobody tries to do without a term"""

    # unions
    unions_well: float = 3.0
    """times what the best of the first seconds leaves of these, up to which a model did well, too"""
    unions_few: int = 2
    """unions that are tried"""


SELECTION = SelectionThresholds()
