"""The drivers on the hardware that a rig file names: python-can, sockets, real time.

What they meet there (drives in a hall, or `fidim simulators` in another process) they cannot tell.
"""

import contextlib
from collections.abc import AsyncGenerator, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from drivers.canbus.python_can import PythonCanTransport
from drivers.cia402.bring_up import refuse_other_master
from drivers.cia402.dictionary import WinchConfig
from drivers.cia402.motion import Cia402Winch, WinchTrials, make_winch, pull_taut
from drivers.cia402.watch import CanopenMaster
from drivers.clock import LoopClock
from drivers.mocap.source import StreamMarkerSource
from drivers.ports import Clock, Operator, Rig
from drivers.remote_operator import RemoteOperator
from fidim_lab.app.compose.homes import HomeKeeper
from fidim_lab.app.compose.loop import running
from fidim_lab.app.compose.motion_capture import SerialDevices, marker_source, run_serial_devices, serial_devices
from fidim_lab.app.compose.winches import winch_configs
from fidim_lab.data.rigs.rig import RigFile
from fidim_lab.data.rigs.rig_guard_tables import GuardsTable
from fidim_lab.data.rigs.rig_serial import Loading, ReleaseEntry
from fidim_lab.errors import SetupError
from procedures.settings import (
    LONGEST_TOGETHER,
    GuardSettings,
    Reaction,
    ReleaseSettings,
    Settings,
    TensionBand,
    TensionSettings,
)

SHORTEST_LISTEN, LONGEST_LISTEN = 0.1, 1.0
"""s of listening for another master, at any heartbeat"""


@dataclass(frozen=True, eq=False)
class RealRig:
    """A rig on real buses and sockets, with the drivers behind its ports for logs, counters and checks."""

    rig: Rig
    transport: PythonCanTransport
    master: CanopenMaster
    winches: tuple[Cia402Winch, ...]
    markers: StreamMarkerSource
    serial: SerialDevices


@asynccontextmanager
async def real_rig(
    file: RigFile,
    operator: Operator | None = None,
    *,
    winches: Sequence[WinchConfig] | None = None,
    takes_over: bool = False,
    tried_by: str = "",
) -> AsyncGenerator[RealRig]:
    """Open bus and motion capture, and keep the control loop running until the context ends; nothing moves by itself.

    operator: whoever answers prompts; may be left out where the rig file has a simulated hand. winches: as
    `winch_configs` has them, so that their EDS files are not read again. takes_over: drives that an earlier host has
    left holding the load are not refused. tried_by: the person in whose presence the stops are tried, so that what is
    to be proven is not asked for yet.
    To be run on a loop that waits (`run_loop(..., real_time=True)`).
    Raises SetupError where a socket cannot be opened, the bus would be too full or nobody answers prompts; BusError
    where the bus cannot be reached or another master is heard; DeviceError where a motion-capture server does not
    answer.
    """
    clock = LoopClock()
    async with contextlib.AsyncExitStack() as stack:
        transport = open_bus(file)
        stack.callback(transport.close)
        master = make_master(file, transport, clock)
        configs = winch_configs(file, on_trial=bool(tried_by)) if winches is None else winches
        made = tuple(make_winch(config, master, takes_over=takes_over) for config in configs)
        trials = tuple(WinchTrials(winch, tried_by) for winch in made) if tried_by else ()
        markers = marker_source(file, clock)
        serial = serial_devices(file, clock)
        answering = operator or await _hand(file, stack)
        nodes = [entry.node_id for entry in file.winches]
        await refuse_other_master(transport, clock, file.bus.host_id, listening_time(file), nodes)
        await running(stack, master.run())
        if file.keeps_homes:
            await running(stack, HomeKeeper(file, made, clock).run())
        for winch in made:
            await running(stack, winch.watch_health())
        stack.push_async_callback(markers.close)
        await markers.start()
        await run_serial_devices(stack, serial)
        pulls = tuple(partial(pull_taut, winch) for winch in made)
        rig = Rig(clock, made, markers, answering, serial.release, serial.gauges, master, trials, pulls)
        yield RealRig(rig, transport, master, made, markers, serial)


def open_bus(file: RigFile) -> PythonCanTransport:
    """The rig's CAN bus. Raises SetupError where what the file says of it is wrong, BusError where it is not there."""
    bus = file.bus
    options: dict[str, Any] = {"send_patience": 1.0 / bus.sync_rate, **bus.options}
    return PythonCanTransport(bus.interface, bus.channel, bitrate=bus.bitrate, **options)


def listening_time(file: RigFile) -> float:
    """s in which another master of this bus would be heard."""
    return min(max(2.0 * file.bus.heartbeat, 5.0 / file.bus.sync_rate, SHORTEST_LISTEN), LONGEST_LISTEN)


def make_master(file: RigFile, transport: PythonCanTransport, clock: Clock) -> CanopenMaster:
    """The CANopen master of the rig; it says nothing before `run`. Raises SetupError."""
    bus = file.bus
    return CanopenMaster(
        transport,
        clock,
        sync_rate=bus.sync_rate,
        heartbeat_period=bus.heartbeat,
        host_id=bus.host_id,
        bitrate=bus.bitrate,
    )


async def _hand(file: RigFile, stack: contextlib.AsyncExitStack) -> Operator:
    if file.hand is None:
        raise SetupError(f"{file.path}: nobody answers prompts.", hint="Give an operator, or [simulated_hand].")
    hand = RemoteOperator(file.hand.host, file.hand.port)
    await hand.open()
    stack.push_async_callback(hand.close)
    return hand


