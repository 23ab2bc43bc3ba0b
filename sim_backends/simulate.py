"""A campaign without bus, cameras and procedure: what `fidim simulate` writes. The quick way to known truth."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from fidim_lab.arrays import PerCable, Vector3
from fidim_lab.data.records import Campaign, Plan, PlannedWindow, Pose, Robot, Window
from fidim_lab.errors import InfeasibleError
from sim_backends.plant.mechanics import Rest
from sim_backends.plant.motion import SlackInterval
from sim_backends.plant.own_sensors import OwnNoise, OwnPoseSensors
from sim_backends.plant.plant import Plant
from sim_backends.plant.sensors import Cameras, CurrentSensors, Encoders, Noise, sensor_streams
from sim_backends.plant.world import World

BETWEEN = 60.0
"""s of plant time from one window to the next: periodic effects meet each window with another phase"""
MILD = 0.7
"""of a displacement, where the free motion left the tensions' limits: the true body is not the one of the plan"""


@dataclass(frozen=True)
class Sampling:
    """How long and how often a window is sampled."""

    duration: float = 10.0
    """s"""
    rate: float = 100.0
    """Hz"""
    own_sensors: OwnNoise | None = None
    """swivel encoders and an inclinometer beside the rest; None: there are none"""

    @property
    def stamps(self) -> np.ndarray:
        """(N,) s from the release, both ends included."""
        return np.arange(round(self.duration * self.rate) + 1) / self.rate


@dataclass(frozen=True, eq=False)
class RecordedWindow:
    """One window as it was recorded, and what its sensors do not say."""

    window: Window
    tension: tuple[float, float]
    """smallest and largest true tension of any cable at the samples, N"""
    slack: tuple[SlackInterval, ...]


class SimulatedPlatform(Protocol):
    """What windows are recorded from: `Plant`, or another engine's world with the same verbs (documented there)."""

    @property
    def world(self) -> World:
        """What is true."""
        ...

    @property
    def tensions(self) -> PerCable:
        """Now, N."""
        ...

    @property
    def slack(self) -> tuple[SlackInterval, ...]:
        """Since the platform was placed."""
        ...

    @property
    def pose(self) -> Pose:
        """True pose of P now."""
        ...

    def rest(self, lengths: PerCable, near: Pose | None = None, displacement: np.ndarray | None = None) -> Rest:
        """Where it rests with these encoder lengths, or is held aside."""
        ...

    def place(self, rest: Rest, lengths: PerCable, t: float = 0.0) -> None:
        """Begin at rest there at time t."""
        ...

    def begin_window(self, number: int | None = None) -> None:
        """Say that a window begins now."""
        ...

    def advance(self, t: float) -> None:
        """Let time pass until t."""
        ...

    def markers(self) -> np.ndarray:
        """True positions (M, 3), m."""
        ...

    def encoder_lengths(self) -> PerCable:
        """As ideal encoders see them, m."""
        ...


def simulate_campaign(
    robot: Robot,
    plan: Plan,
    world: World,
    rng: np.random.Generator,
    noise: Noise | None = None,
    recording: Sampling | None = None,
    *,
    platform: SimulatedPlatform | None = None,
    watch: Callable[[RecordedWindow], None] | None = None,
) -> tuple[Campaign, dict[str, object]]:
    """Record every planned window of a true world: rest, displaced release, free motion, as the sensors see it.

    Args:
        robot: what the robot file says; goes into the campaign unchanged.
        plan: the windows. Its lengths are the encoders'; the drums stop within one count of them.
        world: what is true, from `plant.world.make_world`.
        rng: noise, small errors of the winches. The same seed gives the same campaign.
        noise: of the sensors; default: what the robot file states.
        recording: default 10 s at 100 Hz.
        platform: what moves, made from the same world; default `Plant(world)`.
        watch: called after each window.

    Returns:
        the campaign, and the truth (of `truth_of`, with the slack intervals of each window under "slack").

    Raises:
        InfeasibleError: a window has no rest, or cannot be displaced so, with all cables taut; names the window.
    """
    noise, recording = noise or Noise.of(robot), recording or Sampling()
    plant = platform or Plant(world)
    windows: list[Window] = []
    slack: dict[str, object] = {}
    for k, (planned, stream) in enumerate(zip(plan.windows, rng.spawn(len(plan.windows)), strict=True)):
        session = _Session(plant, robot, noise, recording, stream, k * BETWEEN)
        try:
            recorded = session.record(planned, number=k + 1)
        except InfeasibleError as error:
            raise InfeasibleError(f"Window {planned.id}: {error.message}", hint=error.hint) from error
        windows.append(recorded.window)
        if recorded.slack:
            slack[planned.id] = [{"cable": i.cable, "start": i.start, "stop": i.stop} for i in recorded.slack]
        if watch is not None:
            watch(recorded)
    campaign = Campaign(name=plan.name, robot=robot, sample_rate=recording.rate, windows=tuple(windows))
    return campaign, truth_of(world, plan.name) | {"slack": slack}


