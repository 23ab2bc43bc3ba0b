"""Two rates near each other: the header's and that of the time stamps, or 60 Hz and 59.94. Which one is right?

Cameras that follow video take 60/1.001 frames, and programs call that 60: times made of such a header say nothing. A
rate of 99.95 Hz is that of a computer's clock which is off (NTP sets it right by 5e-4), if the cameras take 100. A
clock that runs a thousandth fast is a gravity that is two thousandths too large: mostly the body, or a geometry that is
left open, takes it up, and nothing shows. So both are fitted. Where one explains the recordings better beyond chance,
it leads; else the standard deviations are widened to hold both answers, and it is said.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.data.records import Campaign
from fidim_lab.identification.cleaning.stamps import mean_step
from fidim_lab.identification.results.result import IdentificationResult

SAME = 2e-4
"""of a rate: 2 ms in 10 s; what stamps do not tell, and what moves no parameter by more than its two thousandths"""
OTHER = 0.05
"""of a rate: more is another camera, not a clock that is a little off"""
AGREE = 0.25
"""of the difference, by which windows may differ: one wrong rate is the same in all"""
VIDEO = (24.0, 30.0, 48.0, 60.0, 120.0, 240.0)
"""Hz, that may stand for 1.001 times less"""
SLOWER = 1.001
SET_RIGHT = 7e-4
"""of a rate, within which a clock may be off: a computer's own by 1e-4, one that is being set right by 5e-4 more; less
than the thousandth of video"""
FIGURES = 2
"""of a rate that cameras are set to: 50, 100, 120, 240 Hz"""
CERTAIN = 25.0
"""χ² by which one must lead: odds of 10⁵, as many windows are looked at"""


@dataclass(frozen=True)
class TwoClocks:
    """The other time that the same samples may have."""

    stamps: float
    """Hz, by the stamps"""
    header: float
    """Hz, by campaign.toml, or the even one nearby"""
    says: str
    """for people"""
    by_rate: bool = False
    """whether only the rate itself raises the doubt"""

    def nearest(self, rate: float) -> float:
        """That of the two which is nearer to a rate, Hz."""
        return min((self.stamps, self.header), key=lambda one: abs(rate / one - 1))


def two_clocks(campaign: Campaign) -> TwoClocks | None:
    """Where header and stamps, as recorded, differ alike in all windows, or say a rate of video; else None."""
    ratios = np.array([
        mean_step(np.arange(len(w.t)), w.t) * campaign.sample_rate for w in campaign.windows if _whole(w.t)
    ])  # fmt: skip
    if len(ratios) < 2:
        return None
    off = float(np.median(ratios)) - 1
    rate = campaign.sample_rate
    if np.abs(ratios - 1).max() < SAME:
        return _of_the_rate(rate)
    if not SAME < abs(off) < OTHER or np.abs(ratios - 1 - off).max() > AGREE * abs(off):
        return None
    says = f"The time stamps say {rate / (1 + off):.6g} Hz, campaign.toml says {rate:.6g} Hz."
    return TwoClocks(rate / (1 + off), rate, says)


def _of_the_rate(rate: float) -> TwoClocks | None:
    """Where the rate itself, Hz, raises a doubt: one of video, or one that only a clock that is off makes uneven."""
    if any(abs(rate / one - 1) < SAME for one in VIDEO):
        says = f"{rate:.6g} Hz may stand for {rate / SLOWER:.6g}, which cameras that follow video take."
        return TwoClocks(rate / SLOWER, rate, says, by_rate=True)
    even = round(rate, FIGURES - 1 - int(np.floor(np.log10(rate))))
    if not SAME < abs(even / rate - 1) < SET_RIGHT:
        return None
    return TwoClocks(rate, even, f"{rate:.6g} Hz may be {even:g} Hz by a clock that is off.", by_rate=True)


def _whole(t: np.ndarray) -> bool:
    """Whether no row is missing, so that rows count time."""
    return len(t) > 100 and float(np.quantile(np.diff(t), 0.9)) < 1.5 * float(np.median(np.diff(t)))


def by_both(
    cleaned: Campaign, clocks: TwoClocks, identify: Callable[[Campaign], IdentificationResult]
) -> IdentificationResult:
    """The better of both answers, or the first with standard deviations that hold the other.

    cleaned: what is identified; the stamps of each window are the recorded ones, or were put on the header's grid.
    """
    by_window = {w.id: _clock_of(w.t, clocks) for w in cleaned.windows if _whole(w.t)}
    now = clocks.nearest(float(np.median(list(by_window.values()))))
    other = clocks.header if now == clocks.stamps else clocks.stamps
    first, second = (
        identify(_stretched(cleaned, {w.id: by_window.get(w.id, now) / rate for w in cleaned.windows}))
        for rate in (now, other)
    )
    said = f"{clocks.says} "
    usual = max(1.0, min(one.noise_ratio or 1.0 for one in (first, second)) ** 2)
    unlike = {w.id for one in (first, second) for w in one.windows if w.chi2_per_dof is None}
    leads = [
        (second.outcome.answers - first.outcome.answers, 0.0, "with the other, the model does not explain them"),
        (_left_out(first) - _left_out(second), 0.0, "with the other, windows contradict each other"),
    ]
    if _shows_all(first) and _shows_all(second):  # else χ² differs by where the search ends in a flat valley
        leads += [
            (_is_bent(first) - _is_bent(second), 0.0, "with the other, the robot file's geometry does not hold"),
            ((_chi2(first, unlike) - _chi2(second, unlike)) / usual, CERTAIN, "χ² is {:.0f} less"),
        ]
    for lead, least, why in leads:
        if abs(lead) > least:
            better, rate = (second, other) if lead > 0 else (first, now)
            if clocks.by_rate and better is first:
                return first
            said += f"The recordings are explained better with {rate:.6g} Hz ({why.format(abs(lead))}): it is used."
            return replace(better, warnings=(said, *better.warnings))
    said += (
        f"The recordings do not show which is right: {now:.6g} Hz is used, and each ± includes the change by the "
        "other. Correct the wrong one."
    )
    return replace(_widened(first, second), warnings=(said, *first.warnings))


def _shows_all(result: IdentificationResult) -> bool:
    """Whether the recordings determine every parameter."""
    return all(one.seen for one in result.parameters.values())


def _is_bent(result: IdentificationResult) -> bool:
    """Whether the robot file's geometry, stated without a survey, does not hold."""
    return result.geometry is not None and not result.geometry.stated and bool(result.geometry.moved)


