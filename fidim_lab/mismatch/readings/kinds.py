"""Kinds of errors of readings over a session: a drift, a step between two windows, a scatter between windows.

What is the same in all windows (an encoder's zero, a shift of the capture frame) stands among them as their rival: it
is geometry, and for the search for effects.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.identification.cleaning.free_motion import whole_id
from fidim_lab.mismatch.readings.influence import AXES, Influence
from fidim_lab.mismatch.thresholds import SHARED

DRIFT = "length-drift"
STEP = "length-step"
SCATTER = "length-scatter"
CAMERA_DRIFT = "camera-drift"
CAMERA_STEP = "camera-step"
CONSTANT = "constant"
SAYS = {
    DRIFT: "Lengths drift over the session (cables that grow, or encoders that lose their zero)",
    STEP: "Lengths jump between two windows (a slip on the drum, or a zero that was set again)",
    SCATTER: "Lengths are off by a different amount in each window (encoder resolution or hysteresis, an eccentric "
    "drum or pulley, or slip: not distinguished)",
    CAMERA_DRIFT: "The cameras' frame drifts over the session",
    CAMERA_STEP: "The cameras' frame is shifted",
    CONSTANT: "Lengths, or the cameras' frame, are off by the same amount in all windows",
}


@dataclass(frozen=True, eq=False)
class ReadingKind:
    """One kind of error: z = design θ, each θ of the same unknown size."""

    id: str
    cable: int | None
    """1-based; None where it is of all cables alike, of all with their own sizes, or of no cable"""
    of_window: tuple[Float[np.ndarray, "width p"], ...]
    """of each window in the order of recording"""
    names: tuple[str, ...] = ()
    """of θ; none where it is another one in every window"""
    first: str | None = None
    """the first window after a step"""

    @property
    def is_scatter(self) -> bool:
        """Whether every window has θ of its own."""
        return not self.names

    def design(self, seen: Influence, order: Sequence[str]) -> Float[np.ndarray, "z p"]:
        """Of the windows that were fitted. order: ids of all windows, as they were recorded."""
        if self.is_scatter:
            chosen = self.of_window[0]
            return np.kron(np.eye(len(seen.windows)), chosen)
        return np.vstack([self.of_window[order.index(whole_id(id))] for id in seen.windows])


def reading_kinds(cables: int, order: Sequence[str]) -> tuple[tuple[ReadingKind, ...], ...]:
    """All kinds; those that differ in what was picked (a cable, a window) stand together, and share one chance."""
    lengths = np.eye(cables + AXES)[:, :cables]
    shifts = np.eye(cables + AXES)[:, cables:]
    alike, axes = lengths.sum(axis=1, keepdims=True), tuple("xyz")
    each = [lengths[:, k : k + 1] for k in range(cables)]
    own = tuple(f"cable {k + 1}" for k in range(cables))
    groups: list[tuple[ReadingKind, ...]] = [
        (_each_window(SCATTER, None, lengths, len(order)),),
        tuple(_each_window(SCATTER, k + 1, one, len(order)) for k, one in enumerate(each)),
        tuple(_course(CONSTANT, k + 1, one, np.ones(len(order)), ("by",)) for k, one in enumerate(each)),
        (_course(CONSTANT, None, lengths, np.ones(len(order)), own),),
        (_course(CONSTANT, None, shifts, np.ones(len(order)), axes),),
    ]
    if len(order) < SHARED.fewest:
        return tuple(groups)
    course = np.linspace(0.0, 1.0, len(order))
    groups += [
        (_course(DRIFT, None, alike, course, ("by",)),),
        (_course(DRIFT, None, lengths, course, own),),
        tuple(_course(DRIFT, k + 1, one, course, ("by",)) for k, one in enumerate(each)),
        (_course(CAMERA_DRIFT, None, shifts, course, axes),),
        tuple(_steps(STEP, None, lengths, order, own)),
        tuple(step for k, one in enumerate(each) for step in _steps(STEP, k + 1, one, order, ("by",))),
        tuple(_steps(CAMERA_STEP, None, shifts, order, axes)),
    ]
    return tuple(groups)


def _each_window(id: str, cable: int | None, chosen: np.ndarray, count: int) -> ReadingKind:
    return ReadingKind(id, cable, (chosen,) * count)


def _course(
    id: str, cable: int | None, chosen: np.ndarray, course: np.ndarray, names: tuple[str, ...], first: str | None = None
) -> ReadingKind:
    return ReadingKind(id, cable, tuple(float(at) * chosen for at in course), names, first)


def _steps(
    id: str, cable: int | None, chosen: np.ndarray, order: Sequence[str], names: tuple[str, ...]
) -> Iterable[ReadingKind]:
    """One for each window but the first."""
    for k in range(1, len(order)):
        yield _course(id, cable, chosen, (np.arange(len(order)) >= k).astype(float), names, order[k])
