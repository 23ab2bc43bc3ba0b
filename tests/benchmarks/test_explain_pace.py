"""What is timed is there: a part that was moved would stop the benchmark."""

import importlib

import pytest

from benchmarks.explain_pace import PARTS, Shares


@pytest.mark.parametrize("place", [place for places in PARTS.values() for place in places])
def test_every_part_is_where_it_is_said_to_be(place: str) -> None:
    module, function = place.rsplit(".", 1)
    assert callable(getattr(importlib.import_module(module), function))


def test_the_time_of_an_inner_part_is_its_own_alone() -> None:
    shares = Shares()
    inner = shares.timed("scores", lambda: sum(range(200_000)))
    shares.timed("baseline", inner)()
    assert shares.seconds["scores"] > 0
    assert shares.seconds["baseline"] < shares.seconds["scores"]
