"""`fidim doctor`: is everything here that an experiment needs? One line a check, and what to do where one fails."""

import os
import shutil
import socket
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, packages_distributions, version
from pathlib import Path

from fidim_lab.app.doctor.checks import BY_TRIAL, Check, CheckVerdict, make_table, summary
from fidim_lab.app.doctor.permissions_doctor import check_permissions
from fidim_lab.app.formats.answer_file import write_answer
from fidim_lab.app.terminal import console
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.data.robot_file import read_robot
from fidim_lab.errors import FidimError, HardwareError, RefusedError

OUR_PACKAGES = ("fidim_lab", "drivers", "procedures", "sim_backends")
LIBRARIES = ("casadi", "canopen", "python-can", "pyserial", "numpy", "scipy", "pandas", "textual")
PYTHONS = ((3, 11), (3, 13))
FREE_DISK = 1e9
"""bytes: a night of windows with the raw CAN log"""
CLOCK_STEP = 1e-4
"""s; a coarser monotonic clock cannot stamp a 250 Hz SYNC"""


@dataclass(frozen=True)
class UnconnectedDrive:
    """A drive that nobody has connected yet."""

    eds: Path
    family: str | None = None


def doctor_command(
    robot: Path | None,
    json_file: Path | None,
    rig: Path | None = None,
    drive: UnconnectedDrive | None = None,
    picture: Path | None = None,
) -> int:
    """Run all checks, print them, and return the exit code: 1 where one failed, 3 where hardware cannot be reached.

    With a drive's EDS file only that is told, and nothing of this computer. `picture`: an SVG file for a drawing of the
    robot, which is drawn in the terminal as well. Raises FileError where a file cannot be read.
    """
    file = None if rig is None else read_rig(rig)
    checks: list[Check] = []
    if drive is not None:
        from .drive_doctor import check_eds

        checks += check_eds(drive.eds, drive.family)
    if drive is None or robot is not None or file is not None:
        checks += [check() for check in CHECKS]
    if robot is not None:
        checks += check_robot(robot)
    if file is not None:
        from fidim_lab.app.doctor.rig_doctor import check_rig

        checks += [] if robot == file.robot_path else check_robot(file.robot_path)
        checks += check_rig(file)
    console.out.print(make_table(checks))
    if robot is not None:
        _draw(robot, picture)
    write_answer(json_file, "fidim-doctor/1", {"checks": [asdict(check) for check in checks]})
    wrong = [check for check in checks if check.verdict.wrong]
    unproven = sum(check.advice == BY_TRIAL for check in checks if not check.verdict.wrong)
    console.out.print(summary(checks, wrong, unproven), markup=False)
    if any(check.verdict is CheckVerdict.UNREACHABLE for check in wrong):
        return HardwareError.exit_code
    return RefusedError.exit_code if wrong else 0


