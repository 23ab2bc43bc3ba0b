"""What lies beside the windows of a run, for every command that makes one: raw bytes, devices.json, manifest.json.

records = RunRecords(folder, rig, write_inputs)      # write_inputs: writes plan.toml and whatever else belongs there
bus.tap(records.on_frame)
try:
    report = await run_procedure(…, listeners=(records.on_event, …), guards=(LogGuard(records.error),))
    await records.after_run()                  # while the rig is still open
finally:
    records.close()                            # or, while a control loop goes on: await records.closed()
"""

from collections.abc import Callable
from pathlib import Path

from drivers.canbus.transport import CanFrame
from drivers.disk import InlineDisk
from drivers.mocap.source import StreamMarkerSource
from drivers.ports import Disk, Rig
from fidim_lab.app.formats.devices_file import devices_of, read_back, write_devices
from fidim_lab.app.formats.manifest import write_manifest
from fidim_lab.data.rigs.rig import RigFile
from fidim_lab.errors import FidimError
from procedures.events import Event, RunStarted
from procedures.recording.raw_logs import RawLogs

LINE, FRAMES = 45.0, 3.0
"""bytes of a CAN frame in its log; frames of a winch in each cycle. Four winches at 100 Hz have 11.6 in all, SDO and
heartbeats included; with RPDOs of cyclic position mode 15.6"""
PACKET, MARKER, ROW = 300.0, 75.0, 520.0
"""bytes of a motion-capture packet beside its markers, of each marker, and of a row of a window (csv and mcap)"""
MANIFEST_WITHIN = 600.0
"""s: as long as no disk takes to read a day's run"""


def bytes_a_second(file: RigFile) -> float:
    """How fast a run of this rig fills the disk, bytes/s, as if it recorded all the time."""
    bus = file.bus.sync_rate * LINE * (1.0 + FRAMES * (len(file.winches) + 1))
    return bus + file.motion_capture.rate * (PACKET + MARKER * len(file.robot.markers) + ROW)


class RunRecords:
    """Opens when the run's folder is there, also for a run that is resumed; taps and listener never raise."""

    def __init__(self, folder: Path, rig: Rig, write_inputs: Callable[[], None], disk: Disk | None = None) -> None:
        """write_inputs: writes what belongs beside the run into the folder; may raise OSError or FidimError.

        disk: takes all of it.
        """
        self._disk = InlineDisk() if disk is None else disk
        self._folder = folder
        self._rig = rig
        self._write_inputs = write_inputs
        self._logs = RawLogs(folder, self._disk)
        self._unwritten: str | None = None
        self._open = False
        if isinstance(rig.markers, StreamMarkerSource):
            rig.markers.tap(self._logs.on_packet)

    def on_frame(self, frame: CanFrame) -> None:
        """A tap of the bus."""
        self._logs.on_frame(frame)

    def on_event(self, event: Event) -> None:
        """A listener of the run: begins when it does."""
        if not isinstance(event, RunStarted):
            return
        self._open = True
        devices = devices_of(self._rig)
        self._disk.put(lambda: self._carry_out(self._logs.open))
        self._disk.secure(lambda: self._carry_out(lambda: write_devices(self._folder, devices), self._write_inputs))

    def error(self) -> str | None:
        """Why the raw logs, or what else belongs beside the run, are not whole: for `LogGuard`."""
        return self._unwritten or self._logs.error

    async def after_run(self) -> None:
        """Read the drives' objects once more into devices.json. Raises HardwareError when the disk fails."""
        if self._open:
            devices = await read_back(self._rig)
            await self._disk.do(lambda: write_devices(self._folder, devices))

    def close(self) -> None:
        """Close the logs and write the manifest; may be called twice. Raises HardwareError when the disk fails."""
        if self._ends():
            write_manifest(self._folder)

    async def closed(self) -> None:
        """As `close`, beside the control loop: a manifest reads all that was recorded."""
        if self._ends():
            await self._disk.do(lambda: write_manifest(self._folder), longest=MANIFEST_WITHIN)

    def _ends(self) -> bool:
        """Whether there is anything to write a manifest of."""
        self._logs.close()
        was_open, self._open = self._open, False
        return was_open

    def _carry_out(self, *jobs: Callable[[], object]) -> None:
        """A job: what goes wrong is said by a guard."""
        try:
            for job in jobs:
                job()
        except (OSError, FidimError) as error:
            self._unwritten = self._unwritten or str(error)
