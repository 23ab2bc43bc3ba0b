"""The drivers on a simulated laboratory inside this process: dry runs, campaigns without a bus, fault rehearsals."""

import contextlib
import math
import time
from collections.abc import AsyncGenerator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from functools import partial

import can
import numpy as np

from drivers.canbus.python_can import PythonCanTransport
from drivers.canbus.transport import CanTransport
from drivers.cia402.dictionary import WinchConfig
from drivers.cia402.motion import Cia402Winch, pull_taut
from drivers.cia402.watch import CanopenMaster
from drivers.clock import LoopClock
from drivers.mocap.decoders import MarkerObjects, ViconUdpDecoder
from drivers.mocap.feeds import ByteFeed, UdpFeed
from drivers.mocap.source import StreamMarkerSource
from drivers.ports import Operator, Rig
from fidim_lab.app.compose.loop import running
from fidim_lab.data.records import Body, Campaign, Plan, Robot
from fidim_lab.data.rigs.rig_winch_tables import TemperatureObject
from fidim_lab.errors import InfeasibleError
from sim_backends.drive.node import SimulatedDrive
from sim_backends.in_process_bus import InProcessBus
from sim_backends.laboratory import Laboratory
from sim_backends.mocap.encoders import ViconEncoder
from sim_backends.mocap.faults import Faults
from sim_backends.mocap.server import ServerFeed
from sim_backends.mocap.sockets import UdpSender
from sim_backends.plant.hidden import KNOWN, parse_effect
from sim_backends.plant.sensors import Noise
from sim_backends.plant.world import World, make_world
from sim_backends.served_bus import ServedBus
from sim_backends.simulate import simulate_campaign, truth_of

SYNC_RATE = 100.0
"""Hz in a dry run: as many currents as marker frames (a real rig's default is 250)"""
MARKER_RATE = 100.0
"""Hz"""
REACH = 0.3
"""m of cable beyond the plan's shortest and longest that a simulated winch may wind or pay out"""
GRAIN = 0.005
"""s by which a simulated motor current may be old in real time"""
SHORTEST = 0.05
"""m"""


@dataclass(frozen=True, eq=False)
class SimulatedRig:
    """A rig in a simulated laboratory, with what a rehearsal may reach behind the ports."""

    rig: Rig
    transport: CanTransport
    laboratory: Laboratory
    drives: tuple[SimulatedDrive, ...]


def simulated_world(robot: Robot, seed: int, hide: tuple[str, ...]) -> World:
    """A true robot near the robot file's, with hidden effects. Raises SetupError for an effect it does not know."""
    effects = tuple(parse_effect(text, robot.n) for text in hide)
    return make_world(robot, np.random.default_rng([seed, 0]), effects)


def hidden_keys() -> dict[str, dict[str, str]]:
    """Each effect that a simulated world can hide → its keys, each with what it is, its unit and default."""
    cable = {"cable": "number of the cable"}
    return {
        name: {
            **(cable if kind.one_cable or kind.any_cable else {}),
            **{key: f"{one.says}, {one.unit} (default {one.default:g})" for key, one in kind.keys.items()},
        }
        for name, kind in KNOWN.items()
    }


def world_truth(world: World, name: str, seed: int) -> dict[str, object]:
    """What is true in a simulated world, for truth.json."""
    return truth_of(world, name, seed)


def simulated_campaign(robot: Robot, plan: Plan, body: Body, seed: int, *, noisy: bool = True) -> Campaign:
    """A campaign of a known true body, without bus, cameras or procedure; nothing is hidden.

    Sensors as the robot file states them, ideal ones where not `noisy`. Raises InfeasibleError, naming the window,
    where the platform cannot rest or be displaced as planned, or a cable goes slack in motion.
    """
    world = make_world(robot, np.random.default_rng([seed, 0]), body=body)
    noise = None if noisy else Noise(marker=0.0, encoder=0.0, current=0.0)
    rng = np.random.default_rng([seed, 1])
    campaign, truth = simulate_campaign(robot, plan, replace(world, mass=robot.mass), rng, noise)
    slack = truth["slack"]
    if isinstance(slack, dict) and slack:
        raise InfeasibleError(f"A cable goes slack in {', '.join(slack)}.", hint="Displace the platform less.")
    return campaign


