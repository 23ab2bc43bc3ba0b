"""Where the platform swings freely in each recording: release, hand, second release, catch, a touch at the end.

The equations of motion that need no cable force (`balance`) are linear in the body. The body that balances the better
half of all seconds is found first (least trimmed squares; CAD only fills in what nothing shows), so that neither a hand
nor a wrong CAD decides. A hand then is where most of the inertial force has no source: what is left over is more than
half of it, and far above what is usual in that window. Missing physics (friction, drag, a surveyed geometry) leaves
less, and grows and falls with the motion: it stays in, for `explain`.

Where markers and lengths do not show the pose (two cables, one marker), only a hand that holds still is seen; one that
does so before the release is seen everywhere, also where noise hides the forces.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import median_filter

from fidim_lab.arrays import Series, runs
from fidim_lab.data.records import Campaign, Window
from fidim_lab.identification.cleaning.balance import EVERY, HALF, WindowBalance, balances_of, blocks
from fidim_lab.identification.cleaning.removed import CleanRecordings, Removed
from fidim_lab.identification.cleaning.resting import resting
from fidim_lab.model.regressor import parameter_vector
from fidim_lab.say import counted

PART = ", part "
"""what the id of all but a window's first part goes on with"""
WHY = "not free: held, pushed or touched"


@dataclass(frozen=True)
class FreeMotionRule:
    """The thresholds, chosen before any recording of a real robot was looked at with them."""

    averaged: float = 0.3
    """s, over which what is left over and inertial forces are averaged (rms)"""
    share: float = 0.5
    """of the inertial forces that a hand leaves over at least: what `hand_free` asks for (spec/irma4u.md §2)"""
    above: float = 4.0
    """times what is usually left over in the window"""
    goes_on: float = 1.5
    """the same beside a disturbance, and where a hand holds still: it leaves little where the platform hangs nearly at
    rest"""
    still: float = 2.0
    """times the inertial forces, left over where the platform does not move: no free motion has so little of them"""
    slow: float = 0.5
    """of the window's rms speed, below which the platform may be held: where it swings through, few markers show too
    little of its inertial forces"""
    balanced: float = 0.25
    """of a window's nodes that must balance, so that the others say something"""
    block: float = 1.0
    """s: blocks in which the better half is looked for"""
    rounds: int = 10
    """of least trimmed squares; they settle in 3 to 6"""
    shown: float = 1e-4
    """of the largest singular value, below which a direction of the body stays where CAD has it"""
    most: float = 0.6
    """of all nodes that may be disturbed: with more, the robot file or the frame is wrong, and nothing is cut"""
    shortest: float = 1.0
    """s of free motion, without which a part is not kept"""


RULE = FreeMotionRule()


Cuts = dict[str, list[tuple[float, float]]]
"""window id → begins and ends of what is not free, s"""


def hands(campaign: Campaign, known: Sequence[WindowBalance] | None = None, rule: FreeMotionRule = RULE) -> Cuts:
    """Where the platform is not free. Windows that do not show their poses say nothing.

    known: their `balances`, computed here unless given.
    """
    balances = {one.window.id: one for one in (balances_of(campaign) if known is None else known)}
    found, judged = _unbalanced(balances, campaign, rule) if balances else ({}, set())
    for window in campaign.windows:
        cuts = [] if window.id in found else resting(window, campaign.robot.sensors.marker_noise)
        if window.id in judged:  # what comes to rest later may rub: that is for `explain`
            cuts = [cut for cut in cuts if cut[0] == -np.inf]
        if cuts:
            found[window.id] = cuts
    return found


def _unbalanced(balances: dict[str, WindowBalance], campaign: Campaign, rule: FreeMotionRule) -> tuple[Cuts, set[str]]:
    """Where the equations of motion do not balance, and the windows that can say so."""
    chi = _robust_body(list(balances.values()), parameter_vector(campaign.robot.nominal), rule)
    disturbed = {id: _disturbed(one, chi, rule) for id, one in balances.items()}
    if np.concatenate(list(disturbed.values())).mean() > rule.most:
        return {}, set(balances)
    judged = {id for id, one in balances.items() if _says(one, chi, rule)}
    return {id: cuts for id, one in balances.items() if (cuts := _times(one, disturbed[id]))}, judged


