"""The drivers on the hardware that a rig file names: python-can, sockets, real time.

What they meet there (drives in a hall, or `fidim simulators` in another process) they cannot tell.
"""

import contextlib
import math
from collections.abc import AsyncGenerator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from drivers.canbus.python_can import PythonCanTransport
from drivers.cia402.config import GENERIC_EDS, Load, StopReactions, StoredZero, TemperatureObject, WinchConfig
from drivers.cia402.cyclic import make_winch
from drivers.cia402.family import DriveFamily, family_path, read_family
from drivers.cia402.fitted import fitted
from drivers.cia402.master import CanopenMaster
from drivers.cia402.signals import Signal
from drivers.cia402.takeover import refuse_other_master
from drivers.cia402.trials import WinchTrials
from drivers.cia402.winch import Cia402Winch
from drivers.cia402.words import Mode
from drivers.clock import LoopClock
from drivers.mocap.source import StreamMarkerSource
from drivers.ports import Clock, Operator, Rig
from drivers.remote_operator import RemoteOperator
from fidim_lab.app.compose.homes import HomeKeeper
from fidim_lab.app.compose.loop import running
from fidim_lab.app.compose.motion_capture import marker_source
from fidim_lab.app.compose.proofs import held_proofs
from fidim_lab.app.compose.serial_devices import SerialDevices, run_serial_devices, serial_devices
from fidim_lab.data.rigs.rig import GuardEntry, GuardReaction, RigFile, WinchEntry
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

REACTIONS = {
    GuardReaction.HOLD: Reaction.HOLD,
    GuardReaction.QUICK_STOP: Reaction.QUICK_STOP,
    GuardReaction.REJECT_WINDOW: Reaction.REJECT_WINDOW,
    GuardReaction.WARN: Reaction.WARN,
}
SHORTEST_LISTEN, LONGEST_LISTEN = 0.1, 1.0
"""s of listening for another master, at any heartbeat"""
MODES = {"profile-position": Mode.PROFILE_POSITION, "cyclic-position": Mode.CYCLIC_POSITION}
STEP_TIMEOUT = 2.0
"""s for one step of a drive's machine, besides its brake"""


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
    takes_over: bool = False,
    homing: bool = False,
    tried_by: str = "",
) -> AsyncGenerator[RealRig]:
    """Open bus and motion capture, and keep the control loop running until the context ends; nothing moves by itself.

    operator: whoever answers prompts; may be left out where the rig file has a simulated hand. takes_over: drives that
    an earlier host has left holding the load are not refused. homing: stored zeros are made anew, none is checked.
    tried_by: the person in whose presence the stops are tried, so that what is to be proven is not asked for yet.
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
        configs = winch_configs(file, homing=homing, on_trial=bool(tried_by))
        winches = tuple(make_winch(config, master, takes_over=takes_over) for config in configs)
        trials = tuple(WinchTrials(winch, tried_by) for winch in winches) if tried_by else ()
        markers = marker_source(file, clock)
        serial = serial_devices(file, clock)
        answering = operator or await _hand(file, stack)
        nodes = [entry.node_id for entry in file.winches]
        await refuse_other_master(transport, clock, file.bus.host_id, listening_time(file), nodes)
        await running(stack, master.run())
        if file.keeps_homes:
            await running(stack, HomeKeeper(file, winches, clock).run())
        for winch in winches:
            await running(stack, winch.watch_health())
        stack.push_async_callback(markers.close)
        await markers.start()
        await run_serial_devices(stack, serial)
        rig = Rig(clock, winches, markers, answering, serial.release, serial.gauges, master, trials)
        yield RealRig(rig, transport, master, winches, markers, serial)


def open_bus(file: RigFile) -> PythonCanTransport:
    """The rig's CAN bus. Raises SetupError where what the file says of it is wrong, BusError where it is not there."""
    bus = file.bus
    options = {"send_patience": 1.0 / bus.sync_rate, **bus.options}
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


def winch_configs(file: RigFile, *, homing: bool = False, on_trial: bool = False) -> tuple[WinchConfig, ...]:
    """What the drivers are told of each winch. Raises SetupError naming file, winch and key.

    homing: stored zeros are about to be made anew, so that none is checked. on_trial: stops are about to be tried.
    """
    winches = file.robot.winches or ()
    age = file.guards["stale_winch"].thresholds["age"]
    try:
        configs = [
            _winch_config(entry, winch.newton_per_ampere, age, homing, file.path.parent)
            for entry, winch in zip(file.winches, winches, strict=True)
        ]
        return tuple(replace(one, proofs=held_proofs(file, one), on_trial=on_trial) for one in configs)
    except SetupError as error:
        raise SetupError(f"{file.path}: {error.message}", hint=error.hint) from error


