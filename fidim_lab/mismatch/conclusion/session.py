"""The report on what differs from window to window, and on noise other than in the robot file.

A body that changes is physics, a drift of lengths may be (cables that grow), and both are named as effects; steps and
scatter of lengths and the frame of the cameras are the sensors' own. Each is reported with its size and with what it
cannot be distinguished from.
"""

from dataclasses import replace

import numpy as np

from fidim_lab.identification.markers.finding import DefectKind
from fidim_lab.mismatch.cleaning.clean import Cleaned
from fidim_lab.mismatch.conclusion.explanation import Explanation, NamedCause, Reading, Verdict
from fidim_lab.mismatch.conclusion.parts import EffectParameter
from fidim_lab.mismatch.session.changes import SessionChange, SessionChanges
from fidim_lab.mismatch.session.kinds import (
    BODY_DRIFT,
    BODY_ONCE,
    BODY_STEP,
    CAMERA_DRIFT,
    CAMERA_STEP,
    CONSTANT,
    DRIFT,
    PHYSICS,
    SAYS,
    SCATTER,
    STEP,
)
from fidim_lab.mismatch.session.load import PointLoad
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.units import millimetres, plain

NOISE = "marker-noise"
PLACE, MOMENTS = ("m",) * 3, ("m²",) * 6
"""units of a body's parameters, per unit mass"""
MOST_CHANNELS = 2
"""whose noise is reported"""
NEXT = {
    DRIFT: "Record one place first and last in a session, and home the winches in between.",
    STEP: "Check that cable's drum, and home its winch again.",
    SCATTER: "State the encoder_resolution that was found in the robot file. Move to one place from both sides: "
    "hysteresis gives two lengths.",
    CAMERA_DRIFT: "Fix a marker to the frame and record it too.",
    BODY_ONCE: "Leave that window out, or make it a campaign of its own.",
    BODY_DRIFT: "Weigh the platform before and after a session.",
    BODY_STEP: "Fasten whatever may have shifted, or make a campaign for each load.",
    CAMERA_STEP: "Calibrate the cameras again.",
    NOISE: "State the marker_noise that was found in the robot file.",
}


def with_session(told: Explanation, changes: SessionChanges | None, cleaned: Cleaned) -> Explanation:
    """The explanation with what differs between windows and was put right, and with noise of readings."""
    if changes is None:
        return _with_noise(told, cleaned)
    sensors = cleaned.campaign.robot.sensors
    readings = tuple(_reading(one, changes) for one in changes.found)
    physics = tuple(
        NamedCause(
            one.id,
            one.cable,
            one.equivalent_to,
            one.parameters,
            SAYS[one.id],
            single=not found.rivals,
            windows=dict(zip(changes.order, found.kind.course.tolist(), strict=True)),
        )
        for found, one in zip(changes.found, readings, strict=True)
        if one.id in PHYSICS
    )
    verdict = told.verdict
    if verdict is Verdict.NOTHING_MISSING:
        verdict = Verdict.EXPLAINED if physics else Verdict.SENSOR_FAULT
    said = [reading.says for reading in readings]
    if not all(one.kind.is_body for one in changes.found):
        said.append(f"The robot file states {millimetres(sensors.encoder_resolution):.2g} mm for lengths.")
        said.append("The fit uses corrected values.")
    if changes.moves_body:
        said.append("The fit has the body of each window; its parameters are those without the change.")
    message = f"{' '.join(said)} {told.message.replace('Nothing is missing:', 'Nothing else is missing:', 1)}"
    told = replace(told, verdict=verdict, effects=(*told.effects, *physics), readings=readings, message=message)
    return _with_noise(told, cleaned)


def _with_noise(told: Explanation, cleaned: Cleaned) -> Explanation:
    """With marker noise that is not as the robot file states, where no more than noise is left."""
    if told.verdict in (Verdict.UNKNOWN_PHYSICS, Verdict.PARTLY_EXPLAINED):
        return told
    found = [one for one in cleaned.screening.findings if one.kind is DefectKind.NOISE and one.window is None]
    noise = tuple(
        Reading(NOISE, None, (), {one.channel: EffectParameter(one.size, None, one.unit)}, one.says, NEXT[NOISE])
        for one in found[:MOST_CHANNELS]
    )
    return replace(told, readings=(*told.readings, *noise)) if noise else told


def _reading(error: SessionChange, changes: SessionChanges) -> Reading:
    kind = error.kind
    alike = tuple(dict.fromkeys(other.id for other in error.rivals if other.id not in (kind.id, CONSTANT)))
    return Reading(kind.id, kind.cable, alike, _parameters(error), _words(error, changes), NEXT[kind.id])


def _parameters(error: SessionChange) -> dict[str, EffectParameter]:
    if error.kind.is_scatter:
        return {"size": EffectParameter(error.size, None, "m")}
    if error.kind.is_body:
        by = np.diag(error.kind.chosen[-BODY:])
        rows = zip(error.kind.names, by * error.theta, by * error.sd, PLACE + MOMENTS, strict=True)
    else:
        rows = ((name, value, sd, "m") for name, value, sd in zip(error.kind.names, error.theta, error.sd, strict=True))
    return {name: EffectParameter(float(value), float(sd), unit) for name, value, sd, unit in rows}


def _words(error: SessionChange, changes: SessionChanges) -> str:
    kind = error.kind
    where = f", cable {kind.cable}" if kind.cable is not None else ""
    since = f", from window {kind.first} on" if kind.first is not None else ""
    since = f", window {kind.first}" if kind.id == BODY_ONCE else since
    load = changes.load(error) if kind.is_body else None
    if kind.is_scatter:
        sizes = f"{millimetres(error.size):.2g} mm"
    elif load is not None:
        sizes = _as_a_load(load)
    else:
        rows = list(zip(kind.names, error.theta, error.sd, strict=True))[: len(PLACE) if kind.is_body else None]
        sizes = ", ".join(f"{name} {millimetres(value):+.2g} ± {millimetres(sd):.1g} mm" for name, value, sd in rows)
    return f"{SAYS[kind.id]}{where}{since}: {sizes}."


def _as_a_load(load: PointLoad) -> str:
    at = ", ".join(plain(millimetres(value)) for value in load.at)
    sd = ", ".join(plain(millimetres(value), 1) for value in load.at_sd)
    share = f"{100 * load.share:+.2f} ± {100 * load.share_sd:.1g} %"
    return f"a load of {share} of the platform's mass at ({at}) ± ({sd}) mm from P"
