"""`fidim doctor --rig`: the hardware of a rig file, checked without moving or writing anything.

The bus is listened to first; then each drive is asked by SDO reads, motion capture is watched for some seconds. No
SYNC, no heartbeat and no NMT command is sent: a drive that is at work for somebody else is not disturbed.
"""

import asyncio
import contextlib
from collections import Counter

import numpy as np

from drivers.canbus.load import MAX_LOAD
from drivers.canbus.python_can import PythonCanTransport
from drivers.canbus.transport import CanFrame
from drivers.cia402.bring_up import MEANING as ZERO
from drivers.cia402.bring_up import InspectedObject, Standing, graded, inspect
from drivers.cia402.dictionary import family_path, read_family
from drivers.cia402.motion import Cia402Winch
from drivers.cia402.watch import CanopenMaster
from drivers.cia402.wire import Strangers
from drivers.clock import LoopClock
from drivers.ports import Clock
from fidim_lab.app import compose
from fidim_lab.app.compose.real import make_master, open_bus, rig_settings
from fidim_lab.app.compose.winches import winch_configs
from fidim_lab.app.doctor.checks import Check, CheckVerdict
from fidim_lab.app.doctor.mocap_doctor import Watched, check_motion_capture
from fidim_lab.app.doctor.robot_plausibility import middle_rests
from fidim_lab.app.doctor.serial_doctor import check_serial
from fidim_lab.data.eds import read_dictionary
from fidim_lab.data.rigs.rig import RigFile
from fidim_lab.errors import BusError, DeviceError, FidimError, HardwareError, InfeasibleError, SetupError
from fidim_lab.model.mechanism import Mechanism
from procedures.expected import NominalRest, PlaceHistory, SeenAtRest, place_measurements
from procedures.guards.geometry_guard import NAME as GEOMETRY
from procedures.guards.geometry_guard import lacks
from procedures.steps import Lengths

from .drive_doctor import check_family, check_grades, check_repairs

NAME = "marker and its place by the lengths"
HANGS = "does the platform hang freely and still from all cables?"

LISTEN = 1.0
"""s; ten heartbeats of a drive that another master has set up"""
HEARTBEAT = 0x700
STANDINGS = {
    Standing.HOLDS: CheckVerdict.OK,
    Standing.TO_BE_WRITTEN: CheckVerdict.WRITTEN,
    Standing.WRONG: CheckVerdict.FAILED,
}


def check_rig(file: RigFile) -> list[Check]:
    """All checks of a rig; what cannot be reached is a check that says so."""
    checks = [
        Check(f"rig {file.path.name}", CheckVerdict.OK, f"{file.name}: {len(file.winches)} winches, {file.bus.name}")
    ]
    checks += [*check_reach(file), *check_tensions(file)]
    for eds, name in sorted({(entry.eds_file, entry.family) for entry in file.winches if entry.eds_file is not None}):
        with contextlib.suppress(FidimError):  # said with its winch, where the drives are asked
            found = read_dictionary(eds, 1)
            checks += check_family(found, read_family(family_path(name, file.path.parent)))
            checks += check_repairs(found)
    checks += compose.run_loop(_check_hardware(file), real_time=True)
    return checks + check_guards(file)


async def _check_hardware(file: RigFile) -> list[Check]:
    clock = LoopClock()
    checks, lengths = await _check_bus(file, clock)
    seen, watched = await check_motion_capture(file, clock)
    checks += [*seen, *check_place(file, lengths, watched)]
    checks += await check_serial(file, clock)
    if file.hand is not None:
        checks.append(await _check_hand(file))
    return checks


async def _check_bus(file: RigFile, clock: Clock) -> tuple[list[Check], Lengths | None]:
    """Checks, and all cables' lengths where every encoder and its zero is known."""
    lengths: list[float] = []
    try:
        transport = open_bus(file)
    except (SetupError, BusError) as error:
        return [Check("CAN bus", CheckVerdict.UNREACHABLE, error.message, error.hint, file.bus.name)], None
    checks = [Check("CAN bus", CheckVerdict.OK, "open", wanted=file.bus.name)]
    try:
        master = make_master(file, transport, clock)
        winches = [Cia402Winch(config, master) for config in winch_configs(file)]
        checks.append(_check_load(master))
        others = await _listen(file, transport, clock)
        checks += others
        if any(check.verdict is CheckVerdict.FAILED for check in others):
            advice = "end the other master first: questions of ours would mix with its own"
            return [
                *checks,
                Check("drives", CheckVerdict.FAILED, "not read, because another master is active", advice),
            ], None
        for number, winch in enumerate(winches):
            asked = await _check_drive(file, winch)
            checks += asked
            if not any(check.verdict.wrong and ZERO in check.name for check in asked):
                lengths += await _length(winch)
            if transport.fault is not None:
                rest = ", ".join(other.name for other in winches[number + 1 :])
                problem = f"{transport.fault}{f'; not asked: {rest}' if rest else ''}"
                checks.append(Check("CAN bus", CheckVerdict.UNREACHABLE, problem, "look at adapter and cable"))
                break
    except FidimError as error:
        verdict = CheckVerdict.UNREACHABLE if isinstance(error, HardwareError) else CheckVerdict.FAILED
        checks.append(Check("CAN bus", verdict, error.message, error.hint))
    finally:
        transport.close()
    return checks, tuple(lengths) if len(lengths) == len(file.winches) else None


