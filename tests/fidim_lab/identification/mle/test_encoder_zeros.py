"""Encoders whose zeros nobody knows: they tell an anchor that is off, and keep silent where the file is right."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Campaign
from fidim_lab.identification.mle.encoder_zeros import anchors_by_encoders
from fidim_lab.identification.mle.evidence import ODDS
from fidim_lab.identification.mle.geometry_words import encoders_say
from fidim_lab.identification.results.result import Moved
from fidim_lab.model.mechanism import Mechanism

OFF = np.array([0.02, -0.004, 0.003])
"""m, of the anchor of cable 2"""
SCATTER = 3e-4
"""m, of what an encoder counts from window to window"""


@pytest.fixture
def with_zeros(recorded, exact_motions):
    """The campaign beside a robot file with one anchor off by so much, its encoders read from a zero of their own."""

    def make(off: np.ndarray, seed: int, zero: float = 1.5) -> Campaign:
        campaign = recorded(noise=1e-4, cluster=True, seed=seed)
        cables = list(campaign.robot.cables)
        cables[1] = replace(cables[1], d=cables[1].d - off)
        file = Mechanism(replace(campaign.robot, cables=tuple(cables)))
        random = np.random.default_rng(seed)
        windows = []
        for window, (lengths, motion) in zip(campaign.windows, exact_motions, strict=True):
            counted = lengths - zero + SCATTER * random.standard_normal(len(lengths))
            held = np.median(file.lengths(motion.positions, motion.rotations), axis=0)
            said = np.tile(held, (len(window.t), 1))
            windows.append(replace(window, lengths=said, lengths_by_poses=True, encoder_zeros=held - counted))
        return replace(campaign, robot=file.robot, windows=tuple(windows))

    return make


def test_an_anchor_that_is_off_is_told_with_its_place(with_zeros):
    found = {one.cable: one for one in anchors_by_encoders([with_zeros(OFF, 1)])}
    told = found[2]
    assert told.log_odds > ODDS
    assert told.log_odds > max(one.log_odds for cable, one in found.items() if cable != 2) + ODDS
    assert (np.abs(np.array(told.by) - OFF) < 4 * np.array(told.sd)).all()
    assert told.left < 0.2 * told.scatter
    assert told.windows == 5


def test_a_right_file_is_let_alone(with_zeros):
    for seed in range(8):
        assert encoders_say(anchors_by_encoders([with_zeros(np.zeros(3), seed)])) == ""


def test_campaigns_pool_an_anchor_and_keep_their_zeros(with_zeros):
    first, second = with_zeros(OFF, 1), with_zeros(OFF, 2, zero=0.2)
    alone = anchors_by_encoders([first])[1]
    n = first.robot.n
    together = anchors_by_encoders([first, second], [range(n), range(n)])[1]
    assert together.windows == 10
    assert together.log_odds > alone.log_odds
    assert (np.abs(np.array(together.by) - OFF) < 4 * np.array(together.sd)).all()


def test_a_window_needs_one_marker_whichever_it_is(with_zeros):
    campaign = with_zeros(OFF, 1)
    first, *others = campaign.windows
    markers = np.arange(first.markers.shape[1])[:, None]
    covered = replace(first, markers=np.where(markers == 0, np.nan, first.markers))
    blind = replace(first, markers=np.full_like(first.markers, np.nan))
    whole, one_less, none, without = (
        anchors_by_encoders([replace(campaign, windows=(*kept, *others))])
        for kept in ((first,), (covered,), (blind,), ())
    )
    assert none == without
    assert [one.windows for one in one_less] == [one.windows for one in whole]
    assert one_less[1].by == pytest.approx(whole[1].by, abs=1e-3)


def test_few_windows_or_none_that_were_read_say_nothing(with_zeros, recorded):
    campaign = with_zeros(OFF, 1)
    assert anchors_by_encoders([replace(campaign, windows=campaign.windows[:3])]) == ()
    assert anchors_by_encoders([recorded()]) == ()


def test_a_sentence_tells_anchor_and_whether_the_fit_agrees(with_zeros):
    heard = anchors_by_encoders([with_zeros(OFF, 1)])
    sd = (1e-3, 1e-3, 1e-3)
    same, other = (encoders_say(heard, [Moved("anchor", 2, by, sd)]) for by in ((0.01, 0, 0), (-0.01, 0, 0)))
    assert "the zero of cable 2 differs by" in same
    assert same.endswith("the way the fit moves it.")
    assert not other.endswith("the way the fit moves it.")
