"""Taking over drives that an earlier host has left with power: killed, crashed, or disconnected.

The load hangs on such drives, so nothing here lets go of it: a drive that still runs is stopped on its quick-stop ramp,
one that holds is compared with the rig file, object by object, and keeps holding. What would have to be written first
is refused: that takes a person, who secures the load and takes the power away (`without_power`).

`take_over` stands for `bring_up` when a run goes on; `refuse_other_master` comes before either.
"""

from collections.abc import Iterable

from drivers.canbus.transport import CanFrame, CanTransport
from drivers.cia402.bring_up.bringup import OF_A_MOVE, BroughtUp, bring_up, graded, refuse_grades, start_sampling
from drivers.cia402.bring_up.inspection import InspectedObject, Standing, inspect
from drivers.cia402.dictionary.config import WinchConfig
from drivers.cia402.dictionary.settings import SettingCheck, interpolation
from drivers.cia402.profile.machine import Command
from drivers.cia402.profile.scale import wrap32
from drivers.cia402.profile.words import controlword, mode_name
from drivers.cia402.watch.master import CanopenMaster
from drivers.cia402.watch.node import NodeLink
from drivers.cia402.watch.without_power import read_state
from drivers.cia402.wire.pdo import Mappable
from drivers.cia402.wire.strangers import ALL_NODES, END_IT, Strangers
from drivers.ports import Clock, DriveState
from fidim_lab.errors import BusError, DeviceError

NOT_TAKEN_OVER = "it holds the load, but with other settings than the rig file"
_LOOK = 0.01
"""s between two questions by SDO"""
_STANDSTILL = 0.005
"""of the highest speed"""
_WATCHED = 0.1
"""s between two places that tell a speed: at standstill a count more or less is 0.2 mm/s at 20 µm a count"""
_JUDGED_ELSEWHERE = ("6041:0", "1001:0")
"""state and error register: what they are is why we are here"""
_MOVES = (DriveState.OPERATION_ENABLED, DriveState.FAULT_REACTION)


async def take_over(master: CanopenMaster, link: NodeLink, config: WinchConfig) -> BroughtUp:
    """What `bring_up` establishes, for a drive in whatever state; a load that it holds is held all the while.

    `master.run()` must be running. A drive without power (also one whose 605A takes it away after a quick stop) is
    brought up as ever. Raises DeviceError naming every object that differs, or as `bring_up`.
    """
    link.forget()
    state = await _stop(master.clock, link, config)
    if state is not DriveState.QUICK_STOP_ACTIVE:
        return await bring_up(master, link, config)
    seen = await inspect(link, config, master.host_id)
    checks = [_check(found) for found in seen if found.object not in _JUDGED_ELSEWHERE]
    mode = await link.sdo.read(Mappable.MODE_DISPLAY.index)
    wanted = link.mode = config.mode
    checks.append(SettingCheck("6061:0", "mode of operation", mode_name(wanted), mode_name(mode), ok=mode == wanted))
    for setting in link.able.fitting(interpolation(config, master.period)):
        checks.append(setting.check(await link.sdo.read(setting.index, setting.sub)))
    if wrong := [str(check) for check in checks if not check.ok]:
        raise DeviceError(
            config.device,
            f"{NOT_TAKEN_OVER}: " + "; ".join(wrong) + ".",
            hint="Secure the load, then: fidim power-off RIG.",
        )
    grades = await graded(link, config)
    refuse_grades(config, grades)
    link.decoder.displayed = mode
    await start_sampling(master, link, config)
    return BroughtUp(tuple(checks), grades)


async def _stop(clock: Clock, link: NodeLink, config: WinchConfig) -> DriveState:
    """At rest, in whichever state without a motion that is. Raises DeviceError where it does not come to one."""
    state = await read_state(link)
    if state is DriveState.OPERATION_ENABLED:
        link.send_controlword(controlword(Command.QUICK_STOP), 0)
    elif state is DriveState.SWITCHED_ON:  # on its way to be enabled: the motor does not hold anything yet
        link.send_controlword(controlword(Command.DISABLE_VOLTAGE), 0)
    slowest = config.drive_velocity(_STANDSTILL * config.max_speed)
    deadline = clock.now() + config.step_timeout + config.max_speed / config.quick_stop_deceleration
    while True:
        state, speed = await read_state(link), abs(await _velocity(clock, link, config))
        leaves = state is DriveState.QUICK_STOP_ACTIVE and not config.stop.holds_in_quick_stop
        if not leaves and state not in (*_MOVES, DriveState.SWITCHED_ON) and speed <= slowest:
            return state
        if clock.now() >= deadline:
            found = f"{state}, {config.cable_speed(speed):+.3f} m/s"
            raise DeviceError(config.device, f"was left running and does not stop: {found}.", hint="Stop it by hand.")
        await clock.sleep(_LOOK)


async def _velocity(clock: Clock, link: NodeLink, config: WinchConfig) -> float:
    """As its 606C has it; of a drive without one by its encoder."""
    if link.able.has(Mappable.VELOCITY.index):
        return await link.sdo.read(Mappable.VELOCITY.index)
    before, t = await link.sdo.read(Mappable.POSITION.index), clock.now()
    await clock.sleep(_WATCHED)
    turned = wrap32(await link.sdo.read(Mappable.POSITION.index) - before)
    return turned / (clock.now() - t) / link.layout.velocity_digit


def _check(found: InspectedObject) -> SettingCheck:
    written = found.standing is Standing.TO_BE_WRITTEN and found.object in OF_A_MOVE
    return SettingCheck(
        found.object, found.meaning, found.wanted, found.found, ok=written or found.standing is Standing.HOLDS
    )


async def refuse_other_master(
    transport: CanTransport, clock: Clock, host_id: int, seconds: float, nodes: Iterable[int] = ALL_NODES
) -> None:
    """Listen for `seconds`, before a word of our own, for somebody who drives this bus already.

    nodes: ids of the drives. Raises BusError where SYNC, NMT or LSS commands, the host's own heartbeat, or commands
    and questions to one of the drives are heard: two masters undo each other's stops, and each keeps the other's
    drives from missing its heartbeat.
    """
    strangers = Strangers(host_id, nodes)

    def hear(frame: CanFrame) -> None:
        if listening:
            strangers.hear(frame)

    listening = True
    transport.subscribe(hear)
    await clock.sleep(seconds)
    listening = False
    if strangers.says:
        raise BusError(f"Another master is on this bus: {strangers.says} within {seconds:g} s.", hint=END_IT)
