"""Gross and simple mistakes of a robot file, each undone: the robots and views of a recording to try.

Which of them makes markers and lengths agree is for `robot_mistakes`.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import combinations, permutations, product

import numpy as np
from scipy.spatial.transform import Rotation

from fidim_lab.data.records import Cable, Robot
from fidim_lab.identification.data_checks.thresholds import DATA_CHECKS

UNITS = (
    (1e-3, "millimetres for metres"),
    (0.3048, "feet for metres"),
    (0.01, "centimetres for metres"),
    (0.0254, "inches for metres"),
)


@dataclass(frozen=True, eq=False)
class Change:
    """One mistake undone: another robot, or the recording seen otherwise."""

    says: str
    robot: Robot
    order: tuple[int, ...] | None = None
    length_scale: float = 1.0
    turn: np.ndarray = field(default_factory=lambda: np.eye(3))
    about: np.ndarray = field(default_factory=lambda: np.zeros(3))
    shift: np.ndarray = field(default_factory=lambda: np.zeros(3))


def robot_changes(robot: Robot) -> Iterator[Change]:
    """Every simple mistake of a robot file, or of what wrote the windows, undone."""
    for order in _orders(robot.n):
        yield Change(_order_in_words(order), robot, order)
        words = f"in another order ({', '.join(str(k + 1) for k in order)})"
        yield Change(f"The attachments are {words}", _reordered(robot, order, anchors=False))
        yield Change(f"The anchors are {words}", _reordered(robot, order, anchors=True))
    yield from _units(robot)
    for name, turn in _axes():
        yield Change(f"The motion capture's axes are others: the robot's x, y, z are its {name}", robot, turn=turn)
    middle = np.mean([cable.d for cable in robot.cables], axis=0)
    for name, turn in _turns():
        yield Change(f"The motion capture's frame is {name}", robot, turn=turn)
        yield Change(
            f"The motion capture's frame is {name} (about the middle of the anchors)", robot, turn=turn, about=middle
        )
        yield Change(f"The attachments are {name}", _with(robot, lambda a, turn=turn: turn @ a))
        yield Change(f"The anchors are {name}", _moved(robot, turn, np.zeros(3)))
        yield Change(f"The anchors are {name} (about their middle)", _moved(robot, turn, middle))
        if name.startswith("mirrored"):
            both = _with(_moved(robot, turn, np.zeros(3)), lambda a, turn=turn: turn @ a)
            yield Change(f"Anchors and attachments are {name}", both)


def _units(robot: Robot) -> Iterator[Change]:
    for factor, words in UNITS:
        for scale, said in ((factor, words), (1 / factor, _reversed(words))):
            yield Change(f"Anchors, attachments and radii are in {said}", _scaled(robot, scale, scale, scale))
            yield Change(f"The anchors are in {said}", _scaled(robot, scale, 1.0))
            yield Change(f"The attachments are in {said}", _scaled(robot, 1.0, scale))
            yield Change(f"The pulley radii are in {said}", _scaled(robot, 1.0, 1.0, scale))
            yield Change(f"Anchors and pulley radii are in {said}", _scaled(robot, scale, 1.0, scale))
            yield Change(f"The cable lengths are in {said}", robot, length_scale=scale)
            yield Change(f"The markers are in {said}", robot, turn=scale * np.eye(3))


def _reversed(words: str) -> str:
    other, _, metres = words.partition(" for ")
    return f"{metres} for {other}"


def _orders(cables: int) -> Iterator[tuple[int, ...]]:
    """All orders of few cables; of many those with two exchanged, and those counted from another or the other way."""
    identity = tuple(range(cables))
    if cables <= DATA_CHECKS.robot_changes_few:
        yield from (order for order in permutations(identity) if order != identity)
        return
    for first, second in combinations(identity, 2):
        order = list(identity)
        order[first], order[second] = second, first
        yield tuple(order)
    for begin in identity:
        yield tuple((begin - k) % cables for k in identity)
        if begin:
            yield tuple((begin + k) % cables for k in identity)


def _reordered(robot: Robot, order: tuple[int, ...], *, anchors: bool) -> Robot:
    """Drums, or else attachments, of other cables."""
    own = robot.cables
    if anchors:
        return replace(robot, cables=tuple(replace(own[k], a=cable.a) for k, cable in zip(order, own, strict=True)))
    return replace(robot, cables=tuple(replace(cable, a=own[k].a) for k, cable in zip(order, own, strict=True)))


def _axes() -> Iterator[tuple[str, np.ndarray]]:
    """All exchanged and reversed axes but those of `_turns`, with names."""
    known = [np.eye(3), *(turn for _, turn in _turns())]
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            turn = np.zeros((3, 3))
            turn[range(3), order] = signs
            if not np.array_equal(turn, np.eye(3)) and not any(np.array_equal(turn, other) for other in known):
                yield (
                    ", ".join(f"{'−' if sign < 0 else ''}{'xyz'[k]}" for sign, k in zip(signs, order, strict=True)),
                    turn,
                )


def _turns() -> Iterator[tuple[str, np.ndarray]]:
    for axis, name in enumerate("xyz"):
        yield f"mirrored in {name}", np.diag([-1.0 if k == axis else 1.0 for k in range(3)])
    for angle in (90, 180, 270):
        yield f"turned by {angle}° about z", Rotation.from_euler("z", -angle, degrees=True).as_matrix().round(12)


def _with(robot: Robot, a: Callable[[np.ndarray], np.ndarray]) -> Robot:
    return replace(robot, cables=tuple(replace(cable, a=a(cable.a)) for cable in robot.cables))


def _scaled(robot: Robot, anchors: float, attachments: float, radius: float = 1.0) -> Robot:
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
