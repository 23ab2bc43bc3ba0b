"""Windows are counted, not the parts that a hand left of them."""

import pytest

from fidim_lab.identification.cleaning.free_motion import were_used, window_count


@pytest.mark.parametrize(
    ("ids", "says"),
    [
        (["i01"], "1 window"),
        (["i01", "i02"], "2 windows"),
        (["i01", "i02", "i02, part 2"], "2 windows (in 3 parts)"),
        (["i01", "i01, part 2", "i01, part 3"], "1 window (in 3 parts)"),
        ([], "0 windows"),
    ],
)
def test_parts_of_a_window_count_once(ids: list[str], says: str) -> None:
    assert window_count(ids) == says


def test_one_window_was_used_and_two_were() -> None:
    assert were_used(iter(["i01", "i01, part 2"])) == "1 window (in 2 parts) was used"
    assert were_used(["i01", "i02"]) == "2 windows were used"
