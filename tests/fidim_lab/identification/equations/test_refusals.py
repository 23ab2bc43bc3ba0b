"""Reasons of many windows in few words."""

from fidim_lab.identification.equations.refusals import bare, no_sigma, together


def test_a_window_is_named_once():
    assert bare("i01", "Window i01: 5 samples.") == "5 samples."
    assert bare("i01", "Window i01 lasts 0.1 s.") == "lasts 0.1 s."
    assert bare("i01", "0.25 s of it are good.") == "0.25 s of it are good."


def test_windows_with_one_reason_share_its_words():
    unused = {"i01": "Window i01: lengths miss by 71 mm.", "i02": "Window i02: lengths miss by 80 mm.", "i03": "Blind."}
    assert together(unused) == "i01, i02 (figures of i01): lengths miss by 71 mm.; i03: Blind."
    assert together({}) == ""


def test_of_many_windows_the_first_and_the_last_are_named():
    unused = {f"i{k:02d}": f"Window i{k:02d}: lengths miss by {k} mm." for k in range(1, 16)}
    assert together(unused) == "15 windows (i01, i02, … i15; figures of i01): lengths miss by 1 mm."


def test_why_there_is_no_sigma_is_said_once():
    assert no_sigma({}) == ""
    assert no_sigma({"i01": "too short", "i02": "too short"}) == "σ⊥ – in every one: too short"
    assert no_sigma({"i01": "1 s", "i02": "blind"}) == "σ⊥ –: i01: 1 s; i02: blind"
