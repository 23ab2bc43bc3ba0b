"""What may differ from window to window: lengths, cameras or the body, by a drift, a step, or (lengths) a scatter.

What is the same in all windows (an encoder's zero, a shift of the capture frame) stands among them as their rival: it
is geometry, and for the search for effects.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import PARAMETER_NAMES
from fidim_lab.identification.cleaning.free_motion import whole_id
from fidim_lab.mismatch.session.influence import AXES, Influence, width_of
from fidim_lab.mismatch.thresholds import SHARED

DRIFT = "length-drift"
STEP = "length-step"
SCATTER = "length-scatter"
CAMERA_DRIFT = "camera-drift"
CAMERA_STEP = "camera-step"
BODY_DRIFT = "body-drift"
BODY_STEP = "body-step"
BODY_ONCE = "body-once"
CONSTANT = "constant"
OF_BODY = (BODY_DRIFT, BODY_STEP, BODY_ONCE)
PHYSICS = (DRIFT, *OF_BODY)
"""named as effects, though they belong to one session: no model of another has them"""
SAYS = {
    DRIFT: "Lengths drift over the session (cables that grow, or encoders that lose their zero)",
    STEP: "Lengths jump between two windows (a slip on the drum, or a zero that was set again)",
    SCATTER: "Lengths are off by a different amount in each window (encoder resolution or hysteresis, an eccentric "
    "drum or pulley, or slip: not distinguished)",
    CAMERA_DRIFT: "The cameras' frame drifts over the session",
    CAMERA_STEP: "The cameras' frame is shifted",
    BODY_DRIFT: "The body changes steadily over the session (something that runs out, gathers or wanders)",
    BODY_STEP: "The body changes between two windows (a load put on or taken off, or something that shifted)",
    BODY_ONCE: "The body is another one in a single window (a load that was on it, or off it, there alone)",
    CONSTANT: "Lengths, or the cameras' frame, are off by the same amount in all windows",
}


@dataclass(frozen=True, eq=False)
class SessionKind:
    """One kind of difference between windows: z = design θ, each θ (m) of the same unknown size."""

    id: str
    cable: int | None
    """1-based; None where it is of all cables alike, of all with their own sizes, or of no cable"""
    chosen: Float[np.ndarray, "width p"]
    """what θ is of"""
    course: Float[np.ndarray, " windows"]
    """times which each window has it, in the order of recording"""
    names: tuple[str, ...] = ()
    """of θ; none where it is another one in every window"""
    first: str | None = None
    """the first window after a step, or the only one"""

    @property
    def is_body(self) -> bool:
        """Whether it is the body that differs, and not what is read of it."""
        return self.id in OF_BODY

    @property
    def is_scatter(self) -> bool:
        """Whether every window has θ of its own."""
        return not self.names

    def design(self, seen: Influence, order: Sequence[str]) -> Float[np.ndarray, "z p"]:
        """Of the windows that were fitted. order: ids of all windows, as they were recorded."""
        if self.is_scatter:
            return np.kron(np.eye(len(seen.windows)), self.chosen)
        return np.vstack([self.share(id, order) * self.chosen for id in seen.windows])

    def share(self, window: str, order: Sequence[str]) -> float:
        """Times which a window, or a part of it, has θ."""
        return float(self.course[order.index(whole_id(window))])


def session_kinds(cables: int, order: Sequence[str], arm: float) -> tuple[tuple[SessionKind, ...], ...]:
    """All kinds; those that differ in what was picked (a cable, a window) stand together, and share one chance.

    arm: m, about as far as the mass is from P. A θ of the body moves the centre of mass by θ, or a moment by arm θ.
    """
    entries = np.eye(width_of(cables))
    lengths, shifts, body = entries[:, :cables], entries[:, cables : cables + AXES], entries[:, cables + AXES :].copy()
    body[:, AXES:] *= arm
    alike, axes = lengths.sum(axis=1, keepdims=True), tuple("xyz")
    each = [lengths[:, k : k + 1] for k in range(cables)]
    own = tuple(f"cable {k + 1}" for k in range(cables))
    always = np.ones(len(order))
    groups: list[tuple[SessionKind, ...]] = [
        (SessionKind(SCATTER, None, lengths, always),),
        tuple(SessionKind(SCATTER, k + 1, one, always) for k, one in enumerate(each)),
        tuple(SessionKind(CONSTANT, k + 1, one, always, ("by",)) for k, one in enumerate(each)),
        (SessionKind(CONSTANT, None, lengths, always, own),),
        (SessionKind(CONSTANT, None, shifts, always, axes),),
    ]
    if len(order) < SHARED.fewest:
        return tuple(groups)
    course = np.linspace(0.0, 1.0, len(order))
    groups += [
        (SessionKind(DRIFT, None, alike, course, ("by",)),),
        (SessionKind(DRIFT, None, lengths, course, own),),
        tuple(SessionKind(DRIFT, k + 1, one, course, ("by",)) for k, one in enumerate(each)),
        (SessionKind(CAMERA_DRIFT, None, shifts, course, axes),),
        tuple(_steps(STEP, None, lengths, order, own)),
        tuple(step for k, one in enumerate(each) for step in _steps(STEP, k + 1, one, order, ("by",))),
        tuple(_steps(CAMERA_STEP, None, shifts, order, axes)),
        (SessionKind(BODY_DRIFT, None, body, course, PARAMETER_NAMES),),
        tuple(_steps(BODY_STEP, None, body, order, PARAMETER_NAMES)),
        tuple(_steps(BODY_ONCE, None, body, order, PARAMETER_NAMES, once=True)),
    ]
    return tuple(groups)


def _steps(
    id: str, cable: int | None, chosen: np.ndarray, order: Sequence[str], names: tuple[str, ...], *, once: bool = False
) -> Iterable[SessionKind]:
    """One for each window but the first; once: of that window alone, the first too."""
    windows = np.arange(len(order))
    for k in range(0 if once else 1, len(order)):
        course = (windows == k if once else windows >= k).astype(float)
        yield SessionKind(id, cable, chosen, course, names, order[k])


def not_told_apart(kind: SessionKind, order: Sequence[str], fitted: Sequence[str]) -> tuple[SessionKind, ...]:
    """Steps at other windows, or the same in one window alone, which differ from a step only in windows not fitted.

    order: ids of all windows, as they were recorded; fitted: of those that were fitted, or of parts of them.
    """
    if kind.first is None:
        return ()
    what = (kind.cable, kind.chosen, order, kind.names)
    every = [*_steps(BODY_STEP if kind.is_body else kind.id, *what)]
    every += [*_steps(BODY_ONCE, *what, once=True)] if kind.is_body else []
    courses = {tuple(kind.course): kind}
    for one in every:  # the last window alone is a step there
        courses.setdefault(tuple(one.course), one)
    at = [order.index(whole_id(id)) for id in fitted]
    return tuple(one for one in [*courses.values()][1:] if np.array_equal(one.course[at], kind.course[at]))
