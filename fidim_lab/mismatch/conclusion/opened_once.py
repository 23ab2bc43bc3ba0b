"""Windows of role `test`: used neither in fits nor in choices, opened once when everything else is decided."""

from dataclasses import replace

from fidim_lab.data.records import Campaign, Role
from fidim_lab.mismatch.conclusion.explanation import Explanation
from fidim_lab.mismatch.conclusion.parts import Before, HeldOutFigures
from fidim_lab.mismatch.fitting.baseline import Baseline
from fidim_lab.mismatch.fitting.holdout import predict
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.units import millimetres


def with_test(told: Explanation, campaign: Campaign, exact: Baseline, model: Completed) -> Explanation:
    """The explanation with the figures of the test windows; as it was where there are none.

    exact: the model as it is. model: the one that is told.
    """
    windows = campaign.of_role(Role.TEST)
    if not windows:
        return told
    before, after = predict(exact.as_it_is, windows), predict(model, windows)
    rms = Before(millimetres(before.rms), millimetres(after.rms))
    return replace(told, test=HeldOutFigures(Before(before.chi2_per_dof, after.chi2_per_dof), rms))
