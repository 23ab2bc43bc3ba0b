"""Reasons of many windows in few words."""

from fidim_lab.identification.equations.refusals import bare, together


def test_a_window_is_named_once():
    assert bare("i01", "Window i01: 5 samples.") == "5 samples."
    assert bare("i01", "Window i01 lasts 0.1 s.") == "lasts 0.1 s."
    assert bare("i01", "0.25 s of it are good.") == "0.25 s of it are good."


def test_windows_with_one_reason_share_its_words():
    unused = {"i01": "Window i01: lengths miss by 71 mm.", "i02": "Window i02: lengths miss by 80 mm.", "i03": "Blind."}
    assert together(unused) == "i01, i02 (figures of i01): lengths miss by 71 mm.; i03: Blind."
    assert together({}) == ""
