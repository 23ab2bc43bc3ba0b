"""A fit's changes of the robot file's geometry, as values for files and sentences for people."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from fidim_lab.identification.mle.evidence import FRAME, ODDS, Factors
from fidim_lab.identification.mle.geometry import Surveyed
from fidim_lab.identification.results.result import AnchorByEncoder, Geometry, Moved
from fidim_lab.identification.survey import TYPICAL_ANCHOR, TYPICAL_ATTACHMENT, TYPICAL_MARKER, TYPICAL_TURN
from fidim_lab.units import millimetres, plain

TOLD = 3
"""pieces of the geometry that are named in a sentence; the rest is in the result file"""
CLEARLY = 3.0
"""sd by which a piece must be off to be named"""
UNSEEN = 0.9
"""of its prior sd: what is known no better after the recordings was not seen by them"""
ANGLES = ("axis", "gravity")
"""pieces whose θ are angles"""


def told_geometry(surveyed: Surveyed, sd: Float[np.ndarray, " shared"] | None = None) -> Geometry:
    """Every piece that was left open, with its standard deviation after the fit.

    sd: of all shared parameters, where χ²/dof does not say how much the data may be believed.
    """
    sd = np.sqrt(np.diag(surveyed.found.tempered_covariance)) if sd is None else sd
    moved: list[Moved] = []
    end = len(sd) - sum(len(one.sd) for one in surveyed.geometry)
    for one in surveyed.geometry:
        place, end = slice(end, end + len(one.sd)), end + len(one.sd)
        by, spread = surveyed.found.values[place], sd[place]
        moved.append(Moved(one.name, one.cable, tuple(map(float, by)), tuple(map(float, spread))))
    return Geometry(surveyed.weighed.chi2_gain, tuple(moved))


def geometry_warnings(surveyed: Surveyed, told: Geometry, *, answers: bool) -> tuple[str, ...]:
    """Whether the file's geometry holds, what is off most, and what no recording shows.

    answers: whether the fit as a whole does. An open geometry takes up what is missing, and windows that are held out
    show that.
    """
    by_encoders = (says,) if (says := encoders_say(told.encoders, told.moved)) else ()
    if not surveyed.geometry:
        return by_encoders
    explained = surveyed.found.explained and answers
    moved = furthest(told, explained=explained)
    if moved and not explained:
        moved = f"{moved} Whether the geometry is wrong is not known before the cause is named (fidim explain)."
    details = [says for says in (moved, *by_encoders, _unseen(surveyed, told)) if says]
    weighed = surveyed.weighed
    if weighed.log_bayes is None:
        return tuple(details)
    usual, scaled = _usual(weighed.factors)
    if not weighed.leads:
        return (
            f"The robot file has no [survey], and the recordings do not show whether its geometry is exact: every ± "
            f"assumes {usual}.",
        )
    if not explained:
        return (
            f"With {usual} scaled to {scaled} the recordings fit better (log evidence {weighed.log_bayes:+.3g}), and "
            "every ± includes it; this may also be caused by what the model leaves out.",
            *details,
        )
    return (
        f"The robot file's geometry does not hold exactly: with {usual} scaled to {scaled} the recordings fit better "
        f"(log evidence {weighed.log_bayes:+.3g}). The geometry was fitted with the body; every ± includes it. State "
        "[survey] in the robot file.",
        *details,
    )


def _usual(factors: Factors) -> tuple[str, str]:
    """The usual survey of what is open, and its scale."""
    known, scaled = list[str](), list[str]()
    if factors.cables is not None:
        known.append(f"{millimetres(TYPICAL_ANCHOR):g} mm anchors, {millimetres(TYPICAL_ATTACHMENT):g} mm attachments")
        scaled.append(f"{plain(factors.cables * millimetres(TYPICAL_ANCHOR), 2)} mm for anchors")
    if factors.markers is not None:
        known.append(f"{millimetres(TYPICAL_MARKER):g} mm markers")
        scaled.append(f"{plain(factors.markers * millimetres(TYPICAL_MARKER), 2)} mm for markers")
    if factors.frame is not None:
        known.append(f"{millimetres(TYPICAL_TURN):g} mrad gravity and capture frame")
        scaled.append(f"{plain(factors.frame * millimetres(TYPICAL_TURN), 2)} mrad for gravity and capture frame")
    return f"a usual survey ({', '.join(known)})", " and ".join(scaled)


def furthest(told: Geometry, *, explained: bool) -> str:
    """The pieces that are clearly off, in a sentence: first the frame, which concerns all others.

    explained: whether the fit leaves noise alone. Where it does not, pieces move for what is missing, too, and their sd
    know nothing of that: then it is not known which of them are off.
    """
    off: list[tuple[bool, float, str]] = []
    for one in told.moved:
        sizes = np.abs(one.by) / np.asarray(one.sd)
        k = int(np.argmax(sizes))
        if sizes[k] < CLEARLY:
            continue
        name = "capture frame" if one.what == "frame" else one.what.replace("_", " ")
        where = name + ("" if one.cable is None else f" of cable {one.cable}")
        off.append((one.what in FRAME, float(sizes[k]), f"{where} by {_by(one)}"))
    if not off:
        return ""
    named = [says for *_, says in sorted(off, reverse=True)[:TOLD]]
    if explained:
        return f"Clearly wrong: {'; '.join(named)}."
    return (
        f"The fit moved {'; '.join(named)}; but the recordings are not explained, and geometry that is left open takes "
        "up a part of whatever is missing."
    )


def _by(one: Moved) -> str:
    """By how much, with units."""
    shown = [_away(value) for value in one.by]
    if one.what == "frame":
        return f"({', '.join(shown[:3])}) mrad and ({', '.join(shown[3:])}) mm"
    return f"({', '.join(shown)}) {'mrad' if one.what in ANGLES else 'mm'}"


def encoders_say(encoders: Sequence[AnchorByEncoder], moved: Sequence[Moved] = ()) -> str:
    """Anchors that the encoders ask to move, in a sentence; nothing where they agree with the robot file.

    moved: by a fit. None has used the encoders' readings: one that moves an anchor the same way is confirmed by them.
    """
    by_fit = {one.cable: np.array(one.by) for one in moved if one.what == "anchor"}
    said: list[str] = []
    for one in sorted(encoders, key=lambda one: -one.log_odds):
        if one.log_odds < ODDS:
            break
        by, sd = (", ".join(plain(millimetres(value), 2) for value in values) for values in (one.by, one.sd))
        same = one.cable in by_fit and float(by_fit[one.cable] @ np.array(one.by)) > 0.0
        scatter, left = (plain(millimetres(value), 2) for value in (one.scatter, one.left))
        says = (
            f"the zero of cable {one.cable} differs by {scatter} mm (sd) between {one.windows} windows with the robot "
            f"file's geometry, and by {left} mm with its anchor moved by ({by}) ± ({sd}) mm"
        )
        said.append(f"{says}, the way the fit moves it" if same else says)
    return f"The encoders, whose readings no fit uses: {'; '.join(said)}." if said else ""


def _unseen(surveyed: Surveyed, told: Geometry) -> str:
    """Pieces that the recordings do not show at all."""
    pieces = zip(surveyed.geometry, told.moved, strict=True)
    hidden = [
        one.what for one, after in pieces if all(a > UNSEEN * b for a, b in zip(after.sd, one.sd, strict=True) if b > 0)
    ]
    if not hidden:
        return ""
    kinds = ", ".join(f"{kind.replace('_', ' ')} ({hidden.count(kind)})" for kind in dict.fromkeys(hidden))
    return f"Not determined by these recordings, so kept as surveyed: {kinds}."


def _away(value: float) -> str:
    """m or rad in thousandths, with two figures and the sign; 0 below a hundredth of them."""
    shown = round(millimetres(value), 2)
    return f"{'+' if shown > 0 else ''}{plain(shown, 2)}" if shown else "0"
