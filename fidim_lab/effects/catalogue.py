"""All effects of spec/model.md §5 for one robot, in a stable order.

`catalogue(robot)` has one value for each effect, variant and cable; `by_id` those of one id. `IDS` are the ids, fixed
because they appear in results. To add an effect see docs/effects.md: write its class, and add a line to `_MAKERS`.
"""

from collections.abc import Callable, Iterable

from fidim_lab.data.files.toml_file import nearest
from fidim_lab.data.records import Robot
from fidim_lab.effects.cables.cable_elasticity import DampedElasticity, DampedFrame, DampedStiffness, DampedWinch
from fidim_lab.effects.cables.cable_mass import CableMass, SwivelInertia
from fidim_lab.effects.cables.cable_torsion import CableTorsion, HoseTorsion, LayTorque
from fidim_lab.effects.dissipation.attachment_friction import AttachmentFriction
from fidim_lab.effects.dissipation.drag import (
    AirDragLinear,
    AirDragQuadratic,
    RotationalDrag,
    RotationalDragPerAxis,
    RotationalDragQuadratic,
)
from fidim_lab.effects.dissipation.pulley_friction import (
    PulleyFriction,
    PulleyFrictionByTension,
    SwivelDamping,
    SwivelFriction,
    SwivelFrictionGivingWay,
)
from fidim_lab.effects.effect import HandContact, NamedEffect, SensorFault, UnknownEffect
from fidim_lab.effects.geometry.cable_geometry import (
    AnchorOffset,
    AttachmentOffset,
    CableCreep,
    CableLengthBias,
    PulleyRadius,
)
from fidim_lab.effects.geometry.frames import CaptureScale, ClockRate, FrameMisalignment, GravityTilt, TimeOffset
from fidim_lab.effects.geometry.markers import MarkerOffset, MarkerStalk
from fidim_lab.effects.loads.constant_force import BodyForce, ConstantForce
from fidim_lab.effects.loads.loose_mass import LooseMass, LooseMassOnAxis
from fidim_lab.effects.loads.oscillation import FrameSway, FrameSwayOwnPhase, PeriodicForce, PeriodicForceOwnPhase
from fidim_lab.effects.loads.umbilical import Umbilical, UmbilicalWithRest
from fidim_lab.errors import SetupError

Maker = Callable[[Robot], Iterable[NamedEffect]]


def _once(*kinds: type[NamedEffect]) -> Maker:
    return lambda robot: [kind() for kind in kinds]


def _each(kind: type[NamedEffect]) -> Maker:
    """One for each cable."""
    return lambda robot: [kind(cable=number) for number in range(1, robot.n + 1)]


def _all_and_each(kind: type[NamedEffect]) -> Maker:
    """Alike for all cables, and one for each where there are several."""
    return lambda robot: [kind(), *(_each(kind)(robot) if robot.n > 1 else [])]


def _elasticity(robot: Robot) -> list[NamedEffect]:
    each = _each(DampedElasticity)(robot) if robot.n > 1 else []
    return [DampedElasticity(), DampedStiffness(), *each]


def _markers(robot: Robot) -> list[NamedEffect]:
    return [MarkerOffset(number=number) for number in range(1, len(robot.markers) + 1)]


def _stalks(robot: Robot) -> list[NamedEffect]:
    """Upright ones first."""
    return [MarkerStalk(number=number, axis=axis) for number in range(1, len(robot.markers) + 1) for axis in (2, 0, 1)]


_MAKERS: tuple[Maker, ...] = (
    _once(AirDragLinear),
    _once(AirDragQuadratic),
    _once(RotationalDrag, RotationalDragPerAxis),
    _once(RotationalDragQuadratic),
    _all_and_each(SwivelFriction),
    lambda robot: [SwivelFrictionGivingWay(cables=robot.n)],
    _all_and_each(SwivelDamping),
    _all_and_each(SwivelInertia),
    _all_and_each(PulleyFriction),
    _all_and_each(PulleyFrictionByTension),
    _all_and_each(AttachmentFriction),
    _elasticity,
    _each(DampedWinch),
    _once(DampedFrame),
    _each(CableCreep),
    _once(CableMass),
    _once(LayTorque),
    _once(CableTorsion, HoseTorsion),
    _each(AnchorOffset),
    _each(AttachmentOffset),
    _all_and_each(PulleyRadius),
    _each(CableLengthBias),
    _once(GravityTilt),
    _markers,
    _stalks,
    _once(FrameMisalignment),
    _once(CaptureScale),
    _once(ClockRate),
    _once(TimeOffset),
    _once(PeriodicForce, PeriodicForceOwnPhase),
    _once(ConstantForce),
    _once(BodyForce),
    _once(Umbilical, UmbilicalWithRest),
    _once(LooseMass, LooseMassOnAxis),
    _once(FrameSway, FrameSwayOwnPhase),
    _once(HandContact),
    _once(SensorFault),
    _once(UnknownEffect),
)


def catalogue(robot: Robot) -> tuple[NamedEffect, ...]:
    """Every effect, variant and cable for this robot, in the order of spec/model.md §5, all cables first."""
    return tuple(effect for maker in _MAKERS for effect in maker(robot))


def by_id(robot: Robot, id: str, cable: int | None = None) -> tuple[NamedEffect, ...]:
    """The effects with this id, and with this cable where one is given.

    Raises SetupError for an id that the catalogue does not have, or a cable for which it has none.
    """
    every = catalogue(robot)
    named = [effect for effect in every if effect.id == id]
    if not named:
        ids = dict.fromkeys(effect.id for effect in every)
        near = nearest(id, ids)
        meant = f"Did you mean {near}? " if near else ""
        raise SetupError(f"No effect is called '{id}'.", hint=f"{meant}Known: {', '.join(ids)}.")
    found = tuple(effect for effect in named if cable is None or effect.cable == cable)
    if not found:
        raise SetupError(f"{id}: there is none for cable {cable} of a robot with {robot.n} cables.")
    return found