def _winch_config(
    entry: WinchEntry, newton_per_ampere: float, sample_age: float, homing: bool, folder: Path
) -> WinchConfig:
    family = read_family(family_path(entry.family, folder))
    config = WinchConfig(
        name=entry.name,
        node_id=entry.node_id,
        counts_per_turn=entry.counts_per_turn * entry.gear_ratio,
        drum_radius=entry.drum_radius,
        rated_current=entry.rated_current,
        current_limit=entry.current_limit,
        max_speed=entry.max_speed,
        max_acceleration=entry.max_acceleration,
        length_limits=entry.length_limits,
        direction=entry.direction,
        reversed=entry.reversed,
        home_count=entry.home_count,
        home_length=entry.home_length,
        quick_stop_deceleration=entry.quick_stop_deceleration,
        following_error=entry.following_error,
        following_error_time=entry.following_error_time,
        heartbeat=entry.heartbeat,
        host_timeout=entry.host_timeout,
        sdo_timeout=entry.sdo_timeout,
        step_timeout=STEP_TIMEOUT + entry.brake_time,
        stop=StopReactions(**vars(entry.stop)),
        eds=entry.eds or GENERIC_EDS,
        vendor_id=entry.vendor_id,
        product_code=entry.product_code,
        serial_number=entry.serial_number,
        rated_torque=entry.rated_torque,
        sample_age=sample_age,
        current_offset=entry.tension.offset / newton_per_ampere,
        temperature=_temperature(entry),
        sto=None if entry.sto is None else Signal(entry.sto.bit, entry.sto.active),
        brake_output=None if entry.brake_output is None else Signal(**vars(entry.brake_output)),
        family=family,
        motor_counts=entry.counts_per_turn,
        load=_load(entry, family),
        torque_constant=entry.torque_constant,
        mode=MODES[entry.mode],
        zero=None if homing else _stored_zero(entry),
    )
    return fitted(config)


def _load(entry: WinchEntry, family: DriveFamily) -> Load:
    if entry.load is None and family.load_object is not None:
        return Load.VENDOR
    return Load(entry.load or family.load)


def _stored_zero(entry: WinchEntry) -> StoredZero | None:
    home = entry.home
    if home is None:
        return None
    per_metre = entry.counts_per_turn * entry.gear_ratio / (2.0 * math.pi * entry.drum_radius)
    return StoredZero(home.serial_number, entry.multi_turn, home.last_count, max(1, round(entry.turned * per_metre)))


def _temperature(entry: WinchEntry) -> TemperatureObject | None:
    asked = entry.temperature
    return None if asked is None else TemperatureObject(asked.index, asked.sub, asked.scale)


async def _hand(file: RigFile, stack: contextlib.AsyncExitStack) -> Operator:
    if file.hand is None:
        raise SetupError(f"{file.path}: nobody answers prompts.", hint="Give an operator, or [simulated_hand].")
    hand = RemoteOperator(file.hand.host, file.hand.port)
    await hand.open()
    stack.push_async_callback(hand.close)
    return hand


def rig_settings(file: RigFile, base: Settings | None = None) -> Settings:
    """What a procedure is told of this rig: length limits, speeds that its winches can do, friction band, guards."""
    base, configs = base or Settings(), winch_configs(file)
    speed, acceleration = _highest(configs)
    motion = replace(
        base.motion,
        speed=min(base.motion.speed, speed),
        acceleration=min(base.motion.acceleration, acceleration),
        length_limits=tuple(config.length_limits for config in configs),
        together=max(base.motion.together, min(file.guards["stale_winch"].thresholds["age"], LONGEST_TOGETHER)),
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
        tension=tension,
        place=replace(base.place, off=file.place.off, change=file.place.change, part=file.place.part),
        guard=_guard_settings(file.guards, base.guard, window),
        release=None if file.release is None else _release_settings(file.release, base),
    )


def require_what_winches_do(file: RigFile, settings: Settings) -> None:
    """Raise SetupError for what a drive would refuse or not wait for: now, not in the middle of a run.

    Speeds, accelerations, and the guard of the following error.
    """
    speed, acceleration = _highest(winch_configs(file))
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


def _highest(configs: tuple[WinchConfig, ...]) -> tuple[float, float]:
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


def _guard_settings(guards: Mapping[str, GuardEntry], base: GuardSettings, window: float) -> GuardSettings:
    """window: the drives' own for the following error, m."""
    stale, tension = guards["stale_winch"].thresholds, guards["tension"].thresholds
    motion = guards["motion"].thresholds
    following, heat = guards["following_error"].thresholds, guards["temperature"].thresholds
    return replace(
        base,
        sample_age=stale["age"],
        slack=tension["slack"],
        overload=tension["overload"],
        hysteresis=tension["hysteresis"],
        tension_for=tension["lasting"],
        marker_for=guards["marker"].thresholds["lasting"],
        motion=motion["allowed"],
        motion_late=motion["late"],
        motion_speed=motion["speed"],
        motion_speed_for=motion["lasting"],
        slip=guards["slip"].thresholds["allowed"],
        following_error=following["part"] * window,
        following_error_for=following["lasting"],
        temperature=heat["limit"],
        temperature_hysteresis=heat["hysteresis"],
        temperature_age=heat["age"],
        bus_lost=round(guards["bus_errors"].thresholds["lost"]),
        loop_late=guards["host_loop"].thresholds["late"],
        disk_spare=guards["disk"].thresholds["spare"],
        reactions={name.replace("_", " "): REACTIONS[entry.reaction] for name, entry in guards.items()},
    )
