"""A window replayed by MuJoCo from an exported robot, beside our own prediction of it."""

import numpy as np

from fidim_lab.arrays import Positions, Series
from fidim_lab.errors import SetupError
from sim_backends.mujoco_world.engine import engine


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
