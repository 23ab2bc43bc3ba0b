"""One run of winch-driven excitation on a hidden body: at most two tries, what was planned and what was seen.

`window_of` is what all bodies share at a window, `one` is a run, `carried` a session of them; `benchmarks.excite` makes
many and counts.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.excite.strokes import LIMITS
from benchmarks.excite.swung import Swung, carry_out
from fidim_lab.data.records import Body, Campaign, Pose, Robot, Role
from fidim_lab.data.records import Window as Recording
from fidim_lab.errors import InfeasibleError, RefusedError
from fidim_lab.identification.excitation.again import may_gain, why_again
from fidim_lab.identification.excitation.bodies import Bodies
from fidim_lab.identification.excitation.identified import bodies_of
from fidim_lab.identification.excitation.knowledge import Knowledge
from fidim_lab.identification.excitation.place import ExcitationPlace, inside, wanted_amplitudes
from fidim_lab.identification.excitation.plan import Excitation, planned
from fidim_lab.identification.excitation.seen import SwingOscillations, seen_swing, taught
from fidim_lab.identification.excitation.strokes import COARSE
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.kinematics import dependent_pose
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import driven_motions
from fidim_lab.model.swing import Swing
from procedures.protocols.excite import TELLING
from sim_backends.plant.hidden import HiddenEffect
from sim_backends.plant.plant import Plant
from sim_backends.plant.world import World, make_world

CAD_OFF = 0.05
MOST_DAMPING = 0.08
JITTER = 0.004
"""s: a cycle of the bus"""
CLOSE = 0.15
MOST_TRIES = 2
RATE = 100.0
"""Hz"""
LEAST_CARE = 0.05
"""part of a displacement, to which it is found how far a hand may go"""


@dataclass(frozen=True)
class Try:
    """One excitation, recorded."""

    reached: tuple[float, ...]
    """m, by the plan"""
    seen: tuple[float, ...]
    """m"""
    tension: tuple[float, float]
    predicted: tuple[float, float]
    why_less: str
    seconds: float
    wanted: tuple[float, ...]

    @property
    def share(self) -> float:
        """Of the wanted swing that is planned for."""
        return float(np.linalg.norm(self.reached) / np.linalg.norm(self.wanted))

    @property
    def error(self) -> float:
        """Of the whole swing, as a part of the planned one."""
        return float(np.linalg.norm(self.seen) / np.linalg.norm(self.reached) - 1)

    @property
    def off(self) -> float:
        """Of the whole swing, as a part of the wanted one."""
        return float(np.linalg.norm(self.seen) / np.linalg.norm(self.wanted) - 1)

    @property
    def mix_error(self) -> float:
        """The largest of any mode, as a part of the whole swing."""
        return float(np.abs(np.subtract(self.seen, self.reached)).max() / np.linalg.norm(self.reached))


Tries = tuple[Try, ...] | str
"""of a window; the words of a refusal"""


@dataclass(frozen=True, eq=False)
class Window:
    """A window with what is the same whoever the hidden body is."""

    place: ExcitationPlace
    care: float
    """part of its displacement that a hand may give it with the same care as the winches"""
    wanted: np.ndarray
    """m, in each mode: what a hand gives with that care, or a part of it"""
    first: Excitation | None
    """the plan of a first try; None where it is refused"""


def window_of(mechanism: Mechanism, z: np.ndarray, part: float = 1.0) -> Window:
    """A window let go by hand so far that the tensions of all bodies that CAD may mean, 5 % off in mass, keep.

    Wanted is this part of that displacement.
    """
    n = mechanism.robot.n
    there = ExcitationPlace.at(mechanism, z[:n])
    low, high = mechanism.robot.limits.tension
    kept, beyond = 0.0, 2.0  # the first that is tried is the whole
    while beyond - kept > LEAST_CARE and kept < 1.0:
        care = (kept + beyond) / 2
        if _keeps(there, care * z[n:], (low * (1 + CAD_OFF), high / (1 + CAD_OFF))):
            kept = care
        else:
            beyond = care
    care = max(kept, LEAST_CARE)
    return window_at(there, part * care * z[n:], care)


def window_at(there: ExcitationPlace, displacement: np.ndarray, care: float = 1.0) -> Window:
    """A window of a plan with this displacement (m)."""
    wanted = wanted_amplitudes(there, displacement)
    try:
        first = planned(there, wanted, Knowledge.none(len(wanted)), LIMITS, Bodies.around(there.body).others)
    except InfeasibleError:
        first = None
    return Window(there, care, wanted, first)


def _keeps(there: ExcitationPlace, displacement: np.ndarray, tension: tuple[float, float]) -> bool:
    """Whether all bodies' tensions stay within these (N) when let go so."""
    mechanism, marker = there.mechanism, there.robot.marker
    lengths, mass = there.equilibrium.lengths, there.robot.mass
    still = np.zeros((1, round(10.0 / COARSE), there.robot.n))
    for body in (there.body, *Bodies.around(there.body).others):
        rest = pose_from_lengths(mechanism, body, lengths, there.equilibrium.pose).pose
        aside = (rest.position + rest.rotation @ marker)[:2] + displacement
        positions, rotations = dependent_pose(mechanism, lengths, marker, (0, 1), aside[np.newaxis], rest)
        found = mass * driven_motions(mechanism, body, Pose(positions[0], rotations[0]), still, COARSE).tensions
        if not tension[0] <= found.min() <= found.max() <= tension[1]:
            return False
    return True


