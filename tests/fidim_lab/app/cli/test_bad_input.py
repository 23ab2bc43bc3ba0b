"""The list of bad input of the specification, through the command: a sentence with window and time, or a refusal."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fidim_lab.app import cli, compose
from fidim_lab.data.campaign import read_campaign, write_campaign
from fidim_lab.data.records import Campaign, Role, Window
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.identification.random_plan import random_plan
from sim_backends.plant.plant import Plant
from sim_backends.plant.sensors import Noise
from sim_backends.simulate import simulate_campaign

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def campaigns(tmp_path_factory) -> dict[str, Campaign]:
    """As it should be, and recordings that only a simulation can spoil."""
    robot = read_robot(PAPERS_ROBOT)
    world = compose.simulated_world(robot, 3, ())
    plant = Plant(world)
    plan = random_plan(robot, "base", 4, 0, 3)
    first = plan.windows[0]
    plans = {
        "good": plan,
        "slack": replace(plan, windows=(replace(first, displacement=2 * first.displacement), *plan.windows[1:])),
        "still": replace(plan, windows=tuple(replace(w, displacement=0 * w.displacement) for w in plan.windows)),
        "one place": replace(
            plan,
            windows=tuple(
                replace(first, id=w.id, displacement=f * first.displacement)
                for w, f in zip(plan.windows, (1, -1, 0.7, -0.6), strict=True)
            ),
        ),
    }
    return {
        name: simulate_campaign(robot, p, world, np.random.default_rng(1), Noise.of(robot), platform=plant)[0]
        for name, p in plans.items()
    }


def only(campaign: Campaign, change: Callable[[Window], Window]) -> Campaign:
    """The first window changed."""
    return replace(campaign, windows=(change(campaign.windows[0]), *campaign.windows[1:]))


def rows(window: Window, kept: np.ndarray) -> Window:
    assert window.lengths is not None
    return replace(
        window, t=window.t[kept], markers=window.markers[kept], lengths=window.lengths[kept], currents=None, further={}
    )


def jump(by: float) -> Callable[[Window], Window]:
    return lambda w: replace(w, t=w.t + by * (np.arange(len(w.t)) >= 500))


def longer(window: Window) -> Window:
    assert window.lengths is not None
    return replace(window, lengths=window.lengths + np.array([0, 0.05, 0, 0]))


def fewer(seconds: float) -> Callable[[Window], Window]:
    return lambda w: rows(w, w.t <= seconds)


CASES: dict[str, tuple[Callable[[dict[str, Campaign]], Campaign], str, int | None, str]] = {
    "no window to fit": (
        lambda c: replace(c["good"], windows=tuple(replace(w, role=Role.VALIDATE) for w in c["good"].windows)),
        "tls", 1, "No window of role 'identify' can be used",
    ),
    "one window": (
        lambda c: replace(c["good"], windows=c["good"].windows[:1]), "tls", None, "Fewer than three windows",
    ),
    "ten samples": (lambda c: only(c["good"], fewer(0.09)), "mle", 2, "i01.csv: 10 samples; a window needs"),
    "a quarter of a second": (lambda c: only(c["good"], fewer(0.25)), "tls", 0, "Window i01 is not used: 0.25 s"),
    "one equilibrium": (
        lambda c: c["one place"], "tls", None, "All 4 windows hang at one equilibrium (cable lengths within 0.0 mm",
    ),
    "nothing moves": (lambda c: c["still"], "mle", 1, "fidim: No window moves: the largest motion is"),
    "slack cable": (lambda c: c["slack"], "tls", None, "Window i01: cable 2 would have had to push from 0.24 to"),
    "lengths contradict the marker": (
        lambda c: only(c["good"], longer), "tls", None, "Window i01: cable",
    ),
    "lengths contradict the marker, trajectories": (
        lambda c: only(c["good"], longer), "mle", 0,
        "Window i01 is not used: its cable lengths and its markers miss each other by 13.4 mm at its start (0.00 s)",
    ),
    "slack cable, trajectories": (
        lambda c: c["slack"], "mle", 0, "Window i01: cable 1 goes slack 0.19 s after its start",
    ),
    "one window in millimetres": (
        lambda c: only(c["good"], lambda w: replace(w, markers=1000 * w.markers)), "tls", 0,
        "Window i01: the markers are in millimetres (at 0.00 s of i01",
    ),
    "all in millimetres": (
        lambda c: replace(
            c["good"], windows=tuple(replace(w, markers=1000 * w.markers) for w in c["good"].windows)
        ), "mle", 1, "the markers are in millimetres",
    ),
    "clock jumps": (
        lambda c: only(c["good"], jump(0.5)), "tls", 0,
        "Window i01: the time stamps jump by 0.510 s at 4.99 s, but the markers do not",
    ),
    "clock jumps by two samples": (
        lambda c: only(c["good"], jump(0.02)), "tls", 0,
        "Window i01: the time stamps jump by 0.030 s at 4.99 s, but the markers do not",
    ),
    "clock goes back": (
        lambda c: only(c["good"], jump(-0.5)), "tls", 2, "i01.csv: line 502: time 4.5 s goes back from 4.99 s",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_bad_input_is_never_a_number_without_a_word(campaigns, tmp_path: Path, capsys, case: str):
    make, method, code, says = CASES[case]
    write_campaign(tmp_path / "campaign", make(campaigns))
    ended = cli.run(["identify", str(tmp_path / "campaign"), "--method", method])
    said = capsys.readouterr()
    assert code is None or ended == code
    assert says in " ".join((said.out + said.err).split())
    assert "Traceback" not in said.out + said.err


def test_good_input_is_not_suspected(campaigns, tmp_path, capsys):
    """Neither are rows that are truly missing taken for a jump of the clock."""
    gaps = only(campaigns["good"], lambda w: rows(w, (w.t < 5) | (w.t > 5.03)))
    gaps = replace(
        gaps, windows=(gaps.windows[0], rows(gaps.windows[1], gaps.windows[1].t % 3 < 2.5), *gaps.windows[2:])
    )
    write_campaign(tmp_path / "campaign", gaps)
    assert read_campaign(tmp_path / "campaign").windows[0].id == "i01"
    assert cli.run(["identify", str(tmp_path / "campaign"), "--method", "tls"]) == 0
    said = capsys.readouterr().out
    for word in ("time stamps jump", "would have had to push", "one equilibrium", "millimetres", "do not move"):
        assert word not in said
