"""What an explanation says of a geometry that was left open: values for the file, a sentence, and a cause.

Within usual survey errors it is no cause. Beyond, the robot file is wrong: this is reported as a class, the largest
error first, because offsets, pulleys, encoder zeros and knots can replace each other.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fidim_lab.data.records import Robot
from fidim_lab.identification.mle.encoder_zeros import anchors_by_encoders
from fidim_lab.identification.mle.evidence import SPREAD_OF_FACTORS, GeometryOdds
from fidim_lab.identification.mle.findings import MISFIT
from fidim_lab.identification.mle.geometry import Surveyed
from fidim_lab.identification.mle.geometry_words import encoders_say, furthest, told_geometry
from fidim_lab.identification.results.result import Geometry, Moved
from fidim_lab.identification.survey import TYPICAL, TYPICAL_ANCHOR, Nuisance
from fidim_lab.mismatch.conclusion.explanation import Explanation, NamedCause, Verdict
from fidim_lab.mismatch.conclusion.parts import EffectParameter
from fidim_lab.mismatch.conclusion.verdict import Judged
from fidim_lab.mismatch.fitting.baseline import Baseline
from fidim_lab.units import millimetres

BEYOND = 2.0 * SPREAD_OF_FACTORS
"""log of times a usual survey, from which on a file is not surveyed as usual but wrong: two sd of the factor's prior, 9
times, a centimetre for anchors"""
CLASS = ("anchor-offset", "attachment-offset", "pulley-radius", "cable-length-bias")
"""effects that a wrong geometry may be"""
LENGTHS = ("anchor", "attachment", "radius", "marker", "encoder_zero")
"""kinds of pieces whose θ are lengths"""


def with_geometry(told: Explanation, baseline: Baseline, exact: Baseline, judged: Judged) -> Explanation:
    """The explanation with its geometry; as it was where the robot file's counts as exact.

    exact: the model as it is with the robot file's own geometry.
    """
    if not baseline.geometry:
        return told
    robot = exact.campaign.robot
    gain = sum(left.chi2 for left in exact.fit.remainders) - sum(left.chi2 for left in baseline.fit.remainders)
    same = (exact.whole is None) == (baseline.whole is None)
    gained = gain / max(1.0, baseline.fit.chi2_per_dof) if same else 0.0
    geometry = told_geometry(Surveyed(judged.named.model.fit, baseline.geometry, GeometryOdds(chi2_gain=gained)))
    geometry = replace(geometry, encoders=anchors_by_encoders([exact.campaign]))
    wrong = is_wrong(baseline.geometry, robot)
    says = geometry_says(geometry, robot, wrong, judged.named.model.fit.excess <= MISFIT)
    told = replace(told, geometry=replace(geometry, stated=robot.survey is not None), message=f"{told.message} {says}")
    if not wrong:
        return told
    verdict = {
        Verdict.NOTHING_MISSING: Verdict.EXPLAINED,
        Verdict.UNKNOWN_PHYSICS: Verdict.PARTLY_EXPLAINED,
    }.get(told.verdict, told.verdict)
    return replace(told, verdict=verdict, effects=(*told.effects, geometry_cause(geometry)))


def is_wrong(opened: Sequence[Nuisance], robot: Robot) -> bool:
    """Whether a geometry that was left open is off by more than a file that states no survey is surveyed to."""
    factors = [one.sd[0] / TYPICAL[one.what] for one in opened if one.what in TYPICAL]
    return robot.survey is None and bool(np.log(max(factors, default=1.0)) > BEYOND)


def geometry_cause(geometry: Geometry) -> NamedCause:
    """The class, by the anchor or attachment that is off most in its own sd; encoders are heard beside the motion."""
    pieces = [one for one in geometry.moved if one.what in ("anchor", "attachment")]
    heard: dict[tuple[str, int | None], float] = {
        ("anchor", one.cable): max(0.0, one.log_odds) for one in geometry.encoders
    }

    def nats(one: Moved) -> float:
        return 0.5 * float(np.max(np.abs(one.by) / np.array(one.sd))) ** 2 + heard.get((one.what, one.cable), 0.0)

    most = max(pieces, key=nats)
    id = f"{most.what}-offset"
    pairs = zip("xyz", most.by, most.sd, strict=True)
    parameters = {f"d{axis}": EffectParameter(by, sd, "m") for axis, by, sd in pairs}
    says = "the geometry in the robot file is wrong; the largest error is here"
    return NamedCause(id, most.cable, tuple(other for other in CLASS if other != id), parameters, says)


def geometry_says(geometry: Geometry, robot: Robot, wrong: bool, explained: bool) -> str:
    """How far the robot file is off, and what to do about it; or that a stated survey was used.

    explained: whether the model that is told leaves noise alone.
    """
    kinds = dict.fromkeys(one.what for one in geometry.moved if one.what in LENGTHS)
    sizes = ", ".join(f"{kind.replace('_', ' ')}s {millimetres(_rms(geometry.moved, kind)):.2g} mm" for kind in kinds)
    head = (
        "The survey in the robot file was used"
        if robot.survey is not None
        else "The geometry in the robot file is wrong"
    )
    said = f"{head} ({sizes} rms, as far as the recordings show). {furthest(geometry, explained=explained)}".rstrip()
    by_encoders = f" {encoders_say(geometry.encoders, geometry.moved)}".rstrip()
    if robot.survey is not None:
        return said + by_encoders
    times = _rms(geometry.moved, "anchor") / TYPICAL_ANCHOR if "anchor" in kinds else 1.0
    size = (
        "within an ordinary survey error" if times < np.exp(SPREAD_OF_FACTORS) else "more than an ordinary survey error"
    )
    size = "far beyond an ordinary survey error" if wrong else size
    said = f"{said} That is {size}. It was fitted with the body; every ± includes it. State [survey] in the robot file."
    return said + by_encoders


def _rms(moved: tuple[Moved, ...], kind: str) -> float:
    """m, of a coordinate of all pieces of a kind."""
    return float(np.sqrt(np.mean(np.concatenate([one.by for one in moved if one.what == kind]) ** 2)))
