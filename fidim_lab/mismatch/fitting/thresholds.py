"""Thresholds for starting, continuing and abandoning fits: unit and reason of each."""

from dataclasses import dataclass


@dataclass(frozen=True)
class FitThresholds:
    """One field for each decision."""

    # fit_data
    first_seconds: float = 3.0
    """s"""
    fit_data_horizons: tuple[float, float] = (3.0, 10.0)
    """s; the start is that of a good fit, so the strides may be long"""
    hopeless: float = 30.0
    """χ²/dof of a model of the first seconds that is not tried on whole windows; of whole windows, what is not
    judged"""

    # held_body
    held_body_horizons: tuple[float, float] = (0.5, 3.0)
    """s"""

    # holdout
    holdout_not_found: float = 0.5
    """s; a prediction that is lost earlier tells of its start, not of the model"""

    # refit
    refit_rounds: int = 3
    """how often parameters may be put back on their bounds"""
    refit_tiny: float = 1e-300
    """below any share of prior variance"""

    # sprung
    stiffest: float = 1e-7
    """m/N, and 1/N for a cable of a metre: a cable stiffer than that is fitted as rigid"""
    stiff: float = 300.0
    """rad/s, of the fastest oscillation on the springs: from here on they are quiet, at no higher price however
    stiff"""
    near: float = 3.0
    """χ²/dof below which a motion is followed well enough for first-order statements about it"""
    sprung_on: tuple[float, float] = (1.0, 3.0)
    """s, of the way from a fit without springs to one with them"""
    crawl: float = 0.01
    """share of what is left, than which a round should not take less off a fit that leaves more than noise"""


FITTING = FitThresholds()
