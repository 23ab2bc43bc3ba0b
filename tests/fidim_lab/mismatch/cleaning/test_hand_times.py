"""When a hand comes and goes, told by a model that dissipates: its motion cannot be carried on backwards."""

import pytest

from fidim_lab.mismatch.cleaning.contacts import find_contacts
from fidim_lab.mismatch.cleaning.segments import predict_segments
from fidim_lab.mismatch.fitting.refit import refit


@pytest.mark.parametrize(("window", "pushed"), [(2, ["i02"]), (0, ["i01", "i02", "v01"])], ids=["one", "all"])
@pytest.mark.sampled(1)
def test_a_known_model_tells_when_a_hand_came_and_went(baseline_of, window: int, pushed: list[str]) -> None:
    hand = f"hand-contact:fx=3.0,fy=-2.0,start=3.4,stop=4.3,window={window}"
    start = baseline_of(hand, "air-drag-linear:c=0.6", seed=12, windows=2, seconds=8.0)
    drag = next(h for h in start.tried.direct if h.effect.id == "air-drag-linear")
    model = refit(start.short_ground, start.short, [drag], [drag.absent], start.context)
    assert model is not None
    segments = predict_segments(model, start.campaign.windows)
    assert [len(one.dof) for one in segments.windows] == [4, 4, 4]
    found = find_contacts(segments)
    assert sorted(contact.window for contact in found) == sorted(pushed)
    for contact in found:
        assert 2.9 < contact.begin < 3.5
        assert 4.2 < contact.end < 4.9
