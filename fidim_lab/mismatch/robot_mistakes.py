"""Mistakes in the robot file (or the files beside it) that are gross and simple: which one change makes the data fit?

Cables in another order, millimetres or feet for metres, a mirrored axis, a robot turned by a quarter or half: each is
undone in turn, and a few poses are fitted to markers, lengths and an upright platform. `find_mistakes` is for a
kinematic misfit of several millimetres; small errors of geometry are for the effects of the catalogue.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import permutations

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from fidim_lab.data.records import Cable, Robot, Window
from fidim_lab.errors import FidimError
from fidim_lab.identification import surface
from fidim_lab.mismatch.clock_check import even_grid
from fidim_lab.model.mechanism import Mechanism

SAMPLES = 4
"""poses of each window"""
WINDOWS = 8
CLOSE = 1e-3
"""m, to which markers and lengths are weighted"""
UPRIGHT = 0.25
"""rad, how far the platform may lean"""
ROUNDS = 12
LONGEST = 0.3
"""m or rad in one step"""
BETTER = 5.0
"""times smaller the misfit must become"""
UNITS = (
    (1e-3, "millimetres for metres"),
    (0.3048, "feet for metres"),
    (0.01, "centimetres for metres"),
    (0.0254, "inches for metres"),
)
TIE = 1.5
"""within this factor of the best, another change is named beside it"""


@dataclass(frozen=True)
class Mistake:
    """A change that makes the kinematics fit."""

    says: str
    before: float
    """m, rms misfit of markers and lengths as the files are"""
    after: float
    """m, with the change"""
    order: tuple[int, ...] | None = None
    """of the cables, 1-based, where that is the change: cable k of the robot file is order[k − 1] of the recording"""


@dataclass(frozen=True, eq=False)
class _Change:
    says: str
    robot: Robot
    order: tuple[int, ...] | None = None
    length_scale: float = 1.0
    turn: np.ndarray = field(default_factory=lambda: np.eye(3))
    about: np.ndarray = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True, eq=False)
class _Sample:
    markers: Float[np.ndarray, "S M 3"]
    lengths: Float[np.ndarray, "S n"]


def find_mistakes(robot: Robot, windows: tuple[Window, ...], least: float = 3e-3) -> tuple[Mistake, ...]:
    """The simple changes that make a gross misfit (m, more than `least`) fit, best first; none where none does."""
    sample = _sampled(robot, windows)
    if sample is None:
        return ()
    before = _misfit(_Change("as it is", robot), sample, None)
    if before < least:
        return ()
    unchanged = Mechanism(robot)
    tried = [
        (_misfit(change, sample, unchanged if change.robot is robot else None), change) for change in _changes(robot)
    ]
    tried.sort(key=lambda pair: pair[0])
    best = tried[0][0]
    if not best * BETTER < min(before, 1e3):
        return ()
    return tuple(_mistake(change, before, after) for after, change in tried[:3] if after <= TIE * best)


def _mistake(change: _Change, before: float, after: float) -> Mistake:
    was = "no pose fits" if not np.isfinite(before) else f"they miss by {before * 1e3:.3g} mm"
    says = f"{change.says}: with that undone, markers and cable lengths agree within {after * 1e3:.2g} mm; "
    says += f"as the files are, {was}."
    return Mistake(says, before, after, None if change.order is None else tuple(k + 1 for k in change.order))


def _sampled(robot: Robot, windows: tuple[Window, ...]) -> _Sample | None:
    """Markers averaged over five samples, at a few places of a few windows."""
    markers, lengths = [], []
    most = min((w.markers.shape[1] for w in windows), default=0)
    for window in windows[:: max(1, len(windows) // WINDOWS)]:
        if window.lengths is None or not np.isfinite(window.lengths).any(axis=0).all():
            continue
        held = np.nanmean(window.lengths, axis=0)
        columns = even_grid(window.t).spread(window.markers[:, :most].reshape(len(window.t), -1))
        rows = np.flatnonzero(np.isfinite(columns).all(axis=1))
        if len(rows) < SAMPLES:
            continue
        for row in rows[np.linspace(0, len(rows) - 1, SAMPLES + 2).astype(int)[1:-1]]:
            markers.append(columns[row].reshape(most, 3))
            lengths.append(held)
    if not markers or len(lengths[0]) != robot.n:
        return None
    return _Sample(np.array(markers), np.array(lengths))


def _misfit(change: _Change, sample: _Sample, mechanism: Mechanism | None) -> float:
    """rms of what markers and lengths are off the best nearly upright poses, m; the median over the poses."""
    made = mechanism or Mechanism(change.robot)
    lengths = sample.lengths * change.length_scale
    if change.order is not None:
        lengths = lengths[:, list(change.order)]
    markers = (sample.markers - change.about) @ change.turn.T + change.about
    body = made.robot.markers[: markers.shape[1]]
    R = np.tile(np.eye(3), (len(markers), 1, 1))
    p = (markers - body).mean(axis=1)
    try:
        for _ in range(ROUNDS):
            step = _step(made, lengths, markers, body, p, R)
            p = p + step[:, :3]
            R[:] = Rotation.from_rotvec(step[:, 3:]).as_matrix() @ R
        left = np.concatenate([_off(markers, body, p, R), lengths - made.lengths(p, R)], axis=1)
    except (FidimError, np.linalg.LinAlgError):
        return np.inf
    lean = np.linalg.norm(Rotation.from_matrix(R).as_rotvec(), axis=1)
    each = np.sqrt((left**2).sum(axis=1) / max(1, left.shape[1] - 6)) + 0.01 * np.maximum(0.0, lean - 2 * UPRIGHT)
    return float(np.median(each)) if np.isfinite(each).all() else np.inf


def _off(markers: np.ndarray, body: np.ndarray, p: np.ndarray, R: np.ndarray) -> np.ndarray:
    return (markers - p[:, np.newaxis] - np.einsum("nij,mj->nmi", R, body)).reshape(len(p), -1)


def _step(
    made: Mechanism, lengths: np.ndarray, markers: np.ndarray, body: np.ndarray, p: np.ndarray, R: np.ndarray
) -> np.ndarray:
    """One Gauss–Newton step of all poses, (S, 6)."""
    prior = np.zeros((len(p), 3, 6))
    prior[:, :, 3:] = np.eye(3)
    rows = np.concatenate(
        [surface.marker_jacobian(R, body) / CLOSE, made.structure_matrix(p, R) / CLOSE, prior / UPRIGHT], axis=1
    )
    turned = Rotation.from_matrix(R).as_rotvec()
    right = np.concatenate(
        [_off(markers, body, p, R) / CLOSE, (lengths - made.lengths(p, R)) / CLOSE, -turned / UPRIGHT], axis=1
    )
    across = np.swapaxes(rows, 1, 2)
    step = np.linalg.solve(across @ rows, (across @ right[..., np.newaxis]))[..., 0]
    size = np.abs(step).max(axis=1, keepdims=True)
    return step * np.minimum(1.0, LONGEST / np.maximum(size, 1e-300))


def _changes(robot: Robot) -> Iterator[_Change]:
    identity = tuple(range(robot.n))
    for order in permutations(identity):
        if order != identity:
            yield _Change(_order_in_words(order), robot, order)
    yield from _units(robot)
    middle = np.mean([cable.d for cable in robot.cables], axis=0)
    for name, turn in _turns():
        yield _Change(f"The motion capture's frame is {name}", robot, turn=turn)
        yield _Change(
            f"The motion capture's frame is {name} (about the middle of the anchors)", robot, turn=turn, about=middle
        )
        yield _Change(f"The attachments are {name}", _with(robot, lambda a, turn=turn: turn @ a))
        yield _Change(f"The anchors are {name}", _moved(robot, turn, np.zeros(3)))
        yield _Change(f"The anchors are {name} (about their middle)", _moved(robot, turn, middle))
        if name.startswith("mirrored"):
            both = _with(_moved(robot, turn, np.zeros(3)), lambda a, turn=turn: turn @ a)
            yield _Change(f"Anchors and attachments are {name}", both)


def _units(robot: Robot) -> Iterator[_Change]:
    for factor, words in UNITS:
        for scale, said in ((factor, words), (1 / factor, _reversed(words))):
            yield _Change(f"Anchors, attachments and radii are in {said}", _scaled(robot, scale, scale))
            yield _Change(f"The anchors are in {said}", _scaled(robot, scale, 1.0))
            yield _Change(f"The attachments are in {said}", _scaled(robot, 1.0, scale))
            yield _Change(f"The cable lengths are in {said}", robot, length_scale=scale)
            yield _Change(f"The markers are in {said}", robot, turn=scale * np.eye(3))


def _reversed(words: str) -> str:
    other, _, metres = words.partition(" for ")
    return f"{metres} for {other}"


def _turns() -> Iterator[tuple[str, np.ndarray]]:
    for axis, name in enumerate("xyz"):
        yield f"mirrored in {name}", np.diag([-1.0 if k == axis else 1.0 for k in range(3)])
    for angle in (90, 180, 270):
        yield f"turned by {angle}° about z", Rotation.from_euler("z", -angle, degrees=True).as_matrix().round(12)


def _with(robot: Robot, a: Callable[[np.ndarray], np.ndarray]) -> Robot:
    return replace(robot, cables=tuple(replace(cable, a=a(cable.a)) for cable in robot.cables))


def _scaled(robot: Robot, anchors: float, attachments: float) -> Robot:
    radius = anchors if anchors == attachments else 1.0
    cables = tuple(
        replace(cable, d=anchors * cable.d, a=attachments * cable.a, radius=radius * cable.radius)
        for cable in robot.cables
    )
    return replace(robot, cables=cables)


def _moved(robot: Robot, turn: np.ndarray, about: np.ndarray) -> Robot:
    """Anchors and swivels turned or mirrored; y is made anew, so that x × y = z."""

    def image(cable: Cable) -> Cable:
        x, z = turn @ cable.x, turn @ cable.z
        return replace(cable, d=turn @ (cable.d - about) + about, x=x, y=np.cross(z, x), z=z)

    return replace(robot, cables=tuple(image(cable) for cable in robot.cables))


def _order_in_words(order: tuple[int, ...]) -> str:
    moved = [k for k, other in enumerate(order) if k != other]
    if len(moved) == 2:
        return f"Cables {moved[0] + 1} and {moved[1] + 1} are swapped"
    count = len(order)
    shift = (order[0]) % count
    if all(other == (k + shift) % count for k, other in enumerate(order)):
        angle = f", as on a robot turned by {360 * shift // count}°" if (360 * shift) % count == 0 else ""
        return f"The cables are numbered from another corner (cable 1 is the recording's cable {shift + 1}{angle})"
    return "The cables are in another order: " + ", ".join(f"{k + 1} is {other + 1}" for k, other in enumerate(order))
