"""How accurately the body is known from a campaign so far: this may end a recording early."""

from dataclasses import dataclass
from pathlib import Path

from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Accuracy, Role
from fidim_lab.errors import FidimError
from fidim_lab.identification.equations.estimators import Method
from fidim_lab.identification.identify import identify
from fidim_lab.identification.results.validation import QUICK


@dataclass(frozen=True)
class KnownAccuracy:
    """Largest standard deviations, each the larger of the stated one and the spread between windows."""

    windows: int
    s: float = float("inf")
    """of s_x, s_y, s_z, m"""
    inertia: float = float("inf")
    """of the six moments per unit mass about P, m²"""
    problem: str = ""
    """why nothing is known"""


def accuracy_of(folder: Path) -> KnownAccuracy:
    """Identify the campaign in a folder by maximum likelihood and say how well it is known. Never raises FidimError."""
    count = 0
    try:
        campaign = read_campaign(folder)
        count = len(campaign.of_role(Role.IDENTIFY))
        if count < Accuracy.FEWEST:
            return KnownAccuracy(count, problem=f"{count} windows, {Accuracy.FEWEST} are needed")
        found = identify(campaign, Method.MLE, checks=QUICK)
    except FidimError as error:
        return KnownAccuracy(count, problem=error.message)
    if not found.outcome.good:  # small standard deviations of a wrong model say nothing
        return KnownAccuracy(count, problem=found.outcome.value)
    sds = {name: max(one.sd, one.spread or 0.0) for name, one in found.parameters.items()}
    return KnownAccuracy(
        count,
        max(sd for name, sd in sds.items() if name.startswith("s_")),
        max(sd for name, sd in sds.items() if name.startswith("I_")),
    )
