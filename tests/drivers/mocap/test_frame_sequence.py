import random
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.mocap.sequence import HORIZON, RUN, Sequencer
from drivers.ports import MarkerFrame


def frame(number: int, t: float = 0.0) -> MarkerFrame:
    return MarkerFrame(t, number, ((1.0, 2.0, 3.0),))


def push(sequencer: Sequencer, *numbers: int) -> list[int]:
    return [out.number for number in numbers for out in sequencer.push(frame(number))]


@pytest.mark.parametrize(
    ("arrived", "passed_on", "counts"),
    [
        ([5, 6, 7, 8], [5, 6, 7, 8], {}),
        ([5], [], {}),  # the very first waits for the second
        ([6, 5, 7], [5, 6, 7], {}),  # even the first two may be swapped
        ([5, 6, 8, 7, 9], [5, 6, 7, 8, 9], {}),
        ([5, 6, 10, 9, 8, 7, 11], [5, 6, 7, 8, 9, 10, 11], {}),
        ([5, 6, 11, 10, 9, 8, 7, 12], [5, 6, 11, 12], {"lost": 4, "late": 4}),  # further ahead than anything is awaited
        ([5, 6, 9, 8, 7, 10], [5, 6, 7, 8, 9, 10], {}),
        ([5, 6, 8, 9, 10, 11, 12], [5, 6, 8, 9, 10, 11, 12], {"lost": 1}),
        ([5, 6, 8, 9, 10, 11, 7, 12], [5, 6, 8, 9, 10, 11, 12], {"lost": 1, "late": 1}),
        ([5, 6, 8, 9, 10, 11, 7, 7], [5, 6, 8, 9, 10, 11], {"lost": 1, "late": 1, "doubled": 1}),
        ([5, 5, 6, 6, 7], [5, 6, 7], {"doubled": 2}),
        ([5, 6, 8, 8, 7], [5, 6, 7, 8], {"doubled": 1}),
        ([5, 6, 1005, 7, 8], [5, 6, 7, 8], {"misnumbered": 1}),  # a damaged number
        ([5, 6, 1005, 1006, 1007], [5, 6, 1005, 1006, 1007], {"lost": 998}),  # a real gap
        ([5, 6, 1006, 1005, 1007], [5, 6, 1005, 1006, 1007], {"lost": 998}),
        ([5, 6, 1005, 1005, 1006], [5, 6, 1005, 1006], {"lost": 998, "doubled": 1}),
        ([5, 6, 1005, 9999, 7], [5, 6, 7], {"misnumbered": 2}),
        ([1005, 1006, 1, 2, 3], [1005, 1006, 1, 2, 3], {"resets": 1}),
        ([1005, 1006, 1, 1007, 1008], [1005, 1006, 1007, 1008], {"misnumbered": 1}),
        ([900, 5, 6, 7], [5, 6, 7], {"misnumbered": 1}),  # a damaged first line
        ([5, 6, 8, 1, 2], [5, 6, 8], {"late": 2, "lost": 1}),
    ],
)
def test_cases(arrived: list[int], passed_on: list[int], counts: dict[str, int]) -> None:
    sequencer = Sequencer(window=4)
    out = push(sequencer, *arrived) + [late.number for late in sequencer.flush()]
    assert out == passed_on
    found = {name: value for name, value in vars(sequencer.counts).items() if value}
    assert found == {"received": len(arrived), **counts}


def test_a_gap_is_given_up_after_the_window_and_not_before() -> None:
    sequencer = Sequencer(window=3)
    assert push(sequencer, 1, 2, 4, 5) == [1, 2]
    assert push(sequencer, 6) == [4, 5, 6]


def test_the_counter_wraps_and_the_numbers_go_on() -> None:
    sequencer = Sequencer(modulus=2**32)
    numbers = [2**32 - 3 + index for index in range(8)]
    swapped = [*numbers[:3], numbers[4], numbers[3], *numbers[5:]]
    assert push(sequencer, *(number % 2**32 for number in swapped)) == numbers
    assert sequencer.counts.lost == 0


def test_a_counter_reset_soon_after_its_start_is_noticed() -> None:
    sequencer = Sequencer()
    push(sequencer, *range(100))
    out = push(sequencer, *range(60))
    assert sequencer.counts.resets == 1
    assert out == list(range(RUN - 1, 60))


def test_a_new_connection_takes_the_count_up_where_it_is() -> None:
    sequencer = Sequencer()
    push(sequencer, *range(100), 101)
    assert [out.number for out in sequencer.restart()] == [101]
    assert push(sequencer, 110, 111) == [110, 111]
    assert sequencer.counts.lost == 1 + 8
    sequencer.restart()
    assert push(sequencer, 3, 4, 5) == [3, 4, 5]
    assert sequencer.counts.resets == 1


@given(displaced=st.lists(st.integers(0, 3), min_size=5, max_size=60))
def test_what_is_displaced_by_less_than_the_window_comes_back_in_order(displaced: list[int]) -> None:
    """Each frame is delayed by 0…3 places (ties in order): nothing is lost, nothing is out of order."""
    numbers = [2 + number for _, number in sorted((index + delay, index) for index, delay in enumerate(displaced))]
    sequencer = Sequencer(window=4)
    out = push(sequencer, 0, 1, *numbers) + [late.number for late in sequencer.flush()]
    assert out == list(range(len(numbers) + 2))


def test_what_came_before_the_first_is_late() -> None:
    sequencer = Sequencer()
    assert push(sequencer, 1, 2, 0, 3) == [1, 2, 3]
    assert sequencer.counts.late == 1


@given(seed=st.integers(0, 10_000), loss=st.floats(0.0, 0.4), doubling=st.floats(0.0, 0.3), wild=st.floats(0.0, 0.1))
def test_every_frame_is_accounted_for(seed: int, loss: float, doubling: float, wild: float) -> None:
    rng = random.Random(seed)
    arrivals: list[tuple[float, int]] = []
    for number in range(200):
        if rng.random() < loss:
            continue
        arrivals.append((number + rng.random() * 4.0, number))
        if rng.random() < doubling:
            arrivals.append((number + rng.random() * 8.0, number))
        if rng.random() < wild:
            arrivals.append((number + rng.random(), rng.randrange(10**9)))
    sequencer = Sequencer()
    out = push(sequencer, *(number for _, number in sorted(arrivals)))
    out += [late.number for late in sequencer.restart()]
    counts = sequencer.counts
    fates = len(out) + counts.late + counts.doubled + counts.misnumbered
    assert fates == counts.received == len(arrivals)
    assert set(out) <= {number for _, number in arrivals}
    assert counts.resets > 0 or all(b > a for a, b in pairwise(out))
    if counts.resets == 0 and out:
        assert out[-1] - out[0] + 1 == len(out) + counts.lost


def test_stamps_stay_those_of_arrival() -> None:
    sequencer = Sequencer()
    out = [item for item in (frame(1, 0.1), frame(3, 0.3), frame(2, 0.35)) for item in sequencer.push(item)]
    assert [(item.number, item.t) for item in out] == [(1, 0.1), (2, 0.35), (3, 0.3)]


def test_memory_of_what_was_lost_is_bounded() -> None:
    sequencer = Sequencer()
    push(sequencer, *range(0, 50_000, 2))
    sequencer.flush()
    assert sequencer.counts.lost == 25_000 - 1
    assert len(sequencer._given_up) <= HORIZON + 8
