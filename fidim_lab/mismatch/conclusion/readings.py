"""The report on wrong lengths and cameras: errors of readings, and noise other than in the robot file.

A drift of lengths may be physics (cables that grow) and is named as an effect; steps, scatter and the frame of the
cameras are the sensors' own. Each is reported with its size and with what it cannot be distinguished from.
"""

from dataclasses import replace

from fidim_lab.identification.markers.finding import DefectKind
from fidim_lab.mismatch.cleaning.clean import Cleaned
from fidim_lab.mismatch.conclusion.explanation import Explanation, NamedCause, Reading, Verdict
from fidim_lab.mismatch.conclusion.parts import EffectParameter
from fidim_lab.mismatch.readings.errors import ReadingError, ReadingErrors
from fidim_lab.mismatch.readings.kinds import CAMERA_DRIFT, CAMERA_STEP, CONSTANT, DRIFT, SAYS, SCATTER, STEP
from fidim_lab.units import millimetres

NOISE = "marker-noise"
MOST_CHANNELS = 2
"""whose noise is reported"""
NEXT = {
    DRIFT: "Record one place first and last in a session, and home the winches in between.",
    STEP: "Check that cable's drum, and home its winch again.",
    SCATTER: "State the encoder_resolution that was found in the robot file. Move to one place from both sides: "
    "hysteresis gives two lengths.",
    CAMERA_DRIFT: "Fix a marker to the frame and record it too.",
    CAMERA_STEP: "Calibrate the cameras again.",
    NOISE: "State the marker_noise that was found in the robot file.",
}


def with_readings(told: Explanation, errors: ReadingErrors | None, cleaned: Cleaned) -> Explanation:
    """The explanation with errors of readings that were corrected, and with their noise."""
    if errors is None:
        return _with_noise(told, cleaned)
    sensors = cleaned.campaign.robot.sensors
    readings = tuple(_reading(one) for one in errors.found)
    drifts = tuple(
        NamedCause(DRIFT, reading.cable, reading.equivalent_to, reading.parameters, SAYS[DRIFT], single=not one.rivals)
        for one, reading in zip(errors.found, readings, strict=True)
        if reading.id == DRIFT
    )
    verdict = told.verdict
    if verdict is Verdict.NOTHING_MISSING:
        verdict = Verdict.EXPLAINED if drifts else Verdict.SENSOR_FAULT
    stated = f"The robot file states {millimetres(sensors.encoder_resolution):.2g} mm for lengths."
    said = " ".join([*(reading.says for reading in readings), stated, "The fit uses corrected values."])
    message = f"{said} {told.message.replace('Nothing is missing:', 'Nothing else is missing:', 1)}"
    told = replace(told, verdict=verdict, effects=(*told.effects, *drifts), readings=readings, message=message)
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


def _reading(error: ReadingError) -> Reading:
    kind = error.kind
    alike = tuple(dict.fromkeys(other.id for other in error.rivals if other.id not in (kind.id, CONSTANT)))
    return Reading(kind.id, kind.cable, alike, _parameters(error), _words(error), NEXT[kind.id])


def _parameters(error: ReadingError) -> dict[str, EffectParameter]:
    if error.kind.is_scatter:
        return {"size": EffectParameter(error.size, None, "m")}
    rows = zip(error.kind.names, error.theta, error.sd, strict=True)
    return {name: EffectParameter(float(value), float(sd), "m") for name, value, sd in rows}


def _words(error: ReadingError) -> str:
    kind = error.kind
    where = f", cable {kind.cable}" if kind.cable is not None else ""
    since = f", from window {kind.first} on" if kind.first is not None else ""
    if kind.is_scatter:
        sizes = f"{millimetres(error.size):.2g} mm"
    else:
        rows = zip(kind.names, error.theta, error.sd, strict=True)
        sizes = ", ".join(f"{name} {millimetres(value):+.2g} ± {millimetres(sd):.1g} mm" for name, value, sd in rows)
    return f"{SAYS[kind.id]}{where}{since}: {sizes}."