def _clock_of(t: np.ndarray, clocks: TwoClocks) -> float:
    """Hz, of a window as it stands."""
    return clocks.nearest(1.0 / mean_step(np.arange(len(t)), t))


def _stretched(campaign: Campaign, factors: dict[str, float]) -> Campaign:
    """Each window's time by its own factor; the campaign itself where all are 1."""
    if all(factor == 1.0 for factor in factors.values()):
        return campaign
    windows = tuple(replace(w, t=w.t[0] + factors[w.id] * (w.t - w.t[0])) for w in campaign.windows)
    return replace(campaign, windows=windows)


def _chi2(result: IdentificationResult, but: Collection[str]) -> float:
    """Of all windows but these."""
    return sum((w.chi2_per_dof or 0.0) * 3 * w.samples for w in result.windows if w.id not in but)


def _left_out(result: IdentificationResult) -> int:
    return sum(not w.used for w in result.windows)


def _widened(first: IdentificationResult, second: IdentificationResult) -> IdentificationResult:
    parameters = {}
    for name, one in first.parameters.items():
        by = one.value - second.parameters[name].value
        parameters[name] = replace(one, sd=float(np.hypot(one.sd, by)))
    change = np.array([first.parameters[n].value - second.parameters[n].value for n in first.parameters])
    return replace(first, parameters=parameters, covariance=first.covariance + np.outer(change, change))
