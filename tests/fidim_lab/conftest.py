"""A simulated recording of another lab's robot, in that lab's files, with what is hidden in it.

Four elastic cables on swivelling pulleys in the arrangement of IRMA4U, a platform that a hand pushes in between, a
motion capture in its own tilted world, a log with its own clock. It does not simulate: friction other than a linear
rotational drag, sensor delays, load-cell errors, frames out of order.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
import scipy.io
from scipy.spatial.transform import Rotation

from fidim_lab.data.records import Body, Cable, Campaign, Plan, PlannedWindow, Robot, Role
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.mechanism import Mechanism
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign

MASS, DRAG = 12.966, 0.01
COMPLIANCE, CABLE_DAMPING = 20e-6, 40.0
STEP, FRAME, DURATION = 1e-3, 10, 30.0
CONTACTS = ((2.0, 5.0), (9.0, 12.0), (16.0, 19.0), (23.0, 26.0))
PUSHES = ((20.0, 0.0, 0.5, 0.4), (4.0, 9.0, 0.5, 1.0), (14.0, 5.0, -1.0, 0.6), (-12.0, 8.0, 0.5, 0.8))
"""force x, y, torque about x, z of each contact, N and N m; they follow a sine of 1.3 Hz"""


SHAPE = tuple(np.array(m) for m in ([0.1, 0.0, 0.3], [-0.1, 0.1, 0.25], [0.0, -0.2, 0.2]))
PLACES = (
    ((1.25, -0.15, -0.2), (18, 12)),
    ((1.1, 0.1, -0.35), (-18, 12)),
    ((1.35, -0.35, -0.3), (12, -18)),
    ((1.2, 0.0, -0.3), (-12, -18)),
    ((1.3, -0.1, -0.4), (18, 18)),
)
"""of P (m), and displacements (mm); the last is held out"""


@dataclass(frozen=True, eq=False)
class LabRecording:
    """Files of a simulated recording, and the truth behind them."""

    folder: Path
    robot: Robot
    body_markers: np.ndarray
    """(M, 3)"""
    noise: float
    t: np.ndarray
    """frame times, s"""
    positions: np.ndarray
    rotations: np.ndarray
    clock_offset: float
    """log − motion capture, s"""
    tilt: float
    compliance: float
    contacts: tuple[tuple[float, float], ...]


def _recorded_on_springs(
    robot: Robot, hidden: Sequence[str], *, meeting: float = 1.0, seconds: float = 4.0, places: Sequence[int] = range(5)
) -> tuple[Campaign, Body]:
    """(campaign, true body) of a robot whose cables meet within so much of the usual distance; four markers.

    places: which of `PLACES`; the last is held out.
    """
    cables = tuple(replace(cable, a=cable.a * np.array([meeting, meeting, 1.0])) for cable in robot.cables)
    robot = replace(robot, cables=cables, extra_markers=SHAPE)
    world = make_world(robot, np.random.default_rng(2), tuple(parse_effect(text, robot.n) for text in hidden))
    windows: list[PlannedWindow] = []
    for k, (place, displacement) in enumerate(PLACES[number] for number in places):
        # lengths tuned at the robot until all cables are taut there
        rest = equilibrium_at(Mechanism(robot), world.body, np.array(place))
        role = Role.VALIDATE if k == len(places) - 1 else Role.IDENTIFY
        at = rest.pose.position + rest.pose.rotation @ robot.marker
        windows.append(PlannedWindow(f"w{k + 1}", role, rest.lengths, 1e-3 * np.array(displacement), at))
    plan, rng = Plan("elastic", tuple(windows)), np.random.default_rng(3)
    campaign, truth = simulate_campaign(robot, plan, world, rng, recording=Sampling(duration=seconds))
    assert not truth["slack"]
    return campaign, world.body


@pytest.fixture(scope="session")
def recorded_on_springs() -> Callable[..., tuple[Campaign, Body]]:
    """Makes recordings of the independent simulator of robots whose cables may meet."""
    return _recorded_on_springs


def lab_robot() -> Robot:
    """IRMA4U's arrangement: looks the same after half a turn."""
    corners = ((1, -1), (1, 1), (-1, 1), (-1, -1))
    cables = tuple(
        Cable(
            d=np.array([1.068 * x, 1.155 * y, 1.839]),
            a=np.array([0.075 * x, 0.075 * y, 0.28]),
            radius=0.03,
            x=np.array([0.0, 0.0, -1.0]),
            y=np.array([0.0, 1.0 * x, 0.0]),
            z=np.array([1.0 * x, 0.0, 0.0]),
        )
        for x, y in corners
    )
    body = Body(np.array([0.0, 0.0, 0.173]), np.array([0.0441, 0.0388, 0.0144, 0.0, 0.0, 0.0]))
    return Robot(cables, MASS, body, np.zeros(3), gravity=np.array([0.0, 0.0, -9.80665]))


