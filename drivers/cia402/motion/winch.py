"""`Cia402Winch`: the Winch port on one CANopen drive in profile position mode.

Cable lengths and sentences outside, encoder counts and controlwords inside. Stops are one frame each, never wait, and
overtake whatever is in progress: a move that was waiting ends with an error and sends nothing more.
"""

import contextlib
from dataclasses import replace

from drivers.cia402.bring_up.bringup import bring_up, forgotten, stops_rest_on
from drivers.cia402.bring_up.takeover import take_over
from drivers.cia402.bring_up.zero import Zeroed, read_zero
from drivers.cia402.dictionary.config import WinchConfig
from drivers.cia402.dictionary.requirements import Graded
from drivers.cia402.dictionary.settings import Setting, SettingCheck
from drivers.cia402.motion.drive import Drive
from drivers.cia402.motion.moves import make_sample, profile, refuse_beyond_limits
from drivers.cia402.motion.orders import begin_hold, begin_move, quick_stop
from drivers.cia402.profile.last_motion import LastMotion
from drivers.cia402.profile.machine import Command, state_of
from drivers.cia402.profile.scale import LengthScale
from drivers.cia402.profile.signals import INPUTS, STO_HINT, STO_SAYS
from drivers.cia402.profile.words import Mode, controlword
from drivers.cia402.watch.health import HealthPoll
from drivers.cia402.watch.master import CanopenMaster
from drivers.cia402.watch.node import NodeLink
from drivers.cia402.wire.nmt import NmtCommand
from drivers.cia402.wire.pdo import Mappable
from drivers.ports import Clock, DriveState, WinchSample
from drivers.trajectory import Trajectory
from fidim_lab.errors import BusError, DeviceError

_TRAVEL = 2e-3
"""m of cable that a winch must go one way for friction to have turned"""
_SETTLED = 0.2
"""s after a command's end in which a drive's own set-point may still come to rest: three times what a guard allows"""
_HALT_RAMP = 0x6084
STANDSTILL = 0.005
"""of the highest speed"""