def true_world(
    robot: Robot,
    rng: np.random.Generator,
    lengths: np.ndarray,
    mechanism: Mechanism,
    damping: tuple[float, float] = (0.0, MOST_DAMPING),
) -> World:
    """A body 5 % off CAD, a mass 5 % off, and drag that damps the most damped mode by so much."""
    while True:
        com = robot.nominal.com * (1 + rng.uniform(-CAD_OFF, CAD_OFF, 3)) + np.append(rng.normal(0, 1.5e-3, 2), 0)
        moments = robot.nominal.inertia * (1 + rng.uniform(-CAD_OFF, CAD_OFF, 6))
        inertia = moments + np.append(np.zeros(3), rng.normal(0, 0.01, 3) * robot.nominal.inertia[:3].min())
        body = Body(com=com, inertia=inertia)
        if np.linalg.eigvalsh(body.inertia_about_com)[0] > 0:
            break
    ratios = _damping_by_drag(ExcitationPlace.at(mechanism, lengths, body).swing)
    mass = robot.mass * (1 + rng.uniform(-CAD_OFF, CAD_OFF))
    c = float(rng.uniform(*damping) / ratios.max() * mass)
    # friction at the attachments turns against the cables' directions, which move little: n of them drag like one
    if rng.uniform() < 0.5:
        hidden = (HiddenEffect("rotational-drag", None, (("c", c),)),)
    else:
        hidden = (HiddenEffect("attachment-friction", None, (("viscous", c / robot.n), ("dry", 0.0))),)
    return replace(make_world(robot, rng, hidden, body=body), mass=mass)


def _damping_by_drag(swing: Swing) -> np.ndarray:
    """ζ of each mode for a drag of the rotation of 1 N m s for each kg."""
    share = np.diag([0.0] * 3 + [1.0] * 3)
    return np.diag(swing.shapes.T @ share @ swing.shapes) / (4 * np.pi * swing.frequencies)


def swung(robot: Robot, plant: Plant, excitation: Excitation, held: np.ndarray, rng: np.random.Generator) -> Swung:
    """The excitation carried out from rest."""
    plant.settle(held)
    chains = excitation.chains
    pieces = [(c.pattern.pieces(), c.direction, b) for c, b in zip(chains, excitation.begins, strict=True)]
    strokes = sum(c.pattern.turns + 1 for c in chains)
    return carry_out(plant, held, pieces, 10.0, rng.uniform(0, JITTER, strokes).tolist())


def recorded(robot: Robot, found: Swung, name: str, rng: np.random.Generator) -> Recording:
    """As cameras and encoders have it."""
    markers = found.markers + rng.normal(0, robot.sensors.marker_noise, found.markers.shape)
    return Recording(name, Role.IDENTIFY, found.t, markers, found.lengths, None)


def looked_at(robot: Robot, place: ExcitationPlace, found: Swung, rng: np.random.Generator) -> SwingOscillations:
    """With the marker's noise, the rest measured before."""
    noise = robot.sensors.marker_noise
    rest = place.equilibrium.marker_position(robot.marker)
    seen = seen_swing(place.swing, found.t, found.markers[:, 0] + rng.normal(0, noise, found.markers[:, 0].shape))
    if seen is None:
        raise InfeasibleError(f"nothing to be seen at {rest}")
    return seen


def possible(run: int, window: Window) -> tuple[float, str]:
    """The part of the wanted swing that winches could give were all that is hidden known, and what limits it.

    Body, mass and damping are the world's; what is left to allow for are set-points that come late.
    """
    rng = np.random.default_rng([run, 7])
    robot, held, mechanism = window.place.robot, window.place.equilibrium.lengths, window.place.mechanism
    world = true_world(robot, rng, held, mechanism)
    place = ExcitationPlace.at(mechanism, held, world.body)
    keys = dict(world.hidden[0].parameters)
    c = keys.get("c", robot.n * keys.get("viscous", 0.0)) / world.mass
    damping = c * _damping_by_drag(place.swing)
    ones = np.ones(len(damping))
    # planned with the file's mass: limits are put where the true mass has them, and what `inside` spares is given back
    low, high = np.array(robot.limits.tension) * robot.mass / world.mass
    spared = np.linalg.solve(np.array([inside((1.0, 0.0)), inside((0.0, 1.0))]).T, [low, high])
    try:
        found = planned(place, window.wanted, Knowledge(damping, ones, ones, damping), LIMITS, (), tuple(spared))
    except InfeasibleError:
        return 0.0, "refused"
    return float(np.linalg.norm(found.reached) / np.linalg.norm(window.wanted)), found.why_less


