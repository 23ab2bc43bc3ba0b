"""The frozen values that travel between layers: robot, body, poses, windows, campaign. SI units throughout.

Files become these in `robot_file` and `campaign`; nothing is validated again after that edge.
"""

from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import ClassVar

import numpy as np

from fidim_lab.arrays import CableSeries, Inertia6, Matrix3, PerCable, Positions, Rotations, Series, Twists, Vector3

PARAMETER_NAMES = ("s_x", "s_y", "s_z", "I_xx", "I_yy", "I_zz", "I_xy", "I_xz", "I_yz")
"""The base inertial parameters χ[1:] of Eq. 22, in the paper's order; inertia per unit mass, about P."""


@dataclass(frozen=True, eq=False)
class Cable:
    """One cable with its swivelling pulley (§2.1, Table 1)."""

    d: Vector3
    """pulley entry point D, world frame, m"""
    a: Vector3
    """attachment A, body frame, m"""
    radius: float
    """pulley radius, m; 0 is a plain eyelet"""
    x: Vector3
    y: Vector3
    z: Vector3
    """fixed unit vectors of the swivel, world frame, x × y = z; z is the swivel axis"""
    name: str = ""
    """by which it is known in every robot that has it; empty where the robot file gives none"""


@dataclass(frozen=True)
class WinchTorque:
    """What turns a motor current into a cable tension."""

    drum_radius: float
    """m"""
    gear_ratio: float
    efficiency: float
    torque_constant: float
    """N m / A at the motor"""

    @property
    def newton_per_ampere(self) -> float:
        """Cable tension for one ampere of motor current, N/A."""
        return self.torque_constant * self.gear_ratio * self.efficiency / self.drum_radius


@dataclass(frozen=True, eq=False)
class Body:
    """Inertial parameters per unit mass: centre of mass s′ (m) and inertia I′ about P (m²), body frame (Eq. 22)."""

    com: Vector3
    inertia: Inertia6
    """xx yy zz xy xz yz"""

    @property
    def vector(self) -> np.ndarray:
        """The nine base parameters in the order of PARAMETER_NAMES."""
        return np.concatenate([self.com, self.inertia])

    @staticmethod
    def from_vector(values: np.ndarray) -> "Body":
        """The body of nine base parameters in the order of PARAMETER_NAMES."""
        return Body(com=np.array(values[:3], dtype=float), inertia=np.array(values[3:9], dtype=float))

    @staticmethod
    def from_about_com(com: Vector3, inertia: Matrix3) -> "Body":
        """The body of com (m, from P) and I′ about G (m², symmetric), by the parallel-axis theorem."""
        about_p = inertia + (com @ com) * np.eye(3) - np.outer(com, com)
        return Body(com=com, inertia=about_p[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])

    @property
    def inertia_matrix(self) -> Matrix3:
        """I′ about P as a symmetric matrix, m²."""
        xx, yy, zz, xy, xz, yz = self.inertia
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    @property
    def inertia_about_com(self) -> Matrix3:
        """I′ about the centre of mass G (parallel-axis theorem), m²."""
        s = self.com
        return self.inertia_matrix - (s @ s * np.eye(3) - np.outer(s, s))


@dataclass(frozen=True)
class Limits:
    """What a procedure may ask of the robot."""

    tension: tuple[float, float] = (20.0, 200.0)
    """N"""
    free_displacement: tuple[float, float] = (0.1, 0.1)
    """m, of the marker's x and y from rest"""


@dataclass(frozen=True)
class Sensors:
    """Stated accuracy of the sensors, one standard deviation or one step."""

    marker_noise: float = 1e-4
    """m, one standard deviation of a marker component"""
    encoder_resolution: float = 2e-5
    """m of cable length for one encoder step"""
    gyro_noise: float = 3e-3
    """rad/s, one standard deviation of an angular rate as the windows have it"""


