"""The devices of a rig file, simulated in a process of their own: drives on its bus, motion capture at its socket.

The other process (`fidim doctor --rig`, a run) opens the same file and meets the same bytes as from hardware.
"""

import contextlib
import time
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import can
import numpy as np

from drivers.canbus.transport import CanFrame
from drivers.cia402.dictionary import GENERIC_EDS, AmpereObject, WinchConfig
from drivers.clock import LoopClock
from fidim_lab.app.compose.simulated import GRAIN, simulated_world
from fidim_lab.app.compose.simulated_motion_capture import (
    MocapSender,
    SerialSimulators,
    as_cameras_see,
    mocap_sender,
    run_serial_simulators,
    serial_link,
    serial_simulators,
)
from fidim_lab.app.compose.winches import winch_configs
from fidim_lab.arrays import PerCable
from fidim_lab.data.records import Plan
from fidim_lab.data.rigs.rig import RigFile
from fidim_lab.data.rigs.rig_tables import BusTable
from fidim_lab.errors import SetupError
from fidim_lab.identification.random_plan import random_plan
from sim_backends.drive.axis import Ampere, Defects, DrumShaft, Make
from sim_backends.drive.node import SimulatedDrive
from sim_backends.drive.objects import AbortCode, read_eds
from sim_backends.hand_server import HandServer
from sim_backends.laboratory import DrumGeometry, Laboratory
from sim_backends.served_bus import ServedBus
from sim_backends.slcan_pty import SlcanPtyBus
from sim_backends.slcan_server import SlcanServerBus

SOCKET = "socket://"
SWITCHED_OFF = bytes.fromhex("2b40600006000000")
"""controlword “shutdown” by SDO"""
OVERCURRENT = 0x2310
"""emergency code of the fault below"""
SERVO_LAG = 0.01
"""s by which a simulated shaft is behind its demand in motion (1/Kv): 0.5 mm at 0.05 m/s"""
AGAIN = "again"
"""after a plug's name: it is put back"""


@dataclass(frozen=True, eq=False)
class SimulatedDevices:
    """What runs, and the plugs that can be pulled on it."""

    file: RigFile
    start: PerCable
    """cable lengths at the beginning, m"""
    bus: can.BusABC
    served: ServedBus
    drives: tuple[SimulatedDrive, ...]
    motion_capture: MocapSender
    serial: SerialSimulators = ()
    out: set[str] = field(default_factory=set[str])
    """plugs that are pulled at the moment"""

    async def pull(self, line: str) -> str:
        """Pull a plug or, with "again" after its name, put it back, and say so. Raises SetupError for one there is not.

        "bus": the adapter's; "mocap": the stream ends; "drive K": no power any more; "sto K": safe torque off; "serial
        K": of the release or a measuring device, in the order of the file. Without a way back: "fault K": overcurrent;
        "off K": another program switches it off. "defect K NAME": wrong in a way that only a trial finds (`Defects`).
        """
        *words, last = line.split() or [""]
        back = last == AGAIN
        plug = " ".join(words if back else [*words, last])
        match plug.split():
            case ["defect", number, *name] if number in self._numbers and " ".join(name) in Defects.names():
                setattr(self.drives[int(number) - 1].defects, "_".join(name), not back)
                return f"{'mended' if back else 'planted'}: {plug}"
            case ["fault" | "off" as what, number] if number in self._numbers and not back:
                self._strike(self.drives[int(number) - 1], what)
                return f"done: {line}"
            case ["bus"]:
                act = self._plug_bus
            case ["mocap"]:
                act = self._plug_motion_capture
            case ["sto", number] if number in self._numbers:
                act = partial(self._open_chain, int(number) - 1)
            case ["drive", number] if number in self._numbers:
                act = partial(self._power, self.drives[int(number) - 1])
            case ["serial", number] if number in self._lines:
                act = partial(self._plug_serial, int(number) - 1)
            case _:
                known = f"bus, mocap, drive K, sto K, fault K or off K with K from {', '.join(self._numbers)}"
                if self.serial:
                    known += f"; serial K with K from {', '.join(self._lines)}"
                known += f"; {AGAIN} after it puts it back (not fault, off); defect K {' | '.join(Defects.names())}"
                raise SetupError(
                    f"{line!r}: no such plug.",
                    hint=f"There are: {known}.",
                )
        if back is not (plug in self.out):
            raise SetupError(f"{line!r}: {plug} is {'not pulled' if back else 'pulled already'}.")
        await act(back)
        self.out.symmetric_difference_update({plug})
        return f"{'put back' if back else 'pulled'}: {plug}"

    @property
    def _numbers(self) -> tuple[str, ...]:
        return tuple(str(k) for k in range(1, len(self.drives) + 1))

    @property
    def _lines(self) -> tuple[str, ...]:
        return tuple(str(k) for k in range(1, len(self.serial) + 1))

    async def _plug_bus(self, back: bool) -> None:
        """The drives go on by themselves meanwhile; one whose power is cut stays silent."""
        with self.served.paused():
            if isinstance(self.bus, SlcanServerBus | SlcanPtyBus):
                self.bus.plugged = back
            for number, drive in enumerate(self.drives, start=1):
                drive.faults.silent = not back or f"drive {number}" in self.out

    async def _plug_motion_capture(self, back: bool) -> None:
        """A system that comes back counts its frames anew."""
        await (self.motion_capture.start() if back else self.motion_capture.close())

    async def _plug_serial(self, number: int, back: bool) -> None:
        line = self.serial[number].line
        (line.plug if back else line.unplug)()

    async def _open_chain(self, number: int, back: bool) -> None:
        """Safe torque off, by the input that the rig file names, else bit 3 (interlock)."""
        sto = self.file.winches[number].sto
        with self.served.paused():
            self.drives[number].faults.safe_torque_off(not back, 3 if sto is None else sto.bit)

    async def _power(self, drive: SimulatedDrive, back: bool) -> None:
        with self.served.paused():
            if not back:
                drive.cut_power()
                return
            drive.restore_power(time.monotonic())
            drive.faults.silent = "bus" in self.out

    def _strike(self, drive: SimulatedDrive, what: str) -> None:
        with self.served.paused():
            if what == "off":
                drive.receive(CanFrame(0x600 + drive.node_id, SWITCHED_OFF, time.monotonic()))
            else:
                drive.faults.raise_fault(OVERCURRENT)


