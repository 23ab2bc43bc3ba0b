"""The same seed gives the same bytes, another one does not; in real time the same devices give much the same."""

import numpy as np
import pytest

from fidim_lab.data.campaign import read_campaign
from sim_backends.mocap.faults import Faults

DISORDER = Faults(lost=0.002, doubled=0.01, reordered=0.01, torn=0.002)


def run(scene, folder, *, seed=1, faults=None):
    rehearsal = scene.make(faults, folder)
    rehearsal.seed = seed
    rehearsal.at("Record", lambda stage: None)
    return rehearsal.run()


def contents(folder):
    return {path.relative_to(folder): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.mark.parametrize("faults", [None, DISORDER], ids=["calm", "disorder"])
@pytest.mark.sampled(1)
def test_the_same_seed_gives_the_same_bytes(scene, faults):
    first, second = (run(scene, name, faults=faults) for name in ("a", "b"))
    first.check()
    there = contents(first.folder)
    assert {str(path) for path in there} >= {"campaign.toml", "robot.toml", "journal.jsonl", "can.log"}
    assert there == contents(second.folder)


@pytest.mark.slow
def test_another_seed_gives_other_bytes(scene):
    first, second = (contents(run(scene, str(seed), seed=seed).folder) for seed in (1, 2))
    assert {str(path) for path in first if first[path] != second.get(path)} >= {
        "can.log",
        "journal.jsonl",
        "windows/i01.csv",
    }


@pytest.mark.slow
def test_in_real_time_over_python_can_and_udp(scene):
    """Real bus threads, real sockets, real seconds: a whole window of the same swing."""
    ended = scene.in_real_time(lambda rehearsal: rehearsal.at("Record", lambda stage: None))
    assert ended.report.exit_code == 0, ended.report.reason
    ended.check(log=False)
    simulated = read_campaign(run(scene, "jumping").folder).windows[0]
    real = read_campaign(ended.folder).windows[0]
    assert np.mean(~np.isnan(real.markers[:, 0, 0])) > 0.98
    assert real.equilibrium == pytest.approx(simulated.equilibrium, abs=2e-3)
    assert np.nanmax(np.abs(real.lengths - simulated.lengths.mean(axis=0))) < 1e-3
    swings = [np.nanmax(np.ptp(window.markers[:, 0], axis=0)) for window in (real, simulated)]
    assert swings[0] == pytest.approx(swings[1], rel=0.4)  # another hand, at another moment of the swing
    assert _frequency(real) == pytest.approx(_frequency(simulated), rel=0.25)
    for k, place in scene.places(ended.folder / "windows" / "i01.csv").items():
        number = ended.first_number(ended.folder / "windows" / "i01.csv") + k
        assert np.abs(place - ended.truth[number]).max() < 6e-4


def _frequency(window):
    """Of the main marker's largest coordinate, from its zero crossings, Hz."""
    place = window.markers[:, 0] - np.nanmean(window.markers[:, 0], axis=0)
    axis = int(np.argmax(np.nanstd(place, axis=0)))
    signs = np.sign(place[~np.isnan(place[:, axis]), axis])
    crossings = np.flatnonzero(np.diff(signs))
    return (len(crossings) - 1) / 2.0 / ((crossings[-1] - crossings[0]) / 100.0)
