"""`MujocoPlant`: a platform in MuJoCo that `sim_backends.simulate` records windows from, as it does from `Plant`.

Rest and displaced poses come from the plant's statics (a pose is a pose); the motion, cable lengths and tensions are
MuJoCo's own. Both engines' lengths at the first pose are compared: a pulley that MuJoCo does not wrap is seen.
"""

from typing import Any

import numpy as np

from fidim_lab.arrays import PerCable
from fidim_lab.data.records import Pose
from fidim_lab.errors import InfeasibleError, OurBugError
from sim_backends.mujoco_world.engine import engine
from sim_backends.mujoco_world.forces import FORCES, Moment, load, refuse_unsupported
from sim_backends.mujoco_world.multibody import BEFORE_ENTRY, STEP, multibody_xml
from sim_backends.plant.mechanics import Rest, Statics
from sim_backends.plant.motion import SlackInterval
from sim_backends.plant.paid_out import PaidOut
from sim_backends.plant.world import World

LENGTHS_AGREE = 1e-6
"""m between the two engines' cable lengths at the first pose"""
WRAPPED = 4
"""points of a tendon that goes round its pulley: both ends, both tangent points"""


class MujocoPlant:
    """A platform on n rigid cables in one world, held at constant cable lengths.

    Not simulated: winches that move, slack cables (an equality pushes instead; when that was is noted in `slack`, and
    the motion is not physical from then on), and the effects that `forces.SUPPORTED` lacks.
    """

    def __init__(self, world: World) -> None:
        """Raises SetupError where MuJoCo is not installed or the world hides what it cannot simulate."""
        refuse_unsupported(world)
        self.world = world
        self._mujoco = engine()
        self._statics, self._paid_out = Statics(world), PaidOut(world)
        self._forced = bool(world.effects(*FORCES))
        self._model: Any = None
        self._data: Any = None
        self._drums = np.zeros(world.n)
        self._start = self._window_start = 0.0
        self._window = 0
        self._last: tuple[float, np.ndarray] | None = None
        self._slack: list[SlackInterval] = []
        self.tensions = np.zeros(world.n)
        """now, N"""

    @property
    def t(self) -> float:
        """Time of the experiment, s."""
        return self._start + float(self._data.time)

    @property
    def slack(self) -> tuple[SlackInterval, ...]:
        """When which cable should not have pulled, since the platform was placed, as seen at the samples."""
        return tuple(self._slack)

    @property
    def pose(self) -> Pose:
        """True pose of P now."""
        moment = self._moment()
        return Pose(moment.position, moment.rotation)

    def rest(self, lengths: PerCable, near: Pose | None = None, displacement: np.ndarray | None = None) -> Rest:
        """As `Plant.rest`: by itself, or held `displacement` (x, y; m) aside. Raises InfeasibleError without one."""
        true = self._paid_out.true(np.asarray(lengths, dtype=float))
        self._statics.t = self._paid_out.t
        rest = self._statics.rest(true, near)
        return rest if displacement is None else self._statics.held_aside(rest, true, displacement)

    def place(self, rest: Rest, lengths: PerCable, t: float = 0.0) -> None:
        """Begin at rest there at time t with these encoder lengths (m).

        Raises InfeasibleError where MuJoCo's cables have other lengths there: it does not wrap a pulley.
        """
        self._model = self._mujoco.MjModel.from_xml_string(multibody_xml(self.world, rest.pose, t))
        self._data = self._mujoco.MjData(self._model)
        self._drums, self._start, self._window_start = np.array(lengths, dtype=float), t, t
        self._paid_out.restart(t)
        self._last, self._slack = None, []
        n = self.world.n
        before = np.array([BEFORE_ENTRY if cable.radius else 0.0 for cable in self.world.cables])
        missing = self._paid_out.true(self._drums) - (self._model.tendon_length0[:n] - before)
        if np.abs(missing).max() > LENGTHS_AGREE:
            cable = int(np.argmax(np.abs(missing)))
            raise InfeasibleError(
                f"MuJoCo cannot simulate cable {cable + 1}: its length differs by {missing[cable] * 1e3:.3f} mm, the "
                "cable does not go round its pulley there.",
                hint="Take --backend native.",
            )
        self._model.eq_data[:n, 0] = missing
        self._look()

    def begin_window(self, number: int | None = None) -> None:
        """Say that a window begins now."""
        self._window = self._window + 1 if number is None else number
        self._window_start = self.t

    def advance(self, t: float) -> None:
        """Let time pass until t (s).

        Raises OurBugError where t lies in the past, InfeasibleError where a cable leaves its pulley.
        """
        remaining = t - self.t
        if remaining < -1e-9:
            raise OurBugError(f"The MuJoCo world was asked to go back from {self.t:.6f} s to {t:.6f} s.")
        if remaining < 1e-9:
            return
        steps = int(np.ceil(remaining / STEP - 1e-6))
        self._model.opt.timestep = remaining / steps
        if self._forced:
            for _ in range(steps):
                self._data.xfrc_applied[1] = self._load_ahead(remaining / steps)
                self._mujoco.mj_step(self._model, self._data)
        else:
            self._mujoco.mj_step(self._model, self._data, nstep=steps)
        self._look()

    def markers(self) -> np.ndarray:
        """True marker positions (M, 3), world frame, m."""
        pose = self.pose
        return pose.position + self.world.markers @ pose.rotation.T

    def encoder_lengths(self) -> PerCable:
        """Cable lengths as ideal encoders see them, m: held."""
        return self._drums.copy()

    def _moment(self) -> Moment:
        q, v = self._data.qpos, self._data.qvel
        matrix = np.empty(9)
        self._mujoco.mju_quat2Mat(matrix, q[3:7])
        rotation = matrix.reshape(3, 3)
        return Moment(
            world=self.world,
            t=self.t,
            in_window=self.t - self._window_start,
            window=self._window,
            position=q[:3].copy(),
            rotation=rotation,
            velocity=v[:3].copy(),
            omega=rotation @ v[3:6],
        )

    def _load_ahead(self, h: float) -> np.ndarray:
        """Forces in the middle of the coming step, by extrapolation: held at its start they would feed in energy."""
        now, force = self.t, load(self._moment())
        last, self._last = self._last, (now, force)
        if last is None:
            return force
        return force + (force - last[1]) * (h / 2) / (now - last[0])

    def _look(self) -> None:
        """Tensions of the present state; refuses one in which a cable does not touch its pulley."""
        if self._forced:
            self._data.xfrc_applied[1] = load(self._moment())
        self._mujoco.mj_forward(self._model, self._data)
        data, n = self._data, self.world.n
        equality = data.efc_type == self._mujoco.mjtConstraint.mjCNSTR_EQUALITY
        held = equality & (data.efc_id < n)
        self.tensions = -data.efc_force[held]
        if len(self.tensions) != n or not np.isfinite(data.qpos).all():
            raise InfeasibleError(f"MuJoCo lost the platform at t = {self.t - self._window_start:.2f} s.")
        self._slack += [SlackInterval(int(i) + 1, self.t, self.t) for i in np.flatnonzero(self.tensions <= 0)]
        for i, cable in enumerate(self.world.cables):
            if cable.radius and data.ten_wrapnum[i] != WRAPPED:
                raise InfeasibleError(
                    f"MuJoCo's cable {i + 1} left its pulley at t = {self.t - self._window_start:.2f} s.",
                    hint="Take --backend native.",
                )
