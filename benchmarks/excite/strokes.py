"""What the strokes themselves tell of the body, with known lengths, beside the free motion after them.

python -m benchmarks.excite driven --runs 12
"""

import argparse

import numpy as np

from benchmarks.page import table
from fidim_lab.data.records import Body, Robot
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.identification.design import information, pool
from fidim_lab.identification.design.task import DesignTask
from fidim_lab.identification.design.windows import place
from fidim_lab.identification.excitation.bodies import Bodies
from fidim_lab.identification.excitation.knowledge import Knowledge
from fidim_lab.identification.excitation.motion import line_of
from fidim_lab.identification.excitation.place import ExcitationPlace, WinchLimits, wanted_amplitudes
from fidim_lab.identification.excitation.plan import Excitation, planned
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import driven_motions

LIMITS = WinchLimits(speed=0.5, acceleration=4.0)
STEP_OF = 1e-5
"""relative, of the difference quotients by body and lengths"""


def driven(options: argparse.Namespace) -> str:
    """What the strokes themselves tell, with known lengths, beside the free motion after them."""
    robot = read_robot(PAPERS_ROBOT)
    task = DesignTask(robot)
    mechanism = task.mechanism()
    drawn = pool.draw(mechanism, task, max(12, options.runs), np.random.default_rng(5), lambda _: None)
    sums = {name: np.zeros((9, 9)) for name in ("hand", "free", "strokes", "both")}
    for z in drawn.z[: options.runs]:
        place_ = ExcitationPlace.at(mechanism, z[: robot.n])
        wanted = wanted_amplitudes(place_, z[robot.n :])
        none = Knowledge(*np.array([[0.0], [1.0], [1.0], [0.0]]) * np.ones(len(wanted)))
        excitation = planned(place_, wanted, none, LIMITS, Bodies.around(robot.nominal).others)
        size = float(np.linalg.norm(excitation.reached) / np.linalg.norm(wanted))
        aside = np.concatenate([z[: robot.n], size * z[robot.n :]])
        hand, same = (place(mechanism, task, one) for one in (z, aside))
        sums["hand"] += information.information(mechanism, task, [hand])[0]
        sums["free"] += information.information(mechanism, task, [same])[0]
        strokes, both = _by_strokes(robot, mechanism, z[: robot.n], excitation)
        sums["strokes"] += strokes
        sums["both"] += both
    rows = [[what, *(f"{sd:.1e}" for sd in information.predicted_sd(sums[name]))] for name, what in DRIVEN.items()]
    names = ["s_x", "s_y", "s_z", "I_xx", "I_yy", "I_zz", "I_xy", "I_xz", "I_yz"]
    return (
        f"{options.runs} windows of 10 s, predicted sd (m, m²) with the robot file's marker noise and encoder "
        "resolution, the right model, no damping, rigid cables, and clocks of drives and cameras that agree: a "
        "millisecond between them would cost more than the strokes gain.\n\n" + table(["", *names], rows)
    )


DRIVEN = {
    "hand": "let go by hand, the whole displacement",
    "free": "let go by hand, with the swing that the winches give",
    "strokes": "the strokes alone, from rest",
    "both": "the strokes and the free motion after them as one motion from rest",
}


def _by_strokes(
    robot: Robot, mechanism: Mechanism, held: np.ndarray, excitation: Excitation
) -> tuple[np.ndarray, np.ndarray]:
    """Information of the strokes and of strokes with 10 s of free motion, the held lengths eliminated."""
    line = line_of(excitation.chains, 10.0)
    accelerations = line.accelerations(np.array([chain.direction for chain in excitation.chains]))[np.newaxis]
    near = ExcitationPlace.at(mechanism, held).equilibrium.pose

    def marker(x: np.ndarray) -> np.ndarray:
        body = Body.from_vector(x[:9])
        rest = pose_from_lengths(mechanism, body, x[9:], near).pose
        found = driven_motions(mechanism, body, rest, accelerations, line.steps)
        return (found.positions[0] + found.rotations[0] @ robot.marker)[1:]

    x = np.concatenate([robot.nominal.vector, held])
    steps = STEP_OF * np.concatenate([np.full(3, 0.2), np.full(6, 0.05), np.ones(robot.n)])
    columns = [(marker(x + h) - marker(x - h)) / (2 * h.sum()) for h in np.diag(steps)]
    weights = np.sqrt(information.RATE * np.maximum(line.steps, 0.0)) / robot.sensors.marker_noise
    rows = np.stack(columns, axis=-1) * weights[:, np.newaxis, np.newaxis]
    moving = line.t[1:] <= excitation.seconds + 1e-9
    return _eliminated(robot, rows[moving]), _eliminated(robot, rows)


def _eliminated(robot: Robot, rows: np.ndarray) -> np.ndarray:
    gram = np.einsum("kij,kil->jl", rows, rows)
    own = gram[9:, 9:] + np.eye(robot.n) / robot.sensors.encoder_resolution**2
    return gram[:9, :9] - gram[:9, 9:] @ np.linalg.solve(own, gram[9:, :9])
