"""From one take as it was read to poses in the robot's frame, the same way for every format.

    unit → missing samples → even steps → which marker is which → labels mended → poses → which axis is up

What the file says is taken; what it does not say is found by the robot file: the unit by the distances between
markers, the upward axis (and the body, among several) by the cable lengths, which do not change while the motors are
locked. Where that is thin, the caller is asked for `--unit`, `--up`, `--order` or `--body`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from fidim_lab.arrays import Positions, Rotations, Series
from fidim_lab.data.importers.reading import LENGTH_UNITS
from fidim_lab.data.importers.recording import BodyTrack, MarkerLog
from fidim_lab.data.importers.takes import Asked
from fidim_lab.data.marker_order import order_of
from fidim_lab.data.missing import without_filled
from fidim_lab.data.rigid_body import MarkerSeries, fit_pose
from fidim_lab.data.stitching import stitch
from fidim_lab.errors import FidimError, InfeasibleError, RefusedError
from fidim_lab.model.mechanism import Mechanism

UPRIGHT = MappingProxyType(
    {
        "z": np.eye(3),
        "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
        "x": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    }
)
"""by the axis that points upwards in the file: what turns it to z"""
TRIED_UNITS = ("m", "mm")
"""a factor of 1000 apart, so that a place tells them apart"""
STRAY = 5e-3
"""m, by which lengths of locked cables may vary by the poses. With a surveyed frame it was 0.1 to 0.5 in 60 takes"""
CLEAR = 2.0
"""times as much must they vary in another way to read the file, or it is asked for"""
WIDEST = 3.0
"""times as far from the middle of the anchors as these are themselves, the platform cannot be"""
FEW = 2000
"""samples are enough to see whether lengths vary"""


@dataclass(frozen=True, eq=False)
class PosedTake:
    """Poses of one take in the robot's frame, and how they came about."""

    t: Series
    """s, even steps"""
    markers: MarkerSeries
    """(N, B, 3) m, in the robot file's order"""
    positions: Positions
    rotations: Rotations
    rms: Series
    """m, misfit of the rigid markers; 0 where poses were exported"""
    names: tuple[str, ...]
    """of the markers in the file, in that order"""
    decided: tuple[str, ...]
    warnings: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class PoseReading:
    """One way to read the poses of a file, and how much the cable lengths vary in it."""

    up: str
    positions: Positions
    rotations: Rotations
    varies: float
    """m"""
    body: BodyTrack | None = None
    turned: bool = False
    """whether the body's own axes are named like the file's, too"""

    @property
    def words(self) -> str:
        """For a person."""
        axes = ", its own axes too" if self.turned else ""
        return f"{self.up} upwards{axes}" + (f" for body {self.body.name}" if self.body else "")


def pose_take(mechanism: Mechanism, log: MarkerLog, asked: Asked) -> PosedTake:
    """The poses of one take. Raises RefusedError where the markers do not fit, or something has to be asked for."""
    body = mechanism.robot.markers
    log, said = _in_metres(mechanism, log, asked)
    count = log.positions.shape[1] + (0 if log.unlabelled is None else log.unlabelled.shape[1])
    if asked.body is None and count and len(body) >= 3:
        try:
            found = _by_markers(mechanism, log, asked)
        except RefusedError as error:
            if not log.bodies:
                raise
            found = _by_bodies(mechanism, log, asked)
            found = replace(found, warnings=(*found.warnings, f"markers not used: {error}"))
    elif log.bodies:
        found = _by_bodies(mechanism, log, asked)
    else:
        raise RefusedError(f"{count} markers and no rigid body; a pose needs three markers or a body.")
    return replace(found, decided=(*said, *found.decided))


def _in_metres(mechanism: Mechanism, log: MarkerLog, asked: Asked) -> tuple[MarkerLog, tuple[str, ...]]:
    if asked.unit is not None:
        return _scaled(log, LENGTH_UNITS[asked.unit] / log.scale), (f"lengths in {asked.unit}, as asked for",)
    if log.unit_said:
        return log, ()
    unit = _unit_of(mechanism, log)
    return _scaled(log, LENGTH_UNITS[unit]), (f"lengths in {unit}: the file does not say, the robot file fits so",)


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
    body = mechanism.robot.markers
    if log.positions.shape[1] >= len(body) >= 3:
        fits: dict[str, float] = {}
        for unit in TRIED_UNITS:
            scaled = _scaled(log, LENGTH_UNITS[unit])
            try:
                fits[unit] = order_of(without_filled(scaled.positions, scaled.scale)[0], body)[1]
            except RefusedError:
                continue
        if len(fits) == 1:
            return next(iter(fits))
    anchors = np.array([cable.d for cable in mechanism.robot.cables])
    reach = WIDEST * np.linalg.norm(anchors - anchors.mean(axis=0), axis=1).max()
    for unit in TRIED_UNITS if log.bodies else ():
        away = LENGTH_UNITS[unit] * np.linalg.norm(log.bodies[0].positions, axis=1) - np.linalg.norm(
            anchors.mean(axis=0)
        )
        if np.nanmedian(away) < reach:
            return unit
    raise RefusedError("The file does not say its unit of length, and in none the robot file fits.", hint="Say --unit.")


