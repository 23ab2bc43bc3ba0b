import math
from collections.abc import Callable
from typing import Any

import canopen
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.cia402.dictionary import GENERIC_EDS, WinchConfig
from drivers.cia402.dictionary.settings import identity, limits
from drivers.cia402.profile.scale import LengthScale, wrap32
from fidim_lab.errors import SetupError

Make = Callable[..., WinchConfig]


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"name": ""}, "name: "),
        ({"node_id": 127}, "node_id: 127; at most 126 is allowed"),
        ({"counts_per_turn": 0.0}, "counts_per_turn: 0; more than 0 is allowed"),
        ({"drum_radius": math.nan}, "drum_radius: nan"),
        ({"rated_current": -1.0}, "rated_current: -1; more than 0 is allowed"),
        ({"direction": 0}, "direction: 0; allowed are -1 or 1"),
        ({"length_limits": (2.0, 1.0)}, "length_limits: the shortest, 2 m, is not below the longest, 1 m"),
        ({"length_limits": (0.5, math.nan)}, "length_limits"),
        ({"length_limits": (0.5, 3.0), "home_count": 2**31 - 10}, "beyond the encoder's 32 bits"),
        ({"home_count": 2**31}, "home_count: 2147483648; at most 2147483647 is allowed"),
        ({"home_length": math.inf}, "home_length: inf"),
        ({"current_limit": 41.0}, "current_limit: 41 A is more than ten times the rated 4 A"),
        ({"heartbeat": 66.0}, "heartbeat: 66; at most 65 is allowed"),
        ({"stop": {"quick_stop": 0}}, "stop, quick_stop: 0; at least 1 is allowed"),
        ({"stop": {"connection_lost": 0}}, "stop, connection_lost: 0; allowed is 3"),
    ],
)
def test_each_mistake_names_its_key(config: Make, change: dict[str, Any], complaint: str) -> None:
    with pytest.raises(SetupError, match=complaint):
        config(**change)


def test_all_mistakes_at_once(config: Make) -> None:
    with pytest.raises(SetupError, match=r"winch 'winch 3': node_id.*direction.*drum_radius"):
        config(drum_radius=0.0, node_id=0, direction=2)


def test_our_eds_describes_all_that_is_written(config: Make) -> None:
    dictionary = canopen.import_od(str(GENERIC_EDS), 3)
    settings = (*identity(config(vendor_id=1, product_code=1, serial_number=1), (0, 0)), *limits(config(), 127))
    for setting in settings:
        assert dictionary.get_variable(setting.index, setting.sub) is not None, setting


def test_limits_in_counts(config: Make) -> None:
    wanted = {s.object: s.wanted for s in limits(config(drum_radius=1.0 / (2.0 * math.pi), direction=-1), 127)}
    assert (wanted["607D:1"], wanted["607D:2"]) == (-40000, 10000)
    assert wanted["1016:1"] == 127 << 16 | 250
    assert wanted["1017:0"] == 100
    assert wanted["607F:0"] == 10000
    assert wanted["6073:0"] == 1500
    assert (wanted["605A:0"], wanted["605E:0"], wanted["6007:0"]) == (6, 2, 3)


def test_who_must_answer(config: Make) -> None:
    assert {s.object for s in identity(config(), (0, 0))} == {"1000:0", "1005:0", "6502:0", "6075:0"}
    by_eds = {s.object: s.wanted for s in identity(config(serial_number=9), (7, 8))}
    assert (by_eds["1018:1"], by_eds["1018:2"], by_eds["1018:4"]) == (7, 8, 9)
    assert {s.object: s.wanted for s in identity(config(vendor_id=5), (7, 0))}["1018:1"] == 5


INT32 = st.integers(-(2**31), 2**31 - 1)
DIRECTION = st.sampled_from([-1, 1])


@given(INT32, INT32, DIRECTION, st.floats(0.0, 10.0), st.floats(100.0, 1e6))
def test_count_to_length_and_back(count: int, home: int, direction: int, length: float, density: float) -> None:
    scale = LengthScale(density, direction, home, length)
    assert scale.count(scale.length(count)) == count


@given(st.integers(-1000, 1000), DIRECTION)
def test_lengths_are_continuous_where_the_encoder_wraps(steps: int, direction: int) -> None:
    scale = LengthScale(1000.0, direction, home_count=2**31 - 1, home_length=2.0)
    count = wrap32(2**31 - 1 + steps)
    assert scale.length(count) == pytest.approx(2.0 + direction * steps / 1000.0)


def test_one_turn_of_the_drum() -> None:
    scale = LengthScale.of_drum(20000.0, 0.03, 1, 500, 1.5)
    assert scale.length(20500) == pytest.approx(1.5 + 2.0 * math.pi * 0.03)
    assert scale.velocity(-20000) == pytest.approx(-2.0 * math.pi * 0.03)
    assert scale.magnitude(-1e-9) == 1
