"""Lengths compared with markers: is the marker where the lengths put it, and does each winch move it as expected?

Encoders cannot see that a cable slipped, that a drum has another size, that two drives changed places or that rising
counts wind; cameras cannot see that their origin moved. Together they show it, and often what it is.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fidim_lab.arrays import PerCable, Vector3
from fidim_lab.errors import InfeasibleError
from procedures.expected.nominal_rest import ExpectedRest, NominalRest
from procedures.outcomes import Measurement
from procedures.settings import PlaceSettings
from procedures.steps import Lengths, longest_way

STEP = 2e-3
"""m of cable for a derivative: far above rounding, far below the bend of the geometry"""
LIKE = 0.25
"""part of what is to be explained that a cause may leave, or `NEAR`"""
NEAR = 3e-3
"""m: twice what settling (2 mm peak to peak) and a marker's noise leave of a mean"""
AXES = {"y and z": (0, 2, 1), "x and y": (1, 0, 2), "x and z": (2, 1, 0)}


@dataclass(frozen=True, eq=False)
class SeenAtRest:
    """Measurements while the platform rested."""

    lengths: Lengths
    """by the encoders, m"""
    marker: Vector3
    """the main one, m"""


class PlaceHistory:
    """The marker's error at the last place, and what was accepted since: updated by each comparison of a run."""

    def __init__(self) -> None:
        self.last: tuple[SeenAtRest, Vector3] | None = None
        self.windows: list[str] = []
        """accepted since then: what has changed may have changed in them"""

    def doubt(self) -> str:
        """The end of a sentence that tells a change: the windows in which it may have happened; empty without any."""
        if self.last is None or not self.windows:
            return ""
        return (
            f". It may have happened during window {', '.join(self.windows)}, which was accepted: check it before "
            "using it"
        )


def place_measurements(
    rest: NominalRest, seen: SeenAtRest, history: PlaceHistory, settings: PlaceSettings
) -> tuple[tuple[Measurement, ...], str]:
    """How far the marker is from where the lengths put it, and how much that has changed since the place before.

    Returns what would explain it, too, where that is too much. Raises InfeasibleError where the platform could not
    rest at these lengths at all.
    """
    here = rest.at(seen.lengths)
    off = seen.marker - here.marker
    found = [
        Measurement(
            "distance of the marker from its place by the lengths", float(np.linalg.norm(off)), "m", high=settings.off
        )
    ]
    changed = off
    if history.last is not None:
        before, off_before = history.last
        allowed = settings.change + settings.part * longest_way(before.lengths, seen.lengths)
        changed = off - off_before
        far = float(np.linalg.norm(changed))
        found.append(Measurement("change of that distance since the last place", far, "m", high=allowed))
    doubt = history.doubt()
    history.last, history.windows = (seen, off), []
    wrong = [one for one in found if not one.outcome.usable]
    if not wrong:
        return tuple(found), ""
    return tuple(found), causes(rest, seen, changed if wrong[0] is not found[0] else off) + doubt


def causes(rest: NominalRest, seen: SeenAtRest, off: Vector3) -> str:
    """What alone would put the marker off (m) like this, in words: a cable, all lengths, exchanged axes, an origin."""
    here = rest.at(seen.lengths)
    found = [says for says, left in _causes(rest, seen, here, off) if left <= max(LIKE * np.linalg.norm(off), NEAR)]
    ways = " ".join(f"{1e3 * way:+.0f}" for way in off)
    found.append(f"the marker, or the origin of motion capture, is off by ({ways}) mm")
    return f"possible causes: {'; or '.join(found)}"


def _causes(rest: NominalRest, seen: SeenAtRest, here: ExpectedRest, off: Vector3) -> Iterator[tuple[str, float]]:
    """Each with what it leaves unexplained, m."""
    for name, order in AXES.items():
        left = float(np.linalg.norm(seen.marker[list(order)] - here.marker))
        yield f"{name} of the markers are exchanged (up, in the rig file)", left
    ways = [_response(rest, seen.lengths, np.eye(rest.n)[cable]) for cable in range(rest.n)]
    for cable, way in enumerate(ways, start=1):
        by = float(off @ way / (way @ way))
        says = f"cable {cable} is {1e3 * abs(by):.0f} mm {'longer' if by > 0 else 'shorter'} than its encoder says"
        yield says, float(np.linalg.norm(off - by * way))
    way = np.sum([length * one for length, one in zip(seen.lengths, ways, strict=True)], axis=0)
    by = float(off @ way / (way @ way))
    yield f"all cables are {100 * by:+.1f} % longer than the encoders say", float(np.linalg.norm(off - by * way))