def without_hands(campaign: Campaign, cuts: Cuts, rule: FreeMotionRule = RULE) -> CleanRecordings:
    """What is free before and after each disturbance becomes a window of its own ("i03", "i03, part 2").

    All parts keep their window's clock and lengths.
    """
    windows: list[Window] = []
    removed: list[Removed] = []
    for window in campaign.windows:
        ours = cuts.get(window.id, [])
        windows += parts(window, ours, rule.shortest) if ours else [window]
        removed += [_told(window, begin, end) for begin, end in ours]
    if not removed:
        return CleanRecordings(campaign)
    return CleanRecordings(replace(campaign, windows=tuple(windows)), tuple(removed), _notes(removed))


def lasting(cuts: Cuts) -> Cuts:
    """Disturbances longer than the effect of one bad sample: only these are certain before samples are judged."""
    longer = {id: [cut for cut in ours if cut[1] - cut[0] > ONE_SAMPLE] for id, ours in cuts.items()}
    return {id: ours for id, ours in longer.items() if ours}


def parts(window: Window, cuts: Sequence[tuple[float, float]], shortest: float) -> list[Window]:
    """What is free before, between and after the cuts (begin, end; s), as windows with the rows of the whole.

    The first part keeps the window's id. Parts shorter than so many seconds are left out.
    """
    begins = [-np.inf, *(end for _, end in cuts)]
    ends = [*(begin for begin, _ in cuts), np.inf]
    found: list[Window] = []
    for begin, end in zip(begins, ends, strict=True):
        use = (window.t > begin) & (window.t < end)
        if use.sum() < 2 or window.t[use][-1] - window.t[use][0] < shortest:
            continue
        name = window.id if not found else f"{window.id}{PART}{len(found) + 1}"
        markers = np.where(use[:, np.newaxis, np.newaxis], window.markers, np.nan)
        found.append(replace(window, id=name, markers=markers))
    return found


def window_count(ids: Iterable[str]) -> str:
    """The number of windows, as text: parts of one window count as one, and their number is given too."""
    parts = list(ids)
    count = len({whole_id(one) for one in parts})
    windows = counted(count, "window")
    return windows if len(parts) == count else f"{windows} (in {len(parts)} parts)"


def were_used(ids: Iterable[str]) -> str:
    """The same, as a clause."""
    count = window_count(ids)
    return f"{count} {'was' if count.startswith('1 ') else 'were'} used"


def whole_id(part: str) -> str:
    """The id of the window that a part was cut from."""
    return part.split(PART)[0]