async def _length(winch: Cia402Winch) -> list[float]:
    """m by the encoder; nothing from a drive that does not answer."""
    try:
        return [winch.config.scale.length(await winch.link.sdo.read(0x6064))]
    except DeviceError:
        return []


def _check_load(master: CanopenMaster) -> Check:
    wanted = f"at most {MAX_LOAD:.0%}"
    return Check("CAN bus load", CheckVerdict.OK, f"{master.load:.0%} at worst, by calculation", wanted=wanted)


async def _listen(file: RigFile, transport: PythonCanTransport, clock: Clock) -> list[Check]:
    """Who talks before anybody was asked: another master would fight with ours."""
    heard: Counter[int] = Counter()
    strangers = Strangers(file.bus.host_id, [entry.node_id for entry in file.winches])

    def hear(frame: CanFrame) -> None:
        if listening:
            heard.update(() if frame.remote else (frame.id,))
            strangers.hear(frame)

    listening = True
    transport.subscribe(hear)
    await clock.sleep(LISTEN)
    listening = False
    says = strangers.says
    advice = "end the other master: two on one bus fight over the drives" if says else ""
    found = f"{says} in {LISTEN:g} s" if says else "nobody"
    checks = [Check("other masters", CheckVerdict.FAILED if says else CheckVerdict.OK, found, advice, "nobody")]
    nodes = {identifier - HEARTBEAT for identifier in heard if 0 < identifier - HEARTBEAT < 127}
    others = sorted(nodes - {entry.node_id for entry in file.winches} - {file.bus.host_id})
    if others:
        found, advice = f"node {', '.join(map(str, others))}", "not in the rig file; their frames add to the load"
        checks.append(Check("other nodes", CheckVerdict.WARNING, found, advice))
    return checks


async def _check_drive(file: RigFile, winch: Cia402Winch) -> list[Check]:
    try:
        inspected = await inspect(winch.link, winch.config, file.bus.host_id)
        grades = await graded(winch.link, winch.config)
    except DeviceError as error:
        advice = error.hint or "check its power, its node id, the bit rate and the bus's termination"
        found = error.message.removeprefix(f"{winch.config.device}: ")
        return [Check("drive", CheckVerdict.UNREACHABLE, found, advice, f"node {winch.config.node_id}", winch.name)]
    says = winch.link.twins.says
    advice = "unplug one, or give it an id of its own" if says else ""
    alone = Check(
        "nodes of this id", CheckVerdict.FAILED if says else CheckVerdict.OK, says or "one", advice, "one", winch.name
    )
    return [alone, *(_as_check(item, winch.name) for item in inspected), *check_grades(grades, winch.name)]


def _as_check(item: InspectedObject, device: str) -> Check:
    name = f"{item.object} {item.meaning}"
    return Check(name, STANDINGS[item.standing], item.found, item.advice, item.wanted, device)


async def _check_hand(file: RigFile) -> Check:
    hand = file.hand
    if hand is None:
        return Check("prompts", CheckVerdict.OK, "a person answers")
    try:
        _, writer = await asyncio.open_connection(hand.host, hand.port)
    except OSError as error:
        found = f"{hand.host}:{hand.port}: {error.strerror or error}"
        return Check("simulated hand", CheckVerdict.UNREACHABLE, found, "is `fidim simulators` running?")
    writer.close()
    return Check("simulated hand", CheckVerdict.OK, f"{hand.host}:{hand.port} answers")


