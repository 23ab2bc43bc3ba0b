"""Guards over what drives say of themselves: threshold, hysteresis, duration, age."""

import pytest

from drivers.ports import DriveState, WinchSample
from procedures.guards.drive_guards import BusGuard, FollowingErrorGuard, TemperatureGuard
from procedures.guards.guard import Observation
from procedures.outcomes import Outcome
from procedures.recording.journal import LineKind, read_journal
from procedures.settings import GuardSettings, Reaction
from procedures.steps import Phase

SETTINGS = GuardSettings(following_error=0.01, following_error_for=0.5, temperature=70.0, temperature_age=10.0)
NAMES = ("a", "b")


def seen(t, **said):
    healthy = WinchSample(t, DriveState.OPERATION_ENABLED, 1.0, 0.0, 1.0, True)
    return Observation(
        t, Phase.RESTING, (healthy, WinchSample(t, DriveState.OPERATION_ENABLED, 1.0, 0.0, 1.0, True, **said)), None
    )


@pytest.mark.parametrize(
    ("errors", "trips"),
    [
        ([(0.0, 0.02), (0.4, 0.02)], [False, False]),
        ([(0.0, -0.02), (0.5, -0.02)], [False, True]),
        ([(0.0, 0.02), (0.3, 0.009), (0.5, 0.02)], [False, False, True]),  # within the hysteresis: goes on
        ([(0.0, 0.02), (0.3, 0.007), (0.5, 0.02)], [False, False, False]),
        ([(0.0, 0.02), (0.3, None), (0.5, 0.02)], [False, False, False]),
    ],
)
def test_a_motor_that_stays_behind(errors, trips):
    guard = FollowingErrorGuard(NAMES, SETTINGS)
    assert [guard.look(seen(t, following_error=e)) is not None for t, e in errors] == trips


def test_its_sentence_names_winch_value_and_limit():
    guard = FollowingErrorGuard(NAMES, GuardSettings(following_error=0.01, following_error_for=0.0))
    says = guard.look(seen(0.0, following_error=-0.0123))
    assert says == "b is -12.3 mm from its drive's commanded position, at most 10 mm is allowed"


def test_a_hot_drive_and_one_that_does_not_tell_any_more():
    guard = TemperatureGuard(NAMES, SETTINGS)
    assert guard.look(seen(0.0, temperature=69.0)) is None
    assert guard.look(seen(1.0, temperature=71.0)) == "b has 71 °C, at most 70 °C is allowed"
    assert guard.look(seen(2.0, temperature=68.0)) is not None
    assert guard.look(seen(3.0, temperature=64.0)) is None
    assert guard.look(seen(12.9)) is None
    assert guard.look(seen(13.1)) == "b has not reported its temperature for 10 s"


def test_drives_that_never_told_a_temperature_are_not_missed():
    guard = TemperatureGuard(NAMES, SETTINGS)
    assert all(guard.look(seen(float(t))) is None for t in range(100))


def test_lost_bus_cycles_count_within_a_second():
    guard = BusGuard(NAMES, 10)
    looks = [(0.0, 0), (0.5, 10), (0.9, 11), (1.45, 15), (1.6, 15), (3.0, 100), (4.1, 100)]
    assert [guard.look(seen(t, lost=n)) is not None for t, n in looks] == [
        *(False, False, True),
        *(False, False),
        *(False, False),
    ]


class _SpoilsOnce:
    """Finds something in the first recording, for a moment."""

    name = "hum"
    reaction = Reaction.REJECT_WINDOW

    def __init__(self):
        self.since = None

    def look(self, seen):
        if seen.phase is not Phase.RECORDING:
            return None
        self.since = seen.t if self.since is None else self.since
        return "it hums" if 1.0 < seen.t - self.since < 1.2 else None


def test_a_guard_that_rejects_the_window_lets_the_run_go_on_and_the_window_is_recorded_again(world, lab, tmp_path):
    report = world.run(lab.one, tmp_path / "run", guards=(_SpoilsOnce(),))
    assert report.outcome is Outcome.PASS
    assert [row.attempts for row in report.windows] == [2]
    assert (tmp_path / "run" / "rejected").is_dir()
    journal = read_journal(tmp_path / "run" / "journal.jsonl")
    assert [e.reason for e in journal if e.kind is LineKind.WARNED] == ["it hums"]
    checks = [(e.outcome, e.reason) for e in journal if e.step == "CheckWindow" and e.kind is LineKind.STEP_FINISHED]
    assert checks[0] == (Outcome.FAIL, "the hum guard: it hums")
    assert checks[1][0].usable
