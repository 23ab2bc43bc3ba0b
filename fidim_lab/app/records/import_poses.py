"""From one take as it was read to poses in the robot's frame, the same way for every format.

    unit → missing samples → even steps → which marker is which → labels mended → poses → which axis is up

What the file says is taken; what it does not say is found by the robot file: the unit by the distances between
markers, the upward axis (and the body, among several) by the cable lengths, which do not change while the motors are
locked. Where that is thin, the caller is asked for `--unit`, `--up`, `--order` or `--body`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from fidim_lab.app.records.import_readings import (
    CLEAR,
    FAR,
    OTHER_AXES,
    SURVEYED,
    PoseReading,
    Track,
    in_another_frame,
    readings_of,
    refuse_misread,
    stands_still,
)
from fidim_lab.app.records.import_units import MIRROR, SOME, found_otherwise, in_metres, units_that_fit
from fidim_lab.arrays import Positions, Rotations, Series
from fidim_lab.data.importers.reading import LENGTH_UNITS, MIN_FRAMES
from fidim_lab.data.importers.recording import MarkerLog
from fidim_lab.data.importers.takes import Asked
from fidim_lab.data.marker_order import order_of
from fidim_lab.data.missing import without_filled
from fidim_lab.data.rigid_body import MarkerSeries, cluster_shape, fit_pose
from fidim_lab.data.stitching import found_by_shape, stitch
from fidim_lab.errors import RefusedError
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.say import counted

STRAY = 2e-3
"""m, by which lengths of locked cables may vary by the poses. With a surveyed frame it was 0.0 to 0.3 in 60 takes, in
frames turned by 37° or more 4.4 to 13"""
UNFOUND = 0.5
"""share of samples in which no marker was found by the distances, beyond which these are other markers"""
SOLVED = 5e-6
"""m, noise under which markers were computed, not measured: cameras leave 20 µm or more, rounding to 10 µm leaves 3"""
FEWEST_MEASURED = 3
"""markers stand for a pose whether measured or computed; more tell something more only if measured"""


WRONG_AXIS = "An axis has the wrong sign, or two are exchanged"
MEND_AXIS = "Correct the axes in the export or in the column map."


class MirroredError(RefusedError):
    """Markers that are the robot file's in a mirror: a rigid body of the same file is mirrored as they are."""


@dataclass(frozen=True, eq=False)
class PosedTake:
    """Poses of one take in the robot's frame, and how they came about."""

    t: Series
    """s, even steps"""
    markers: MarkerSeries
    """(N, B, 3) m, in the robot file's order; by poses three of them"""
    positions: Positions
    rotations: Rotations
    rms: Series
    """m, misfit of the rigid markers; 0 where poses were exported"""
    names: tuple[str, ...]
    """of the markers in the file, in that order"""
    decided: tuple[str, ...]
    warnings: tuple[str, ...]


def pose_take(mechanism: Mechanism, log: MarkerLog, asked: Asked) -> PosedTake:
    """The poses of one take. Raises RefusedError where the markers do not fit, or something has to be asked for."""
    body = mechanism.robot.markers
    count = log.positions.shape[1] + (0 if log.unlabelled is None else log.unlabelled.shape[1])
    if count < FEWEST_MEASURED and not log.bodies:
        what = f"{counted(count, 'marker')} and no rigid body's rotations; a pose needs three markers or a body"
        hint = "Put all markers of a take side by side into one file, or export places and rotations of the body."
        raise RefusedError(what, hint=hint)
    log = _chosen_markers(log, asked)
    log, said_rate = _at_rate(log, asked)
    log, said = in_metres(mechanism, log, asked)
    said = (*said_rate, *said)
    if asked.body is None and count and len(body) >= 3:
        try:
            found = _by_markers(mechanism, log, asked)
        except RefusedError as error:
            if not log.bodies or isinstance(error, MirroredError):
                raise _with_cause(mechanism, log, asked, error) from None
            found = _by_bodies(mechanism, log, asked)
            found = replace(found, warnings=(*found.warnings, f"markers not used: {error}"))
    else:
        found = _by_bodies(mechanism, log, asked)
    return replace(found, decided=(*said, *found.decided))


