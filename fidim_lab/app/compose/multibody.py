"""A robot as a MuJoCo model for other programs, as the simulated world is made; MuJoCo itself is not needed here."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from fidim_lab.arrays import Positions, Series, Vector3
from fidim_lab.data.records import Body, Cable, Pose
from fidim_lab.errors import SetupError
from sim_backends.mujoco_world.engine import engine
from sim_backends.mujoco_world.multibody import multibody_xml, numbers
from sim_backends.plant.world import World


@dataclass(frozen=True, eq=False)
class Multibody:
    """What the model is made of; SI, world frame."""

    cables: tuple[Cable, ...]
    mass: float
    """kg"""
    body: Body
    """per unit mass, about P"""
    markers: Positions
    """(M, 3) m, body frame"""
    gravity: Vector3
    pose: Pose
    """at the start; the cables keep the lengths that they have there"""
    twist: np.ndarray
    """(6,) [ṗ; ω] at the start, along which the lengths do not change"""


def multibody_mjcf(made: Multibody) -> str:
    """MJCF: body `platform`, tendon `cable0` …, sites `marker0` …, and the keyframe `start`.

    A cable is an equality: it would push where it had to, so a motion in which one goes slack is not physical there.
    """
    world = World(made.cables, made.mass, made.body, made.markers, made.gravity, None)
    text = multibody_xml(world, made.pose)
    sites = "".join(f'<site name="marker{k}" pos="{numbers(place)}"/>' for k, place in enumerate(made.markers))
    end = text.index("</body>")
    text = f"{text[:end].rstrip()}\n      {sites}\n    {text[end:]}"
    quaternion = Rotation.from_matrix(made.pose.rotation).as_quat(scalar_first=True)
    place = [*made.pose.position, *quaternion, *np.zeros(len(made.cables))]
    spin = made.pose.rotation.T @ made.twist[3:]
    rates = [*made.twist[:3], *spin, *(_swivel_rate(cable, made.pose, made.twist) for cable in made.cables)]
    key = f'<keyframe><key name="start" qpos="{numbers(place)}" qvel="{numbers(rates)}"/></keyframe>'
    return text.replace("</mujoco>", f"  {key}\n</mujoco>\n")


def _swivel_rate(cable: Cable, pose: Pose, twist: np.ndarray) -> float:
    """rad/s of the swivel about its z: (c × ċ)·z / h²."""
    arm = pose.rotation @ cable.a
    c, rate = pose.position + arm - cable.d, twist[:3] + np.cross(twist[3:], arm)
    across = c - (c @ cable.z) * cable.z
    return float(np.cross(across, rate) @ cable.z / (across @ across))


def replay_rms(xml: str, t: Series, marker: Positions) -> float | None:
    """How far the main marker is from its predicted path: rms of a coordinate, m; infinite where it goes astray.

    t: s since keyframe `start`. marker: predicted, (N, 3) m. None where MuJoCo is not installed.
    """
    try:
        mujoco = engine()
    except SetupError:
        return None
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    times, places = [], []
    while not times or times[-1] < t[-1]:
        mujoco.mj_kinematics(model, data)
        times.append(data.time)
        places.append(data.site("marker0").xpos.copy())
        mujoco.mj_step(model, data)
        if data.time < times[-1]:  # MuJoCo begins anew where a state is no number
            return float(np.inf)
    reached = np.stack([np.interp(t, times, axis) for axis in np.transpose(places)], axis=1)
    return float(np.sqrt(np.mean((reached - marker) ** 2)))