def _draw(path: Path, picture: Path | None) -> None:
    """The robot at rest in the middle of its workspace, as letters and as a picture; nothing where it does not rest."""
    from fidim_lab.app.doctor.robot_plausibility import middle_rests, units
    from fidim_lab.app.doctor.robot_text import robot_views
    from fidim_lab.model.mechanism import Mechanism

    try:
        robot = read_robot(path)
        rests = middle_rests(Mechanism(robot)) if units(robot).ok else []
    except FidimError:  # said above
        return
    if not rests:
        return
    rest = rests[len(rests) // 2]
    console.out.print(f"\n{robot_views(robot, rest)}\n", markup=False, highlight=False, no_wrap=True)
    if picture is not None:
        from fidim_lab.app.report.drawings.drawing import write_svg
        from fidim_lab.app.report.drawings.robot_picture import robot_picture

        write_svg(picture, robot_picture(robot, rest))
        console.out.print(f"picture     {picture}", markup=False)


def check_python() -> Check:
    """Return whether this Python is one that the project is tested on."""
    low, high = PYTHONS
    ok = low <= sys.version_info[:2] <= high
    advice = "" if ok else f"use Python {low[0]}.{low[1]} to {high[0]}.{high[1]}: make install PYTHON=python3.11"
    return Check("Python", CheckVerdict.OK if ok else CheckVerdict.FAILED, sys.version.split()[0], advice)


def check_libraries() -> Check:
    """Return the versions of the libraries that do the work."""
    found: list[str] = []
    missing: list[str] = []
    for name in LIBRARIES:
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            missing.append(name)
    if missing:
        return Check("libraries", CheckVerdict.FAILED, f"without {', '.join(missing)}", "make install")
    return Check("libraries", CheckVerdict.OK, ", ".join(found))


def check_package_names() -> Check:
    """Return whether another distribution brings a package of one of our four generic names."""
    owners = packages_distributions()
    strangers = {name: sorted(set(owners.get(name, ())) - {"fidim-lab"}) for name in OUR_PACKAGES}
    clashes = [f"{name} (from {', '.join(who)})" for name, who in strangers.items() if who]
    if clashes:
        return Check(
            "package names", CheckVerdict.FAILED, "; ".join(clashes), "install fidim-lab in an environment of its own"
        )
    return Check("package names", CheckVerdict.OK, "no other package has these names: " + ", ".join(OUR_PACKAGES))


def check_can() -> Check:
    """Return which CAN this system offers."""
    import can

    interfaces = len(can.interfaces.VALID_INTERFACES)
    try:
        socket.socket(getattr(socket, "PF_CAN", -1), socket.SOCK_RAW, getattr(socket, "CAN_RAW", 1)).close()
    except OSError as error:
        advice = "only needed for socketcan; adapters by slcan, pcan, kvaser … work without it"
        return Check("CAN", CheckVerdict.WARNING, f"no socketcan in the kernel ({error.strerror})", advice)
    return Check("CAN", CheckVerdict.OK, f"socketcan, and {interfaces} python-can interfaces")


def check_udp() -> Check:
    """Return whether a datagram travels over loopback, as motion capture needs."""
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        try:
            receiver.bind(("127.0.0.1", 0))
            receiver.settimeout(1.0)
            sender.sendto(b"fidim", receiver.getsockname())
            receiver.recv(16)
        except OSError as error:
            return Check("UDP", CheckVerdict.FAILED, str(error), "allow UDP on this machine: a firewall stops it")
    return Check("UDP", CheckVerdict.OK, "a datagram came back over loopback")


def check_clock() -> Check:
    """Return whether the monotonic clock is fine enough to stamp samples."""
    step = time.get_clock_info("monotonic").resolution
    ok = step <= CLOCK_STEP
    advice = "" if ok else "the system's timer is too coarse for 250 Hz; see the power settings"
    return Check("clock", CheckVerdict.OK if ok else CheckVerdict.FAILED, f"monotonic, {step:.0e} s", advice)


def check_disk() -> Check:
    """Return whether runs can be written here."""
    here = Path.cwd()
    free = shutil.disk_usage(here).free
    if not os.access(here, os.W_OK):
        return Check(
            "disk", CheckVerdict.FAILED, f"{here} is not writable", "start fidim in a folder of your own, or use --out"
        )
    ok = free > FREE_DISK
    return Check(
        "disk", CheckVerdict.OK if ok else CheckVerdict.FAILED, f"{free / 1e9:.1f} GB free", "" if ok else "make room"
    )


CHECKS: tuple[Callable[[], Check], ...] = (
    check_python,
    check_libraries,
    check_package_names,
    check_permissions,
    check_can,
    check_udp,
    check_clock,
    check_disk,
)


def check_robot(path: Path) -> list[Check]:
    """Return whether a robot file is plausible: it reads, its nominal body can exist, it has rest poses."""
    from fidim_lab.app.doctor.robot_plausibility import plausibility

    name = f"robot {path.name}"
    try:
        robot = read_robot(path)
    except FidimError as error:
        advice = "correct the file" if path.exists() else "name another file; fidim init robot writes one"
        return [Check(name, CheckVerdict.FAILED, str(error), advice)]
    count = len(robot.markers)
    checks = [Check(name, CheckVerdict.OK, f"{robot.n} cables, {count} marker{'s' * (count != 1)}, {robot.mass:g} kg")]
    return checks + [
        Check(f"{name}: {what}", _verdict(ok, advice), found, advice) for what, ok, found, advice in plausibility(robot)
    ]


def _verdict(ok: bool, advice: str) -> CheckVerdict:
    """What is well and still calls for advice is a warning."""
    return CheckVerdict.FAILED if not ok else CheckVerdict.WARNING if advice else CheckVerdict.OK