def _chosen_markers(log: MarkerLog, asked: Asked) -> MarkerLog:
    """The take with the markers that were asked for, in that order; its others as places without a label."""
    if not asked.order:
        return log
    loose = np.zeros((len(log.t), 0, 3)) if log.unlabelled is None else log.unlabelled
    names = (*log.names, *(f"unlabelled {k + 1}" for k in range(loose.shape[1])))
    missing = [name for name in asked.order if names.count(name) != 1]
    if missing:
        raise RefusedError(f"--order: no marker {missing[0]!r}; the file has {', '.join(names)[:150]}.")
    places, at = np.concatenate([log.positions, loose], axis=1), [names.index(name) for name in asked.order]
    return replace(log, names=asked.order, positions=places[:, at], unlabelled=np.delete(places, at, axis=1))


def _at_rate(log: MarkerLog, asked: Asked) -> tuple[MarkerLog, tuple[str, ...]]:
    """The take at the rate that was asked for. Raises RefusedError where the file says two and nobody said which."""
    if asked.rate is not None:
        slower = log.rate / asked.rate
        breaks = tuple(slower * at for at in log.breaks)
        log = replace(log, t=slower * log.t, rate=asked.rate, breaks=breaks)
        return log, (f"{asked.rate:g} Hz, as requested",)
    if log.rate_doubt:
        raise RefusedError(log.rate_doubt, hint="Say the right one with --rate.")
    return log, ()


def _with_cause(mechanism: Mechanism, log: MarkerLog, asked: Asked, error: RefusedError) -> RefusedError:
    """The same, or the unit that fits where the one that was said does not; or that only a mirror fits."""
    if isinstance(error, MirroredError) or asked.order:
        return error
    for unit, misfit in units_that_fit(mechanism, log).items():
        if not np.isclose(LENGTH_UNITS[unit], log.scale):
            what = f"The unit is not the one that {'was requested' if asked.unit else 'the file says'}: in {unit} the"
            what = f"{what} distances between the markers fit the robot file to {misfit * 1e3:.1f} mm"
            return RefusedError(what, hint=f"Give --unit {unit}.")
    unit, mirrored = found_otherwise(mechanism, log) or (None, False)
    if mirrored:
        what = "The markers are the mirror image of the robot file's: whatever their labels, their distances fit"
        what = f"{what} in a mirror{f' and in {unit}' if unit else ''} only. {WRONG_AXIS}"
        return MirroredError(what, hint=MEND_AXIS)
    if unit is not None:
        what = (
            f"The unit is not the one that was stated: whatever their labels, the markers' distances fit in {unit} only"
        )
        return RefusedError(what, hint=f"Give --unit {unit}.")
    return error


