"""A new rig file for a robot file: for hardware, or for `fidim simulators` on this computer."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fidim_lab.app.doctor.robot_plausibility import middle_rests
from fidim_lab.app.starters.sections import Section, document, plain_keys
from fidim_lab.data.records import Robot
from fidim_lab.data.rigs import rig_guard_tables as guards
from fidim_lab.data.rigs import rig_serial_tables as serial
from fidim_lab.data.rigs import rig_tables as tables
from fidim_lab.data.rigs import rig_winch_tables as winch_tables
from fidim_lab.data.rigs.rig_file import FORMAT
from fidim_lab.model.mechanism import Mechanism

OF_ONE = ("name", "node_id", "direction", "reversed", "home_count", "home_length", "serial_number")
"""keys of a winch that belong to it alone; `[every_winch]` has the others"""
BUS_PORT, MOCAP_PORT, HAND_PORT = 20100, 20101, 20102
"""of 127.0.0.1, where simulated devices are; those of examples/rigs/simulated.toml"""
SLOW: Mapping[str, float] = {"heartbeat": 0.3, "host_timeout": 1.5, "sdo_timeout": 3.0}
"""s, for simulators that share a computer with everything else"""

SHORTEST = 0.2
"""m of cable, that an attachment does not meet its pulley"""


@dataclass(frozen=True)
class RigWish:
    """What the rig file is for."""

    path: Path
    robot_file: Path
    robot: Robot
    simulated: bool


def rig_text(wish: RigWish) -> str:
    """The file as text."""
    where = "devices that fidim simulators serves on this computer" if wish.simulated else "your hardware"
    first = f"    fidim simulators {wish.path}         # in another terminal\n" if wish.simulated else ""
    opening = f"""A rig of {wish.robot.n} winches: {where}. docs/rig.md explains each table.
A line with # before a key shows the default of that key. When done:
{first}    fidim doctor --rig {wish.path}       # reads and compares, moves nothing"""
    return document("rig", opening, [*_top(wish), *_winches(wish), *_outside(wish), *_guards(wish.simulated)])


def _top(wish: RigWish) -> list[Section]:
    robot = os.path.relpath(wish.robot_file.resolve(), wish.path.resolve().parent)
    values = {"format": FORMAT, "name": f"rig of {wish.robot_file.stem}", "robot": robot}
    bus: dict[str, Any] = {"interface": "socketcan", "channel": "can0", "bitrate": 1_000_000, "sync_rate": 250.0}
    if wish.simulated:
        options = {"sleep_after_open": 0.1}
        slow = {"interface": "slcan", "channel": f"socket://127.0.0.1:{BUS_PORT}", "sync_rate": 100.0}
        bus |= slow | {"options": options}
    only = [key for key in plain_keys(tables.RigTable) if key != "every_winch"]
    return [Section("", tables.RigTable, values, only=only), Section("[bus]", tables.BusTable, bus)]


def _winches(wish: RigWish) -> list[Section]:
    common = [key for key in plain_keys(winch_tables.RigWinchTable) if key not in OF_ONE]
    drum = None if wish.robot.winches is None else wish.robot.winches[0]
    values: dict[str, Any] = {
        "eds": "generic",
        "counts_per_turn": 4096.0,
        "gear_ratio": 10.0 if drum is None else drum.gear_ratio,
        "drum_radius": 0.03 if drum is None else drum.drum_radius,
        "rated_current": 5.0,
        "current_limit": 12.0 if wish.simulated else 10.0,
        "length_limits": [SHORTEST, _longest(wish.robot)],
        "max_speed": 0.5 if wish.simulated else 0.1,
        "max_acceleration": 1.0 if wish.simulated else 0.5,
        **(SLOW if wish.simulated else {}),
    }
    every = "Values for each [[winch]] that does not state its own."
    return [
        Section("[every_winch]", winch_tables.RigWinchTable, values, every, only=common),
        *(
            Section(f"[every_winch.{key}]", model, says=says, commented=True)
            for key, model, says in (
                ("stop", winch_tables.StopReactions, "What a drive does by itself: CiA 402 option codes."),
                ("temperature", winch_tables.TemperatureObject, "If the drive reports its temperature."),
                ("sto", winch_tables.Signal, "Input that is on while safe torque off is active."),
                ("brake_output", winch_tables.Signal, "Output that applies the holding brake."),
            )
        ),
        *(section for number in range(wish.robot.n) for section in _winch(number, wish)),
    ]