@dataclass(frozen=True, eq=False)
class Survey:
    """How well the geometry of a robot file is known: standard deviations, 0 where it is exact."""

    anchor: np.ndarray
    """(n, 3) of each D, world frame, m"""
    attachment: np.ndarray
    """(n, 3) of each A, body frame, m"""
    radius: float = 0.0
    """of each pulley, m"""
    axis: float = 0.0
    """of each swivel's axis, rad"""
    marker: float = 0.0
    """of each coordinate of a marker, body frame, m"""
    encoder_zero: float = 0.0
    """of each cable length, the same error in all windows, m"""
    frame_shift: float = 0.0
    """of the motion-capture frame against the robot frame, m"""
    frame_rotation: float = 0.0
    """the same, rad"""
    gravity: float = 0.0
    """of the direction of gravity in the robot frame, rad"""

    @staticmethod
    def alike(n: int, anchor: float, attachment: float) -> "Survey":
        """All anchors of n cables known alike, and all attachments (m); everything else exact."""
        return Survey(np.full((n, 3), anchor), np.full((n, 3), attachment))

    @property
    def exact(self) -> bool:
        """Whether nothing is uncertain."""
        return not (self.anchor.any() or self.attachment.any() or any(self.scalars.values()))

    @property
    def scalars(self) -> dict[str, float]:
        """What is known alike of all cables or markers, by the keys of the robot file."""
        names = ("radius", "axis", "marker", "encoder_zero", "frame_shift", "frame_rotation", "gravity")
        return {name: getattr(self, name) for name in names}

    def scaled(self, factor: float) -> "Survey":
        """All standard deviations so many times as large."""
        scalars = {name: factor * value for name, value in self.scalars.items()}
        return Survey(factor * self.anchor, factor * self.attachment, **scalars)


@dataclass(frozen=True, eq=False)
class Robot:
    """A cable-suspended robot as its robot file describes it: geometry, nominal body, limits, sensors."""

    cables: tuple[Cable, ...]
    mass: float
    """kg"""
    nominal: Body
    """what CAD says"""
    marker: Vector3
    """main marker, body frame, m"""
    extra_markers: tuple[Vector3, ...] = ()
    gravity: Vector3 = field(default_factory=lambda: np.array([0.0, 0.0, -9.81]))
    limits: Limits = Limits()
    sensors: Sensors = Sensors()
    winches: tuple[WinchTorque, ...] | None = None
    """one for each cable; None where the robot file has no [winch]"""
    survey: Survey | None = None
    """how well the geometry is known; None where the robot file does not say"""

    @property
    def n(self) -> int:
        """Number of cables."""
        return len(self.cables)

    @property
    def attachment_plane(self) -> float:
        """Mean a_z, m: s_z is known only relative to it (gauge)."""
        return float(np.mean([cable.a[2] for cable in self.cables]))

    @property
    def freedoms(self) -> int:
        """λ = 6 − n."""
        return 6 - self.n

    @property
    def markers(self) -> np.ndarray:
        """All markers, body frame, (M, 3), the main one first."""
        return np.array([self.marker, *self.extra_markers])


@dataclass(frozen=True, eq=False)
class Pose:
    """One pose of the platform: P in the world frame (m), rotation body → world."""

    position: Vector3
    rotation: Matrix3


@dataclass(frozen=True, eq=False)
class Motion:
    """Poses over time with their twist and its derivative, all in the world frame."""

    t: Series
    positions: Positions
    rotations: Rotations
    twists: Twists
    """[ṗ; ω], m/s, rad/s"""
    accelerations: Twists
    """[p̈; α], m/s², rad/s²"""


class Role(StrEnum):
    """What a window is for."""

    IDENTIFY = "identify"
    VALIDATE = "validate"
    """never used for fitting shared parameters"""
    TEST = "test"
    """never fitted, never used to choose a model: opened once, for the figures of the answer"""


@dataclass(frozen=True, eq=False)
class Window:
    """One recording of free motion with locked motors. A missing sample is NaN."""

    id: str
    role: Role
    t: Series
    """s, increasing"""
    markers: np.ndarray
    """(N, M, 3) world frame, m; the main marker first"""
    lengths: CableSeries | None
    """(N, n) from the encoders, m"""
    currents: CableSeries | None
    """(N, n) motor currents, A"""
    equilibrium: Vector3 | None = None
    """main marker at rest before the motion started, m"""
    further: dict[str, np.ndarray] = field(default_factory=dict[str, np.ndarray])
    """columns that the format does not name, kept as they are"""
    lengths_by_poses: bool = False
    """the lengths, or their zeros, were computed from the markers with the robot file's geometry: they repeat what the
    markers say and are no measurement of their own"""
    encoder_zeros: PerCable | None = None
    """(n,) m: what was added to the encoders' readings so that they agree with the poses; the readings, without it,
    differ from the true lengths by the same in all windows of a session. None where none were read"""
    body_change: np.ndarray | None = None
    """(9,): what `Body.vector` has here beyond that of the campaign: of a body that changes over a session, found by
    `fidim explain` and never recorded. None: nothing"""
    body_change_by: np.ndarray | None = None
    """(9, p): its derivative by p numbers, the same in all windows, of which it was estimated, each in units of its
    standard deviation beforehand; None: it is exact"""

    @property
    def duration(self) -> float:
        """s"""
        return float(self.t[-1] - self.t[0])

    def middle(self, on_body: np.ndarray) -> Vector3 | None:
        """Mean place of the main marker, world frame, m; by the marker that is seen most, as if the body did not turn.

        on_body: (M, 3) m, the markers on the body. None where no marker is seen.
        """
        seen = np.asarray(np.isfinite(self.markers).all(axis=2))
        most = int(np.argmax(seen.sum(axis=0)))
        if not seen[:, most].any():
            return None
        return self.markers[seen[:, most], most].mean(axis=0) + on_body[0] - on_body[most]

    def of_rows(self, rows: slice | np.ndarray) -> "Window":
        """Some of its samples: a slice, or a mask or numbers of rows."""
        return replace(
            self,
            t=self.t[rows],
            markers=self.markers[rows],
            lengths=None if self.lengths is None else self.lengths[rows],
            currents=None if self.currents is None else self.currents[rows],
            further={name: values[rows] for name, values in self.further.items()},
        )


