"""Geometry that the survey leaves open, as nuisance parameters of a fit with normal priors.

A robot file's geometry is measured, not known. Everything with a standard deviation in the file's `[survey]` becomes a
parameter θ of the model with that prior about 0 (the file's value), so that estimates use what the recordings say of it
and every standard deviation counts what they do not. Combinations that no recording shows (gauges) stay at their prior.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Robot, Survey
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.effects.geometry.cable_geometry import (
    AnchorOffset,
    AttachmentOffset,
    CableLengthBias,
    PulleyRadius,
    SwivelAxis,
)
from fidim_lab.effects.geometry.frames import FrameMisalignment, GravityTilt
from fidim_lab.effects.geometry.markers import MarkerOffset
from fidim_lab.model.mechanism import Mechanism

TYPICAL_ANCHOR, TYPICAL_ATTACHMENT = 1e-3, 0.5e-3
"""m: what a total station and a caliper reach on a cable robot; assumed where a robot file says nothing"""
TYPICAL = MappingProxyType({"anchor": TYPICAL_ANCHOR, "attachment": TYPICAL_ATTACHMENT})
"""the same by the key of `[survey]`"""
TYPICAL_MARKER = 1e-3
"""m: what a ruler reaches from a marker to the platform's frame; assumed where a robot file says nothing"""
TYPICAL_TURN, TYPICAL_SHIFT = 2e-3, 2e-3
"""rad, m: by which a calibration square on a floor stands off gravity, and off the frame in which anchors were surveyed
by other means; a spirit level is good to 5 mrad"""
EXACT = 1e-9
"""m and rad: the sd of one coordinate that is exact beside others that are not; a thousandth of what is ever told"""


@dataclass(frozen=True)
class Nuisance:
    """One piece of the geometry that is uncertain."""

    what: str
    """by the key of `[survey]`"""
    effect: NamedEffect
    sd: tuple[float, ...]
    """of its θ about 0, m or rad"""

    @property
    def name(self) -> str:
        """`what`, with the number of a marker that is not the main one: with `cable`, which piece it is."""
        number = self.effect.number if isinstance(self.effect, MarkerOffset) else 1
        return self.what if number == 1 else f"{self.what} {number}"

    @property
    def cable(self) -> int | None:
        """1-based; None where it concerns none, or all."""
        return self.effect.cable


def typical(robot: Robot) -> Survey:
    """What is assumed of a robot whose file says nothing: a usual survey of anchors and attachments."""
    return Survey.alike(robot.n, TYPICAL_ANCHOR, TYPICAL_ATTACHMENT)


def usual(robot: Robot, factor: float = 1.0) -> tuple[Nuisance, ...]:
    """What a usual survey leaves open, its standard deviations so many times as large."""
    return nuisances(robot, typical(robot).scaled(factor))


def usual_markers(robot: Robot, factor: float = 1.0) -> tuple[Nuisance, ...]:
    """What a usual survey leaves open of the markers' places on the platform."""
    return nuisances(robot, replace(Survey.alike(robot.n, 0.0, 0.0), marker=factor * TYPICAL_MARKER))


def usual_frame(robot: Robot, factor: float = 1.0) -> tuple[Nuisance, ...]:
    """What remains open of the capture's frame against the robot's, and of the direction of gravity in it."""
    turn, shift = factor * TYPICAL_TURN, factor * TYPICAL_SHIFT
    exact = Survey.alike(robot.n, 0.0, 0.0)
    return nuisances(robot, replace(exact, frame_rotation=turn, frame_shift=shift, gravity=turn))


def stated(robot: Robot) -> tuple[Nuisance, ...]:
    """What the robot file's own survey leaves open; nothing where it has none."""
    return () if robot.survey is None else nuisances(robot, robot.survey)


def stated_or_usual(robot: Robot) -> tuple[Nuisance, ...]:
    """What the robot file's own survey leaves open; what a usual one does where it has none."""
    return usual(robot) if robot.survey is None else stated(robot)


def as_found(mechanism: Mechanism, pieces: Mapping[tuple[str, int | None], Sequence[float]]) -> Mechanism:
    """The mechanism with the geometry that a fit has found, behind its effects; itself where that is the file's.

    pieces: (name of a piece, 1-based cable or None) → by how much, m or rad.
    """
    opened = opened_by(mechanism.robot, pieces)
    if not opened:
        return mechanism
    theta = [*mechanism.theta.tolist(), *(float(by) for one in opened for by in pieces[one.name, one.cable])]
    return Mechanism(
        mechanism.robot, (*mechanism.effects, *(one.effect for one in opened)), theta, native=mechanism.native
    )


def opened_by(robot: Robot, pieces: Collection[tuple[str, int | None]]) -> tuple[Nuisance, ...]:
    """What is open of the geometry where these pieces are: (name, 1-based cable or None)."""
    known = stated(robot) or (*usual(robot), *usual_markers(robot), *usual_frame(robot))
    return tuple(one for one in known if (one.name, one.cable) in pieces)


def nuisances(robot: Robot, survey: Survey) -> tuple[Nuisance, ...]:
    """Everything that the survey leaves open, in a fixed order; nothing for an exact one."""
    found: list[Nuisance] = []
    for k in range(robot.n):
        cable = k + 1
        found += [
            Nuisance("anchor", AnchorOffset(cable), tuple(survey.anchor[k])),
            Nuisance("attachment", AttachmentOffset(cable), tuple(survey.attachment[k])),
            Nuisance("axis", SwivelAxis(cable), 2 * (survey.axis,)),
            Nuisance("encoder_zero", CableLengthBias(cable), (survey.encoder_zero,)),
        ]
        if robot.cables[k].radius > 0:
            found.append(Nuisance("radius", PulleyRadius(cable), (survey.radius,)))
    found += [
        Nuisance("marker", MarkerOffset(number=number), 3 * (survey.marker,))
        for number in range(1, len(robot.markers) + 1)
    ]
    found.append(Nuisance("frame", FrameMisalignment(), 3 * (survey.frame_rotation,) + 3 * (survey.frame_shift,)))
    found.append(Nuisance("gravity", GravityTilt(), 2 * (survey.gravity,)))
    return tuple(one for one in found if any(one.sd))


def prior_sd(open_geometry: Sequence[Nuisance]) -> Float[np.ndarray, " theta"]:
    """Standard deviations of all θ, in the order of the nuisances."""
    return np.maximum(np.concatenate([np.zeros(0), *(one.sd for one in open_geometry)]), EXACT)