def _robust_body(
    balances: Sequence[WindowBalance], nominal: np.ndarray, rule: FreeMotionRule
) -> Float[np.ndarray, "10"]:
    """χ that balances the better half of all blocks, each weighed by its inertial forces."""
    seconds = [block for one in balances for block in blocks(one, rule.block)]
    chi, before = nominal, None
    for _ in range(rule.rounds):
        left = np.array([np.sqrt(np.mean((rows @ chi) ** 2)) for rows, _ in seconds])
        inertial = np.array([np.sqrt(np.mean((rows @ chi) ** 2)) for _, rows in seconds]) + np.finfo(float).tiny
        better = np.argsort(left / inertial)[: max(1, (len(seconds) + 1) // 2)] if before is not None else None
        kept = np.arange(len(seconds)) if better is None else np.sort(better)
        if before is not None and np.array_equal(kept, before):
            break
        before = kept
        rows = np.concatenate([seconds[k][0] / max(inertial[k], np.median(inertial)) for k in kept])
        step = np.linalg.lstsq(rows[:, 1:], -rows @ nominal, rcond=rule.shown)[0]
        chi = nominal + np.concatenate([[0.0], step])
    return chi


def _disturbed(one: WindowBalance, chi: Float[np.ndarray, "10"], rule: FreeMotionRule) -> Bool[np.ndarray, " N"]:
    """Nodes at which the platform is not free."""
    left, inertial = _forces(one, chi, rule)
    own = max(float(np.median(left)), float(np.median(one.noise)))
    unmoved = left > rule.share**2 * inertial
    found = unmoved & (left > rule.above**2 * own)
    slow = _averaged(one.t, one.speeds**2, rule) < rule.slow**2 * np.mean(one.speeds**2)
    found |= (left > rule.still**2 * inertial) & (left > rule.goes_on**2 * own) & slow
    for begin, end in runs(unmoved & (left > rule.goes_on**2 * own)):
        found[begin:end] = found[begin:end].any()
    if not _says(one, chi, rule):
        return np.zeros(len(left), dtype=bool)  # noise or missing physics hides what a hand would leave
    if found.any():  # what lies beside a hand must be seen to swing: a platform that is held at rest balances, too
        for begin, end in runs(~found):
            found[begin:end] = left[begin:end].sum() > rule.share**2 * inertial[begin:end].sum()
    return found


def _says(one: WindowBalance, chi: Float[np.ndarray, "10"], rule: FreeMotionRule) -> bool:
    """Whether enough of it balances, so that the rest says something."""
    left, inertial = _forces(one, chi, rule)
    return bool((left < rule.share**2 * inertial).mean() >= rule.balanced)


def _forces(one: WindowBalance, chi: Float[np.ndarray, "10"], rule: FreeMotionRule) -> tuple[Series, Series]:
    """Squares of what is left over and of the inertial forces, averaged, each node weighed by how well it is shown.

    Where markers hardly show the motion, errors of rates grow as noise does, and then once more as accelerations.
    Of what is left over without what one node has alone: its neighbours share samples with it, and feel a force, while
    noise can put a single pose far away where a mode turns.
    """
    worse = np.maximum(one.noise / np.median(one.noise), 1.0) ** 2
    left, inertial = (((rows @ chi) ** 2).sum(axis=1) / worse for rows in (one.left, one.inertial))
    return _averaged(one.t, median_filter(left, size=3, mode="mirror"), rule), _averaged(one.t, inertial, rule)


def _averaged(t: Series, squares: Series, rule: FreeMotionRule) -> Series:
    """Mean of what lies within half of `averaged` of each node."""
    reach = 0.5 * rule.averaged + 1e-9
    total = np.concatenate([[0.0], np.cumsum(squares)])
    first, last = np.searchsorted(t, t - reach), np.searchsorted(t, t + reach)
    return (total[last] - total[first]) / (last - first)


def _times(one: WindowBalance, disturbed: Bool[np.ndarray, " N"]) -> list[tuple[float, float]]:
    """Begins and ends of the disturbances, s; up to an end of the recording where no node lies between."""
    begin, end = float(one.window.t[0]), float(one.window.t[-1])
    found: list[tuple[float, float]] = []
    for a, b in runs(disturbed):
        first = -np.inf if a == 0 or one.t[a] < begin + HALF + EVERY else float(one.t[a]) - HALF
        last = np.inf if b == len(disturbed) or one.t[b - 1] > end - HALF - EVERY else float(one.t[b - 1]) + HALF
        found.append((first, last))
    return found


def _told(window: Window, begin: float, end: float) -> Removed:
    t = (max(begin, float(window.t[0])), min(end, float(window.t[-1])))
    use = (window.t >= t[0]) & (window.t <= t[1])
    return Removed(window.id, t, WHY, int(np.isfinite(window.markers[use]).all(axis=2).sum()))


def _notes(removed: Sequence[Removed]) -> tuple[str, ...]:
    """One sentence for all of them."""
    shown = ", ".join(f"{one.window} {one.t[0]:.2f} to {one.t[1]:.2f} s" for one in removed[:SHOWN])
    more = f" and {len(removed) - SHOWN} more" if len(removed) > SHOWN else ""
    return (f"The platform is not free (held, pushed or touched) in {shown}{more}: this is left out.",)


ONE_SAMPLE = 4 * HALF + RULE.averaged + 2 * EVERY
"""s that a cut lasts at most which a single bad sample or a step of a marker makes"""
SHOWN = 4
"""cuts that the sentence names"""
