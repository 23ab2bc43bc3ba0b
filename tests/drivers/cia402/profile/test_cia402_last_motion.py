"""The direction of a drum's last travel, through noise, turns back, and the wrap of 32 bits."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.cia402.profile.last_motion import LastMotion
from drivers.cia402.profile.scale import wrap32


def after(positions, threshold=10):
    motion = LastMotion(threshold)
    for position in positions:
        motion.feed(wrap32(position))
    return motion.direction


@pytest.mark.parametrize(
    ("positions", "direction"),
    [
        ([], 0),
        ([500], 0),
        ([500, 505, 510], 0),
        ([500, 511], 1),
        ([500, 489], -1),
        ([500, 600, 595, 598, 591], 1),
        ([500, 600, 589], -1),
        ([500, 400, 600, 700, 695], 1),
        ([2**31 - 5, 2**31 + 10], 1),
        ([-(2**31) + 5, -(2**31) - 10], -1),
    ],
)
def test_tables(positions, direction):
    assert after(positions) == direction


@given(st.lists(st.integers(-5, 5), max_size=50), st.integers(-(2**31), 2**31 - 1), st.sampled_from((-1, 1)))
def test_noise_after_a_move_keeps_it(noise, start, sign):
    way = [start + sign * k * 7 for k in range(10)]
    assert after([*way, *(way[-1] + n for n in noise)]) == sign


@given(st.lists(st.integers(-1000, 1000), min_size=1, max_size=60))
def test_it_is_the_last_travel_beyond_the_threshold(positions):
    """Against looking back over everything: from the newest place, which bound was left last."""
    direction, newest = 0, positions[-1]
    low = high = newest
    for place in reversed(positions):
        low, high = min(low, place), max(high, place)
        if high - low > 10:
            direction = 1 if place == low else -1
            break
    # the travel from `place` to the opposite extreme within what came after it
    assert after(positions) == direction
