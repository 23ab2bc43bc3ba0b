"""`CyclicWinch`: the Winch port in cyclic synchronous position mode: the host sends a target before every SYNC.

All winches take their targets at the same SYNC, so they go in step from the first cycle to the last. The way counts
SYNCs, not time: a late host makes all of them slow, never one of them early. A SYNC after a late one comes a tenth of a
cycle early at most (`CanopenMaster.run`), so that is how far a drive is from its last target when it is sampled: 0.1 mm
at 0.3 m/s and 250 Hz; at more than 0.9 of its highest speed it cannot make up for that, and may be a whole cycle behind
(1.2 mm), all the same on the line. Without new targets a drive stays at the
last, and a host that is lost stops it as in every mode (1016, 6007). Where drives have it, this is the mode for moves
that must keep cables taut; profile position (`Cia402Winch`) asks less of drive and bus.
"""

from dataclasses import replace

from drivers.cia402.dictionary.config import WinchConfig
from drivers.cia402.motion.moves import refuse_beyond_limits
from drivers.cia402.motion.orders import begin_hold, begin_move
from drivers.cia402.motion.winch import STANDSTILL, Cia402Winch
from drivers.cia402.profile.machine import Command, state_of
from drivers.cia402.profile.scale import wrap32
from drivers.cia402.profile.words import Mode, controlword
from drivers.cia402.watch.master import CanopenMaster
from drivers.ports import DriveState, WinchSample
from drivers.trajectory import Trajectory
from fidim_lab.errors import DeviceError

_ARRIVED = 2e-4
"""m by which the encoder may be off the last target: a fifth of what procedures allow"""


class CyclicWinch(Cia402Winch):
    """One winch. Made and used as `Cia402Winch`; its config's mode is cyclic position."""

    def __init__(self, config: WinchConfig, master: CanopenMaster, *, takes_over: bool = False) -> None:
        """As `Cia402Winch`."""
        super().__init__(config, master, takes_over=takes_over)
        self._demand = 0.0
        """where the drive is asked to be, counts, not wrapped"""
        self._way: tuple[int, Trajectory, int] | None = None
        """the command it belongs to, the way (counts, s since its beginning), and the SYNCs since then"""
        master.before_sync(self._stream)

    async def prepare(self, speed: float, acceleration: float) -> None:
        """Look at the limits; nothing is sent. Raises RefusedError beyond them."""
        refuse_beyond_limits(self.config, self.config.length_limits[0], speed, acceleration)
        self._ramp = acceleration
        self._prepared = (speed, acceleration)

    async def move_to(self, length: float, speed: float, acceleration: float) -> None:
        """Begin to move at the next SYNC. Winches that are told so within one cycle go in step.

        Raises RefusedError beyond limits; DeviceError where the drive has no power, still moves, or does not follow.
        """
        refuse_beyond_limits(self.config, length, speed, acceleration)
        if self._moving:
            raise DeviceError(self.config.device, "is still moving.", hint="Hold it first.")
        order = begin_move(self.drive, self.config.device)
        await self.prepare(speed, acceleration)
        goal = self._demand + wrap32(self._scale.count(length) - wrap32(round(self._demand)))
        per_metre = self._scale.counts_per_metre
        self._way = order, Trajectory(0.0, self._demand, goal, speed * per_metre, acceleration * per_metre), 0
        await self.drive.follow(order)

    async def hold(self) -> None:
        """Stop on the ramp of the last move and stand; returns at standstill.

        Raises DeviceError where the drive has no power. Where its state is unknown, a quick stop is sent instead.
        """
        order, values = begin_hold(self.drive, self.config.device)
        if state_of(values.statusword) is DriveState.OPERATION_ENABLED and (way := self._way) is not None:
            position, velocity = way[1].at(way[2] * self.master.period)
            stop = Trajectory.stopping(0.0, position, velocity, self._ramp * self._scale.counts_per_metre)
            self._way = order, stop, 0
            seconds = self.config.step_timeout + 2.0 * stop.end
            await self.drive.word(order, lambda _word: not self._moving, "the end of the stop ramp", seconds)
        slowest = self.config.drive_velocity(STANDSTILL * self.config.max_speed)
        await self.drive.stand_still(order, slowest, self.config.step_timeout)
        self.stands()

    def latest(self) -> WinchSample | None:
        """As every winch; the target is reached when the way has ended and the encoder is there."""
        sample, values = super().latest(), self.link.values
        if sample is None or values is None:
            return sample
        off = abs(wrap32(values.position - wrap32(round(self._demand)))) / self._scale.counts_per_metre
        return replace(sample, target_reached=not self._moving and off <= _ARRIVED)

    async def _take_over(self, order: int) -> None:
        """The present position is the first target; released from halt, the drive follows it."""
        self._demand = float(self.drive.healthy().position)
        self._way = None
        self.drive.target = wrap32(round(self._demand))
        self.drive.send(order, controlword(Command.ENABLE_OPERATION))
        self.stands()
        await self.drive.follow(order)

    @property
    def _moving(self) -> bool:
        way = self._way
        return way is not None and way[0] == self.drive.order and way[2] * self.master.period < way[1].end

    def _on(self, way: Trajectory, velocity: float) -> Trajectory:
        """The rest of a way in cable (m): from the next SYNC on, if no other is late."""
        per_metre, now = self._scale.counts_per_metre, self.master.clock.now()
        start, target = (self._scale.length(round(place)) for place in (self._demand, way.target))
        speed, ramp = way.speed / per_metre, way.acceleration / per_metre
        return Trajectory(now, start, target, speed, ramp, self._scale.velocity(velocity))

    def _stream(self) -> None:
        """Just before each SYNC: the target that the drive takes at it."""
        values = self.link.values
        if not self.link.brought_up or values is None:
            return
        cyclic = self.link.mode is Mode.CYCLIC_POSITION and values.mode == Mode.CYCLIC_POSITION
        if not cyclic or state_of(values.statusword) is not DriveState.OPERATION_ENABLED:
            self._way, self._demand = None, float(values.position)  # whenever it begins to follow, it begins here
            return
        if (way := self._way) is not None:
            order, trajectory, steps = way
            if order != self.drive.order:
                self._way = None  # overtaken: a stop by the drive itself
                return
            self._way = order, trajectory, steps + 1
            self._demand, velocity = trajectory.at((steps + 1) * self.master.period)
            self._commanded = self._on(trajectory, velocity)
        self.drive.target = wrap32(round(self._demand))
        self.link.send_target(self.drive.target)


def make_winch(config: WinchConfig, master: CanopenMaster, *, takes_over: bool = False) -> Cia402Winch:
    """The winch that the config's mode asks for. Raises SetupError (see `CanopenMaster.add_node`)."""
    kind = CyclicWinch if config.mode is Mode.CYCLIC_POSITION else Cia402Winch
    return kind(config, master, takes_over=takes_over)
