"""The simulated robot: a platform on cables that winches hold or move, driven by gravity, hands and what is hidden.

`Plant(world)` compiles it; `settle` or `place` puts it at rest; `advance` lets time pass. What a sensor needs can then
be asked for: `markers`, `encoder_lengths`, `tensions`. One plant is one experiment, and it is deterministic.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from fidim_lab.arrays import PerCable, Vector3
from fidim_lab.data.records import Pose
from fidim_lab.errors import OurBugError
from sim_backends.plant.mechanics.kinematics import (
    HAND_SIZE,
    LOOSE,
    POSE,
    TWIST,
    matrix_of,
    oscillation,
    pose_of,
    size,
    stalks,
    stalks_at,
)
from sim_backends.plant.mechanics.statics import Rest, Statics
from sim_backends.plant.motion import NO_HAND, DrumMotion, PlatformMotion, SlackInterval
from sim_backends.plant.paid_out import PaidOut
from sim_backends.plant.seen import markers_at
from sim_backends.plant.world import World


@dataclass(frozen=True, eq=False)
class HandLaw:
    """A hand on the main marker: spring and damper to where it wants it, damper of rotation, and when it is gone.

    From `fading` on the grip gets weaker and is nothing at `until`.
    """

    target: Vector3
    """where it wants the marker, world frame, m"""
    stiffness: Vector3
    """N/m along x, y, z"""
    damping: Vector3
    """N s/m"""
    rotation_damping: float = 0.0
    """N m s"""
    force: Vector3 | None = None
    """steady push, N"""
    fading: float = np.inf
    """s, plant time"""
    until: float = np.inf

    def at(self, t: float) -> np.ndarray:
        """The law as the plant takes it (HAND_SIZE,), at plant time t."""
        if t >= self.until:
            return NO_HAND
        grip = 1.0 if t <= self.fading else (self.until - t) / (self.until - self.fading)
        law = np.zeros(HAND_SIZE)
        law[0:3], law[3:6], law[6:9] = self.target, grip * self.stiffness, grip * self.damping
        law[9] = grip * self.rotation_damping
        law[10:13] = 0.0 if self.force is None else grip * self.force
        return law


class Plant:
    """A platform on n cables in one world.

    Not simulated: cables that touch each other or the platform, slip on the drum, the drives (their moves are given to
    `advance`), sag, torsion and heat of the cables, a platform that is not rigid; the hand never slips. What of the
    hidden effects is simplified stands in `hidden`.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self.hand: HandLaw | None = None
        self._statics = Statics(world)
        self._motion = PlatformMotion(world)
        self._paid_out = PaidOut(world)
        self._drums = np.zeros(world.n)
        self._window, self._window_start = 0, 0.0
        self._yield = np.zeros(world.n)
        for effect in world.effects("winch-hold-compliance"):
            if effect["k"] > 0:
                self._yield += [effect.concerns(i) / effect["k"] for i in range(world.n)]

    @property
    def t(self) -> float:
        """Plant time, s."""
        return self._motion.t

    @property
    def tensions(self) -> PerCable:
        """True cable tensions now, N; 0 for a slack cable."""
        return self._motion.tensions.copy()

    @property
    def pose(self) -> Pose:
        """True pose of P now."""
        return pose_of(self.world, self._motion.x)

    @property
    def rate(self) -> Vector3:
        """True angular rate now about the body's axes, rad/s."""
        return self._motion.x[TWIST][3:].copy()

    @property
    def slack(self) -> tuple[SlackInterval, ...]:
        """When which cable did not pull, since the platform was placed."""
        return self._motion.slack.intervals()

    def rest(self, lengths: PerCable, near: Pose | None = None, displacement: np.ndarray | None = None) -> Rest:
        """Where it would rest with these encoder lengths (m), by itself or held `displacement` (x, y; m) aside.

        Raises:
            InfeasibleError: there is no such rest with all cables taut.
        """
        true = self._paid_out.true(np.asarray(lengths, dtype=float))
        self._statics.t = self._paid_out.t
        rest = self._statics.rest(true, near)
        return rest if displacement is None else self._statics.held_aside(rest, true, displacement)

    def place(self, rest: Rest, lengths: PerCable, t: float = 0.0, twist: np.ndarray | None = None) -> None:
        """Begin at rest there at plant time t with these encoder lengths (m); creep, window and slack begin anew.

        At rest against the frame: where that sways, the platform is displaced and moves with it. twist: how it is
        pushed there, [velocity of G in the world frame; angular rate about the body's axes], m/s and rad/s, as far as
        the cables let it go.
        """
        self._paid_out.restart(t)
        self._drums = np.array(lengths, dtype=float)
        x = np.zeros(size(self.world))
        x[POSE] = rest.coordinates
        x[TWIST] = 0.0 if twist is None else twist
        for effect in self.world.effects("frame-sway"):
            displaced, moving, _ = oscillation(effect, ca.SX(t))
            x[0:3] += np.array(ca.evalf(displaced)).ravel()
            x[TWIST][:3] += np.array(ca.evalf(moving)).ravel()
        rotation = matrix_of(rest.coordinates[3:7])
        for k, effect in enumerate(self.world.effects("loose-mass")):
            sag = self.world.gravity / (2 * np.pi * effect["f"]) ** 2
            arm = effect.vector("bx", "by", "bz") - self.world.body.com
            x[LOOSE + 6 * k : LOOSE + 6 * k + 3] = x[0:3] + rotation @ arm + sag
        for k, effect in enumerate(stalks(self.world)):
            sag = self.world.gravity * effect["k"]
            first = stalks_at(self.world) + 6 * k
            x[first : first + 3] = x[0:3] + rotation @ (self.world.markers[0] - self.world.body.com) + sag
        self._window_start = t
        none = np.zeros(self.world.n)
        self._motion.start(x, t, self._drive(t, none, none))

    def settle(self, lengths: PerCable, near: Pose | None = None, t: float = 0.0) -> Rest:
        """Begin at the rest that belongs to these encoder lengths (m).

        Raises:
            InfeasibleError: there is no rest with all cables taut.
        """
        self._paid_out.restart(t)
        rest = self.rest(lengths, near)
        self.place(rest, lengths, t)
        return rest

    def begin_window(self, number: int | None = None) -> None:
        """Say that a window begins now (effects that happen at some time in a window count from here)."""
        self._window = self._window + 1 if number is None else number
        self._window_start = self.t

    def advance(
        self,
        t: float,
        lengths: PerCable | None = None,
        rates: PerCable | None = None,
        accelerations: PerCable | None = None,
    ) -> None:
        """Let time pass until t (s).

        Args:
            t: plant time, not before the present.
            lengths: encoder lengths at the beginning, m; None: as they are. A jump of more than some micrometres is a
                jerk that the cables follow within 0.1 s.
            rates: of them at the beginning, m/s; None: held.
            accelerations: constant during this time, m/s².

        Raises:
            OurBugError: t lies in the past.
            InfeasibleError: the platform came into a singular pose.
        """
        if t < self.t - 1e-9:
            raise OurBugError(f"The plant was asked to go back from {self.t:.6f} s to {t:.6f} s.")
        if lengths is not None:
            self._drums[:] = lengths
        rate = np.zeros(self.world.n) if rates is None else np.asarray(rates, dtype=float)
        acceleration = np.zeros(self.world.n) if accelerations is None else np.asarray(accelerations, dtype=float)
        dt = t - self.t
        self._motion.run(t, self._drive(self.t, rate, acceleration))
        self._drums += rate * dt + acceleration * dt**2 / 2
        self._paid_out.pass_time(dt, rate)

    def encoder_lengths(self) -> PerCable:
        """Cable lengths as ideal encoders see them now, m: what is paid out, and how far a held winch yields."""
        return self._drums + self._yield * self._motion.tensions

    @property
    def remembered_since(self) -> float:
        """The earliest plant time at which `markers` still knows where they were, s."""
        return self._motion.history[0][0]

    def markers(self, t: float | None = None) -> np.ndarray:
        """True marker positions (M, 3), world frame, m, now or since `remembered_since` (cubic between two steps).

        Raises:
            OurBugError: t is not within what has been simulated.
        """
        return markers_at(self.world, self._motion.history, self.t if t is None else t)

    def energy(self) -> float:
        """Kinetic and potential energy now, J (up to a constant)."""
        none = np.zeros(self.world.n)
        return self._motion.energy_now(self._drive(self.t, none, none))

    def _drive(self, t: float, rates: PerCable, accelerations: PerCable) -> DrumMotion:
        true_rates, true_accelerations = self._paid_out.true_motion(self._drums, rates, accelerations)
        return DrumMotion(
            lengths=self._paid_out.true(self._drums),
            rates=true_rates,
            accelerations=true_accelerations,
            hand=NO_HAND if self.hand is None else self.hand.at(t),
            window_start=self._window_start,
            window=float(self._window),
        )