def _longest(robot: Robot) -> float:
    """m, in whole tenths: from an anchor to the far side of the anchors, at the lowest place of rest."""
    anchors = np.array([cable.d for cable in robot.cables])
    down = robot.gravity / np.linalg.norm(robot.gravity)
    along = anchors @ down
    flat = anchors - along[:, None] * down
    across = max(float(np.linalg.norm(a - b)) for a in flat for b in flat)
    around = max(np.pi * cable.radius for cable in robot.cables)
    rests = middle_rests(Mechanism(robot))
    lowest = max((float((rest.pose.position @ down)) for rest in rests), default=float(along.max()) + across)
    return float(np.ceil(10.0 * (np.hypot(across, lowest - float(along.min())) + around)) / 10.0)


def _winch(number: int, wish: RigWish) -> list[Section]:
    home = round(_longest(wish.robot) / 2.0, 1)
    own = {"name": f"winch {number + 1}", "node_id": number + 1, "direction": 1, "home_count": 0, "home_length": home}
    says = "One table for each winch, in the order of the robot file's cables." if number == 0 else ""
    drum = None if wish.robot.winches is None else wish.robot.winches[number]
    if drum is not None and wish.robot.winches is not None and drum.drum_radius != wish.robot.winches[0].drum_radius:
        own["drum_radius"] = drum.drum_radius
    only = [*OF_ONE, *(["drum_radius"] if "drum_radius" in own else [])]
    tension = "Measured by fidim tension-calibrate." if number == 0 else ""
    return [
        Section("[[winch]]", winch_tables.RigWinchTable, own, says, only=only, silent=number > 0),
        Section("[winch.tension]", winch_tables.TensionTable, says=tension, silent=number > 0, commented=True),
    ]


def _outside(wish: RigWish) -> list[Section]:
    names = [f"marker{k}" for k in range(1, len(wish.robot.markers) + 1)]
    mocap: dict[str, Any] = {"kind": "vicon-udp", "rate": 100.0, "markers": names}
    if wish.simulated:
        mocap |= {"host": "127.0.0.1", "port": MOCAP_PORT}
    hand = {"port": HAND_PORT} if wish.simulated else {}
    return [
        Section("[motion_capture]", tables.MocapTable, mocap),
        Section("[simulated_hand]", tables.HandTable, hand, commented=not wish.simulated),
        Section("[place]", guards.PlaceTable, commented=True),
        Section("[release]", serial.ReleaseTable, commented=True),
        Section("[load_cells]", serial.LoadCellsTable, commented=True),
        Section("[inclinometer]", serial.InclinometerTable, commented=True),
    ]


def _guards(simulated: bool) -> list[Section]:
    """A section for each guard, explained by its model."""
    looser = {"stale_winch": {"age": 1.0}, "host_loop": {"late": 1.0}} if simulated else {}
    return [
        Section(
            f"[guards.{name}]",
            field.annotation,
            looser.get(name, {}),
            _docstring(field.annotation),
            commented=name not in looser,
        )
        for name, field in guards.GuardsTable.model_fields.items()
        if isinstance(field.annotation, type)
    ]


def _docstring(model: type[Any]) -> str:
    """What the model says behind the name of its table."""
    said = " ".join((model.__doc__ or "").split()).partition("`")[2].partition("`")[2].lstrip(": ").rstrip(".")
    return f"{said[0].upper()}{said[1:]}." if said else ""