@asynccontextmanager
async def simulated_devices(
    file: RigFile, seed: int, hide: tuple[str, ...] = (), plan: Plan | None = None, *, loaded: bool = True
) -> AsyncGenerator[SimulatedDevices]:
    """Serve the devices of a rig file in real time until the context ends.

    loaded: False where no cable carries the platform, which then stays where it is. The robot rests at the plan's first
    lengths, else somewhere in its workspace. Raises SetupError where the file's bus or stream cannot be simulated or an
    address is taken, InfeasibleError where the robot cannot rest anywhere.
    """
    clock = LoopClock()
    file = as_cameras_see(file)
    start = _start(file, plan if loaded else None, seed)
    configs = winch_configs(file)
    laboratory = _laboratory(file, configs, start, seed, hide)
    shafts = laboratory.shafts if loaded else tuple(DrumShaft() for _ in configs)
    drives = _drives(file, configs, laboratory, shafts, start)
    async with contextlib.AsyncExitStack() as stack:
        bus = _open_bus(file.bus)
        served = stack.enter_context(ServedBus(bus, drives))
        mocap = mocap_sender(file, laboratory, clock)
        stack.push_async_callback(mocap.close)
        await mocap.start()
        if file.hand is not None:
            hand = HandServer(laboratory.hand(clock), file.hand.host, file.hand.port)
            stack.push_async_callback(hand.close)
            await hand.start()
        serial = serial_simulators(file, laboratory, clock)
        await run_serial_simulators(stack, serial)
        yield SimulatedDevices(file, start, bus, served, drives, mocap, serial)


def _start(file: RigFile, plan: Plan | None, seed: int) -> PerCable:
    if plan is None:
        plan = random_plan(file.robot, "start", 1, 0, seed)
    lengths = plan.windows[0].lengths
    for entry, length in zip(file.winches, lengths, strict=True):
        low, high = entry.length_limits
        if not low <= length <= high:
            raise SetupError(
                f"{file.path}: {entry.name}, length_limits: {low:g} to {high:g} m, but the simulated robot would begin "
                f"with {length:.3f} m.",
                hint="Widen them, or give --plan with a first window within them.",
            )
    return lengths


