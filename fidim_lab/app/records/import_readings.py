"""The ways in which the poses of a file may be read: which axis points upwards, which body, units, quaternions.

While the motors are locked the cable lengths do not change: of each reading it is computed how much they do. Where
none fits, readings that no file asks for are tried, so that the cause can be named: another unit, the quaternion's
numbers in another order, the rotation the other way round.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import permutations, product
from types import MappingProxyType

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from fidim_lab.arrays import Matrix3, Positions, Rotations
from fidim_lab.data.importers.reading import LENGTH_UNITS, MIN_FRAMES
from fidim_lab.data.importers.recording import BodyTrack
from fidim_lab.errors import FidimError, InfeasibleError, RefusedError
from fidim_lab.identification.calibration.registration import Registration, Transform, register_frame
from fidim_lab.model.mechanism import Mechanism

UPRIGHT = MappingProxyType(
    {
        "z": np.eye(3),
        "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
        "x": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    }
)
"""by the axis that points upwards in the file: what turns it to z"""
OTHER_AXES = tuple(
    turn
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3))
    if np.linalg.det(turn := np.eye(3)[list(order)] * np.array(signs)[:, np.newaxis]) > 0.0
    and not any(np.array_equal(turn, known) for known in UPRIGHT.values())
)
"""the other 21 turns by right angles: another heading, z downwards"""
UNITS = ("m", "mm", "cm", "in")
"""of length, that are tried"""
SURVEYED = 1e-3
"""m, by which lengths of locked cables vary at most where a file is read as it was meant: 0.0 to 0.3 in 60 takes"""
FAR = 5.0
"""times as much do they vary in a wrong reading, at least: a wrong axis made 4 to 10 mm of 0.1"""
CLEAR = 2.0
"""times as much must they vary in another way to read the file, or it is asked for. A foreign frame of the capture was
taken for one of the body, or the other way round, with 2.1 to 110 times as much in 36 takes of 4, 3 and 2 cables"""
TRIED = 6
"""readings of a take, whose frame is sought elsewhere: markers have three, a body has five"""
FEW = 2000
"""samples are enough to see whether lengths vary"""
PIECES = 8
"""of a take, in each of which lengths are compared: hands and motors may move the platform between two releases. Of
12 s each has most of a swing, of 50 s with four releases most have nothing else"""

Track = tuple[BodyTrack | None, Positions, Rotations]


@dataclass(frozen=True, eq=False)
class PoseReading:
    """One way to read the poses of a file, and how much the cable lengths vary in it."""

    turn: Matrix3
    """file's axes → robot's axes"""
    positions: Positions
    rotations: Rotations
    varies: float
    """m"""
    body: BodyTrack | None = None
    turned: bool = False
    """whether the body's own axes are named like the file's, too"""

    @property
    def up(self) -> str:
        """The axis of the file that points upwards, such as "y" or "-y"."""
        return self._axes[2]

    @property
    def words(self) -> str:
        """For a person."""
        usual = any(np.array_equal(self.turn, turn) for turn in UPRIGHT.values())
        axes = f"{self.up} upwards" if usual else f"the file's {', '.join(self._axes)} as the robot's x, y, z"
        axes += ", its own axes too" if self.turned else ""
        if self.body is None:
            return axes
        return f"{axes} for body {self.body.name}" + (f", {self.body.read_as}" if self.body.read_as else "")

    @property
    def _axes(self) -> tuple[str, ...]:
        """Of the file, that are the robot's x, y, z."""
        return tuple(f"{'-' if row.sum() < 0.0 else ''}{'xyz'[int(np.argmax(np.abs(row)))]}" for row in self.turn)


