"""Motion that dies out is reported as such; what keeps its energy is not, however wrong the model is."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Robot
from fidim_lab.effects.dissipation.attachment_friction import AttachmentFriction
from fidim_lab.effects.dissipation.drag import RotationalDrag
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.effects.geometry.cable_geometry import AnchorOffset
from fidim_lab.effects.geometry.frames import GravityTilt
from fidim_lab.identification.mle.dissipated import lost_energy
from fidim_lab.identification.mle.figures import figures_of
from fidim_lab.identification.mle.findings import cause, outcome
from fidim_lab.identification.mle.fit import Fit, fit
from fidim_lab.identification.mle.judge import Remainder
from fidim_lab.identification.mle.trajectories.optimise import Ending
from fidim_lab.identification.results.result import ResultOutcome
from fidim_lab.model.mechanism import Mechanism

from .conftest import Record


def fitted(four: Robot, record: Record, effects: Sequence[NamedEffect], theta: Sequence[float]) -> Fit:
    windows = record(four, 3, seconds=6.0, markers=3, effects=effects, theta=tuple(theta))
    return fit(Mechanism(four, native=True), windows)


@pytest.mark.parametrize(
    ("effect", "theta"), [(RotationalDrag(), (0.02,)), (AttachmentFriction(), (0.004, 0.004))], ids=["drag", "friction"]
)
def test_what_dissipates_is_told(four: Robot, record: Record, effect: NamedEffect, theta: Sequence[float]) -> None:
    found = fitted(four, record, (effect,), theta)
    lost = lost_energy(found.remainders, found.likelihood.noise)
    assert found.excess > 1.5
    assert lost is not None
    assert lost.windows == 3
    assert "decays" in lost.says


@pytest.mark.parametrize(
    ("effect", "theta"),
    [(AnchorOffset(2), (0.02, 0.0, 0.0)), (GravityTilt(), (0.02, -0.01))],
    ids=["anchor", "gravity"],
)
def test_what_keeps_the_energy_is_not(four: Robot, record: Record, effect: NamedEffect, theta: Sequence[float]) -> None:
    found = fitted(four, record, (effect,), theta)
    assert lost_energy(found.remainders, found.likelihood.noise) is None


@pytest.mark.parametrize("dies", [True, False], ids=["dies", "keeps"])
def test_a_search_that_found_no_motion_tells_by_the_recordings(four: Robot, record: Record, *, dies: bool) -> None:
    effects, theta = ((RotationalDrag(),), (0.02,)) if dies else ((GravityTilt(),), (0.02, -0.01))
    found = fitted(four, record, effects, theta)
    optimum = replace(found.journey.optimum, ending=Ending.EXHAUSTED, foretold=())
    lost = replace(found, journey=replace(found.journey, optimum=optimum), remainders=found.remainders[:1])
    assert cause(lost, None).startswith("The recorded motion dies down in all 3 windows") == dies


def made(rate: float, noise: float, size: float, seed: int) -> Remainder:
    """A swing of 1.3 Hz that loses `rate` of its energy a second, against one that loses none."""
    t = np.arange(1001) / 100
    kept = size * np.sin(2 * np.pi * 1.3 * t + seed)[:, np.newaxis, np.newaxis] * np.ones(3)
    noisy = noise * np.random.default_rng(seed).standard_normal(kept.shape)
    recorded = kept * np.exp(-rate * (t - 5) / 2)[:, np.newaxis, np.newaxis] + noisy
    return Remainder(t, recorded - kept, kept, 1.0, 1, 1.0, None, noise)


def test_the_rate_is_that_of_the_energy() -> None:
    lost = lost_energy([made(0.05, 1e-4, 0.01, seed) for seed in range(4)], 1e-4)
    assert lost is not None
    assert lost.rate == pytest.approx(0.05, rel=0.05)


def test_a_swing_that_is_lost_in_noise_has_died_down() -> None:
    """Of a swing that halves in a second, noise alone is left long before the window ends."""
    lost = lost_energy([made(0.7, 1e-3, 2e-3, seed) for seed in range(4)], 1e-3)
    assert lost is not None
    assert 0.05 < lost.rate < 0.7  # what noise hides may be as large as it


def test_faint_or_single_swings_tell_nothing() -> None:
    assert lost_energy([made(0.05, 1e-4, 0.01, 0)], 1e-4) is None
    assert lost_energy([made(0.05, 1e-4, 2e-5, seed) for seed in range(4)], 1e-4) is None
    assert lost_energy([made(0.0, 1e-4, 1e-3, seed) for seed in range(4)], 1e-4) is None
    one_grows = [made(rate, 1e-4, 0.01, seed) for seed, rate in enumerate((0.05, 0.05, -0.05))]
    assert lost_energy(one_grows, 1e-4) is None


def test_a_body_of_which_nothing_is_seen_is_no_answer(four: Robot, record: Record) -> None:
    found = fit(Mechanism(four, native=True), record(four, 3, seconds=3.0))
    figures = figures_of(found, four.nominal)
    assert outcome(found, figures, ()).answers
    unseen = {name: replace(parameter, seen=False) for name, parameter in figures.parameters.items()}
    ended = outcome(found, replace(figures, parameters=unseen), ())
    assert ended is ResultOutcome.UNSEEN
    assert not ended.answers
