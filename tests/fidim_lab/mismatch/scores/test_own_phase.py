"""Tones that meet every window at another phase: their score from windows of which each knows its own."""

import numpy as np
import pytest

from fidim_lab.data.records import Campaign, Robot
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.mismatch.fitting.baseline import fit_baseline
from fidim_lab.mismatch.fitting.refit import refit
from fidim_lab.mismatch.linearised.hypotheses import hypotheses
from fidim_lab.mismatch.scores.own_phase import own_phase_scores, rotations
from fidim_lab.mismatch.scores.score import Projected, WindowGram
from fidim_lab.mismatch.scores.views import tones, view
from fidim_lab.mismatch.selection.select import select
from fidim_lab.mismatch.thresholds import SHARED
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign

WINDOWS, COMMON = 8, 3


@pytest.fixture
def tone(irma4: Robot):
    return next(h for h in hypotheses(irma4).periodic if h.effect.id == "periodic-force")


def scored(tone, irma4: Robot, own: np.ndarray):
    """The scores where the windows' amplitudes (W, 6) are these, each known as well as 20 random samples tell."""
    rng = np.random.default_rng(4)
    size = COMMON + 6 + 1
    grams, gradient, curvature = [], np.zeros(6), np.zeros((6, 6))
    for x in own:
        columns = rng.normal(size=(20, 6)) * 2e3
        residual = -columns @ x
        gram = np.zeros((size, size))
        at = np.r_[COMMON : COMMON + 6, size - 1]
        both = np.column_stack([columns, residual])
        gram[np.ix_(at, at)] = both.T @ both
        grams.append(WindowGram(gram, 1000, np.zeros(COMMON)))
        gradient, curvature = gradient - gram[COMMON:-1, -1], curvature + gram[COMMON:-1, COMMON:-1]
    left = sum(gram.gram[-1, -1] for gram in grams) + 8000.0
    found = Projected((tone,), (slice(0, 6),), gradient, curvature, left, 8000, 1.0, np.zeros((size, size)))
    scores = own_phase_scores(found, grams, irma4)
    return (scores[0] if scores else None), left - 8000.0


def test_amplitude_and_phases_come_back_but_for_their_common_turn(tone, irma4) -> None:
    rng = np.random.default_rng(1)
    amplitude, phases = np.array([0.02, 0.05, -0.01, 0.03, -0.02, 0.04]), rng.uniform(-np.pi, np.pi, WINDOWS)
    score, excess = scored(tone, irma4, rotations(phases) @ amplitude)
    assert score.gain == pytest.approx(excess, rel=0.02)
    assert score.phases is not None
    common = np.angle(np.exp(1j * (score.phases - phases)).mean())
    np.testing.assert_allclose(np.exp(1j * (score.phases - phases - common)), 1.0, atol=0.1)
    np.testing.assert_allclose(rotations(np.array([common]))[0] @ score.theta[0], amplitude, atol=2e-3)
    assert score.tried[0].effect.of_each_window
    assert score.log_evidence > 0.4 * excess


def test_amplitudes_that_differ_by_more_than_a_phase_are_no_such_tone(tone, irma4) -> None:
    """As what is left of a drag is: along one line, at any phase, larger where the platform swings more."""
    rng = np.random.default_rng(2)
    line, sizes = np.array([0.02, 0.05, -0.01, 0.0, 0.0, 0.0]), np.linspace(0.1, 2.0, WINDOWS)
    turned = rotations(rng.uniform(-np.pi, np.pi, WINDOWS)) @ line
    assert scored(tone, irma4, turned)[0] is not None
    assert scored(tone, irma4, sizes[:, np.newaxis] * turned)[0] is None
    assert scored(tone, irma4, rng.normal(size=(WINDOWS, 6)) * 0.04)[0] is None


def test_noise_alone_is_no_tone(tone, irma4) -> None:
    score, _ = scored(tone, irma4, np.random.default_rng(3).normal(size=(WINDOWS, 6)) * 1e-4)
    assert score is None or score.log_evidence < 0


