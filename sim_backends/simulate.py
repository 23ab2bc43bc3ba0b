"""A campaign without bus, cameras and procedure: what `fidim simulate` writes. The quick way to known truth."""

from dataclasses import dataclass

import numpy as np

from fidim_lab.data.records import Campaign, Plan, PlannedWindow, Pose, Robot, Window
from fidim_lab.errors import InfeasibleError
from sim_backends.plant.motion import SlackInterval
from sim_backends.plant.plant import Plant
from sim_backends.plant.sensors import Cameras, CurrentSensors, Encoders, Noise, sensor_streams
from sim_backends.plant.world import World

BETWEEN = 60.0
"""s of plant time from one window to the next: periodic effects meet each window with another phase"""


@dataclass(frozen=True)
class Recording:
    """How long and how often a window is sampled."""

    duration: float = 10.0
    """s"""
    rate: float = 100.0
    """Hz"""

    @property
    def stamps(self) -> np.ndarray:
        """(N,) s from the release, both ends included."""
        return np.arange(round(self.duration * self.rate) + 1) / self.rate


def simulate_campaign(
    robot: Robot,
    plan: Plan,
    world: World,
    rng: np.random.Generator,
    noise: Noise | None = None,
    recording: Recording | None = None,
) -> tuple[Campaign, dict[str, object]]:
    """Record every planned window of a true world: rest, displaced release, free motion, as the sensors see it.

    Args:
        robot: what the robot file says; goes into the campaign unchanged.
        plan: the windows. Its lengths are the encoders'; the drums stop within one count of them.
        world: what is true, from `plant.world.make_world`.
        rng: noise, small errors of the winches. The same seed gives the same campaign.
        noise: of the sensors; default: what the robot file states.
        recording: default 10 s at 100 Hz.

    Returns:
        the campaign, and the truth (of `truth_of`, with the slack intervals of each window under "slack").

    Raises:
        InfeasibleError: a window has no rest, or cannot be displaced so, with all cables taut; names the window.
    """
    noise, recording = noise or Noise.of(robot), recording or Recording()
    plant = Plant(world)
    windows: list[Window] = []
    slack: dict[str, object] = {}
    for k, (planned, stream) in enumerate(zip(plan.windows, rng.spawn(len(plan.windows)), strict=True)):
        session = _Session(plant, robot, noise, recording, stream)
        try:
            window, loose = session.record(planned, number=k + 1, start=k * BETWEEN)
        except InfeasibleError as error:
            raise InfeasibleError(f"Window {planned.id}: {error.message}", hint=error.hint) from error
        windows.append(window)
        if loose:
            slack[planned.id] = [{"cable": i.cable, "start": i.start, "stop": i.stop} for i in loose]
    campaign = Campaign(name=plan.name, robot=robot, sample_rate=recording.rate, windows=tuple(windows))
    return campaign, truth_of(world, plan.name) | {"slack": slack}


def truth_of(world: World, name: str, seed: int | None = None) -> dict[str, object]:
    """What is true in a world, for a JSON file: hidden effects with their sizes, s (m), I (m², about P), mass (kg)."""
    case: dict[str, object] = {
        "title": ", ".join(effect.id for effect in world.hidden) or "nothing left out",
        "label": [effect.id for effect in world.hidden],
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
        self, plant: Plant, robot: Robot, noise: Noise, recording: Recording, rng: np.random.Generator
    ) -> None:
        streams = sensor_streams(rng)
        self._plant, self._noise, self._recording = plant, noise, recording
        self._rng = streams.encoders
        self._cameras = Cameras(plant.world, noise.marker, streams.cameras)
        self._encoders = Encoders(noise.encoder)
        winches = robot.winches
        self._currents = None if winches is None else CurrentSensors(winches, noise.current, streams.currents)

    def record(self, planned: PlannedWindow, *, number: int, start: float) -> tuple[Window, tuple[SlackInterval, ...]]:
        """Rest, displaced release at plant time `start`, and the samples."""
        plant = self._plant
        held = planned.lengths + self._rng.uniform(-1.0, 1.0, planned.lengths.shape) * self._noise.encoder
        near = Pose(position=planned.position - plant.world.markers[0], rotation=np.eye(3))
        plant.place(plant.rest(held, near), held, start)
        rest = plant.rest(held, near)
        aside = plant.rest(held, near, displacement=planned.displacement)
        equilibrium = self._cameras.place(rest.marker) + self._rng.normal(0.0, 0.1 * self._noise.marker, 3)
        plant.place(aside, held, start)
        plant.begin_window(number)
        markers, lengths, currents = self._samples(start)
        window = Window(
            id=planned.id,
            role=planned.role,
            t=self._recording.stamps,
            markers=markers,
            lengths=lengths,
            currents=currents,
            equilibrium=equilibrium,
        )
        return window, plant.slack

    def _samples(self, start: float) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Markers at the cameras' times, lengths and currents at the host's, in the order in which they happen."""
        plant, stamps = self._plant, self._recording.stamps
        exposures = np.maximum([self._cameras.exposure(stamp) for stamp in stamps], 0.0)
        markers, lengths, currents = [], [], []
        for t in np.union1d(stamps, exposures):
            plant.advance(start + t)
            while len(markers) < len(stamps) and exposures[len(markers)] <= t:
                markers.append(self._cameras.see(stamps[len(markers)], plant.markers()))
            if len(lengths) < len(stamps) and stamps[len(lengths)] <= t:
                lengths.append(self._encoders.read(plant.encoder_lengths()))
                if self._currents is not None:
                    currents.append(self._currents.read(plant.tensions))
        return np.array(markers), np.array(lengths), np.array(currents) if currents else None