@dataclass(frozen=True, eq=False)
class Learnt:
    """What a session knows before a window."""

    bodies: Bodies
    knowledge: Knowledge | None = None
    recorded: tuple[Recording, ...] = ()
    """windows accepted, as cameras and encoders have them"""

    def identified(self, robot: Robot, recording: Recording) -> "Learnt":
        """With one more window, as `fidim run` learns from it."""
        recorded = (*self.recorded, recording)
        if len(recorded) > TELLING or self.bodies.sure:
            return replace(self, recorded=recorded)
        try:
            bodies = bodies_of(Campaign("a session", robot, RATE, recorded))
        except RefusedError:
            return replace(self, recorded=recorded)
        knowledge = None if self.knowledge is None else self.knowledge.by_identified_body()
        return Learnt(bodies, knowledge, recorded)


def one(run: int, window: Window) -> Tries:
    """The first window of a session: at most two tries, the second where `fidim run` would make one."""
    if window.first is None:
        return "refused"
    rng = np.random.default_rng([run, 7])
    robot, held = window.place.robot, window.place.equilibrium.lengths
    plant = Plant(true_world(robot, rng, held, window.place.mechanism))
    return tried(window, window.first, plant, Learnt(Bodies.around(robot.nominal)), rng)[0]


def carried(run: int, windows: Sequence[Window]) -> list[Tries]:
    """A session of one hidden body: each window is planned with what the ones before it taught."""
    rng = np.random.default_rng([run, 8])
    robot, mechanism = windows[0].place.robot, windows[0].place.mechanism
    plant = Plant(true_world(robot, rng, windows[0].place.equilibrium.lengths, mechanism))
    learnt, done = Learnt(Bodies.around(robot.nominal)), list[Tries]()
    for window in windows:
        first = window.first
        if learnt.knowledge is not None:
            known = learnt.knowledge
            known = known.by_identified_body() if learnt.bodies.sure else known.elsewhere()
            first = _planned(_as_likely(window, learnt), known, learnt.bodies, window.wanted)
        if first is None:
            done.append("refused")
            continue
        tries, learnt, last = tried(window, first, plant, learnt, rng)
        learnt = learnt.identified(robot, recorded(robot, last, f"i{len(done):02d}", rng))
        done.append(tries)
    return done


def tried(
    window: Window, excitation: Excitation, plant: Plant, learnt: Learnt, rng: np.random.Generator
) -> tuple[tuple[Try, ...], Learnt, Swung]:
    """A window's recordings, what is known after them, and the last one."""
    wanted, robot, held = window.wanted, window.place.robot, window.place.equilibrium.lengths
    place, bodies = _as_likely(window, learnt), learnt.bodies
    knowledge = learnt.knowledge or Knowledge.none(len(wanted))
    tries: list[Try] = []
    while True:
        found = swung(robot, plant, excitation, held, rng)
        seen = looked_at(robot, place, found, rng)
        prediction = (excitation.tension, excitation.why_less, excitation.seconds)
        reached, amplitudes, aim = (
            tuple(map(float, values)) for values in (excitation.reached, seen.amplitudes, wanted)
        )
        tries.append(Try(reached, amplitudes, found.tension, *prediction, aim))
        lesson = taught(place, bodies, excitation, seen, knowledge)
        place, bodies, knowledge = lesson.place, lesson.bodies, lesson.knowledge
        again = None
        if len(tries) < MOST_TRIES and may_gain(seen.amplitudes, excitation, CLOSE):
            again = _planned(place, knowledge, bodies, wanted, excitation)
        if again is None or not why_again(seen.amplitudes, excitation, again, CLOSE):
            return tuple(tries), Learnt(bodies, knowledge, learnt.recorded), found
        excitation = again


def _as_likely(window: Window, learnt: Learnt) -> ExcitationPlace:
    """The window's place with the body that is likely."""
    if learnt.knowledge is None:
        return window.place
    return ExcitationPlace.at(window.place.mechanism, window.place.equilibrium.lengths, learnt.bodies.likely)


def _planned(
    place: ExcitationPlace, knowledge: Knowledge, bodies: Bodies, wanted: np.ndarray, before: Excitation | None = None
) -> Excitation | None:
    """None where it is refused."""
    try:
        return planned(place, wanted, knowledge, LIMITS, bodies.others, before=before)
    except InfeasibleError:
        return None
