"""Guards of the devices beside winches and cameras: the release, load cells, an inclinometer."""

from collections.abc import Sequence

from drivers.ports import Gauge, Release, Rig
from procedures.guards import Guard, Observation, Reacting
from procedures.settings import GuardSettings, Reaction
from procedures.steps import Phase


class ReleaseGuard:
    """The release let go by itself, or was lost while it held."""

    name = "release"
    reaction = Reaction.HOLD

    def __init__(self, release: Release) -> None:
        self._release = release

    def look(self, seen: Observation) -> str | None:
        """What it has latched."""
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
                return f"{gauge.name} has told nothing so far"
            if (age := seen.t - reading.t) > gauge.age:
                return f"{gauge.name} has told nothing for {age:.2f} s; at most {gauge.age:g} s is allowed"
        return None


def device_guards(rig: Rig, settings: GuardSettings) -> tuple[Guard, ...]:
    """Those of the devices that the rig has, reacting as the settings say."""
    guards: list[Guard] = []
    if rig.release is not None:
        guards.append(ReleaseGuard(rig.release))
    if rig.gauges:
        guards.append(GaugeGuard(rig.gauges))
    return tuple(Reacting(guard, settings.reactions.get(guard.name, guard.reaction)) for guard in guards)
