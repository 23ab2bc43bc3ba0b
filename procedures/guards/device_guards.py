"""Guards of other devices: the bus, the release, load cells, an inclinometer."""

from collections.abc import Sequence

from drivers.ports import Bus, Gauge, Release, Rig
from procedures.guards.guard import Guard, Observation, Reacting
from procedures.settings import GuardSettings, Reaction
from procedures.steps import Phase


class OtherMasterGuard:
    """Somebody else commands the drives, or a second node answers with the id of one: no stop of ours is safe then."""

    name = "other master"
    reaction = Reaction.QUICK_STOP

    def __init__(self, bus: Bus) -> None:
        self._bus = bus

    def look(self, seen: Observation) -> str | None:
        """The other master or node, in words; None without one."""
        return self._bus.strangers or None


class BusRemarkGuard:
    """An error on the bus that was recovered from; reported again when it happens again."""

    name = "bus remark"
    reaction = Reaction.WARN
    QUIET = 10.0
    """s without a new one after which the next is told"""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._last = bus.remark
        self._new_at = float("-inf")

    def look(self, seen: Observation) -> str | None:
        """The fault in words while it lasts, else None."""
        remark = self._bus.remark
        if remark != self._last:
            self._last, self._new_at = remark, seen.t
        return remark if remark and seen.t - self._new_at <= self.QUIET else None


class ReleaseGuard:
    """The release let go by itself, or was lost while it held."""

    name = "release"
    reaction = Reaction.HOLD

    def __init__(self, release: Release) -> None:
        self._release = release

    def look(self, seen: Observation) -> str | None:
        """The latched fault in words, or None."""
        return f"{self._release.name}: {self._release.fault}" if self._release.fault else None


class GaugeGuard:
    """A measuring device has stopped telling; counted while its readings are of use."""

    name = "gauges"
    reaction = Reaction.WARN

    def __init__(self, gauges: Sequence[Gauge]) -> None:
        self._gauges = gauges

    def look(self, seen: Observation) -> str | None:
        """The first whose newest reading is too old."""
        if seen.phase not in (Phase.RESTING, Phase.RECORDING):
            return None
        for gauge in self._gauges:
            reading = gauge.latest()
            if reading is None:
                return f"{gauge.name} has sent nothing so far"
            if (age := seen.t - reading.t) > gauge.age:
                return f"{gauge.name} has sent nothing for {age:.2f} s; at most {gauge.age:g} s is allowed"
        return None


def device_guards(rig: Rig, settings: GuardSettings) -> tuple[Guard, ...]:
    """Those of the devices that the rig has, reacting as the settings say."""
    guards: list[Guard] = []
    if rig.bus is not None:
        guards += [OtherMasterGuard(rig.bus), BusRemarkGuard(rig.bus)]
    if rig.release is not None:
        guards.append(ReleaseGuard(rig.release))
    if rig.gauges:
        guards.append(GaugeGuard(rig.gauges))
    return tuple(Reacting.by(settings, guard) for guard in guards)