def _hand(t: np.ndarray) -> np.ndarray:
    """(N, 8): wrench of the hand, then how hard it brakes linear and angular velocity."""
    hand = np.zeros((len(t), 8))
    for (begin, end), (fx, fy, tx, tz) in zip(CONTACTS, PUSHES, strict=True):
        middle = begin + 1.2
        brake = (t >= begin) & (t < middle)
        push = (t >= middle) & (t < end)
        hand[brake, 6:] = (80.0, 2.0)
        sine = np.sin(2 * np.pi * 1.3 * (t[push] - middle))
        hand[push, 0], hand[push, 1], hand[push, 3], hand[push, 5] = fx * sine, fy * sine, tx * sine, tz * sine
    return hand


def _step(mechanism: Mechanism, rest_lengths: np.ndarray) -> ca.Function:
    """One Runge–Kutta step of position, rotation (columns), velocity, spin; input: the hand."""
    state, hand = ca.SX.sym("state", 18), ca.SX.sym("hand", 8)
    position, rotation = state[:3], ca.reshape(state[3:12], 3, 3)
    velocity, spin = state[12:15], state[15:]
    cables = mechanism.cables_at(position, rotation, ca.SX.zeros(0))
    structure = ca.horzcat(*(cable.screw for cable in cables)).T
    lengths = ca.vertcat(*(cable.length for cable in cables))
    rate = structure @ state[12:]
    tension = ca.fmax((lengths - rest_lengths) / COMPLIANCE + CABLE_DAMPING * rate, 0)
    com = rotation @ ca.DM(mechanism.robot.nominal.com)
    inertia = MASS * (rotation @ ca.DM(mechanism.robot.nominal.inertia_matrix) @ rotation.T)
    mass = ca.blockcat([[MASS * ca.SX.eye(3), -MASS * ca.skew(com)], [MASS * ca.skew(com), inertia]])
    weight = MASS * ca.DM(mechanism.robot.gravity)
    wrench = ca.vertcat(weight, ca.cross(com, weight)) - structure.T @ tension + hand[:6]
    wrench -= ca.vertcat(hand[6] * velocity, (hand[7] + MASS * DRAG) * spin)
    wrench -= ca.vertcat(MASS * ca.cross(spin, ca.cross(spin, com)), ca.cross(spin, inertia @ spin))
    slope = ca.Function(
        "slope",
        [state, hand],
        [ca.vertcat(velocity, ca.vec(ca.skew(spin) @ rotation), ca.solve(mass, wrench)), tension],
    )
    k1, pull = slope(state, hand)
    k2 = slope(state + STEP / 2 * k1, hand)[0]
    k3 = slope(state + STEP / 2 * k2, hand)[0]
    k4 = slope(state + STEP * k3, hand)[0]
    return ca.Function("step", [state, hand], [state + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4), pull])