def _laboratory(
    file: RigFile, configs: tuple[WinchConfig, ...], start: PerCable, seed: int, hide: tuple[str, ...]
) -> Laboratory:
    drums = tuple(
        DrumGeometry(config.scale.length(0), config.direction, 1.0 / config.scale.counts_per_metre)
        for config in configs
    )
    world = simulated_world(file.robot, seed, hide)
    rng = np.random.default_rng([seed, 1])
    return Laboratory(file.robot, world, start, rng, time.monotonic, drums=drums, grain=GRAIN)


def _drives(
    file: RigFile,
    configs: tuple[WinchConfig, ...],
    laboratory: Laboratory,
    shafts: tuple[DrumShaft, ...],
    start: PerCable,
) -> tuple[SimulatedDrive, ...]:
    """Drives as the factory made them: rated values and identity as the rig file says, the rest from the EDS."""
    drives: list[SimulatedDrive] = []
    for entry, config, drum, shaft, length in zip(file.winches, configs, laboratory.drums, shafts, start, strict=True):
        position = drum.direction * (float(length) - drum.home_length) / drum.metres_per_count
        od = read_eds(entry.eds_file or GENERIC_EDS, entry.node_id)
        if isinstance(od.find(0x6040), AbortCode):
            raise SetupError(
                f"{file.path}: {entry.name}: the EDS file {entry.eds} describes no drive: no controlword (6040).",
                hint="Give the file of the drive, not of an I/O module or a master.",
            )
        od.fix(0x6075, 0, round(1e3 * entry.rated_current))
        if (own := config.family.rated_current) is not None:
            od.fix(own.index, own.sub, round(entry.rated_current / own.ampere))
        if entry.rated_torque is not None:
            od.fix(0x6076, 0, round(1e3 * entry.rated_torque))
        od.fix(0x607E, 0, 0xC0 if entry.reversed else 0)
        if entry.counts_per_turn == round(entry.counts_per_turn):
            od.fix(0x608F, 1, round(entry.counts_per_turn))
        if entry.serial_number is not None:
            od.fix(0x1018, 4, entry.serial_number)
        drive = SimulatedDrive(entry.node_id, od, shaft, position=position, make=make_of(config), lag=SERVO_LAG)
        drive.faults.claim_identity(vendor=entry.vendor_id, product=entry.product_code)
        drive.faults.offset_current(entry.direction * config.current_offset)
        drives.append(drive)
    return tuple(drives)


def make_of(config: WinchConfig) -> Make:
    """What the winch's drive family does otherwise than the profile, for a simulated drive."""
    family, ramp = config.family, config.ramp_speed
    return Make(
        speed=config.counts_per_digit(family.speed),
        velocity=config.counts_per_digit(family.velocity_unit),
        acceleration=1.0 if ramp else config.counts_per_digit(family.acceleration or family.speed),
        ramp_speed=ramp,
        rated_current=config.rated_current,
        load=_ampere(family.load_object),
        current_limit=_ampere(family.current_limit),
    )


def _ampere(told: AmpereObject | None) -> Ampere | None:
    return None if told is None else Ampere(told.index, told.sub, told.ampere)


def _open_bus(entry: BusTable) -> can.BusABC:
    """Our end of the rig file's bus. Raises SetupError for one that only hardware has."""
    if entry.interface == "slcan" and entry.channel.startswith(SOCKET):
        host, _, port = entry.channel.removeprefix(SOCKET).rpartition(":")
        if not port.isdigit():
            raise SetupError(f"bus, channel: {entry.channel!r} has no port; an example is socket://127.0.0.1:20100.")
        return SlcanServerBus(host, int(port))
    if entry.interface == "slcan":
        return SlcanPtyBus(serial_link(entry.channel))
    if entry.interface != "udp_multicast" and not entry.channel.startswith("vcan"):
        raise SetupError(
            f"The bus {entry.name} belongs to hardware or to one process: simulated drives are not put on it.",
            hint='Use "slcan" with channel = "socket://127.0.0.1:20100" or "/tmp/fidim/can", "udp_multicast", vcan….',
        )
    options: dict[str, Any] = dict(entry.options)
    try:
        return can.Bus(entry.channel, entry.interface, **options)
    except (can.CanError, OSError, ValueError, TypeError) as error:
        raise SetupError(f"The CAN bus {entry.name} cannot be opened: {error}.") from error
