"""The paper's own takes: body and geometry from four and two cables predict those of three."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fidim_lab.app.records.import_takes import find_windows
from fidim_lab.data.importers.grab import read_grab
from fidim_lab.data.records import Campaign, Role, Window
from fidim_lab.identification.joint.cross import predicted_by
from fidim_lab.identification.joint.fit import FRICTION, alone, fit_jointly
from fidim_lab.identification.joint.sharing import in_common

BROKEN = frozenset({"k46-2", "k48", "k50-2"})
"""takes whose markers jump by centimetres or are hardly seen: told so by the import"""


def cut(window: Window) -> Window | None:
    """8 to 18 s, as the laboratory used its takes."""
    rows = (window.t >= 8.0) & (window.t <= 18.005)
    if rows.sum() < 300 or window.id in BROKEN:
        return None
    return replace(window, role=Role.IDENTIFY, t=window.t[rows], markers=window.markers[rows], lengths=None)


@pytest.mark.shared
@pytest.mark.slow
def test_four_and_two_cables_predict_three(shared: Path) -> None:
    wanted = {8, 9, 12, 13, 18, 19, 20, 21, 22, 23, 26, 31, 32, 33, 36, *range(37, 61)}
    groups = read_grab(shared / "recordings" / "grab", lambda number: number in wanted)
    campaigns: list[Campaign] = []
    for group in groups:
        windows = [cut(window) for one in find_windows(group) for window in one.windows]
        kept = tuple(window for window in windows if window is not None)
        campaigns.append(Campaign(group.name, group.robot, 100.0, kept))
    common = in_common(campaigns)
    both = in_common([campaigns[0], campaigns[2]])
    fitted = fit_jointly(both, alone(both, native=True), FRICTION, native=True)
    assert fitted.layout.effects == FRICTION
    anchor = next(piece.place for piece in fitted.layout.pieces if piece.key == ("anchor", 2))
    assert np.abs(fitted.values[anchor]).max() < 0.1
    seen = predicted_by(common, replace(fitted, chosen=(0, 2)), 1, (Role.IDENTIFY,))
    assert seen.rms is not None
    assert seen.of_pose is not None
    assert seen.rms < 1.06e-3
    assert seen.of_pose < 1.0e-3
