"""The unit of length of a take: the file's, the one asked for, or the one in which the robot file fits."""

from dataclasses import replace

import numpy as np

from fidim_lab.app.records.import_readings import UNITS
from fidim_lab.data.importers.reading import LENGTH_UNITS
from fidim_lab.data.importers.recording import MarkerLog
from fidim_lab.data.importers.takes import Asked
from fidim_lab.data.marker_order import order_of
from fidim_lab.data.missing import without_filled
from fidim_lab.data.stitching import FEWEST, found_by_shape
from fidim_lab.errors import RefusedError
from fidim_lab.model.mechanism import Mechanism

BY_PLACE = ("m", "mm")
"""a factor of 1000 apart, so that a place tells them apart"""
WIDEST = 3.0
"""times as far from the middle of the anchors as these are themselves, the platform cannot be"""
SOME = 40
"""samples, in which markers are looked for in other units and in a mirror: 20 ms for each"""
MOSTLY = 0.6
"""of all markers are then found: three of five, which a mirror does not change, must not be enough"""
MIRROR = np.array([1.0, 1.0, -1.0])
"""by which coordinates are multiplied"""


def in_metres(mechanism: Mechanism, log: MarkerLog, asked: Asked) -> tuple[MarkerLog, tuple[str, ...]]:
    """The take in m, and how its unit is known. Raises RefusedError where it has to be asked for."""
    if asked.unit is not None:
        return _scaled(log, LENGTH_UNITS[asked.unit] / log.scale), (f"lengths in {asked.unit}, as requested",)
    if log.unit_said:
        return log, ()
    unit = _unit_of(mechanism, log)
    return _scaled(log, LENGTH_UNITS[unit]), (
        f"lengths in {unit}: not stated in the file, but the marker distances of the robot file fit",
    )


def units_that_fit(mechanism: Mechanism, log: MarkerLog) -> dict[str, float]:
    """Units in which the distances between the markers are those of the robot file, with their misfit, m rms."""
    body = mechanism.robot.markers
    fits: dict[str, float] = {}
    if not log.positions.shape[1] >= len(body) >= 3:
        return fits
    for unit in UNITS:
        scaled = _scaled(log, LENGTH_UNITS[unit] / log.scale)
        try:
            fits[unit] = order_of(without_filled(scaled.positions, scaled.scale)[0], body)[1]
        except RefusedError:
            continue
    return fits


def found_otherwise(mechanism: Mechanism, log: MarkerLog) -> tuple[str | None, bool] | None:
    """Another unit (None: the same), and whether in a mirror, in which most markers are found whatever their labels.

    None where they are found as read, or in no way, or where three markers look the same in a mirror.
    """
    body = mechanism.robot.markers
    places = log.positions if log.unlabelled is None else np.concatenate([log.positions, log.unlabelled], axis=1)
    some = without_filled(places, log.scale)[0][:: max(1, len(places) // SOME)]
    ways: list[tuple[str | None, bool, float]] = [(None, False, 1.0), (None, True, 1.0)]
    ways += [(unit, mirrored, LENGTH_UNITS[unit] / log.scale) for mirrored in (False, True) for unit in UNITS]
    for unit, mirrored, factor in ways:
        if (unit is not None and np.isclose(factor, 1.0)) or (mirrored and len(body) <= FEWEST):
            continue
        seen = factor * some * (MIRROR if mirrored else 1.0)
        if np.isfinite(found_by_shape(seen, body)).all(axis=2).mean() > MOSTLY:
            return None if unit is None and not mirrored else (unit, mirrored)
    return None


def _scaled(log: MarkerLog, factor: float) -> MarkerLog:
    return replace(
        log,
        positions=factor * log.positions,
        scale=factor * log.scale,
        bodies=tuple(replace(body, positions=factor * body.positions) for body in log.bodies),
        unlabelled=None if log.unlabelled is None else factor * log.unlabelled,
    )


def _unit_of(mechanism: Mechanism, log: MarkerLog) -> str:
    """The unit in which the markers fit the robot file; without markers, in which the body is near the anchors."""
    fits = units_that_fit(mechanism, log)
    if len(fits) == 1:
        return next(iter(fits))
    anchors = np.array([cable.d for cable in mechanism.robot.cables])
    reach = WIDEST * np.linalg.norm(anchors - anchors.mean(axis=0), axis=1).max()
    for unit in BY_PLACE if log.bodies else ():
        away = LENGTH_UNITS[unit] * np.linalg.norm(log.bodies[0].positions, axis=1) - np.linalg.norm(
            anchors.mean(axis=0)
        )
        if np.nanmedian(away) < reach:
            return unit
    raise RefusedError(
        "The file does not state its unit of length, and the markers fit the robot file in none.",
        hint="Check which columns are which marker's x, y and z, and the markers of the robot file; or give --unit.",
    )