def _by_markers(mechanism: Mechanism, log: MarkerLog, asked: Asked) -> PosedTake:
    body = mechanism.robot.markers
    markers, said = without_filled(log.positions, log.scale)
    loose = np.zeros((len(markers), 0, 3)) if log.unlabelled is None else without_filled(log.unlabelled, log.scale)[0]
    names = (*log.names, *(f"unlabelled {k + 1}" for k in range(loose.shape[1])))
    labelled = markers if markers.shape[1] >= len(body) else np.concatenate([markers, loose], axis=1)
    order, misfit, warnings = _order(names, labelled, body, asked)
    picked = tuple(names[k] for k in order)
    said = (*said, f"markers in the robot file's order: {', '.join(picked)}; distances agree to {misfit * 1e3:.1f} mm")
    mended = stitch(labelled[:, order], np.concatenate([markers, loose], axis=1), body)
    if mended.found:
        said = (*said, f"in {mended.found} samples a missing marker was found among places without a label")
    if mended.relabelled:
        warnings = (
            *warnings,
            f"labels were wrong in {mended.relabelled} samples and were mended by the rigid distances",
        )
    t, even = _even(log, mended.markers)
    reading, told = _upright(mechanism, log, asked, [(None, *fit_pose(even, body)[:2])])
    turned = even @ UPRIGHT[reading.up].T
    positions, rotations, rms = fit_pose(turned, body)
    return PosedTake(
        t, turned, positions, rotations, rms, picked, (*said, *told.decided), (*warnings, *told.warnings)
    )  # fmt: skip


def _order(
    names: Sequence[str], markers: np.ndarray, body: np.ndarray, asked: Asked
) -> tuple[tuple[int, ...], float, tuple[str, ...]]:
    """Indices of the markers in the robot file's order, misfit of their distances (m), and what is to be checked."""
    if asked.order:
        missing = [name for name in asked.order if names.count(name) != 1]
        if missing or len(asked.order) != len(body):
            what = f"no marker {missing[0]!r}" if missing else f"{len(asked.order)} names for {len(body)} markers"
            raise RefusedError(f"--order: {what}; the file has {', '.join(names)[:150]}.")
        order = tuple(names.index(name) for name in asked.order)
        return order, order_of(markers[:, order], body)[1], ()
    order, misfit, certain = order_of(markers, body)
    doubt = "another order of the markers fits nearly as well: check it, or say --order"
    return order, misfit, () if certain else (doubt,)


def _by_bodies(mechanism: Mechanism, log: MarkerLog, asked: Asked) -> PosedTake:
    """Poses as exported; the robot file's markers stand where these put them."""
    named = [body for body in log.bodies if asked.body in (None, body.name)]
    if not named:
        found = ", ".join(body.name for body in log.bodies)
        raise RefusedError(f"--body {asked.body}: no such rigid body; found {found[:150] or 'none'}.")
    tracks: list[tuple[BodyTrack | None, Positions, Rotations]] = []
    said: tuple[str, ...] = ()
    t = _even(log, log.t)[0]
    for body in named:
        places, said = without_filled(body.positions[:, None], log.scale)
        positions = _even(log, places)[1]
        rotations = _even(log, body.rotations)[1]
        rotations[np.isnan(positions[:, 0, 0])] = np.nan
        tracks.append((body, positions[:, 0], rotations))
    reading, told = _upright(mechanism, log, asked, tracks)
    name = reading.body.name if reading.body else ""
    said = (*said, f"poses are those of rigid body {name}; its origin and axes count as the robot file's body frame")
    where, turn = reading.positions, reading.rotations
    markers = where[:, None] + np.einsum("nij,mj->nmi", turn, mechanism.robot.markers)
    rms = np.where(np.isfinite(where[:, 0]), 0.0, np.nan)
    names = tuple(f"{name} {k + 1}" for k in range(markers.shape[1]))
    return PosedTake(t, markers, where, turn, rms, names, (*said, *told.decided), told.warnings)


