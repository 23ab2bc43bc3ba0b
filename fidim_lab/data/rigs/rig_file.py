"""Rig files: the hardware of a laboratory, as TOML ("fidim-rig/1"). Paths in it are relative to the file."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeVar

from fidim_lab.data.eds.text import LIMIT as EDS_LIMIT
from fidim_lab.data.files.input_file import open_input
from fidim_lab.data.files.toml_file import nearest, read_toml
from fidim_lab.data.records import Robot, WinchTorque
from fidim_lab.data.rigs.home_file import WinchHome, read_homes
from fidim_lab.data.rigs.rig import MocapEntry, RigFile, WinchEntry
from fidim_lab.data.rigs.rig_serial_tables import COMMANDS, gauge_entries, release_entry
from fidim_lab.data.rigs.rig_tables import STANDARD_PORTS, UNITS, MocapKind, MocapTable, RigTable
from fidim_lab.data.rigs.rig_winch_tables import GENERIC, RigWinchTable, TensionTable
from fidim_lab.data.robot_file import read_robot, robot_path
from fidim_lab.errors import FileError

T = TypeVar("T")

FORMAT = "fidim-rig/1"
SAME_DRUM = 0.01
"""by how much of it a drum radius may differ between rig and robot file"""


def read_rig(path: Path, *, opened: bool = True) -> RigFile:
    """Read and check a rig file and the robot file it names.

    opened: False where its bus will not be: then python-can is not asked for the interface, and an emergency stop does
    not wait until it is imported.
    Raises FileError naming file, table, key, what was found and what is allowed; all mistakes of one kind at once:
    first those of the tables by themselves, then those of what they name.
    """
    table = read_toml(path, RigTable, FORMAT, COMMANDS)
    robot_file = robot_path(table.robot, path.parent)
    robot = _checked(path, table, robot_file, opened=opened)
    homes = read_homes(path)
    winches = tuple(
        _winch(path, winch, homes.get(winch.name), drum.torque_constant)
        for winch, drum in zip(table.winch, robot.winches or (), strict=True)
    )
    return RigFile(
        path=path,
        name=table.name,
        robot_path=robot_file,
        robot=calibrated(robot, tuple(winch.tension for winch in winches)),
        bus=table.bus,
        winches=winches,
        motion_capture=_motion_capture(path, table.motion_capture, len(robot.markers)),
        guards=table.guards,
        place=table.place,
        hand=table.simulated_hand,
        release=release_entry(path, table.release),
        gauges=gauge_entries(path, table.load_cells, table.inclinometer, robot.n),
    )


def calibrated(robot: Robot, tensions: tuple[TensionTable, ...]) -> Robot:
    """The robot whose winches turn a motor current into tension with the measured gain, where there is one."""
    if robot.winches is None:
        return robot
    return replace(
        robot, winches=tuple(_with_gain(winch, entry) for winch, entry in zip(robot.winches, tensions, strict=True))
    )


def _with_gain(winch: WinchTorque, tension: TensionTable) -> WinchTorque:
    if tension.gain is None:
        return winch
    return replace(winch, torque_constant=winch.torque_constant * tension.gain / winch.newton_per_ampere)


def _check_interface(path: Path, name: str) -> None:
    """By what python-can and its plug-ins list; none of them is loaded."""
    from can.interfaces import BACKENDS  # 0.1 s, for nobody who reads no rig file

    if name not in BACKENDS:
        near = nearest(name, BACKENDS)
        meant = f"; the nearest is {near!r}" if near else ""
        known = ", ".join(sorted(BACKENDS))
        raise FileError(path, "bus, interface", f"{name!r} is not an interface of python-can{meant}. It has {known}.")


def _checked(path: Path, table: RigTable, robot_file: Path, *, opened: bool) -> Robot:
    """The robot, when everything that the tables name is there and fits. Raises FileError with all that does not."""
    found: list[FileError] = []

    def tried(check: Callable[[], T]) -> T | None:
        try:
            return check()
        except FileError as error:
            found.append(error)
            return None

    if opened:
        tried(lambda: _check_interface(path, table.bus.interface))
    robot = tried(lambda: read_robot(robot_file, named_by=path))
    for number, winch in enumerate(table.winch, start=1):
        tried(partial(_check_eds, path, f"winch {number}, eds", winch.eds))
    if robot is not None:
        known, markers = robot, len(robot.markers)
        found += _cable_problems(path, table, known)
        tried(lambda: _motion_capture(path, table.motion_capture, markers))
        tried(lambda: gauge_entries(path, table.load_cells, table.inclinometer, known.n))
    if len(found) == 1:
        raise found[0]
    if found or robot is None:
        raise FileError(path, "", _together(path, found), hint=next((error.hint for error in found if error.hint), ""))
    return robot


def _check_eds(path: Path, place: str, named: str) -> None:
    """Raises FileError where the file of a drive's objects is not there, or is no file."""
    try:
        if named != GENERIC:
            with open_input(path.parent / named, EDS_LIMIT):
                pass
    except FileError as error:
        raise FileError(path, place, f'{named!r}: {error.problem}; "{GENERIC}" is the built-in one') from None


