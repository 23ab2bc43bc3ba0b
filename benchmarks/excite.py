"""Winch-driven excitation on hidden true bodies: amplitude, tensions, accuracy.

python -m benchmarks.excite swings --runs 1000       amplitude after one and two tries, tensions; a CPU second a run
python -m benchmarks.excite driven --runs 12         what the strokes themselves tell of the body
"""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.excite_strokes import LIMITS, driven
from benchmarks.page import table, write_section
from fidim_lab.data.records import Body, Pose, Robot
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.design import pool
from fidim_lab.identification.design.task import DesignTask
from fidim_lab.identification.excitation.bodies import Bodies
from fidim_lab.identification.excitation.knowledge import Knowledge
from fidim_lab.identification.excitation.place import Place, wanted_amplitudes
from fidim_lab.identification.excitation.plan import Excitation, falls_short, missed, more_in_reach, planned
from fidim_lab.identification.excitation.seen import Seen, seen_swing, taught
from fidim_lab.identification.excitation.strokes import COARSE
from fidim_lab.model.driven import driven_motions
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.kinematics import dependent_pose
from fidim_lab.model.mechanism import Mechanism
from sim_backends.excited import Swung, carry_out
from sim_backends.plant.hidden import HiddenEffect
from sim_backends.plant.plant import Plant
from sim_backends.plant.world import World, make_world

CAD_OFF = 0.05
MOST_DAMPING = 0.08
JITTER = 0.004
"""s: a cycle of the bus"""
CLOSE = 0.15
MOST_TRIES = 2
LEAST_CARE = 0.05
"""part of a displacement, to which it is found how far a hand may go"""


@dataclass(frozen=True)
class Try:
    """One excitation, recorded."""

    reached: np.ndarray
    """m, by the plan"""
    seen: np.ndarray
    """m"""
    tension: tuple[float, float]
    predicted: tuple[float, float]
    why_less: str
    seconds: float
    wanted: np.ndarray

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
        return float(np.abs(self.seen - self.reached).max() / np.linalg.norm(self.reached))


@dataclass(frozen=True, eq=False)
class Window:
    """A window with what is the same whoever the hidden body is."""

    place: Place
    care: float
    """part of its displacement that a hand may give it with the same care as the winches"""
    wanted: np.ndarray
    """m, in each mode: what a hand gives with that care"""
    first: Excitation | None
    """the plan of a first try; None where it is refused"""


def window_of(mechanism: Mechanism, z: np.ndarray) -> Window:
    """A window let go by hand so far that the tensions of all bodies that CAD may mean, 5 % off in mass, keep."""
    n = mechanism.robot.n
    there = Place.at(mechanism, z[:n])
    low, high = mechanism.robot.limits.tension
    kept, beyond = 0.0, 2.0  # the first that is tried is the whole
    while beyond - kept > LEAST_CARE and kept < 1.0:
        care = (kept + beyond) / 2
        if _keeps(there, care * z[n:], (low * (1 + CAD_OFF), high / (1 + CAD_OFF))):
            kept = care
        else:
            beyond = care
    care = max(kept, LEAST_CARE)
    wanted = wanted_amplitudes(there, care * z[n:])
    try:
        first = planned(there, wanted, Knowledge.none(len(wanted)), LIMITS, Bodies.around(there.body).others)
    except InfeasibleError:
        first = None
    return Window(there, care, wanted, first)


def _keeps(there: Place, displacement: np.ndarray, tension: tuple[float, float]) -> bool:
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


def true_world(robot: Robot, rng: np.random.Generator, lengths: np.ndarray, mechanism: Mechanism) -> World:
    """A body 5 % off CAD, a mass 5 % off, and drag that damps the most damped mode by up to 8 %."""
    while True:
        com = robot.nominal.com * (1 + rng.uniform(-CAD_OFF, CAD_OFF, 3)) + np.append(rng.normal(0, 1.5e-3, 2), 0)
        moments = robot.nominal.inertia * (1 + rng.uniform(-CAD_OFF, CAD_OFF, 6))
        inertia = moments + np.append(np.zeros(3), rng.normal(0, 0.01, 3) * robot.nominal.inertia[:3].min())
        body = Body(com=com, inertia=inertia)
        if np.linalg.eigvalsh(body.inertia_about_com)[0] > 0:
            break
    swing = Place.at(mechanism, lengths, body).swing
    share = np.diag([0.0] * 3 + [1.0] * 3)
    ratios = np.diag(swing.shapes.T @ share @ swing.shapes) / (4 * np.pi * swing.frequencies)
    mass = robot.mass * (1 + rng.uniform(-CAD_OFF, CAD_OFF))
    c = float(rng.uniform(0, MOST_DAMPING) / ratios.max() * mass)
    # friction at the attachments turns against the cables' directions, which move little: n of them drag like one
    if rng.uniform() < 0.5:
        hidden = (HiddenEffect("rotational-drag", None, (("c", c),)),)
    else:
        hidden = (HiddenEffect("attachment-friction", None, (("viscous", c / robot.n), ("dry", 0.0))),)
    return replace(make_world(robot, rng, hidden, body=body), mass=mass)


def swung(robot: Robot, plant: Plant, excitation: Excitation, held: np.ndarray, rng: np.random.Generator) -> Swung:
    """The excitation carried out from rest."""
    plant.settle(held)
    chains = excitation.chains
    pieces = [(c.pattern.pieces(), c.direction, b) for c, b in zip(chains, excitation.begins, strict=True)]
    strokes = sum(c.pattern.turns + 1 for c in chains)
    return carry_out(plant, held, pieces, 10.0, rng.uniform(0, JITTER, strokes).tolist())


