"""Guards of the host: each trips at its threshold, with its reaction, and forgets with hysteresis."""

import asyncio
from dataclasses import replace

import pytest

from drivers.disk import InlineDisk
from fidim_lab.errors import HardwareError
from procedures.events import RunFinished, StepStarted, Tripped, Warned
from procedures.guards.guard import Observation, watch
from procedures.guards.host_guards import ClockStepGuard, DiskGuard, LoopGuard, host_guards, require_space
from procedures.outcomes import Outcome
from procedures.recording.journal import LineKind, read_journal
from procedures.settings import GuardSettings, Reaction
from procedures.steps import Phase


def at(t):
    return Observation(t, Phase.RESTING, (), None)


def test_a_late_loop_is_told_with_how_late():
    guard = LoopGuard(0.25)
    assert guard.look(at(0.0)) is None
    assert guard.look(at(0.2)) is None
    assert "stood still for 2.00 s" in guard.look(at(2.2))
    assert guard.look(at(2.21)) is None


class Cold:
    """A guard that strikes at a time."""

    name, reaction = "cold", Reaction.HOLD

    def __init__(self, t):
        self._t = t

    def look(self, seen):
        return "it is cold" if seen.t >= self._t else None


@pytest.mark.parametrize(
    ("strikes", "says"),
    [
        (0.05, "it is cold"),
        (0.9, "this computer stood still for 0.80 s; it is cold"),
        (1.31, "this computer stood still for 0.80 s, until 0.41 s ago; it is cold"),
        (1.75, "it is cold"),  # what came of it has been seen by now
    ],
)
@pytest.mark.parametrize(("age", "late"), [(0.2, 0.9), (0.9, 0.25)])
def test_what_a_guard_finds_after_a_standstill_is_told_as_its_consequence(strikes, says, age, late):
    """Looks every 10 ms, and none from 0.1 to 0.9 s."""
    now = [0.0]

    class Stops:
        async def sleep(self, seconds):
            now[0] = round(now[0] + (0.8 if now[0] == 0.1 else seconds), 6)

    settings = GuardSettings(sample_age=age, loop_late=late)
    trip = asyncio.run(watch(Stops(), [Cold(strikes)], lambda: at(now[0]), settings, lambda trip: None))
    assert (trip.guard, trip.says) == ("cold", says)


def test_the_host_guard_tells_of_a_standstill_itself():
    times = iter((0.0, 0.01, 0.81))

    class Stops:
        async def sleep(self, seconds):
            pass

    guards = [LoopGuard(0.25), Cold(0.5)]
    trip = asyncio.run(watch(Stops(), guards, lambda: at(next(times)), GuardSettings(), lambda trip: None))
    assert trip.says == "this computer stood still for 0.80 s, 0.25 s is allowed; check what else runs on it"


def test_a_disk_is_low_until_there_is_clearly_more(tmp_path):
    free = [300e6]
    guard = DiskGuard(tmp_path, 200e6, InlineDisk(), lambda _: free[0])
    assert guard.look(at(0.0)) is None
    free[0] = 100e6
    assert guard.look(at(1.0)) is None, "looked at every five seconds only"
    assert "100 MB free, 200 MB are required" in guard.look(at(6.0))
    free[0] = 210e6
    assert guard.look(at(12.0)) is not None
    free[0] = 250e6
    assert guard.look(at(18.0)) is None


@pytest.mark.parametrize(("free", "enough"), [(229e6, False), (231e6, True)])
def test_a_run_that_would_not_fit_is_refused_before_anything_has_power(tmp_path, free, enough):
    settings = GuardSettings(disk_spare=200e6)
    folder = tmp_path / "not" / "there"
    if enough:
        require_space(folder, 600.0, 50e3, settings, lambda _: free)
        return
    with pytest.raises(HardwareError, match="has 229 MB free; 230 MB are required: 30 MB for a run of 10 min and 200"):
        require_space(folder, 600.0, 50e3, settings, lambda _: free)
    require_space(folder, 600.0, 50e3, replace(settings, reactions={"disk": Reaction.WARN}), lambda _: free)


@pytest.mark.parametrize(("by", "told"), [(0.5, False), (-0.5, False), (3600.0, True), (-2.0, True)])
def test_a_step_of_the_clock_is_told_once(by, told):
    wall = [1000.0]
    guard = ClockStepGuard(lambda: wall[0])
    assert guard.look(at(0.0)) is None
    wall[0] += 2.0 + by
    assert (guard.look(at(2.0)) is not None) is told
    wall[0] += 2.0
    assert guard.look(at(4.0)) is None


def test_a_stepped_clock_warns_and_the_run_goes_on(world, lab, tmp_path):
    jump = [0.0]
    world.at("Record", lambda: jump.__setitem__(0, 7200.0))
    guards = host_guards(tmp_path, GuardSettings(disk_spare=0.0), lambda: world.now() + jump[0], InlineDisk())
    report = world.run(lab.one, tmp_path / "run", guards=guards)
    assert report.outcome is Outcome.PASS
    (warning,) = [e for e in world.events if isinstance(e, Warned)]
    assert "changed by +7200.0 s" in warning.trip.says
    assert [e.kind for e in read_journal(tmp_path / "run" / "journal.jsonl")].count(LineKind.WARNED) == 1


@pytest.mark.parametrize("reaction", [Reaction.HOLD, Reaction.QUICK_STOP])
def test_a_full_disk_ends_the_run_by_the_reaction_of_the_table(reaction, world, lab, tmp_path):
    settings = GuardSettings(disk_spare=1e30, reactions={"disk": reaction})
    report = world.run(lab.one, tmp_path / "run", guards=host_guards(tmp_path, settings, world.now, InlineDisk()))
    assert report.outcome is Outcome.ERROR
    (trip,) = [e.trip for e in world.events if isinstance(e, Tripped)]
    assert (trip.guard, trip.reaction) == ("disk", reaction)
    assert ("quick_stop" in world.winches[0].commands) is (reaction is Reaction.QUICK_STOP)
    begun = [type(e.step).__name__ for e in world.events if isinstance(e, StepStarted)]
    assert begun == ["Enable", "TryWinches", "MoveTo"]
    assert isinstance(world.events[-1], RunFinished)
