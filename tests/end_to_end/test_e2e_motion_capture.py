"""Markers that are lost, frozen or swapped; packets that are lost, doubled, late, torn or garbled."""

import numpy as np
import pytest

from procedures.recording.journal import LineKind
from sim_backends.mocap.faults import Faults

SPREAD = 6e-4
"""m, six standard deviations of a marker coordinate's noise"""
UNSEEN = 3e-3
"""m, a damaged sample that a jump check of 5 mm cannot tell from motion"""


def checks(ended):
    """(outcome, reason) of every window check."""
    found = [e for e in ended.journal if e.step == "CheckWindow" and e.kind is LineKind.STEP_FINISHED]
    return [(e.outcome.value, e.reason) for e in found]


def errors(scene, ended, file):
    """Distance of each sample of a window from where the marker truly was, m."""
    first = ended.first_number(file)
    return np.array([np.abs(place - ended.truth[first + k]).max() for k, place in scene.places(file).items()])


GLITCHES = {
    "occlusions": ("longest gap of the marker is 0.2 s (at most 0.1 s is allowed)", ()),
    "freezes": ("longest gap of the marker is 0.", ()),
    "silences": ("longest gap of the marker is 0.2 s (at most 0.1 s is allowed)", ()),
    "jumps": ("largest jump of marker 1 is ", ((0.02, 0.0, 0.0),)),
}


@pytest.mark.parametrize("kind", GLITCHES)
@pytest.mark.sampled(1)
def test_a_marker_lost_for_a_moment_costs_an_attempt_not_a_window(rehearsal, kind):
    says, more = GLITCHES[kind]
    rehearsal.at("Record", lambda stage: stage.mocap.add(kind, 0.2, *more), after=0.5)
    ended = rehearsal.run()
    report = ended.check()
    assert [outcome for outcome, _ in checks(ended)] == ["fail", "pass"]
    assert says in checks(ended)[0][1]
    assert report.exit_code == 0
    assert [row.attempts for row in report.accepted] == [2]
    assert (ended.folder / "rejected" / "i01-attempt1.csv").read_text().count("\n") == ended.rows + 1
    assert not ended.trip


@pytest.mark.slow
def test_a_window_is_recorded_again_at_most_three_times(scene, rehearsal):
    rehearsal.settings = scene.short(seconds=0.5)
    for attempt in range(1, 6):
        rehearsal.at("Record", lambda stage: stage.mocap.add("occlusions", 0.2), after=0.1, nth=attempt)
    ended = rehearsal.run()
    report = ended.check()
    assert len(ended.begun["Record"]) == 4
    assert report.exit_code == 1
    assert "i01: rejected 4 times, the last time: part of marker samples that are there is 0.6" in report.reason
    assert len(list((ended.folder / "rejected").glob("*.csv"))) == 4
    assert not list((ended.folder / "windows").iterdir())


LOSSES = {
    "occlusions": "the main marker is lost for 3.0",
    "freezes": "the main marker is frozen for 3.0",
    "silences": "no frame has come from motion capture for 3.0",
}


@pytest.mark.parametrize("kind", LOSSES)
@pytest.mark.parametrize("step", ["MoveTo", "Settle"])
@pytest.mark.sampled(1)
def test_a_marker_lost_for_three_seconds_stops_the_run(rehearsal, step, kind):
    rehearsal.at(step, lambda stage: stage.mocap.add(kind, 3.3), after=0.1)
    ended = rehearsal.run()
    report = ended.check()
    assert LOSSES[kind] in report.reason
    assert "at most 3 s is allowed" in report.reason
    assert report.exit_code == 3
    assert ended.trip.t - ended.planted[0] == pytest.approx(3.0, abs=0.1)


@pytest.mark.parametrize(
    ("kind", "says"), [*list(LOSSES.items())[:2], ("silences", "simulated motion capture: nothing received for 1.0 s")]
)
@pytest.mark.sampled(1)
def test_a_marker_lost_for_long_while_recording_stops_the_run_and_keeps_the_rows(scene, rehearsal, kind, says):
    rehearsal.settings = scene.short(seconds=6.0)
    rehearsal.at("Record", lambda stage: stage.mocap.add(kind, 4.0), after=1.0)
    ended = rehearsal.run()
    report = ended.check()
    assert says in report.reason
    assert report.exit_code == 3
    rows = (ended.folder / "rejected" / "i01-attempt1.csv").read_text().splitlines()[1:]
    assert len(rows) >= 99
    assert all(row.split(",")[1] for row in rows[:99])
    words = ended.controlwords(since=ended.planted[0] + 0.9)
    assert {node for _, node, word in words if word & 0x10F == 0x10F} == {1, 2, 3, 4}  # held: halt, with power


def test_a_marker_that_never_comes_back_is_what_the_operator_is_told(scene, rehearsal):
    rehearsal.settings = scene.short(repeats=1)
    rehearsal.at("AwaitHandsOff", lambda stage: stage.mocap.add("occlusions", 1e9))
    report = rehearsal.run().check()
    assert "not moving freely after 2 s: almost no new position of the main marker arrived" in report.reason
    assert report.exit_code == 1


CASES = {
    "nothing": Faults(),
    "lost": Faults(lost=0.005),
    "doubled": Faults(doubled=0.03),
    "out of order": Faults(reordered=0.05),
    "torn": Faults(torn=0.03),
    "all": Faults(lost=0.003, doubled=0.03, reordered=0.05, torn=0.003),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.sampled(1)
def test_packets_in_disorder_give_the_right_samples_or_blank_ones(scene, case):
    rehearsal = scene.make(CASES[case])
    rehearsal.settings = scene.short(seconds=5.0)
    rehearsal.at("Record", lambda stage: None)
    ended = rehearsal.run()
    report = ended.check()
    assert report.exit_code == 0
    for file in sorted(ended.folder.rglob("*.csv")):
        assert errors(scene, ended, file).max() < SPREAD
        blank = ended.rows - len(scene.places(file))
        assert (blank == 0) == (case in ("nothing", "doubled", "out of order"))
    recorded = next(e.reason for e in ended.journal if e.step == "Record" and e.kind is LineKind.STEP_FINISHED)
    for word in {
        "lost": ["lost"],
        "doubled": ["doubled"],
        "torn": ["lost", "malformed"],
        "all": ["lost", "doubled"],
    }.get(case, []):
        assert f"frames {word}" in recorded


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.sampled(1)
def test_no_window_with_a_garbled_sample_is_accepted(scene, seed):
    """Damage that the decoder cannot see (no checksum in the stream) must not become motion."""
    rehearsal = scene.make(Faults(garbled=0.02))
    rehearsal.seed = seed
    rehearsal.settings = scene.short(complete=0.9)
    rehearsal.at("Record", lambda stage: None)
    ended = rehearsal.run()
    report = ended.check()
    for row in report.accepted:
        assert errors(scene, ended, row.file).max() < UNSEEN
    for file in (ended.folder / "rejected").glob("*.csv"):
        assert errors(scene, ended, file).max() > UNSEEN
