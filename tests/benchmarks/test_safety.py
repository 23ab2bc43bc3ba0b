"""The safety benchmark: its draws, its rules on made-up truths, and a sample of its runs."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.safety import judge
from benchmarks.safety.draw import Combination, Planted, combination
from benchmarks.safety.kinds import KINDS, NEVER, Draw, Fault, When
from benchmarks.safety.one_run import carry_out, one_run
from benchmarks.safety.page import report, told
from benchmarks.safety.witness import Truth
from procedures.expected.place_check import PlaceHistory, place_measurements

LIMITS = (20.0, 200.0)
STIFFNESS = np.array([[-800.0, 700.0], [700.0, -900.0]])


def truth(**columns: np.ndarray) -> Truth:
    """Two cables at rest for a second."""
    rest = {
        "t": np.linspace(0.0, 1.0, 201),
        "tensions": np.full((201, 2), 60.0),
        "lengths": np.full((201, 2), 1.4),
        "speeds": np.zeros((201, 2)),
        "powered": np.ones((201, 2), dtype=bool),
        "slipped": np.zeros((201, 2)),
    }
    return Truth(**(rest | columns))


def planted(fault: Fault) -> Planted:
    return Planted("made up", fault, When.MOVE, 1, 0.0)


def test_the_same_number_gives_the_same_combination():
    first, again = combination(1, 7), combination(1, 7)
    assert [one.text for one in first.planted] == [one.text for one in again.planted]
    assert [one.text for one in combination(2, 7).planted] != [one.text for one in first.planted]


@pytest.mark.parametrize("name", sorted(KINDS))
def test_every_kind_makes_faults(name):
    kind = KINDS[name]
    made = [kind.make(Draw(np.random.default_rng(seed))) for seed in range(20)]
    assert all(one.says and set(one.cables) <= {1, 2, 3, 4} for one in made)
    assert kind.when


def test_every_kind_is_drawn():
    drawn = {one.kind for number in range(1, 301) for one in combination(1, number).planted}
    assert drawn == set(KINDS)


def test_a_fault_has_the_room_that_ten_millimetres_of_one_cable_make():
    allowed = judge.room(STIFFNESS, [planted(Fault("", lambda stage: None))], truth(), 0.0)
    assert allowed.newton == pytest.approx([8.0, 9.0])


def test_a_drive_that_nobody_can_stop_has_the_room_of_its_way():
    speeds, lengths = np.zeros((201, 2)), np.full((201, 2), 1.4)
    speeds[:100, 1], lengths[:, 1] = 0.1, 1.4 + np.minimum(0.1 * np.linspace(0.0, 1.0, 201), 0.05)
    fault = Fault("", lambda stage: None, (2,), NEVER)
    allowed = judge.room(STIFFNESS, [planted(fault)], truth(speeds=speeds, lengths=lengths), 0.0)
    assert allowed.distances == pytest.approx([0.0, 0.05])
    assert allowed.newton == pytest.approx([35.0, 45.0])


@pytest.mark.parametrize(("newton", "broken"), [(13.0, False), (11.0, True), (207.0, False), (209.0, True)])
def test_tensions_beyond_the_room_break_the_rule(newton, broken):
    tensions = np.full((201, 2), 60.0)
    tensions[100, 0] = newton
    used, violations = judge.tension(truth(tensions=tensions), LIMITS, judge.Room(np.array([8.0, 9.0]), np.zeros(2)))
    assert bool(violations) == broken == (used > 1.0)


def test_the_jolt_of_a_falling_brake_is_not_judged():
    tensions, powered, speeds = np.full((201, 2), 60.0), np.ones((201, 2), dtype=bool), np.zeros((201, 2))
    powered[50:, 1], speeds[:50, 1], tensions[55, 0] = False, 0.05, 0.0
    allowed = judge.Room(np.array([8.0, 9.0]), np.zeros(2))
    assert not judge.tension(truth(tensions=tensions, powered=powered, speeds=speeds), LIMITS, allowed)[1]
    assert judge.tension(truth(tensions=tensions, powered=powered), LIMITS, allowed)[1], "it stood before"


@pytest.fixture(scope="module")
def without_faults():
    return carry_out(Combination(0, (), 0.1))


def test_a_run_without_faults_keeps_every_rule(without_faults):
    assert without_faults.violations == ()
    assert (without_faults.ended, without_faults.accepted) == ("pass", ("i01", "i02"))
    assert without_faults.tension[0] > LIMITS[0]
    assert "i02" in told(without_faults, 1)


def test_a_cable_that_slips_at_the_end_of_a_window_is_named_at_the_next_place_or_the_plant_tells(monkeypatch):
    def slip(stage):
        drums = list(stage.rig.laboratory.drums)
        drums[1] = replace(drums[1], home_length=drums[1].home_length + 0.025)
        stage.rig.laboratory.drums = tuple(drums)

    fault = Planted("slips", Fault("slips", slip, (2,), 0.0, 0.025), When.RECORD, 1, 1.4)
    one = Combination(0, (fault,), 0.1)
    named = carry_out(one)
    assert (named.accepted, named.violations) == (("i01",), ())
    assert "during window i01" in named.reason
    forgetful = lambda rest, seen, _, settings: place_measurements(rest, seen, PlaceHistory(), settings)  # noqa: E731
    monkeypatch.setattr("procedures.handlers.placing.place_measurements", forgetful)
    blind = carry_out(one)
    assert "i01" in blind.accepted
    assert "b: a cable slipped" in [one.rule for one in blind.violations]


@pytest.mark.parametrize("number", [3, 2, 16])
@pytest.mark.sampled(1)
def test_a_run_is_the_same_each_time_and_keeps_every_rule(number):
    """Run 3: the disk is full, then the cable is cut while a thread judges a window."""
    outcome = one_run(1, number)
    assert outcome == one_run(1, number)
    assert outcome.violations == (), told(outcome, 1)


def test_the_page_names_what_was_broken(without_faults):
    bad = replace(without_faults, violations=(judge.Violation("a: tension", "cable 1 had 3.0 N", 2.0),))
    text = report([without_faults, bad], 1)
    assert "2 runs" in text
    assert "| a: tension | 1 |" in text
    assert "cable 1 had 3.0 N" in text