def rig_settings(file: RigFile, base: Settings | None = None, winches: Sequence[WinchConfig] | None = None) -> Settings:
    """What a procedure is told of this rig: length limits, speeds that its winches can do, friction band, guards."""
    base, configs = base or Settings(), winch_configs(file) if winches is None else winches
    speed, acceleration = _highest(configs)
    motion = replace(
        base.motion,
        speed=min(base.motion.speed, speed),
        acceleration=min(base.motion.acceleration, acceleration),
        length_limits=tuple(config.length_limits for config in configs),
        highest_speed=speed,
        highest_acceleration=acceleration,
        together=max(base.motion.together, min(file.guards.stale_winch.age, LONGEST_TOGETHER)),
    )
    excite = replace(
        base.excite,
        speed=min(base.excite.speed, speed),
        acceleration=min(base.excite.acceleration, acceleration),
    )
    align = replace(
        base.align, speed=min(base.align.speed, speed), acceleration=min(base.align.acceleration, acceleration)
    )
    tension = replace(base.tension, tolerance=_tolerance(file, base.tension), bands=_bands(file))
    window = min(winch.following_error for winch in file.winches)
    return replace(
        base,
        motion=motion,
        excite=excite,
        align=align,
        commission=replace(
            base.commission,
            speed=min(base.commission.speed, speed),
            acceleration=min(base.commission.acceleration, acceleration),
        ),
        taut=replace(base.taut, speed=min(base.taut.speed, speed)),
        tension=tension,
        place=replace(base.place, off=file.place.off, change=file.place.change, part=file.place.part),
        guard=_guard_settings(file.guards, base.guard, window),
        release=None if file.release is None else _release_settings(file.release, base),
    )


def require_what_winches_do(file: RigFile, settings: Settings, winches: Sequence[WinchConfig] | None = None) -> None:
    """Raise SetupError for what a drive would refuse or not wait for: now, not in the middle of a run.

    Speeds, accelerations, and the guard of the following error.
    """
    speed, acceleration = _highest(winch_configs(file) if winches is None else winches)
    for table, one in (("motion", settings.motion), ("excite", settings.excite), ("align", settings.align)):
        for name, value, most, unit in (
            ("speed", one.speed, speed, "m/s"),
            ("acceleration", one.acceleration, acceleration, "m/s²"),
        ):
            if not 0 < value <= most:
                raise SetupError(
                    f"{table}.{name} is {value:g} {unit}; {file.path} allows its winches up to {most:g} {unit}.",
                    hint="Set less (above 0), or allow the drives more in the rig file if they can do it.",
                )
    window = min(winch.following_error for winch in file.winches)
    if settings.guard.following_error > window:
        raise SetupError(
            f"guard.following_error is {settings.guard.following_error:g} m; by {file.path} a drive gives up at "
            f"{window:g} m by itself, before this guard would see it.",
            hint="Set less, or widen following_error of the winches in the rig file.",
        )


def _highest(configs: Sequence[WinchConfig]) -> tuple[float, float]:
    """Speed (m/s) and acceleration (m/s²) that all winches may do."""
    return min(config.max_speed for config in configs), min(config.max_acceleration for config in configs)


def _release_settings(entry: ReleaseEntry, base: Settings) -> ReleaseSettings:
    return replace(base.release or ReleaseSettings(), by_hand=entry.loading is Loading.BY_HAND)


def _bands(file: RigFile) -> tuple[TensionBand, ...] | None:
    """How well each winch's current tells its tension, where every one is calibrated."""
    bands = [
        TensionBand(entry.friction, entry.load_friction, entry.scatter)
        for entry in (winch.tension for winch in file.winches)
        if entry.friction is not None
    ]
    return tuple(bands) if len(bands) == len(file.winches) else None


def _tolerance(file: RigFile, tension: TensionSettings) -> float:
    """The measured friction band as a part of the lower limit, where every winch has one."""
    bands = [winch.tension.friction for winch in file.winches]
    known = [band for band in bands if band is not None]
    return max(known) / file.robot.limits.tension[0] if len(known) == len(bands) else tension.tolerance


def _guard_settings(guards: GuardsTable, base: GuardSettings, window: float) -> GuardSettings:
    """window: the drives' own for the following error, m."""
    return replace(
        base,
        sample_age=guards.stale_winch.age,
        slack=guards.tension.slack,
        overload=guards.tension.overload,
        hysteresis=guards.tension.hysteresis,
        tension_for=guards.tension.lasting,
        slack_handled=guards.tension.handled,
        marker_for=guards.marker.lasting,
        motion=guards.motion.allowed,
        motion_late=guards.motion.late,
        motion_speed=guards.motion.speed,
        motion_speed_for=guards.motion.lasting,
        geometry=guards.geometry.allowed,
        slip=guards.slip.allowed,
        following_error=guards.following_error.part * window,
        following_error_for=guards.following_error.lasting,
        temperature=guards.temperature.limit,
        temperature_hysteresis=guards.temperature.hysteresis,
        temperature_age=guards.temperature.age,
        bus_lost=guards.bus_errors.lost,
        loop_late=guards.host_loop.late,
        disk_spare=guards.disk.spare,
        reactions={name.replace("_", " "): Reaction(guard.reaction.replace("-", " ")) for name, guard in guards},
    )