@dataclass(frozen=True)
class Alignment:
    """How late motion capture is against the encoders, as a jog has shown it."""

    lag: float
    """s: markers show at t what encoders showed at t - lag"""
    sd: float
    """s, one standard deviation"""
    correlation: float
    at: str
    """when it was measured, UTC"""
    source: str
    """kind of motion capture: another one has another delay"""
    rate: float
    """its frames a second"""
    sync_rate: float
    """Hz, of the bus"""


@dataclass(frozen=True, eq=False)
class Period:
    """What a person with a stopwatch or a light gate writes down of a pendulum: some swings at some lengths."""

    lengths: PerCable
    """(n,) m, by tape, from anchor to attachment; periods with the same numbers: it was not hung anew"""
    motion: str
    """what swings, as `model.many_swings.MOTIONS` names it; empty where nobody knows"""
    time: float
    """s, of all the swings"""
    swings: int
    """whole ones, there and back"""
    sd: float
    """s, of `time`"""
    amplitude: float | None = None
    """rad, of the turning platform or of the swaying cords; None where nobody noted it"""
    tilt: tuple[float, float, float] | None = None
    """rad at rest, by an inclinometer: rotations about x, then y, and the standard deviation of each"""

    @property
    def value(self) -> float:
        """s, of one swing."""
        return self.time / self.swings

    @property
    def name(self) -> str:
        """For people."""
        return self.motion or "motion not stated"


@dataclass(frozen=True, eq=False)
class Campaign:
    """A set of windows of one robot, or of periods."""

    name: str
    robot: Robot
    sample_rate: float
    """Hz"""
    windows: tuple[Window, ...]
    alignment: Alignment | None = None
    """by which lengths and currents of the windows were brought to the markers' instants; None: as recorded"""
    periods: tuple[Period, ...] = ()
    """timed by hand or light gate, in place of windows"""

    def of_role(self, role: Role) -> tuple[Window, ...]:
        """The windows of one role, in file order."""
        return tuple(w for w in self.windows if w.role is role)


@dataclass(frozen=True, eq=False)
class PlannedWindow:
    """One equilibrium to be visited, and the displacement from which the platform is let go there."""

    id: str
    role: Role
    lengths: np.ndarray
    """(n,) cable lengths to hold, m"""
    displacement: np.ndarray
    """wanted displacement of the main marker's x, y from rest, m"""
    position: np.ndarray
    """(3,) where the main marker should come to rest, by the nominal model, m"""
    pose: Pose | None = None
    """that the platform is known to have there, for homing; None: its lengths are known"""


@dataclass(frozen=True)
class Accuracy:
    """How well the body is to be known: largest standard deviations, per unit mass, about P."""

    FEWEST: ClassVar[int] = 4
    """identify windows from which it is told: fewer give no spread between windows to hold the stated sd against"""

    s: float
    """m, of each coordinate of the centre of mass"""
    inertia: float
    """m², of each moment and product of inertia"""

    @property
    def says(self) -> str:
        """For people."""
        return f"s within {self.s:g} m and I within {self.inertia:g} m²"


@dataclass(frozen=True, eq=False)
class Plan:
    """The windows of one experiment, in the order in which they are visited."""

    name: str
    windows: tuple[PlannedWindow, ...]
    accuracy: Accuracy | None = None
    """once it is reached, no further window is recorded to identify from"""