class Cia402Winch:
    """One winch. Make it before `CanopenMaster.run()` starts; configure, enable and move while that runs."""

    def __init__(self, config: WinchConfig, master: CanopenMaster, *, takes_over: bool = False) -> None:
        """Registers the node with the master. Raises SetupError (see `CanopenMaster.add_node`).

        takes_over: a drive that an earlier host has left holding its load is not refused, and keeps holding it.
        """
        self.config = config
        self.checks: tuple[SettingCheck, ...] = ()
        """of the last bring-up that succeeded: wanted and found"""
        self.grades: tuple[Graded, ...] = ()
        """likewise: how the drive meets each requirement"""
        self.master = master
        self.clock: Clock = master.clock
        self._configure = take_over if takes_over else bring_up
        self._scale: LengthScale = config.scale
        self.drive = Drive(config, master)
        self.link: NodeLink = self.drive.link
        """the bus side: counters, emergencies, heartbeat"""
        self._ramp = config.max_acceleration
        self._prepared: tuple[float, float] | None = None
        self.zeroed: Zeroed | None = None
        """what `set_length` found"""
        self.link.motion = LastMotion(self._scale.magnitude(_TRAVEL))
        self._health = HealthPoll(
            self.link, master.clock, self._scale, config.temperature, config.sto, self._kept_settings, self._standing
        )
        self._commanded: Trajectory | None = None
        self._forced = False
        """stopped by NMT: PDOs are off"""
        self.powered = False
        """whether it was given power here, and that was not taken since"""
        self.on_trial = False
        """its stops are being tried (`trials`), which looks at it itself"""

    @property
    def name(self) -> str:
        """As in the rig file."""
        return self.config.name

    async def configure(self) -> None:
        """Identity, limits, stop reactions, PDO mapping: written, read back; power is never given.

        `CanopenMaster.run()` must be running. Raises DeviceError naming every object that does not hold, or where the
        drive has power (unless this winch takes over).
        """
        self.drive.begin()
        self._prepared = self._commanded = None
        self._forced = self.powered = False
        found = await self._configure(self.master, self.link, self.config)
        self.checks, self.grades = found.checks, found.grades

    async def set_length(self, length: float) -> None:
        """The cable is `length` (m) long where the encoder stands now. Configure anew before power: limits go by it.

        Raises RefusedError outside the length limits, DeviceError while the drum turns or the drive does not answer.
        """
        zeroed = await read_zero(self.link.sdo, self.config, self.drive.believed(), length)
        self.config = self.config.changed(home_count=zeroed.count, home_length=length, zero=None)
        self._scale, self._prepared, self._commanded, self.zeroed = self.config.scale, None, None, zeroed

    async def enable(self) -> None:
        """Power on, standing: the drive is enabled halted, then takes the present position as its set-point.

        Raises DeviceError where there is a fault (it is never reset here) or a step is not confirmed in time.
        """
        if state_of(self.drive.healthy().statusword) is DriveState.OPERATION_ENABLED:
            await self.hold()
            return
        order = self.drive.begin()
        if self.config.sto is not None and self.config.sto.is_active(await self.link.sdo.read(INPUTS)):
            raise DeviceError(self.config.device, f"cannot be enabled: {STO_SAYS}.", hint=STO_HINT)
        if lost := await forgotten(self.link, self.config, self.master.host_id):
            raise DeviceError(
                self.config.device,
                f"has lost its settings, so it must have restarted: {'; '.join(lost)}.",
                hint="Configure it again.",
            )
        self.stands()
        self.powered = True
        await self.drive.walk_to_operation(order)
        await self._take_over(order)

    async def _take_over(self, order: int) -> None:
        """Enabled and halted: from now on the drive stands by a set-point of ours."""
        await self.drive.clear_acknowledgement(order)
        await self.drive.take_set_point(order, self.drive.healthy().position, self.stands)

    async def prepare(self, speed: float, acceleration: float) -> None:
        """Write and read back speed (m/s) and acceleration (m/s²) of the next move; nothing moves.

        Raises RefusedError beyond the winch's limits (then nothing is sent), DeviceError where the drive does not keep
        them.
        """
        refuse_beyond_limits(self.config, self.config.length_limits[0], speed, acceleration)
        self._prepared = None
        for setting in self.link.able.fitting(profile(self.config, speed, acceleration)):
            await self.link.sdo.write_verified(setting.index, setting.sub, setting.wanted)
        self._ramp = acceleration
        self._prepared = (speed, acceleration)

    async def move_to(self, length: float, speed: float, acceleration: float) -> None:
        """Start a move to a cable length (m), at most at `speed` (m/s); returns once the drive has the set-point.

        What `prepare` has set is not written again. Raises RefusedError for a length, speed or acceleration (m/s²)
        beyond the winch's limits (then nothing is sent), DeviceError where the drive has no power, does not take the
        set-point, or a stop overtook the move.
        """
        refuse_beyond_limits(self.config, length, speed, acceleration)
        order = begin_move(self.drive, self.config.device)
        if self._prepared != (speed, acceleration):
            await self.prepare(speed, acceleration)

        def begins() -> None:
            now = self.clock.now()
            place, velocity = (self._commanded or Trajectory.standing(now, length)).at(now)
            self._commanded = Trajectory(now, place, length, speed, acceleration, velocity)

        await self.drive.take_set_point(order, self._scale.count(length), begins)

    async def hold(self) -> None:
        """Stop on the ramp and stand with power on; returns at standstill.

        Raises DeviceError where the drive has no power. Where its state is unknown, a quick stop is sent instead.
        """
        order, values = begin_hold(self.drive, self.config.device)
        if state_of(values.statusword) is DriveState.OPERATION_ENABLED:
            self.drive.send(order, controlword(Command.ENABLE_OPERATION, halt=True))
            self._stops(self._ramp)
        speed = abs(self.config.cable_speed(values.velocity))
        slowest = self.config.drive_velocity(STANDSTILL * self.config.max_speed)
        await self.drive.stand_still(order, slowest, self.config.step_timeout + speed / self._ramp)
        self.stands()

    def quick_stop(self, *, again: bool = False) -> None:
        """Stop on the quick-stop ramp: one frame, never waits.

        again: the place that is expected stays as it was, and it goes by SDO, too.
        """
        if not again:
            self._stops(self.config.quick_stop_deceleration)
        quick_stop(self.drive, again=again)

    def force_stop(self) -> None:
        """NMT stop, at which the drive does what 6007 says: one frame, never waits.

        Where it is seen to be enabled still, a halt comes before: what 6007 says is the quick stop that it has not
        obeyed. It halts as steeply as a quick stop, not on the ramp of its move. One that is not seen may stand in its
        quick stop, from which that word could enable it again.
        """
        order, sample = self.drive.begin(), self.latest()
        enabled = sample is not None and sample.state is DriveState.OPERATION_ENABLED  # UNKNOWN where it is old
        if enabled and self.link.mode is not Mode.PROFILE_TORQUE:  # where a halt takes the torque away
            with contextlib.suppress(BusError):
                ramp = self.config.drive_acceleration(self.config.quick_stop_deceleration)
                self.link.post(_HALT_RAMP, 0, ramp)
                self.drive.send(order, controlword(Command.ENABLE_OPERATION, halt=True))
        self._forced = True
        self.link.send_nmt(NmtCommand.STOP)

    def fall_silent(self) -> float:
        """No host's heartbeat and no SYNC from now on, to any drive of the bus: each does what 6007 says."""
        self.master.silent = True
        return self.config.host_timeout + self.config.max_speed / self.config.quick_stop_deceleration

    async def ask_length(self) -> float:
        """By SDO. A node that NMT has stopped is made pre-operational for it: PDOs stay off. Raises DeviceError."""
        if self._forced:
            self.link.send_nmt(NmtCommand.PRE_OPERATIONAL)
        return self._scale.length(await self.link.sdo.read(Mappable.POSITION.index))

    def power_off(self) -> None:
        """Take the power away: one frame, never waits."""
        self._commanded, self.powered = None, False
        self.drive.send(self.drive.begin(), controlword(Command.DISABLE_VOLTAGE))

    @property
    def commanded(self) -> Trajectory | None:
        """The commanded cable length (m); None before power, and while something else than a winch uses the drive."""
        return None if self.on_trial else self._commanded

    def stands(self) -> None:
        """From now on the cable is to be where it is now."""
        if (sample := self.latest()) is not None:
            self._commanded = Trajectory.standing(self.clock.now(), sample.length)

    def free(self) -> None:
        """No command is in force: taking up slack moves the drive by itself."""
        self._commanded = None

    def _kept_settings(self) -> tuple[Setting, ...]:
        """Nothing while stops are tried, which changes some."""
        return () if self.on_trial else stops_rest_on(self.link, self.config, self.master.host_id)

    def _standing(self) -> Trajectory | None:
        """The command by which it has been at rest for a while, with power."""
        command, values = self.commanded, self.link.values
        enabled = values is not None and state_of(values.statusword) is DriveState.OPERATION_ENABLED
        return command if enabled and command is not None and self.clock.now() > command.end + _SETTLED else None

    def _stops(self, deceleration: float) -> None:
        """From what the encoder tells, or from where it was told to be where that is too old."""
        now, sample = self.clock.now(), self.latest()
        if self._commanded is None or sample is None:
            return
        known = sample.state is not DriveState.UNKNOWN
        place, velocity = (sample.length, sample.velocity) if known else self._commanded.at(now)
        if known:
            place += velocity * (now - sample.t)
        self._commanded = Trajectory.stopping(now, place, velocity, deceleration)

    def latest(self) -> WinchSample | None:
        """The newest sample, None before the first. One that is too old to be believed has the state UNKNOWN."""
        values = self.link.values
        if values is None:
            return None
        state = DriveState.UNKNOWN if self.drive.stale(values) else state_of(values.statusword)
        heartbeat, counters = self.link.heartbeat, self.link.counters
        health = self._health.believed()
        doubt = self._health.doubt if state is not DriveState.UNKNOWN else ""
        faults = filter(None, (STO_SAYS if health.sto else "", self.drive.fault(), doubt))
        return replace(
            make_sample(values, self.config, self._scale, state, health),
            fault="; ".join(faults),
            heartbeat_age=None if heartbeat is None else max(self.clock.now() - heartbeat.t, 0.0),
            emergencies=counters.emergencies,
            lost=counters.lost,
            moved=0 if self.link.motion is None else self.config.direction * self.link.motion.direction,
            blind=self._health.blind,
        )

    async def watch_health(self) -> None:
        """Ask the drive what its PDOs do not carry, for ever: a task beside `CanopenMaster.run()`."""
        await self._health.run()