def looked_at(robot: Robot, place: Place, found: Swung, rng: np.random.Generator) -> Seen:
    """With the marker's noise, the rest measured before."""
    noise = robot.sensors.marker_noise
    rest = place.equilibrium.marker_position(robot.marker)
    seen = seen_swing(place.swing, found.t, found.markers[:, 0] + rng.normal(0, noise, found.markers[:, 0].shape))
    if seen is None:
        raise InfeasibleError(f"nothing to be seen at {rest}")
    return seen


def one(run: int, windows: Mapping[int, Window]) -> tuple[Try, ...] | str:
    """One run: at most two tries, the second where `fidim run --procedure excite` would make one."""
    rng = np.random.default_rng([run, 7])
    window = windows[run % len(windows)]
    place, wanted, excitation = window.place, window.wanted, window.first
    robot, held = place.robot, place.equilibrium.lengths
    if excitation is None:
        return "refused"
    plant = Plant(true_world(robot, rng, held, place.mechanism))
    knowledge, bodies = Knowledge.none(len(wanted)), Bodies.around(robot.nominal)
    tries: list[Try] = []
    while True:
        found = swung(robot, plant, excitation, held, rng)
        seen = looked_at(robot, place, found, rng)
        prediction = (excitation.tension, excitation.why_less, excitation.seconds)
        tries.append(Try(excitation.reached, seen.amplitudes, found.tension, *prediction, wanted))
        well = not missed(seen.amplitudes, excitation, CLOSE)
        if len(tries) == MOST_TRIES or (well and not falls_short(seen.amplitudes, excitation, CLOSE)):
            return tuple(tries)
        lesson = taught(place, bodies, excitation, seen, knowledge)
        place, bodies, knowledge = lesson.place, lesson.bodies, lesson.knowledge
        try:
            again = planned(place, wanted, knowledge, LIMITS, bodies.others)
        except InfeasibleError:
            return tuple(tries)
        if well and not more_in_reach(seen.amplitudes, again, CLOSE):
            return tuple(tries)
        excitation = again


def swings(options: argparse.Namespace) -> str:
    """Amplitude after one and two tries, and tensions."""
    robot = read_robot(PAPERS_ROBOT)
    task = DesignTask(robot)
    mechanism = task.mechanism()
    drawn = pool.draw(mechanism, task, min(60, options.runs), np.random.default_rng(5), lambda _: None)
    windows = {k: window_of(mechanism, z) for k, z in enumerate(drawn.z)}
    runs = [one(run, windows) for run in range(options.runs)]
    done = [tries for tries in runs if not isinstance(tries, str)]
    low, high = robot.limits.tension
    tensions = np.array([t.tension for tries in done for t in tries])
    beyond = int(((tensions[:, 0] < low) | (tensions[:, 1] > high)).sum())
    first, last = [tries[0] for tries in done], [tries[-1] for tries in done]
    errors = np.abs([t.error for t in last])
    able = [t for t in last if not t.why_less]
    care = np.median([window.care for window in windows.values()])
    rows = [
        ("runs, of them refused in words", f"{len(runs)}, {len(runs) - len(done)}"),
        ("swing within 15 % of the planned or of the wanted one, first try", share(_good(first))),
        ("… after at most two", share(_good(last))),
        ("swing within 15 % of the wanted one, first try", share(_as_wanted(first))),
        ("… after at most two", share(_as_wanted(last))),
        (f"… where the plan says that it can ({len(able)} of {len(last)})", share(_as_wanted(able))),
        ("swing over the wanted one: median, least 5 %", _low([1 + t.off for t in last])),
        (
            "each mode within 15 % of the whole swing that was planned, after at most two",
            share(np.array([t.mix_error <= CLOSE for t in last])),
        ),
        ("off the planned swing, last try: median, 95 %", f"{np.median(errors):.3f}, {np.quantile(errors, 0.95):.3f}"),
        (f"recordings with a tension outside {low:g}–{high:g} N", f"{beyond} of {len(tensions)}"),
        ("least and largest tension of all, N", f"{tensions[:, 0].min():.1f}, {tensions[:, 1].max():.1f}"),
        ("strokes take, median", f"{np.median([t.seconds for tries in done for t in tries]):.1f} s"),
    ]
    return (
        f"The paper's robot, {len(windows)} windows that obey all limits when let go by hand; winches up to "
        f"{LIMITS.speed:g} m/s and {LIMITS.acceleration:g} m/s². Hidden: a body and a mass 5 % off CAD, rotational "
        "drag or friction at the attachments that damps up to 8 %, set-points up to 4 ms late, 0.1 mm noise. Wanted is "
        "the swing that a hand may give with the same care: tensions of all bodies that CAD may mean, 5 % off in "
        f"mass, within the limits ({care:.2f} of the displacement, median). Each run is the first window of a "
        "session: nothing is known of the damping.\n\n" + table(["", ""], rows)
    )


def _good(tries: Sequence[Try]) -> np.ndarray:
    return np.array([min(abs(t.error), abs(t.off)) <= CLOSE for t in tries])


def _as_wanted(tries: Sequence[Try]) -> np.ndarray:
    return np.array([abs(t.off) <= CLOSE for t in tries])


def _low(values: Sequence[float]) -> str:
    return f"{np.median(values):.2f}, {np.quantile(values, 0.05):.2f}"


def share(which: np.ndarray) -> str:
    return f"{100 * which.mean():.1f} %" if len(which) else "–"


PARTS = {"driven": ("What the strokes themselves tell", driven), "swings": ("The swing that winches give", swings)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", choices=PARTS)
    parser.add_argument("--runs", type=int, default=30)
    options = parser.parse_args()
    title, measure = PARTS[options.part]
    text = measure(options)
    print(text)
    write_section("excite", title, f"python -m benchmarks.excite {options.part} --runs {options.runs}", text)


if __name__ == "__main__":
    main()