def readings_of(
    mechanism: Mechanism, tracks: Sequence[Track], turns: Sequence[Matrix3] = tuple(UPRIGHT.values())
) -> Iterator[PoseReading]:
    """Every one of these axes, by default every upward one, with the body's own axes named alike or not."""
    for body, positions, rotations in tracks:
        for turn in turns:
            where, turned = positions @ turn.T, turn @ rotations
            yield PoseReading(turn, where, turned, _varies(mechanism, where, turned), body)
            if body is not None and not np.array_equal(turn, np.eye(3)):
                own = turned @ turn.T
                yield PoseReading(turn, where, own, _varies(mechanism, where, own), body, turned=True)


def _varies(mechanism: Mechanism, positions: Positions, rotations: Rotations) -> float:
    """m, robust standard deviation of the cable lengths by these poses, rms over the cables, where it is least.

    Of the pieces of the take, the quarter counts in which lengths vary least beside the motion: a hand that carries the
    platform slackens cables. inf with too few poses, and where the platform moves no more than lengths may vary: those
    of a body that stands still stay in every reading.
    """
    known = np.flatnonzero(np.isfinite(positions).all(axis=1))
    some = known[:: max(1, len(known) // FEW)]
    if len(some) < MIN_FRAMES:
        return float("inf")
    where, turned = positions[some], rotations[some]
    try:
        lengths = mechanism.lengths(where, turned)
    except (InfeasibleError, FidimError):
        return float("inf")
    varies, moves = (_spreads(columns) for columns in (lengths, _ends(mechanism, where, turned)))
    free = np.flatnonzero(moves > SURVEYED)
    least = free[np.argsort(varies[free] / moves[free])][: PIECES // 4]
    found = float(np.mean(varies[least])) if len(least) else float("inf")
    return found if np.isfinite(found) else float("inf")


def stands_still(mechanism: Mechanism, positions: Positions, rotations: Rotations) -> bool:
    """Whether no piece of a take has the attachments move by more than lengths may vary."""
    known = np.isfinite(positions).all(axis=1)
    ends = _ends(mechanism, positions[known], rotations[known])
    return int(known.sum()) >= MIN_FRAMES and bool((_spreads(ends) <= SURVEYED).all())


def _ends(mechanism: Mechanism, positions: Positions, rotations: Rotations) -> Float[np.ndarray, "N K"]:
    """m, of the cables on the platform, side by side."""
    return np.concatenate([positions + rotations @ cable.a for cable in mechanism.robot.cables], axis=1)


def _spreads(columns: Float[np.ndarray, "N K"]) -> Float[np.ndarray, " P"]:
    """As `_spread`, of each piece of a take."""
    return np.array([_spread(piece) for piece in np.array_split(columns, PIECES)])


def _spread(columns: Float[np.ndarray, "N K"]) -> float:
    """Robust standard deviation, rms over the columns."""
    away = 1.4826 * np.median(np.abs(columns - np.median(columns, axis=0)), axis=0)
    return float(np.sqrt(np.mean(away**2)))


def refuse_misread(mechanism: Mechanism, tracks: Sequence[Track], scale: float, varies: float) -> None:
    """Raises RefusedError that names the way to read exported poses in which the lengths of locked cables stay.

    scale: metres in one unit of the file; varies: how much they vary as the poses were read, m. Nothing is raised where
    that is little, or no other way fits.
    """
    if varies <= SURVEYED:
        return
    for track in tracks:
        for words, hint, other in _misreadings(track, scale):
            fits = min(reading.varies for reading in readings_of(mechanism, [other]))
            if fits <= SURVEYED and fits * FAR < varies:
                what = f"Cable lengths vary by {varies * 1e3:.1f} mm by the poses as read, by {fits * 1e3:.1f} mm with"
                raise RefusedError(f"{what} {words}", hint=hint)


def in_another_frame(mechanism: Mechanism, readings: Sequence[PoseReading]) -> tuple[str, str]:
    """Turn and shift of a foreign frame in which the lengths of locked cables stay, in words, and what to do about it.

    Either the capture's frame is not the robot's, or the body's (or that of its markers) is not the robot file's; both
    where they cannot be told apart. Empty where neither is enough.

    readings: at least one, the best first.
    """
    ways = [(body, one) for one in readings[:TRIED] for body in (False, True)]
    fits = [(register_frame(mechanism, one.positions, one.rotations, body=body), body, one) for body, one in ways]
    enough = min(SURVEYED, readings[0].varies / FAR)
    best = min((found.rms for found, _, _ in fits if found is not None), default=np.inf)
    told: list[str] = []
    hints: list[str] = []
    for of_body in (False, True):
        fitting = [(f, one) for f, body, one in fits if f is not None and body is of_body and f.rms <= CLEAR * best]
        if best > enough or not fitting:
            continue
        found, reading = min(fitting, key=lambda fit: _angle(fit[0].body if of_body else fit[0].world))  # turned least
        words, hint = _foreign(found, reading, of_body=of_body)
        shown = f"Cable lengths vary by {reading.varies * 1e3:.1f} mm by the poses with {reading.words}"
        told.append(f"{shown}, by {found.rms * 1e3:.1f} mm if {words}")
        hints.append(hint)
    return "; or: ".join(told), " Or: ".join(hints)


def _foreign(found: Registration, reading: PoseReading, *, of_body: bool) -> tuple[str, str]:
    """Which frame is another one, and what to do about it."""
    if not of_body:
        words = f"all that was captured is then {_placed(found.world)}: the motion-capture frame is not the robot's"
        return words, "Correct anchors and markers in the robot file, or calibrate the capture frame."
    if reading.body is None:
        words = f"the robot file's markers are {_placed(found.body)} on the body: they are not in its body frame"
        return words, "Correct the markers, or the attachments, in the robot file."
    words = f"what the rigid body calls its own is {_placed(found.body)} in the robot file's body frame: its origin or"
    hint = "Set origin and axes of the rigid body so in the capture program, or export its markers."
    return f"{words} axes are not those of the robot file (capture programs put the origin amid the markers)", hint


def _angle(by: Transform) -> float:
    return float(Rotation.from_matrix(by.rotation).magnitude())


def _placed(by: Transform) -> str:
    turn = Rotation.from_matrix(by.rotation).as_rotvec(degrees=True)
    angle = float(np.linalg.norm(turn))
    axis = ", ".join(f"{x:.2f}" for x in turn / max(angle, 1e-12))
    shift = ", ".join(f"{1e3 * x:.0f}" for x in by.translation)
    return f"turned by {angle:.1f}° about ({axis}) and shifted by ({shift}) mm"


def _misreadings(track: Track, scale: float) -> Iterator[tuple[str, str, Track]]:
    """What is changed, what to do about it, and the poses with it."""
    body, positions, rotations = track
    known = np.isfinite(rotations).all(axis=(1, 2))
    if body is None or not known.any():
        return
    for unit in UNITS:
        if not np.isclose(LENGTH_UNITS[unit], scale):
            yield (
                f"lengths in {unit}",
                f"Give --unit {unit}.",
                (body, LENGTH_UNITS[unit] / scale * positions, rotations),
            )
    turns: dict[str, Rotations] = {"each rotation the other way round (world to body)": rotations.swapaxes(1, 2)}
    xyzw = Rotation.from_matrix(rotations[known]).as_quat()
    for said, order in (("w, x, y, z", [1, 2, 3, 0]), ("x, y, z, w", [3, 0, 1, 2])):
        turned = rotations.copy()
        turned[known] = Rotation.from_quat(xyzw[:, order]).as_matrix()
        turns[f"the numbers of each quaternion taken as {said}"] = turned
    ways = [(words, positions, turned) for words, turned in turns.items()]
    for axis, mirror in zip("xyz", np.eye(3) - 2.0 * np.array([np.diag(row) for row in np.eye(3)]), strict=True):
        words = f"the sign of {axis} changed in places and rotations (is the frame left-handed?)"
        ways.append((words, positions @ mirror, mirror @ rotations @ mirror))
    for words, places, turned in ways:
        yield words, "Correct the export, the column map, or what wrote the file.", (body, places, turned)
