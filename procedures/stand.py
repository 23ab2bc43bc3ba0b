"""What step handlers work with: the rig, the robot, the settings, the recorder, the run folder. Made once for a run."""

from collections.abc import Callable
from dataclasses import dataclass, field

from drivers.disk import InlineDisk
from drivers.ports import Disk, MarkerFrame, Prompt, Rig, WinchSample
from fidim_lab.data.records import Robot
from fidim_lab.errors import DeviceError
from procedures.expected.limits import RestLimits
from procedures.expected.nominal_rest import NominalRest
from procedures.expected.place_check import PlaceHistory
from procedures.recording.recorder import Recorder
from procedures.recording.resumption import LastPlace
from procedures.recording.run_folder import RunFolder
from procedures.settings import Settings


class MarkerNews:
    """When the main marker gave a new position, in every phase: also while somebody may stand before a camera."""

    def __init__(self) -> None:
        self.at: float | None = None
        """monotonic s; None before the first"""
        self._last: tuple[float, float, float] | None = None

    def take(self, frame: MarkerFrame | None, now: float) -> None:
        """The newest frame; one that is hidden, or where the last one was, is no news."""
        if frame is not None and frame.main not in (None, self._last):
            self._last, self.at = frame.main, now


@dataclass(frozen=True, eq=False)
class Stand:
    """Everything a handler may use."""

    rig: Rig
    robot: Robot
    settings: Settings
    workspace: RestLimits
    recorder: Recorder
    folder: RunFolder
    newton_per_ampere: tuple[float, ...]
    progress: Callable[[float], None]
    """how far the step is, 0 to 1"""
    prompted: Callable[[str, Prompt], None]
    """a question is about to be asked in a window"""
    rest: NominalRest | None = None
    """where the platform should rest; None: not known"""
    places: PlaceHistory = field(default_factory=PlaceHistory)
    place: LastPlace | None = None
    """where an earlier process left the robot; checked before anything moves"""
    news: MarkerNews = field(default_factory=MarkerNews)
    disk: Disk = field(default_factory=InlineDisk)
    """takes whatever is to be written"""

    def sample(self, winch: int) -> WinchSample:
        """The newest sample of a winch. Raises DeviceError when it is too old to be believed."""
        device = self.rig.winches[winch]
        sample = device.latest()
        if sample is None:
            raise DeviceError(device.name, "has never reported", hint="Check its power, its node id and the bus.")
        age = self.rig.clock.now() - sample.t
        if age > self.settings.guard.sample_age:
            raise DeviceError(
                device.name,
                f"has not answered for {age:.2f} s; at most {self.settings.guard.sample_age:g} s is allowed",
                hint="Check its power and the bus.",
            )
        return sample

    def samples(self) -> tuple[WinchSample, ...]:
        """The newest sample of every winch. Raises DeviceError as `sample`."""
        return tuple(self.sample(winch) for winch in range(len(self.rig.winches)))

    def lengths(self) -> tuple[float, ...]:
        """Cable lengths, m. Raises DeviceError as `sample`."""
        return tuple(sample.length for sample in self.samples())

    def tensions(self) -> tuple[float, ...]:
        """Cable tensions from the newest motor currents, N. Raises DeviceError as `sample`."""
        return tuple(
            factor * sample.current for factor, sample in zip(self.newton_per_ampere, self.samples(), strict=True)
        )
