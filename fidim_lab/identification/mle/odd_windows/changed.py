"""A session in which something was changed on the way: another payload, cameras that were started or set up anew.

    changed(mechanism, windows)          a sentence, "" where the windows show no such place

Asked where one body and an open geometry do not explain a campaign. Three windows from either end of it are fitted;
where one body explains them, each further window is predicted with it. Where something was changed, some of these agree
and others contradict. Missing physics is in all of them: then three are not explained either.
"""

from collections.abc import Sequence

from fidim_lab.data.records import Window
from fidim_lab.errors import RefusedError
from fidim_lab.identification.mle import held_out
from fidim_lab.identification.mle.findings import MISFIT
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.geometry import begin_surveyed
from fidim_lab.identification.mle.odd_windows.odd_window import FEWEST
from fidim_lab.identification.mle.trajectories.recordings import prepare
from fidim_lab.model.mechanism import Mechanism

AGREE = FEWEST + 1
"""windows at least that one body explains: one that was not fitted shows that it is more than a bent fit"""
CHANGED = 2
"""windows at least that contradict the others: a single one is an odd window"""


def changed(mechanism: Mechanism, windows: Sequence[Window]) -> str:
    """In which windows something was changed, in a sentence; empty where that is not seen."""
    if len(windows) < AGREE + CHANGED:
        return ""
    for ordered in (tuple(windows), tuple(reversed(windows))):
        try:
            found = begin_surveyed(mechanism, list(ordered[:FEWEST]))
        except RefusedError:
            continue
        if found.unused or not found.explained:
            continue
        same = {one.id for k, one in enumerate(ordered) if k < FEWEST or _agrees(found, one)}
        if AGREE <= len(same) <= len(ordered) - CHANGED:
            return _says([w.id for w in windows if w.id in same], [w.id for w in windows if w.id not in same])
    return ""


def _agrees(found: Fit, window: Window) -> bool:
    """Whether a window is what the body makes of its beginning."""
    mechanism = found.likelihood.mechanism
    try:
        predicted = held_out.predict(mechanism, found.values, prepare(window, mechanism.robot), mechanism.robot.sensors)
    except RefusedError:
        return False
    return not predicted.lost and predicted.remainder.chi2_per_dof < MISFIT * found.noise_ratio**2


def _says(same: Sequence[str], other: Sequence[str]) -> str:
    return (
        f"One body explains windows {', '.join(same)}, and contradicts all of {', '.join(other)}: something was "
        "changed between them, such as a payload, cameras or their frame, a marker, or an anchor. Identify each of the "
        "two groups by itself."
    )
