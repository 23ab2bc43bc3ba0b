"""Every error of this project, as one tree.

    FidimError                 what failed, whose fault it is, what to do
    ├── SetupError             the user's files or options; exit 2
    │   └── FileError          … with file, place, what was found, what is allowed
    ├── RefusedError           the answer is a refusal, or a check failed; exit 1
    │   └── InfeasibleError    a pose, plan or window that the physics does not allow
    ├── HardwareError          a device, bus or guard stopped it; exit 3
    │   ├── DeviceError        one named device: does not answer, answers wrongly, reports a fault
    │   ├── BusError           the bus as a whole
    │   └── GuardError         a guard tripped: limit, staleness, emergency stop
    └── OurBugError            a promise of our own code was broken; exit 3, please report

A message is a sentence for a person: which file, key, device, window, time; what was found and what is allowed.
"""

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

_NAME, _PLACE, _MESSAGE = 160, 100, 480
"""characters of a file's name, of a place in it, of all that is said: a file may hold names and values of any length"""


class FidimError(Exception):
    """Something went wrong; the message says what, and `hint` what to do about it."""

    exit_code = 1

    def __init__(self, message: str, *, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint

    def __str__(self) -> str:
        stop = "." if self.hint and not self.message.endswith((".", "?", "!", ":", "…")) else ""
        return f"{self.message}{stop} {self.hint}".strip()


class SetupError(FidimError):
    """The user's files, options or installation are wrong (exit 2)."""

    exit_code = 2


class FileError(SetupError):
    """A file is not what its format says: names the file and the place in it, in fewer than 500 characters."""

    def __init__(self, path: Path | str, place: str, problem: str, *, hint: str = "") -> None:
        name = str(path)
        name = name if len(name) <= _NAME else f"…{name[1 - _NAME :]}"
        where = f"{name}: {_cut(place, _PLACE)}: " if place else f"{name}: "
        super().__init__(_cut(where + problem, _MESSAGE - len(hint)), hint=hint)
        self.path = Path(path)
        self.place = place
        self.problem = problem

    def named_by(self, file: Path, key: str) -> "FileError":
        """The same of a file that a key of another file names: the name may be what is wrong."""
        hint = f"{self.hint} The key {key} of {_cut(file.name, _PLACE)} names it.".strip()
        return FileError(self.path, self.place, self.problem, hint=hint)


def _cut(text: str, longest: int) -> str:
    return text if len(text) <= longest else f"{text[: longest - 1]}…"


class RefusedError(FidimError):
    """The command was carried out, and its answer is no (exit 1)."""

    exit_code = 1


class InfeasibleError(RefusedError):
    """The physics does not allow what was asked: no equilibrium, a slack cable, a singular pose."""


@contextmanager
def of_file(path: Path | None) -> Generator[None]:
    """What physics does not allow is said of the file that asks for it; None: of none."""
    try:
        yield
    except InfeasibleError as error:
        if path is not None:
            error.message = f"{path}: {error.message}"
        raise


class HardwareError(FidimError):
    """A device, the bus or a guard stopped it (exit 3)."""

    exit_code = 3


class DeviceError(HardwareError):
    """One device does not answer, answers wrongly, or reports a fault."""

    def __init__(self, device: str, problem: str, *, hint: str = "") -> None:
        super().__init__(f"{device}: {problem}", hint=hint)
        self.device = device


class BusError(HardwareError):
    """The bus itself failed: unplugged, off, or its receiver died."""


class GuardError(HardwareError):
    """A guard tripped; the robot is held and stays so until somebody resets it."""


class OurBugError(FidimError):
    """A promise of our own code was broken: not the user's fault."""

    exit_code = 3