def _even(log: MarkerLog, values: np.ndarray) -> tuple[Series, np.ndarray]:
    """Even steps at the file's rate: a dropped frame becomes a sample in which nothing was seen."""
    at = np.rint(log.t * log.rate).astype(int)
    full = np.full((at[-1] + 1, *values.shape[1:]), np.nan)
    full[at] = values
    return np.arange(at[-1] + 1) / log.rate, full


@dataclass(frozen=True)
class Decision:
    """What is to be said of a decision."""

    decided: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


def _upright(
    mechanism: Mechanism,
    log: MarkerLog,
    asked: Asked,
    tracks: Sequence[tuple[BodyTrack | None, Positions, Rotations]],
) -> tuple[PoseReading, Decision]:
    """The reading in which cable lengths vary least, if the file or the caller does not say another one."""
    readings = sorted(_readings(mechanism, tracks), key=lambda reading: reading.varies)
    said = asked.up or log.up
    fitting = [reading for reading in readings if reading.up == said] or readings
    best, chosen = readings[0], fitting[0]
    shown = f"cable lengths vary by {chosen.varies * 1e3:.1f} mm (robust sd)"
    if asked.up is None and said is not None and chosen.varies > STRAY >= best.varies:
        words = f"the file says {said} upwards, but cable lengths vary by {chosen.varies * 1e3:.1f} mm so"
        warning = f"{words}; {best.words} was taken, where they vary by {best.varies * 1e3:.1f} mm"
        return best, Decision((), (warning,))
    if asked.up is not None and chosen.varies > STRAY >= best.varies:
        raise RefusedError(
            f"With {asked.up} upwards, as asked for, cable lengths vary by {chosen.varies * 1e3:.1f} mm though the "
            f"motors are locked; with {best.up} upwards by {best.varies * 1e3:.1f} mm.",
            hint=f"Say --up {best.up}.",
        )
    rivals = [r for r in fitting if r is not chosen and r.varies < CLEAR * chosen.varies]
    _ask(chosen, rivals, said)
    how = "as asked for" if asked.up else "as the file says" if log.up else "by the cable lengths"
    decided = (f"{chosen.words}, {how}: {shown}",)
    if asked.up is not None and CLEAR * best.varies < chosen.varies:
        warning = f"{shown}; with {best.up} upwards by {best.varies * 1e3:.1f} mm: is --up {best.up} meant?"
        return chosen, Decision(decided, (warning,))
    if chosen.varies > STRAY:
        warning = f"{shown} though the motors are locked: the motion-capture or body frame is not the robot's"
        return chosen, Decision(decided, (warning,))
    return chosen, Decision(decided)


def _ask(chosen: PoseReading, rivals: Sequence[PoseReading], said: str | None) -> None:
    """Raises RefusedError where another reading fits about as well and nobody said which."""
    other = next((rival for rival in rivals if rival.body is not chosen.body), None)
    if other is not None:
        raise RefusedError(f"Not told: {chosen.words} fits no better than {other.words}.", hint="Say --body.")
    other = next((rival for rival in rivals if rival.up != chosen.up), None)
    if said is None and other is not None:
        what = f"{chosen.up} ({chosen.varies * 1e3:.1f} mm) or {other.up} ({other.varies * 1e3:.1f} mm)"
        raise RefusedError(
            f"Which axis points upwards is not in the file; by the cable lengths {what}.", hint="Say --up."
        )


def _readings(
    mechanism: Mechanism, tracks: Sequence[tuple[BodyTrack | None, Positions, Rotations]]
) -> Iterator[PoseReading]:
    for body, positions, rotations in tracks:
        for up, turn in UPRIGHT.items():
            where, turned = positions @ turn.T, turn @ rotations
            yield PoseReading(up, where, turned, _varies(mechanism, where, turned), body)
            if body is not None and up != "z":
                own = turned @ turn.T
                yield PoseReading(up, where, own, _varies(mechanism, where, own), body, turned=True)


def _varies(mechanism: Mechanism, positions: Positions, rotations: Rotations) -> float:
    """m, robust standard deviation of the cable lengths by these poses, rms over the cables; inf without a pose."""
    known = np.flatnonzero(np.isfinite(positions).all(axis=1))
    some = known[:: max(1, len(known) // FEW)]
    if not len(some):
        return float("inf")
    try:
        lengths = mechanism.lengths(positions[some], rotations[some])
    except (InfeasibleError, FidimError):
        return float("inf")
    away = 1.4826 * np.median(np.abs(lengths - np.median(lengths, axis=0)), axis=0)
    return float(np.sqrt(np.mean(away**2))) if np.isfinite(away).all() else float("inf")
