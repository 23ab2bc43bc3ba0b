"""The motion capture's clock against the winches': free motion does not see an offset, motor currents do.

With locked motors every window's start takes up a shift of its markers' time. The currents of held motors follow the
tensions of the fitted motion on the winches' own clock, i = a + b τ(t − offset) for each window and cable, a and b
being free (losses and scale of currents are not known to some per cent). What all of them say together is the offset.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from fidim_lab.mismatch.explanation import EffectParameter, Explanation, NamedCause, Verdict
from fidim_lab.mismatch.refit import Completed

OFFSET = "time-offset"
CLEAR = 5.0
"""standard deviations beyond which an offset is named: once in a million without one"""
SMALLEST = 3e-4
"""s; less matters to nobody, and current loops lag as much"""
FARTHEST, STRIDE = 0.3, 0.01
"""s, of the first look"""
ROUNDS = 4
SAMPLES = 50
"""of a window, with fewer of which it is not asked"""
DISTORTED = ("pulley-friction",)
"""friction between winch and platform makes currents differ from tensions as an offset would"""


@dataclass(frozen=True)
class Timing:
    """A frame stamped t was taken at t + offset on the winches' clock."""

    offset: float
    """s"""
    sd: float
    """by the scatter between windows and cables"""
    courses: int
    """windows × cables that tell"""

    @property
    def is_off(self) -> bool:
        """Whether an offset is believed."""
        return abs(self.offset) > max(CLEAR * self.sd, SMALLEST)


def timing(model: Completed) -> Timing | None:
    """By the motor currents of the windows that were fitted; None where there are none, or too few that tell."""
    courses = [course for w in range(len(model.fit.likelihood.recordings)) for course in _courses(model, w)]
    if len(courses) < 3:
        return None
    looks = np.arange(-FARTHEST, FARTHEST + STRIDE / 2, STRIDE)
    offset = float(looks[np.argmin([sum(course.misfit(look) for course in courses) for look in looks])])
    steps = np.zeros(0)
    weights = np.zeros(0)
    for _ in range(ROUNDS):
        steps, weights = np.array([course.step(offset) for course in courses]).T
        offset += float(weights @ steps / weights.sum())
    spread = float(weights @ (steps - weights @ steps / weights.sum()) ** 2) / (len(courses) - 1)
    return Timing(offset, float(np.sqrt(max(1.0, spread) / weights.sum())), len(courses))


def with_timing(told: Explanation, model: Completed) -> Explanation:
    """The explanation with an offset of the clocks, where all else is explained and the currents say so.

    model: the one that is told of.
    """
    names = {h.effect.id for h in model.tried}
    if told.verdict not in (Verdict.NOTHING_MISSING, Verdict.EXPLAINED) or names & set(DISTORTED):
        return told
    found = timing(model) if model.whole else None
    if found is None:
        message = f"{told.message} Not tested: {OFFSET} (no motor currents that tell of it)."
        return replace(told, message=message, untested=(*told.untested, OFFSET))
    if not found.is_off:
        return told
    value = EffectParameter(found.offset, found.sd, "s")
    says = "stamps are early: a frame stamped t was taken at t + offset"
    figures = f"{1e3 * found.offset:.2f} ± {1e3 * found.sd:.2f} ms"
    said = f"Motor currents follow the tensions of the fitted motion {figures} later ({found.courses} courses): the "
    said += "cameras' stamps are that much early against the winches' clock."
    return replace(
        told,
        verdict=Verdict.EXPLAINED,
        effects=(*told.effects, NamedCause(OFFSET, None, (), {"offset": value}, says)),
        message=f"{told.message} {said}",
    )


@dataclass(frozen=True, eq=False)
class _Course:
    """One motor's current beside the tension that the model has at the markers' stamps."""

    t: np.ndarray
    current: np.ndarray
    tension: CubicSpline

    def misfit(self, offset: float) -> float:
        """Sum of squares with the best a and b, over that without a tension."""
        column = _centred(self.tension(self.t - offset))
        current = _centred(self.current)
        return 1.0 - float(column @ current) ** 2 / float(column @ column) / float(current @ current)

    def step(self, offset: float) -> tuple[float, float]:
        """What to add to an offset by this course alone, s, and with how much weight, 1/s²."""
        late = self.t - offset
        columns = np.column_stack([np.ones(len(late)), self.tension(late), self.tension(late, 1)])
        found, *_ = np.linalg.lstsq(columns, self.current, rcond=None)
        left = self.current - columns @ found
        noise = float(left @ left) / (len(late) - 3)
        rate = columns[:, 2] - columns[:, :2] @ np.linalg.lstsq(columns[:, :2], columns[:, 2], rcond=None)[0]
        return -float(found[2] / found[1]), float(found[1] ** 2 * (rate @ rate) / noise)


def _centred(values: np.ndarray) -> np.ndarray:
    return values - values.mean()


def _courses(model: Completed, w: int) -> list[_Course]:
    recording = model.fit.likelihood.recordings[w]
    window = recording.window
    if window.currents is None:
        return []
    simulation = model.fit.journey.optimum.simulation
    trajectories, place = simulation.trajectory_of(w)
    nodes = trajectories.grid.t
    t = window.t - window.t[0] - recording.begin
    inside = (t > FARTHEST) & (t < min(float(simulation.ends[w]), nodes[-1]) - FARTHEST)
    found: list[_Course] = []
    for k in range(window.currents.shape[1]):
        use = inside & np.isfinite(window.currents[:, k])
        values = trajectories.tensions[place, :, k]
        if use.sum() >= SAMPLES and np.isfinite(values).all() and np.ptp(window.currents[use, k]) > 0:
            found.append(_Course(t[use], window.currents[use, k], CubicSpline(nodes, values)))
    return found
