"""`WinchTrials`: trials in which one drive must stop by itself or on command (`TrialBench`).

Made for `fidim commission`: without load, at low speed, with a person there. What a trial changes in the drive is put
right by the next `configure`, which writes and reads back everything.
"""

from drivers.cia402.motion.winch import Cia402Winch
from drivers.cia402.profile.machine import Command
from drivers.cia402.profile.words import Mode, controlword
from drivers.cia402.watch.without_power import acknowledge_fault, read_state
from drivers.cia402.wire.sdo import SdoRefusedError
from drivers.ports import DriveState, Trial, TrialStop

SLOW_RAMPS = (1, 5)
"""option codes that stop on the move's own ramp (6084), not on the quick-stop ramp (6085)"""
NEEDS = {
    Trial.POSITION_LIMIT: ((0x607D, 1), (0x607D, 2)),
    Trial.FOLLOWING_ERROR: ((0x6065, 0),),
}
"""objects that are written to provoke it"""
NARROW = 1
"""counts of following error that a drive in motion always exceeds"""


class WinchTrials:
    """One winch on the bench. Its bus has one host: what is withheld from one drive is withheld from all."""

    def __init__(self, winch: Cia402Winch, by: str) -> None:
        """by: the person who is there, in whose name faults are acknowledged."""
        self._winch = winch
        self._master = winch.master
        self._by = by

    @property
    def brake_time(self) -> float:
        """s that the brake takes, by the time that a step of the drive may take."""
        return min(self._winch.config.step_timeout, 1.0)

    def lacks(self, trial: Trial) -> str:
        """Why this trial cannot be made on this drive; empty where it can."""
        config, able = self._winch.config, self._winch.link.able
        for index, sub in NEEDS.get(trial, ()):
            if not able.can_write(index, sub):
                return f"{index:04X}:{sub:X} cannot be written to this drive"
        if trial is Trial.HALT and config.mode is Mode.CYCLIC_POSITION:
            return "in cyclic position mode a hold is the host's own ramp"
        return ""

    def stop(self, trial: Trial, speed: float, acceleration: float) -> TrialStop:
        """By the config: the reaction that the drive was told, and its ramp. `speed` does not matter to it.

        A drive that cannot be told its quick-stop ramp (6085) may stop on the move's: its proof makes the winch slower.
        """
        config = self._winch.config
        option = {Trial.HALT: config.stop.halt, Trial.FOLLOWING_ERROR: config.stop.fault}.get(
            trial, config.stop.quick_stop
        )
        if trial is Trial.POSITION_LIMIT:
            option = 1
        own = option in SLOW_RAMPS or not self._winch.link.able.can_write(0x6085)
        ramp = min(acceleration, config.quick_stop_deceleration) if own else config.quick_stop_deceleration
        withheld = trial in (Trial.LOST_HEARTBEAT, Trial.LOST_SYNC)
        return TrialStop(config.host_timeout if withheld else 0.0, ramp)

    def room(self, length: float, way: float) -> bool:
        """By the rig file's length limits."""
        low, high = self._winch.config.length_limits
        return low <= length <= high and low <= length + way <= high

    async def arm(self, trial: Trial, length: float) -> None:
        """Bring the nearer of the drive's position limits to this length."""
        if trial is not Trial.POSITION_LIMIT:
            return
        here = await self._winch.ask_length()
        scale = self._winch.config.scale
        limit, count = scale.count(length), scale.count(here)
        await self._winch.link.sdo.write_verified(0x607D, 2 if limit > count else 1, limit)

    async def start(self, length: float, speed: float, acceleration: float) -> None:
        """Prepare and begin the move, out of the guards' sight."""
        self._winch.on_trial = True
        await self._winch.prepare(speed, acceleration)
        await self._winch.move_to(length, speed, acceleration)

    async def provoke(self, trial: Trial) -> None:
        """Withhold or command it."""
        winch, drive = self._winch, self._winch.drive
        match trial:
            case Trial.QUICK_STOP:
                winch.quick_stop()
            case Trial.HALT:
                drive.send(drive.begin(), controlword(Command.ENABLE_OPERATION, halt=True))
            case Trial.LOST_HEARTBEAT:
                self._master.without_heartbeat = True
            case Trial.LOST_SYNC:
                self._master.without_sync = True
            case Trial.FOLLOWING_ERROR:
                if winch.link.able.can_write(0x6066):
                    await winch.link.sdo.write(0x6066, 0, 0)
                await winch.link.sdo.write(0x6065, 0, NARROW)
            case Trial.POSITION_LIMIT:
                pass  # it lies on the way

    def end(self) -> None:
        """SYNC and heartbeat go on."""
        self._master.without_sync = self._master.without_heartbeat = False

    def leave(self) -> None:
        """As `end`; the winch tells again where it was told to be."""
        self.end()
        self._winch.on_trial = False

    async def recover(self) -> None:
        """Acknowledge a fault, by SDO. Raises DeviceError where the drive stays in it."""
        link = self._winch.link
        if await read_state(link) is DriveState.FAULT:
            await acknowledge_fault(link, self._winch.clock, self._winch.config.device, self._by)

    async def identity(self) -> tuple[int, ...]:
        """1018:1 to 4; 0 for what the drive does not have."""
        return tuple([await self._told(sub) for sub in (1, 2, 3, 4)])

    async def _told(self, sub: int) -> int:
        link = self._winch.link
        try:
            return await link.sdo.read(0x1018, sub) if link.able.has(0x1018, sub) else 0
        except SdoRefusedError:
            return 0
