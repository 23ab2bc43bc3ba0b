"""Steps between windows, of which those that were fitted tell only on which side of them they are."""

import numpy as np
import pytest

from fidim_lab.mismatch.session.kinds import BODY_STEP, CAMERA_STEP, SessionKind, not_told_apart

ORDER = ("i01", "i02", "v01", "i03", "v02", "i04")
FITTED = ("i01", "i02", "i03", "i04")


def step(id: str, first: str) -> SessionKind:
    course = (np.arange(len(ORDER)) >= ORDER.index(first)).astype(float)
    return SessionKind(id, None, np.eye(16)[:, -9:], course, tuple("abcdefghi"), first)


@pytest.mark.parametrize(
    ("id", "first", "others"),
    [
        (CAMERA_STEP, "i03", [("camera-step", "v01")]),
        (CAMERA_STEP, "v01", [("camera-step", "i03")]),
        (CAMERA_STEP, "i02", []),
        (BODY_STEP, "i04", [("body-step", "v02")]),  # in the last one alone is the same
        (BODY_STEP, "v02", [("body-step", "i04")]),
        (BODY_STEP, "i03", [("body-step", "v01")]),
    ],
)
def test_windows_that_were_not_fitted_leave_open_where_a_step_is(id, first, others):
    found = not_told_apart(step(id, first), ORDER, FITTED)
    assert [(one.id, one.first) for one in found] == others


def test_what_has_no_first_window_stands_alone():
    drift = SessionKind("camera-drift", None, np.eye(16)[:, :3], np.linspace(0, 1, len(ORDER)), tuple("xyz"))
    assert not_told_apart(drift, ORDER, FITTED) == ()