def _response(rest: NominalRest, lengths: Lengths, direction: PerCable) -> Vector3:
    """m of the marker for one metre of cable; NaN where the platform cannot rest beside these lengths."""
    try:
        return (rest.at(_moved(lengths, STEP * direction)).marker - rest.at(lengths).marker) / STEP
    except InfeasibleError:
        return np.full(3, math.nan)


def _moved(lengths: Lengths, by: PerCable) -> Lengths:
    return tuple(float(length + way) for length, way in zip(lengths, by, strict=True))


@dataclass(frozen=True, eq=False)
class Response:
    """The result of moving one winch by a few millimetres."""

    cable: int
    """from 1"""
    seen: Vector3
    """m that the marker moved"""
    model: Vector3
    """m that it should have"""
    pulled: float
    """N that the cable's tension, by motor current, changed"""
    model_pulled: float
    """N that it should have"""


def response_measurements(one: Response, settings: PlaceSettings) -> tuple[Measurement, ...]:
    """Whether marker and tension answered as the model says, as parts of its answer."""
    name, size = f"to a move of winch {one.cable}", float(np.linalg.norm(one.model))
    missed = float(np.linalg.norm(one.seen - one.model)) / max(size, 1e-9)
    found = [Measurement(f"relative error of the marker's response {name}", missed, high=settings.response)]
    if abs(one.model_pulled) >= settings.telling:
        part = one.pulled / one.model_pulled
        found.append(Measurement(f"response of the tension, relative to the model, {name}", part, low=-0.5))
    return tuple(found)


def response_cause(one: Response, rest: NominalRest, lengths: Lengths, way: float) -> str:
    """Possible causes of a response other than the model's. way: m that it moved by its encoder."""
    known = {"it turns against its encoder: is direction, or polarity (607E), wrong": -one.model}
    for cable in range(1, rest.n + 1):
        if cable != one.cable:
            model = _response(rest, lengths, np.eye(rest.n)[cable - 1]) * way
            known[f"it moves cable {cable}: were two drives, node ids or plugs exchanged"] = model
            known[f"it moves cable {cable}, and against its encoder: were two drives exchanged"] = -model
    factor = float(one.seen @ one.model / (one.model @ one.model))
    if factor > 0.0:
        gear = f"it moves {factor:.2g} times as far as its encoder says: gear_ratio, counts_per_turn, drum_radius, 6091"
        known[gear] = factor * one.model
    if np.linalg.norm(one.seen) < 0.3 * np.linalg.norm(one.model):
        return "the marker hardly moves: does the winch turn, is the cable taut, is it this robot's marker?"
    best = min(known, key=lambda says: float(np.linalg.norm(known[says] - one.seen)))
    left = float(np.linalg.norm(known[best] - one.seen))
    if left < 0.5 * np.linalg.norm(one.seen):
        return f"{best}?"
    seen, model = (" ".join(f"{1e3 * value:+.0f}" for value in way) for way in (one.seen, one.model))
    return (
        f"the marker moved by ({seen}) mm, ({model}) mm were expected, and winches and drums do not explain this. "
        "Check whether the platform swung or was touched, whether the marker is loose, whether motion capture "
        "confused it with another marker, and whether its origin was changed"
    )


def common_factor(responses: list[Response], settings: PlaceSettings) -> Measurement:
    """The common factor by which all winches move the marker farther than the model says: wrong drums or gears."""
    model = np.concatenate([one.model for one in responses])
    seen = np.concatenate([one.seen for one in responses])
    factor = float(seen @ model / (model @ model))
    low, high = 1.0 - settings.scale, 1.0 + settings.scale
    return Measurement("cable length by the marker, for each metre by the encoders", factor, "m", low=low, high=high)