@pytest.mark.parametrize("phase", [0.0, 0.7, -2.0])
def test_a_turned_wave_is_the_wave_later(phase: float) -> None:
    s, c = np.array([1.0, 2.0, 3.0]), np.array([-1.0, 0.5, 2.0])
    x = rotations(np.array([phase]))[0] @ np.concatenate([s, c])
    angle = 0.3
    later = s * np.sin(angle + phase) + c * np.cos(angle + phase)
    np.testing.assert_allclose(x[:3] * np.sin(angle) + x[3:] * np.cos(angle), later)


@pytest.fixture(scope="module")
def fanned(irma4: Robot) -> Campaign:
    """A fan whose period is no part of the minute between two windows."""
    plan = random_plan(irma4, "fan", 5, 2, 31)
    hidden = parse_effect("periodic-force:ax=0.3,ay=0.4,az=0.05,f=1.2717", irma4.n)
    world = make_world(irma4, np.random.default_rng(31), (hidden,))
    return simulate_campaign(irma4, plan, world, np.random.default_rng(32), recording=Sampling(8.0))[0]


@pytest.mark.slow
def test_a_fan_that_nothing_keeps_in_step_is_named_with_its_frequency(fanned: Campaign) -> None:
    found = select(fit_baseline(fanned, native=True, say=lambda _: None), lambda _: None)
    (named,) = found.best.model.tried
    assert named.effect.id == "periodic-force"
    assert found.best.model.theta_of(0)[0][6] == pytest.approx(1.2717, abs=0.003)
    assert found.best.is_white
    assert found.best.held_out.chi2_per_dof < 1.1


@pytest.mark.slow
def test_a_sway_of_its_own_phase_is_heard_beside_a_model_that_follows_the_first_seconds_alone(baseline_of) -> None:
    texts = ("frame-sway:ax=0.002,ay=-0.001,f=0.62", "frame-misalignment:rx=0.004,rz=-0.003,dx=0.002")
    start = baseline_of(*texts, seed=33, windows=4, seconds=10.0)
    term = next(h for h in start.tried.direct if h.effect.id == "frame-misalignment")
    model = refit(start.whole_ground, start.fit, [term], [term.absent], start.context)
    assert model is not None
    assert model.excess > SHARED.near
    seen, heard = (look(model, start.tried, start.context) for look in (view, tones))
    assert seen.races
    assert not any(score.tried[0].effect.of_each_window for score in seen.singles)
    loudest = heard.singles[0].tried[0]
    assert loudest.effect.id == "frame-sway"
    assert loudest.effect.of_each_window
    assert loudest.absent[-1] == pytest.approx(0.62, abs=0.1)
    assert heard.singles[0].gain > 0.5 * heard.rest


@pytest.mark.sampled(1)
@pytest.mark.parametrize(
    ("beside", "heard"),
    [("rotational-drag:c=0.0005", True), ("attachment-friction:dry=0.01", False)],
    ids=["nearly all that is left", "half of it"],
)
def test_the_first_seconds_tell_a_sway_of_its_own_phase_that_takes_nearly_all_that_is_left(
    baseline_of, beside: str, heard: bool
) -> None:
    sway = "frame-sway:ax=-0.0003,ay=-0.0013,az=0.0002,f=2.66,psi=0.65"
    start = baseline_of("cable-length-bias:bias=-0.009,cable=3", sway, beside, seed=6, windows=5, seconds=4.0)
    bias = next(h for h in start.tried.direct if (h.effect.id, h.effect.cable) == ("cable-length-bias", 3))
    model = refit(start.short_ground, start.short, [bias], [bias.absent], start.context)
    assert model is not None
    seen = view(model, start.tried, start.context)
    assert any(s.tried[0].effect.of_each_window for s in seen.singles) == heard
    if heard:
        assert seen.singles[0].label == "frame-sway (own phase)"
