"""What this user may: keep the sockets of a service in a folder of their own, open the serial ports that are there.

`check_permissions` belongs to `fidim doctor`. It opens nothing: another program may be using a port.
"""

import os
from pathlib import Path

from serial.tools.list_ports import comports

from fidim_lab.app.doctor.checks import Check, CheckVerdict
from fidim_lab.app.service.place import runtime_folder
from fidim_lab.errors import FidimError

NAME = "permissions"


def check_permissions() -> Check:
    """A warning where a serial port is closed to this user: it may be none of ours. Failed without a place to meet."""
    try:
        folder = runtime_folder()
    except FidimError as error:
        return Check(NAME, CheckVerdict.FAILED, error.message, error.hint)
    ports = [Path(port.device) for port in comports()]
    closed = [port for port in ports if not os.access(port, os.R_OK | os.W_OK)]
    if closed:
        found = f"{', '.join(map(str, closed))} cannot be opened by you"
        return Check(NAME, CheckVerdict.WARNING, found, f"for adapters there: {_remedy(closed)}")
    opened = f", serial {', '.join(map(str, ports))}" if ports else ", no serial port is plugged in"
    return Check(NAME, CheckVerdict.OK, f"sockets in {folder}{opened}")


def _remedy(closed: list[Path]) -> str:
    """The groups that own them are named."""
    groups = sorted({group for port in closed if (group := _group(port))})
    if not groups or groups == ["root"]:
        return "ask your administrator for access"
    return f"sudo usermod -aG {','.join(groups)} $USER, then log in again"


def _group(port: Path) -> str:
    try:
        return port.group()
    except (KeyError, OSError):
        return ""