@asynccontextmanager
async def simulated_rig(
    robot: Robot,
    plan: Plan,
    world: World,
    seed: int,
    *,
    real_time: bool = False,
    operator: Operator | None = None,
    faults: Faults | None = None,
    acceleration: float = 1.0,
    start: Sequence[float] | None = None,
    part: int = 0,
) -> AsyncGenerator[SimulatedRig]:
    """The drivers on simulated devices, running, until the context ends.

    In process on the running loop's clock; with `real_time` over a python-can bus and a UDP socket. The robot rests at
    the plan's first lengths, or at `start` (m). acceleration: m/s² that a winch may do at most. part: of a run that
    goes on, whose noise is new. Raises SetupError or InfeasibleError where such a laboratory cannot be.
    """
    clock = LoopClock()
    now: Callable[[], float] = time.monotonic if real_time else clock.now
    begin = plan.windows[0].lengths if start is None else np.array(start)
    grain = GRAIN if real_time else 0.0
    random = np.random.default_rng([seed, 1, part] if part else [seed, 1])
    laboratory = Laboratory(robot, world, begin, random, now, grain=grain)
    configs = _winch_configs(robot, plan, laboratory, acceleration)
    drives = laboratory.drives(configs[0].eds)
    names = tuple(f"marker{k}" for k in range(1, len(robot.markers) + 1))
    server = laboratory.mocap_server(ViconEncoder(names), MARKER_RATE, faults)
    async with contextlib.AsyncExitStack() as stack:
        feed: ByteFeed
        if real_time:
            transport = _served(stack, drives)
            feed = UdpFeed(clock, 0, "127.0.0.1")
        else:
            bus = transport = InProcessBus(clock.now)
            for drive in drives:
                bus.attach(drive)
            feed = ServerFeed(server, clock)
        stack.callback(transport.close)
        master = CanopenMaster(transport, clock, sync_rate=SYNC_RATE)
        winches = tuple(Cia402Winch(config, master) for config in configs)
        markers = StreamMarkerSource(feed, ViconUdpDecoder(MarkerObjects(names)), clock, rate=MARKER_RATE)
        await running(stack, master.run())
        for winch in winches:
            await running(stack, winch.watch_health())
        if isinstance(transport, InProcessBus):
            await running(stack, _live(transport, clock))
        await markers.start()
        stack.push_async_callback(markers.close)
        if isinstance(feed, UdpFeed):
            sender = UdpSender(server, clock, feed.port)
            await sender.start()
            stack.push_async_callback(sender.close)
        pulls = tuple(partial(pull_taut, winch) for winch in winches)
        rig = Rig(clock, winches, markers, operator or laboratory.hand(clock), bus=master, pulls=pulls)
        yield SimulatedRig(rig, transport, laboratory, drives)


def length_limits(plan: Plan) -> tuple[tuple[float, float], ...]:
    """Shortest and longest cable (m) that each simulated winch may have, as a rig file would say it."""
    lengths = np.array([window.lengths for window in plan.windows])
    shortest = np.maximum(SHORTEST, lengths.min(axis=0) - REACH)
    return tuple(zip(shortest.tolist(), (lengths.max(axis=0) + REACH).tolist(), strict=True))


def _winch_configs(robot: Robot, plan: Plan, laboratory: Laboratory, acceleration: float) -> tuple[WinchConfig, ...]:
    """What a rig file would say of the simulated winches."""
    winches = robot.winches or ()
    return tuple(
        WinchConfig(
            name=f"winch {cable + 1}",
            node_id=cable + 1,
            counts_per_turn=2.0 * math.pi * winch.drum_radius / drum.metres_per_count,
            drum_radius=winch.drum_radius,
            rated_current=RATED_CURRENT,
            current_limit=1.5 * robot.limits.tension[1] / winch.newton_per_ampere,
            max_speed=0.5,
            max_acceleration=acceleration,
            length_limits=reach,
            direction=1 if drum.direction > 0 else -1,
            home_length=drum.home_length,
            temperature=TEMPERATURE,
        )
        for cable, (winch, drum, reach) in enumerate(zip(winches, laboratory.drums, length_limits(plan), strict=True))
    )


TEMPERATURE = TemperatureObject(index=0x2210, scale=0.1)
"""of the generic EDS"""
RATED_CURRENT = 5.0
"""A, object 6075 of the generic EDS"""


def _served(stack: contextlib.AsyncExitStack, drives: tuple[SimulatedDrive, ...]) -> CanTransport:
    """The drives on a python-can bus of this process, served by a thread in real time."""
    channel = f"fidim-{id(drives):x}"
    stack.enter_context(ServedBus(can.Bus(interface="virtual", channel=channel), drives))
    return PythonCanTransport("virtual", channel)


async def _live(bus: InProcessBus, clock: LoopClock) -> None:
    """Let the nodes of an in-process bus live: heartbeats, moves, late answers."""
    while True:
        bus.advance(clock.now())
        await clock.sleep(min(max(bus.due - clock.now(), 1e-4), 0.05))
