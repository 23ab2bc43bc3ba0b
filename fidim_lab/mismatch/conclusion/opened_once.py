"""Figures that tell how well the model that is told foretells windows: those of windows that it did not fit.

Windows of role `test` are used neither in fits nor in choices, and opened once when everything else is decided. Without
any, each window is foretold by the others, to first order.
"""

from dataclasses import replace

from fidim_lab.data.records import Campaign, Role
from fidim_lab.mismatch.conclusion.explanation import Explanation
from fidim_lab.mismatch.conclusion.parts import Before, HeldOutFigures
from fidim_lab.mismatch.fitting.baseline import Baseline
from fidim_lab.mismatch.fitting.holdout import HeldOut, predict
from fidim_lab.mismatch.fitting.left_out import left_out
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.selection.candidates import Candidate
from fidim_lab.units import millimetres


def with_unfitted(
    told: Explanation, campaign: Campaign, before: Baseline, named: Candidate, model: Completed
) -> Explanation:
    """The explanation with the figures of the test windows, or else with those of all, each left out in turn.

    before: the model as it is. named: the model with the effects that are named. model: the one whose figures are told.
    """
    windows = campaign.of_role(Role.TEST)
    if windows:
        return replace(told, test=_figures(predict(before.as_it_is, windows), predict(model, windows)))
    held = named.held_out if model is named.model else predict(model, campaign.of_role(Role.VALIDATE))
    after = left_out(model, held)
    if after is None:
        return told
    return replace(told, left_out=_figures(left_out(before.as_it_is, before.predicted) or before.predicted, after))


def _figures(before: HeldOut, after: HeldOut) -> HeldOutFigures:
    rms = Before(millimetres(before.rms), millimetres(after.rms))
    return HeldOutFigures(Before(before.chi2_per_dof, after.chi2_per_dof), rms)
