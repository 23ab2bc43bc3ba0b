"""Which SYNC a TPDO is dated with: frames that come late, in bursts, are lost, doubled, or sent in another order."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.cia402.wire.sync import SyncAnswers, SyncTimes

PERIOD = 0.002


def played(events: "list[int | tuple[int, int]]", first: int = 0) -> tuple[list[tuple[int, int]], SyncAnswers]:
    """(true number, number by its date) of each frame; an event is a SYNC (its number), or a frame (number, part)."""
    sync = SyncTimes()
    answers = SyncAnswers(sync, 2)
    found: list[tuple[int, int]] = []
    for event in events:
        if isinstance(event, int):
            sync.advance(PERIOD * event)
        else:
            found.append((event[0], round(answers.date((event[1] + first) % 2) / PERIOD)))
    return found, answers


def frames(number: int) -> list[tuple[int, int]]:
    return [(number, 0), (number, 1)]


def wrong(found: list[tuple[int, int]]) -> list[int]:
    return [true for true, dated in found if true != dated]


def test_in_time() -> None:
    found, answers = played([event for k in range(1, 300) for event in (k, *frames(k))])
    assert wrong(found) == []
    assert answers.late == 0


@given(st.data())
def test_however_late_they_come_they_are_dated_right(data: st.DataObject) -> None:
    """Frames wait behind up to 8 further SYNCs, anywhere between two frames, and catch up."""
    events: list[int | tuple[int, int]] = []
    waiting: list[tuple[int, int]] = []
    for k in range(1, 60):
        events.append(k)
        waiting += frames(k)
        must = k % 8 == 0 or k < 3
        taken = len(waiting) if must else data.draw(st.integers(0, len(waiting)))
        events += waiting[:taken]
        del waiting[:taken]
    found, _ = played(events)
    assert wrong(found) == []


@pytest.mark.parametrize("lost", [[(50, 0)], [(50, 1)], [(50, 0), (50, 1)], [(50, 1), (51, 0)]])
def test_after_a_loss_dates_are_right_again_within_half_a_second(lost: list[tuple[int, int]]) -> None:
    events = [event for k in range(1, 500) for event in (k, *frames(k)) if event not in lost]
    found, _ = played(events)
    assert {true - dated for true, dated in found} <= {0, 1}
    assert [k for k in wrong(found) if k > 51 + 0.5 / PERIOD] == []
    if len(lost) == 1:
        assert wrong(found) == []


@pytest.mark.parametrize("away", [10, 30, 60])
def test_after_a_cut_dates_are_right_again_the_sooner_the_longer_it_was(away: int) -> None:
    """Samples of 0.12 s ago were "too old to be believed" for half a second."""
    events = [event for k in range(1, 500) for event in (k, *([] if 100 <= k < 100 + away else frames(k)))]
    found, _ = played(events)
    assert max(wrong(found), default=0) <= 100 + away + 1.0 / away / PERIOD + 1


def test_a_long_silence_is_forgotten() -> None:
    """A drive that said nothing for 2000 SYNCs: what it says then is not dated into the past."""
    silent = [*range(100, 2100)]
    events = [event for k in range(1, 100) for event in (k, *frames(k))] + silent
    events += [event for k in range(2100, 2200) for event in (k, *frames(k))]
    found, _ = played(events)
    assert wrong(found) == []


def test_a_computer_that_is_behind_by_two_cycles_for_a_while() -> None:
    events: list[int | tuple[int, int]] = [event for k in range(1, 100) for event in (k, *frames(k))]
    events += [100, 101, *[event for k in range(102, 250) for event in (k, *frames(k - 2))], *frames(248), *frames(249)]
    events += [event for k in range(250, 400) for event in (k, *frames(k))]
    found, answers = played(events)
    assert wrong(found) == []
    assert answers.late == 149


def test_a_doubled_frame_keeps_its_date() -> None:
    events = [event for k in range(1, 40) for event in (k, (k, 0), (k, 0), (k, 1), (k, 1))]
    assert wrong(played(events)[0]) == []


def test_a_drive_that_sends_its_second_tpdo_first() -> None:
    late = [200, 201, 202, *frames(200), *frames(201), *frames(202)]
    events = [event for k in range(1, 200) for event in (k, *frames(k))] + late
    found, answers = played(events, first=1)
    assert [k for k in wrong(found) if k > 60] == []
    assert answers.late == 2


def test_before_the_first_sync_there_is_no_date() -> None:
    answers = SyncAnswers(SyncTimes(), 2)
    assert answers.date(0) == answers.date(1) == float("-inf")