def _by_markers(mechanism: Mechanism, log: MarkerLog, asked: Asked) -> PosedTake:
    body = mechanism.robot.markers
    markers, said = without_filled(log.positions, log.scale)
    loose = np.zeros((len(markers), 0, 3)) if log.unlabelled is None else without_filled(log.unlabelled, log.scale)[0]
    names = (*log.names, *(f"unlabelled {k + 1}" for k in range(loose.shape[1])))
    labelled = markers if markers.shape[1] >= len(body) else np.concatenate([markers, loose], axis=1)
    places = np.concatenate([markers, loose], axis=1)
    warnings: tuple[str, ...] = ()
    try:
        order, misfit, warnings = _order(names, labelled, body, asked)
        picked, ordered = tuple(names[k] for k in order), labelled[:, order]
        words = f"markers in the robot file's order: {', '.join(picked)}; distances agree to {misfit * 1e3:.1f} mm"
    except RefusedError:
        if asked.order or not _are_found(places[:: max(1, len(places) // SOME)], body):
            raise
        ordered = found_by_shape(places, body)
        picked = tuple(f"marker {k + 1}" for k in range(len(body)))
        words = f"markers found by their distances in each sample, among {len(names)} places whatever their labels"
    said = (*said, words)
    mended = stitch(ordered, places, body)
    if mended.found:
        said = (*said, f"in {mended.found} samples a missing marker was found among places without a label")
    if mended.relabelled:
        warnings = (
            *warnings,
            f"labels were wrong in {mended.relabelled} samples and were corrected by the rigid distances",
        )
    t, even = _even(log, mended.markers)
    _refuse_mirrored(even, body)
    even, framed = _in_robots_frame(mechanism, log, even)
    said = (*said, *framed)
    reading, told = _upright(mechanism, log, asked, [(None, *fit_pose(even, body)[:2])])
    turned = even @ reading.turn.T
    positions, rotations, rms = fit_pose(turned, body)
    if _are_solved(turned):
        said = (
            *said,
            "markers were computed from a pose (they are rigid to the last digit), so three of them are used",
        )
        turned = _three_of(turned, body)
    return PosedTake(
        t, turned, positions, rotations, rms, picked, (*said, *told.decided), (*warnings, *told.warnings)
    )  # fmt: skip


def _are_found(places: np.ndarray, body: np.ndarray) -> bool:
    """Whether the distances show markers in enough of these samples (N, P, 3) m."""
    return bool(np.isnan(found_by_shape(places, body)).all(axis=(1, 2)).mean() <= UNFOUND)


def _in_robots_frame(mechanism: Mechanism, log: MarkerLog, markers: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
    """Markers (N, B, 3) m in the one of the file's frames in which cable lengths vary least, and which, in words.

    Raises RefusedError where they vary about as little in another one.
    """
    ways = [(markers, "as they were recorded")]
    ways += [(frame.points(markers), f"in frame {frame.name}") for frame in log.frames]
    varies = [
        min(one.varies for one in readings_of(mechanism, [(None, *fit_pose(seen, mechanism.robot.markers)[:2])]))
        for seen, _ in ways
    ]
    best = int(np.argmin(varies))
    if len(ways) == 1 or varies[best] > STRAY:  # where none fits, `_upright` says why
        return markers, ()
    for (seen, words), other in zip(ways, varies, strict=True):
        if other <= CLEAR * varies[best] and np.nanmax(np.abs(seen - ways[best][0])) > SOLVED:
            what = f"Not distinguishable by the cable lengths: markers {ways[best][1]}, or {words}."
            raise RefusedError(what, hint="Record the transforms of one of these frames alone.")
    shown = f"cable lengths vary by {1e3 * varies[best]:.1f} mm so"
    return ways[best][0], (f"markers {ways[best][1]}: {shown}, by {1e3 * max(varies):.1f} mm in another frame",)


def _refuse_mirrored(markers: np.ndarray, body: np.ndarray) -> None:
    """Raises RefusedError where the markers (N, B, 3) m are the robot file's in a mirror: distances do not tell."""
    as_read, mirrored = (float(np.nanmedian(fit_pose(seen, body)[2])) for seen in (markers, markers * MIRROR))
    if as_read > SURVEYED and FAR * mirrored < as_read:
        what = f"The markers are the mirror image of the robot file's: as read they miss by {as_read * 1e3:.1f} mm rms"
        what = f"{what}, in a mirror by {mirrored * 1e3:.1f} mm. {WRONG_AXIS}"
        raise MirroredError(what, hint=MEND_AXIS)


def _order(
    names: Sequence[str], markers: np.ndarray, body: np.ndarray, asked: Asked
) -> tuple[tuple[int, ...], float, tuple[str, ...]]:
    """Indices of the markers in the robot file's order, misfit of their distances (m), and what is to be checked."""
    order, misfit, certain = order_of(markers, body)
    if asked.order:
        if len(asked.order) != len(body):
            raise RefusedError(f"--order: {len(asked.order)} names for {len(body)} markers of the robot file.")
        if order != tuple(range(len(body))):
            what = f"--order {','.join(asked.order)}: in another order the distances fit to {misfit * 1e3:.1f} mm."
            raise RefusedError(what, hint=f"Give --order {','.join(names[k] for k in order)}, or leave it out.")
        return order, misfit, ()
    doubt = "another order of the markers fits nearly as well: check it, or give --order"
    return order, misfit, () if certain else (doubt,)


def _by_bodies(mechanism: Mechanism, log: MarkerLog, asked: Asked) -> PosedTake:
    """Poses as exported; three of the robot file's markers stand where these put them, the others are not seen."""
    named = [body for body in log.bodies if asked.body in (None, body.name)]
    if not named:
        found = ", ".join(body.name for body in log.bodies)
        raise RefusedError(f"--body {asked.body}: no such rigid body; found {found[:150] or 'none'}.")
    tracks: list[Track] = []
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
    markers = _three_of(markers, mechanism.robot.markers)
    rms = np.where(np.isfinite(where[:, 0]), 0.0, np.nan)
    names = tuple(f"{name} {k + 1}" for k in range(markers.shape[1]))
    return PosedTake(t, markers, where, turn, rms, names, (*said, *told.decided), told.warnings)


def _are_solved(markers: np.ndarray) -> bool:
    """Whether markers (N, B, 3) m are rigid beyond what cameras measure."""
    whole = np.isfinite(markers).all(axis=(1, 2)).sum() >= MIN_FRAMES
    return bool(whole) and markers.shape[1] > FEWEST_MEASURED and cluster_shape(markers).noise < SOLVED


def _three_of(markers: np.ndarray, body: np.ndarray) -> np.ndarray:
    """(N, B, 3) with the others not seen."""
    return np.where(np.isin(np.arange(len(body)), _widest(body))[:, np.newaxis], markers, np.nan)


def _widest(body: np.ndarray) -> tuple[int, ...]:
    """The first marker, which every window has, and the two that span most with it.

    What is computed from a pose has its errors in common, and fits take markers for independent: with five of them
    the errors of 15 simulated campaigns were 1.6 stated standard deviations (rms), with three 1.1.
    """
    threes = [(0, *pair) for pair in combinations(range(1, len(body)), 2)]
    return max(threes, key=lambda three: _area(body[list(three)]))


def _area(corners: np.ndarray) -> float:
    """m², twice that of the triangle."""
    return float(np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0])))


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
    tracks: Sequence[Track],
) -> tuple[PoseReading, Decision]:
    """The reading in which cable lengths vary least, if the file or the caller does not say another one."""
    if all(stands_still(mechanism, positions, rotations) for _, positions, rotations in tracks):
        raise RefusedError("The platform stands still in this take.", hint="Let go of it while recording.")
    readings = sorted(readings_of(mechanism, tracks), key=lambda reading: reading.varies)
    refuse_misread(mechanism, tracks, log.scale, readings[0].varies)
    said = asked.up or log.up
    fitting = [reading for reading in readings if reading.up == said] or readings
    best, chosen = readings[0], fitting[0]
    other = _other_axes(mechanism, tracks, best.varies, asked.up)
    if other is not None:
        words = f"with {best.words} cable lengths vary by {best.varies * 1e3:.1f} mm"
        warning = f"{words}; {other.words} was taken, where they vary by {other.varies * 1e3:.1f} mm"
        return other, Decision((), (warning,))
    shown = f"cable lengths vary by {chosen.varies * 1e3:.1f} mm (robust sd)"
    wrong = chosen.varies > STRAY >= best.varies or chosen.varies > max(SURVEYED, FAR * best.varies)
    if asked.up is None and said is not None and wrong:
        words = f"the file says {said} upwards, but cable lengths vary by {chosen.varies * 1e3:.1f} mm so"
        warning = f"{words}; {best.words} was taken, where they vary by {best.varies * 1e3:.1f} mm"
        return best, Decision((), (warning,))
    if asked.up is not None and chosen.varies > STRAY >= best.varies:
        raise RefusedError(
            f"With {asked.up} upwards, as requested, cable lengths vary by {chosen.varies * 1e3:.1f} mm though the "
            f"motors are locked; with {best.up} upwards by {best.varies * 1e3:.1f} mm.",
            hint=f"Give --up {best.up}.",
        )
    if chosen.varies > STRAY:
        what = f"C{shown[1:]} by the poses with {chosen.words}, and in no reading less than {best.varies * 1e3:.1f} mm"
        what = f"{what}, though the motors are locked: the motion-capture frame or the body frame is not the robot's"
        other_frame, hint = in_another_frame(mechanism, readings)
        what = other_frame or what
        if asked.up is not None:  # someone knows the frame
            return chosen, Decision((f"{chosen.words}, as requested",), (what,))
        hint = hint or "Correct anchors and markers in the robot file, or calibrate the capture frame."
        soft = f"If the cables are so soft that they stretch by this, give --up {chosen.up[-1]}."
        raise RefusedError(what, hint=f"{hint} {soft}")
    rivals = [r for r in fitting if r.varies < CLEAR * chosen.varies and not _same(r, chosen)]
    _ask(chosen, rivals, said)
    how = "as requested" if asked.up else "as the file says" if log.up else "by the cable lengths"
    decided = (f"{chosen.words}, {how}: {shown}",)
    if asked.up is not None and CLEAR * best.varies < chosen.varies:
        warning = f"{shown}; with {best.up} upwards by {best.varies * 1e3:.1f} mm: is --up {best.up} meant?"
        return chosen, Decision(decided, (warning,))
    return chosen, Decision(decided)