def can_rest(platform: SimulatedPlatform) -> Callable[[Vector3, PerCable, np.ndarray], bool]:
    """Trying places out in the simulated world, as one does in a laboratory: its body is not the nominal one.

    Takes the main marker's place (m), the lengths (m) and a displacement (m); for `random_plan`.
    """

    def works(place: Vector3, lengths: PerCable, displacement: np.ndarray) -> bool:
        near = Pose(place - platform.world.markers[0], np.eye(3))
        try:
            platform.rest(lengths, near)
            platform.rest(lengths, near, displacement)
        except InfeasibleError:
            return False
        return True

    return works


def displaced_less(plan: Plan, ids: Collection[str]) -> Plan:
    """The plan with smaller displacements in some windows, as an operator would do it."""
    windows = (replace(w, displacement=MILD * w.displacement) if w.id in ids else w for w in plan.windows)
    return replace(plan, windows=tuple(windows))


def truth_of(world: World, name: str, seed: int | None = None) -> dict[str, object]:
    """What is true in a world, for a JSON file: hidden effects with their sizes, s (m), I (m², about P), mass (kg)."""
    case: dict[str, object] = {
        "title": ", ".join(effect.id for effect in world.hidden) or "nothing left out",
        "label": [effect.label for effect in world.hidden],
        "par": {effect.id: dict(effect.parameters) for effect in world.hidden},
    }
    cables = [effect.cable for effect in world.hidden if effect.cable is not None]
    if cables:
        case["cable"] = cables[0]
    return {
        "name": name,
        "seed": seed,
        "case": case,
        "s": world.body.com.tolist(),
        "I": world.body.inertia.tolist(),
        "m": world.mass,
    }


class _Session:
    """One window: sensors with their own streams, and the plant they look at."""

    def __init__(
        self,
        plant: SimulatedPlatform,
        robot: Robot,
        noise: Noise,
        recording: Sampling,
        rng: np.random.Generator,
        start: float,
    ) -> None:
        """start: s of the session."""
        streams = sensor_streams(rng)
        self._plant, self._noise, self._recording, self._start = plant, noise, recording, start
        self._rng = streams.encoders
        self._cameras = Cameras(plant.world, noise.marker, streams.cameras, start)
        self._encoders = Encoders(noise.encoder)
        winches = robot.winches
        self._currents = None if winches is None else CurrentSensors(winches, noise.current, streams.currents)
        own = recording.own_sensors
        self._own = None if own is None else OwnPoseSensors(plant.world, own, rng.spawn(1)[0])

    def record(self, planned: PlannedWindow, *, number: int) -> RecordedWindow:
        """Rest, displaced release at the start, and the samples."""
        plant, start = self._plant, self._start
        held = planned.lengths + self._rng.uniform(-1.0, 1.0, planned.lengths.shape) * self._noise.encoder
        near = Pose(position=planned.position - plant.world.markers[0], rotation=np.eye(3))
        plant.place(plant.rest(held, near), held, start)
        rest = plant.rest(held, near)
        aside = plant.rest(held, near, displacement=planned.displacement)
        equilibrium = self._cameras.place(rest.marker) + self._rng.normal(0.0, 0.1 * self._noise.marker, 3)
        plant.place(aside, held, start)
        plant.begin_window(number)
        markers, lengths, tensions, own = self._samples(start)
        currents = None if self._currents is None else np.array([self._currents.read(row) for row in tensions])
        window = Window(
            id=planned.id,
            role=planned.role,
            t=self._recording.stamps,
            markers=markers,
            lengths=lengths,
            currents=currents,
            equilibrium=equilibrium,
            further={} if self._own is None else dict(zip(self._own.names, own.T, strict=True)),
        )
        return RecordedWindow(window, (float(tensions.min()), float(tensions.max())), plant.slack)

    def _samples(self, start: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Markers at the cameras' times; lengths, true tensions and own sensors at the host's; as they happen."""
        plant, stamps = self._plant, self._recording.stamps
        exposures = np.maximum([self._cameras.exposure(stamp) for stamp in stamps], 0.0)
        markers, lengths, tensions, own = [], [], [], []
        for t in np.union1d(stamps, exposures):
            plant.advance(start + t)
            while len(markers) < len(stamps) and exposures[len(markers)] <= t:
                markers.append(self._cameras.see(stamps[len(markers)], plant.markers()))
            if len(lengths) < len(stamps) and stamps[len(lengths)] <= t:
                lengths.append(self._encoders.read(plant.encoder_lengths()))
                tensions.append(plant.tensions)
                if self._own is not None:
                    own.append(self._own.read(plant.pose))
        return np.array(markers), np.array(lengths), np.array(tensions), np.array(own)
