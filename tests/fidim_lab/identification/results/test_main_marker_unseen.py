"""A main marker that is covered, in some windows or in all: the others show where the platform is."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from fidim_lab.data.records import Body, Campaign
from fidim_lab.identification.cleaning.clean import clean_recordings
from fidim_lab.identification.identify import identify as by_equations
from fidim_lab.identification.mle.identify import identify as by_likelihood
from fidim_lab.identification.results.validation import QUICK

NOISE = 1e-4


def covered(campaign: Campaign, ids: set[str]) -> Campaign:
    """Without the main marker in these windows."""
    windows = []
    for window in campaign.windows:
        markers = window.markers.copy()
        if window.id in ids:
            markers[:, 0] = np.nan
        windows.append(replace(window, markers=markers))
    return replace(campaign, windows=tuple(windows))


@pytest.mark.parametrize("identify", [partial(by_equations, checks=QUICK), partial(by_likelihood, native=True)])
@pytest.mark.parametrize("ids", [{"w1"}, {"w1", "w2", "w3", "w4", "w5"}])
def test_body_is_found_by_the_markers_that_are_seen(recorded, true_body: Body, ids: set[str], identify):
    campaign = covered(recorded(noise=NOISE, cluster=True), ids)
    found = identify(clean_recordings(campaign).recordings.campaign)
    assert found.body is not None
    assert found.body.com == pytest.approx(true_body.com, abs=2e-4)
    assert all(window.used for window in found.windows if window.id != "w5")