def _simulate(robot: Robot) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, rotations and tensions at every step of 1 ms."""
    mechanism = Mechanism(robot)
    start, upright = np.array([[0.0, 0.0, 0.55]]), np.eye(3)[None]
    pull = MASS * 9.80665 / -mechanism.structure_matrix(start, upright)[0, :, 2].sum()
    rest_lengths = mechanism.lengths(start, upright)[0] - COMPLIANCE * pull
    steps = round(DURATION / STEP)
    state = np.concatenate([start[0], np.eye(3).ravel(), np.zeros(6)])
    run = _step(mechanism, rest_lengths).mapaccum(steps)
    states, tensions = run(state, _hand(STEP * np.arange(steps)).T)
    states = np.vstack([state, np.array(states).T[:-1]])
    rotations = states[:, 3:12].reshape(-1, 3, 3).transpose(0, 2, 1)
    return states[:, :3], rotations, np.array(tensions).T


def _write_markers(path: Path, markers: np.ndarray) -> None:
    count = markers.shape[1]
    lines = [
        "Trajectories",
        "100",
        "\t\t" + "".join(f"platform:points{m + 1}\t\t\t" for m in range(count)),
        "Frame\tSub Frame" + "\tX\tY\tZ" * count,
        "\t" + "\tmm\tmm\tmm" * count,
    ]
    for frame, row in enumerate(markers.reshape(len(markers), -1), start=1):
        cells = ("" if np.isnan(value) else f"{1e3 * value:.6g}" for value in row)
        lines.append("\t".join([str(frame), "0", *cells]))
    path.write_text("\n".join(lines) + "\n\n", encoding="utf-8")


def _cell(vectors: list[np.ndarray]) -> np.ndarray:
    cell = np.empty(len(vectors), dtype=object)
    for index, vector in enumerate(vectors):
        cell[index] = vector
    return cell


def write_geometry(path: Path, robot: Robot) -> None:
    """A geometry file in that lab's layout."""
    pulleys = [
        {"Id": k, "r": c.radius, "CableEnterPosition": c.d, "FixedFrame": _cell([c.x, c.y, c.z])}
        for k, c in enumerate(robot.cables, start=1)
    ]
    platform = {
        "m": robot.mass,
        "PtoG": robot.nominal.com,
        "InertialMatrix": robot.mass * robot.nominal.inertia_about_com,
        "points": _cell([c.a for c in robot.cables]),
    }
    s = {"EndEffector": {"Platform": platform}, "Trasmission": {"Pulley": _cell(pulleys)}}
    scipy.io.savemat(path, {"s": s})


@pytest.fixture(scope="session")
def lab_recording(tmp_path_factory: pytest.TempPathFactory) -> LabRecording:
    """The simulated recording, written once for all tests; they must not change it."""
    rng = np.random.default_rng(11)
    robot, folder = lab_robot(), tmp_path_factory.mktemp("lab") / "recording"
    folder.mkdir()
    positions, rotations, tensions = _simulate(robot)
    frames = slice(0, None, FRAME)
    body_markers = rng.uniform([-0.22, -0.09, 0.13], [0.22, 0.09, 0.27], (6, 3))
    world = positions[frames, None] + np.einsum("nij,mj->nmi", rotations[frames], body_markers)
    turn = Rotation.from_euler("zyx", [6.0, 1.4, -1.1], degrees=True).as_matrix()
    noise = 5e-5
    markers = (world - [0.05, -0.08, 0.02]) @ turn + noise * rng.normal(size=world.shape)
    markers[1950:1953, 2] = np.nan
    _write_markers(folder / "Motion07.txt", markers)
    write_geometry(folder / "robot_cad.mat", robot)

    mechanism = Mechanism(robot)
    log = slice(1000, -1500)
    swivels = mechanism.swivel_angles(positions[log], rotations[log])
    offset = 391.2043
    t = STEP * np.arange(len(positions))
    st_out = {
        "t": t[log] + offset,
        "cable_length": np.tile([[-0.02], [-0.03], [-0.01], [0.0]], len(t[log])),
        "swivel": (np.round((swivels - swivels[0]) / 2e-5) * 2e-5).T,
        "tensions": (tensions[log] + 0.5 * rng.normal(size=tensions[log].shape)).T,
        "epsilon": Rotation.from_matrix(rotations[log]).as_euler("xyz").T + 0.02,
    }
    scipy.io.savemat(folder / "Motion07_exp.mat", {"st_out": st_out})
    return LabRecording(
        folder=folder,
        robot=robot,
        body_markers=body_markers,
        noise=noise,
        t=t[frames],
        positions=positions[frames],
        rotations=rotations[frames],
        clock_offset=offset,
        tilt=float(np.arccos(turn[2, 2])),
        compliance=COMPLIANCE,
        contacts=CONTACTS,
    )