def check_tensions(file: RigFile) -> list[Check]:
    """Whether the motors can carry what the robot file allows, and how well their currents tell it."""
    checks: list[Check] = []
    low, high = file.robot.limits.tension
    for entry, winch in zip(file.winches, file.robot.winches or (), strict=True):
        carried = entry.current_limit * winch.newton_per_ampere
        wanted = f"above {high:g} N"
        advice = "" if carried > high else "raise current_limit, or lower the robot file's upper tension limit"
        verdict = CheckVerdict.FAILED if advice else CheckVerdict.OK
        checks.append(Check("tension at current_limit", verdict, f"{carried:.0f} N", advice, wanted, entry.name))
    for entry, winch in zip(file.winches, file.robot.winches or (), strict=True):
        if entry.tension.gain is None:
            found = f"{winch.newton_per_ampere:.3g} N/A by drum, gear and efficiency"
            advice = "measure gain, offset and friction at known poses; tensions from currents are good to ± 10 %"
            checks.append(Check("tension calibration", CheckVerdict.WARNING, found, advice, "measured", entry.name))
        else:
            found = f"{entry.tension.gain:g} N/A, {entry.tension.offset:+g} N ± {entry.tension.friction or 0:g} N"
            friction = entry.tension.friction
            advice = "" if friction is None or friction < low else "friction hides the lower tension limit"
            verdict = CheckVerdict.FAILED if advice else CheckVerdict.OK
            checks.append(Check("tension calibration", verdict, found, advice, "measured", entry.name))
    return checks


def check_guards(file: RigFile) -> list[Check]:
    """The reaction table, for a person to read."""
    guards = file.guards.model_dump()
    off = lacks(file.robot)
    return [
        Check(
            f"guard {name}", CheckVerdict.WARNING, f"off: {off}", "an encoder frozen while its drum turns is not seen"
        )
        if off and name == GEOMETRY
        else Check(f"guard {name.replace('_', ' ')}", CheckVerdict.OK, _words(**guard))
        for name, guard in guards.items()
    ]


def _words(reaction: str, **thresholds: float) -> str:
    told = ", ".join(f"{name} {value:g}" for name, value in thresholds.items())
    return f"{reaction}{f' ({told})' if told else ''}"


def check_place(file: RigFile, lengths: Lengths | None, watched: Watched | None) -> list[Check]:
    """lengths: m, by the encoders, None where one of them is not known; watched: what cameras saw, None: nothing."""
    settings = rig_settings(file).place
    wanted = f"at most {1e3 * settings.off:.0f} mm off"
    missing = "encoders or their zeros" if lengths is None else "the main marker"
    places = [] if watched is None else [f.main for f in watched.frames if f.main]
    if lengths is None or not places:
        return [Check(NAME, CheckVerdict.WARNING, f"not compared: {missing} not known", "correct that first", wanted)]
    seen = np.array(places)
    if (swing := float(np.linalg.norm(np.ptp(seen, axis=0)))) > settings.off:
        found = f"not compared: the marker moves by {1e3 * swing:.0f} mm"
        return [Check(NAME, CheckVerdict.WARNING, found, "ask again when the platform is still", wanted)]
    try:
        found, cause = place_measurements(
            NominalRest(file.robot), SeenAtRest(lengths, np.median(seen, axis=0)), PlaceHistory(), settings
        )
    except InfeasibleError as refusal:
        says = f"no rest at these lengths: {refusal.message}"
        return [Check(NAME, CheckVerdict.FAILED, says, f"{HANGS} Are zeros, gears and drums right?", wanted)]
    verdict = CheckVerdict.FAILED if cause else CheckVerdict.OK
    off = found[0].value or 0.0
    return [Check(NAME, verdict, f"{1e3 * off:.1f} mm off", f"{HANGS} Then {cause}" if cause else "", wanted)]


def check_reach(file: RigFile) -> list[Check]:
    """Whether each winch may have the lengths with which the robot rests; nothing where it rests nowhere."""
    rests = middle_rests(Mechanism(file.robot))
    lengths = np.array([rest.lengths for rest in rests])
    checks: list[Check] = []
    for number, entry in enumerate(file.winches if rests else ()):
        low, high = entry.length_limits
        own = lengths[:, number]
        within = int(np.sum((own >= low) & (own <= high)))
        wanted = f"{own.min():.2f} to {own.max():.2f} m"
        found = f"{low:g} to {high:g} m: {within} of {len(rests)} places of rest under the middle of the anchors"
        verdict = CheckVerdict.OK if within == len(rests) else CheckVerdict.WARNING if within else CheckVerdict.FAILED
        advice = (
            "" if verdict is CheckVerdict.OK else "check length_limits (m of cable from D to A) and the robot file's d"
        )
        checks.append(Check("length_limits", verdict, found, advice, wanted, entry.name))
    return checks