def _same(one: PoseReading, other: PoseReading) -> bool:
    """Whether two readings are the same poses: drivers publish a body under two names, as a pose and as a transform."""
    places, turns = one.positions - other.positions, one.rotations - other.rotations
    return all(float(np.nanmax(np.abs(off), initial=0.0)) < SOLVED for off in (places, turns))


def _other_axes(mechanism: Mechanism, tracks: Sequence[Track], varies: float, up: str | None) -> PoseReading | None:
    """The one reading with another heading, or with z downwards, in which lengths stay; None where there are several.

    varies: m, how much they vary in the best of the usual readings; None where that is little. up: as requested.
    """
    if varies <= SURVEYED:
        return None
    found = sorted(readings_of(mechanism, tracks, OTHER_AXES), key=lambda reading: reading.varies)
    fitting = [one for one in found if one.up == up or up is None]
    best = fitting[0].varies
    fits = best <= SURVEYED and FAR * best < varies and fitting[1].varies > CLEAR * best
    return fitting[0] if fits else None


def _ask(chosen: PoseReading, rivals: Sequence[PoseReading], said: str | None) -> None:
    """Raises RefusedError where another reading fits about as well and nobody said which."""
    other = next((rival for rival in rivals if rival.body is not chosen.body), None)
    if other is not None:
        raise RefusedError(
            f"Not distinguishable: {chosen.words} fits no better than {other.words}.",
            hint="Export rotations as quaternions, or say their order in the column map."
            if chosen.body and chosen.body.read_as
            else "Give --body.",
        )
    other = next((rival for rival in rivals if rival.up != chosen.up), None)
    if said is None and other is not None:
        what = f"{chosen.up} ({chosen.varies * 1e3:.1f} mm) or {other.up} ({other.varies * 1e3:.1f} mm)"
        raise RefusedError(
            f"Which axis points upwards is not in the file; by the cable lengths {what}.", hint="Give --up."
        )