def _together(path: Path, found: list[FileError]) -> str:
    """All of them in one sentence, the short ones first; what is wrong with several winches alike is said once."""
    places: dict[str, list[str]] = {}
    for error in found:
        place, _, problem = error.message.removeprefix(f"{path}: ").partition(": ")
        places.setdefault(problem, []).append(place)
    told = [
        f"{place}: {problem.rstrip('.')}" + (f" (the same in {len(others)} more)" if others else "")
        for problem, (place, *others) in places.items()
    ]
    return "; ".join(sorted(told, key=len)) + "."


def _cable_problems(path: Path, table: RigTable, robot: Robot) -> Iterator[FileError]:
    if len(table.winch) != robot.n:
        yield FileError(path, "winch", f"{len(table.winch)} winches for the {robot.n} cables of {table.robot}")
    if robot.winches is None:
        yield FileError(
            path,
            "robot",
            f"{table.robot} has no [winch] table, so motor currents give no tension and no limit can be checked",
            hint="Add drum_radius, gear_ratio, efficiency and torque_constant to it.",
        )
    for number, (ours, theirs) in enumerate(zip(table.winch, robot.winches or (), strict=False), start=1):
        if abs(ours.drum_radius / theirs.drum_radius - 1.0) > SAME_DRUM:
            yield FileError(
                path,
                f"winch {number}, drum_radius",
                f"{ours.drum_radius:g} m, but {table.robot} says {theirs.drum_radius:g} m",
            )


def _winch(path: Path, table: RigWinchTable, home: WinchHome | None, torque_constant: float) -> WinchEntry:
    values = table.model_dump()
    if table.eds != GENERIC:
        values["eds"] = str(path.parent / table.eds)
    if home is not None:
        values |= {"home_count": home.home_count, "home_length": home.home_length}
    return WinchEntry(**values, torque_constant=torque_constant, home=home)


def _motion_capture(path: Path, table: MocapTable, markers: int) -> MocapEntry:
    names = table.markers
    carried_by_body = table.kind is MocapKind.VICON_UDP and table.subject is not None
    if names and len(names) != markers:
        raise FileError(
            path, "motion_capture, markers", f"{len(names)} names for the {markers} marker(s) of the robot file"
        )
    if not names and not carried_by_body:
        names = tuple(f"marker{k}" for k in range(1, markers + 1))
    if table.kind is MocapKind.VICON_DATASTREAM and table.subject is not None:
        names = tuple(f"{table.subject}/{name}" for name in names)
    return MocapEntry(
        **table.model_dump(exclude={"port", "markers", "transport", "unit"}),
        port=STANDARD_PORTS[table.kind] if table.port is None else table.port,
        markers=names,
        transport=table.way,
        unit=UNITS[table.unit],
    )
