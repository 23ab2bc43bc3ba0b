"""What differs between windows, hidden by the other simulator, is found with kind, cable, window and size."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.sealed.campaigns import NATIVE, SealedRecipe, sealed_campaign
from fidim_lab.data.records import Campaign, Robot, Role
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.identification.mle.fit import fit
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.mismatch.budget import Budget
from fidim_lab.mismatch.cleaning.clean import clean
from fidim_lab.mismatch.conclusion.explanation import Verdict
from fidim_lab.mismatch.corrected import with_corrections
from fidim_lab.mismatch.explain import explain
from fidim_lab.mismatch.fitting.baseline import Baseline, fit_baseline
from fidim_lab.mismatch.rounds import Rounds
from fidim_lab.mismatch.selection.general_geometry import opened
from fidim_lab.mismatch.session.changes import SETTLED, SessionChanges, session_changes
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.model.mechanism import Mechanism
from sim_backends.plant.sensors import Noise
from sim_backends.plant.world import make_world
from sim_backends.simulate import BETWEEN, Sampling, simulate_campaign

SEED, WINDOWS, SECONDS = 17, 7, 5.0
SESSION = (WINDOWS) * BETWEEN / 3600
"""h, from the first window to the last: one is held out"""


@pytest.fixture(scope="module")
def errors_of(baseline_of: Callable[..., Baseline]) -> Callable[..., SessionChanges | None]:
    """Of a campaign in which this is hidden."""

    def found(*texts: str) -> SessionChanges | None:
        base = baseline_of(*texts, seed=SEED, windows=WINDOWS, seconds=SECONDS)
        return session_changes(base.fit, base.campaign, SHARED.enough)

    return found


@pytest.mark.sampled(1)
@pytest.mark.parametrize(
    ("hidden", "id", "cable", "sizes"),
    [
        ("length-drift:rate=0.004", "length-drift", None, [-0.004 * SESSION]),
        ("length-drift:rate=-0.005,cable=3", "length-drift", 3, [0.005 * SESSION]),
        ("length-step:by=0.0004,cable=2,at=170", "length-step", 2, [-0.0004]),
        ("camera-drift:x=0.003,y=0,z=-0.002", "camera-drift", None, [0.003 * SESSION, 0.0, -0.002 * SESSION]),
    ],
)
def test_what_readings_are_off_by_is_found_with_its_size(
    errors_of: Callable[..., SessionChanges | None], hidden: str, id: str, cable: int | None, sizes: list[float]
) -> None:
    found = errors_of(hidden)
    assert found is not None
    first = found.found[0]
    assert (first.kind.id, first.kind.cable) == (id, cable)
    np.testing.assert_allclose(first.theta, sizes, atol=float(max(4 * first.sd.max(), 4e-5)))


@pytest.mark.parametrize(
    ("hidden", "id", "first", "mass"),
    [("body-step:m=0.1,at=170", "body-step", 3, 0.1), ("body-drift:rate=1.5", "body-drift", None, 1.5 * SESSION)],
)
def test_a_load_that_is_put_on_is_told_with_mass_and_place(
    baseline_of: Callable[..., Baseline], irma4: Robot, hidden: str, id: str, first: int | None, mass: float
) -> None:
    base = baseline_of(hidden, seed=SEED, windows=WINDOWS, seconds=SECONDS)
    found = session_changes(base.fit, base.campaign, SHARED.enough)
    assert found is not None
    for _ in range(2):  # a body acts on many swings by more than to first order
        found, moved = found.sharpened(fitted_again(found.put_right(base.campaign)).fit)
    assert moved < SETTLED
    (change,) = found.found
    assert (change.kind.id, change.kind.first) == (id, None if first is None else found.order[first])
    load = found.load(change)
    assert load is not None
    assert load.share * irma4.mass == pytest.approx(mass, abs=4 * load.share_sd * irma4.mass + 0.012 * mass)
    np.testing.assert_allclose((load.at - [0.05, -0.05, 0.1]) / load.at_sd, 0.0, atol=4.0)


def fitted_again(campaign: Campaign) -> Baseline:
    return fit_baseline(campaign, native=True, say=lambda _: None)


def test_a_body_of_its_own_in_a_single_window_is_told(campaign_of: Callable[..., Campaign]) -> None:
    loaded = campaign_of("body-step:m=0.1,at=0", seed=SEED, windows=WINDOWS, seconds=SECONDS)
    plain = campaign_of(seed=SEED, windows=WINDOWS, seconds=SECONDS)
    odd = plain.windows[2].id
    windows = tuple(loaded.windows[2] if window.id == odd else window for window in plain.windows)
    found = session_changes(fitted_again(replace(plain, windows=windows)).fit, plain, SHARED.enough)
    assert found is not None
    assert [(one.kind.id, one.kind.first) for one in found.found] == [("body-once", odd)]


def test_a_window_with_a_body_of_its_own_moves_as_if_all_had_it(campaign_of: Callable[..., Campaign]) -> None:
    campaign = campaign_of(seed=SEED, windows=WINDOWS, seconds=SECONDS)
    change = np.array([1e-3, -2e-3, 1e-3, 1e-4, 2e-4, 1e-4, 0.0, 1e-4, 0.0])
    windows, mechanism = list(campaign.of_role(Role.IDENTIFY)), Mechanism(campaign.robot, native=True)
    plain = fit(mechanism, windows)
    moved = fit(mechanism, [replace(window, body_change=change) for window in windows])
    np.testing.assert_allclose((plain.values - change - moved.values) / plain.sd, 0.0, atol=1e-3)
    assert moved.excess == pytest.approx(plain.excess, rel=1e-6)


def test_drums_that_are_eccentric_scatter(errors_of: Callable[..., SessionChanges | None]) -> None:
    found = errors_of("length-scatter:size=0.0003")
    assert found is not None
    assert [one.kind.id for one in found.found][:1] == ["length-scatter"]
    assert 0.3 < found.found[0].size / (0.0003 / np.sqrt(2)) < 2.0


@pytest.mark.slow
def test_a_session_without_errors_has_none(errors_of: Callable[..., SessionChanges | None]) -> None:
    assert errors_of() is None
    assert errors_of("swivel-friction:c=0.01") is None


def test_what_is_the_same_in_all_windows_is_geometry(errors_of: Callable[..., SessionChanges | None]) -> None:
    assert errors_of("cable-length-bias:cable=1,bias=-0.007") is None


def test_a_pose_that_noise_puts_far_away_is_no_hand(irma4: Robot) -> None:
    noise = replace(Noise.of(irma4), marker=1.85 * irma4.sensors.marker_noise)
    plan, world = random_plan(irma4, "readings", 7, 4, 18), make_world(irma4, np.random.default_rng(18))
    made, _ = simulate_campaign(irma4, plan, world, np.random.default_rng(19), noise, recording=Sampling(6.0))
    assert clean(made).contacts == ()


def test_readings_that_are_put_right_have_no_errors(baseline_of: Callable[..., Baseline]) -> None:
    base = baseline_of("length-step:by=0.0004,cable=2,at=170", seed=SEED, windows=WINDOWS, seconds=SECONDS)
    found = session_changes(base.fit, base.campaign, SHARED.enough)
    assert found is not None
    right = found.put_right(base.campaign)
    step = found.found[0].kind.first
    for before, after in zip(base.campaign.windows, right.windows, strict=True):
        assert before.lengths is not None
        assert after.lengths is not None
        moved = after.lengths[0] - before.lengths[0]
        later = [one.id for one in base.campaign.windows].index(before.id) >= [
            one.id for one in base.campaign.windows
        ].index(step or "")
        np.testing.assert_allclose(moved, [0.0, 0.0004 * later, 0.0, 0.0], atol=5e-5)
        np.testing.assert_array_equal(after.markers, before.markers)


def test_a_null_with_more_noise_than_stated_is_told_so(irma4: Robot) -> None:
    plan = random_plan(irma4, "noise", 4, 2, SEED)
    world = make_world(irma4, np.random.default_rng(SEED), ())
    noise = replace(Noise.of(irma4), marker=1.3 * irma4.sensors.marker_noise)
    campaign, _ = simulate_campaign(irma4, plan, world, np.random.default_rng(3), noise, recording=Sampling(SECONDS))
    found = explain(campaign)
    assert found.verdict is Verdict.NOTHING_MISSING
    (noise_told,) = found.readings
    assert noise_told.id == "marker-noise"
    assert noise_told.parameters["x"].value == pytest.approx(noise.marker, rel=0.05)
    assert found.answer is not None
    assert "times the declared" in found.answer.certain


@pytest.mark.slow
def test_an_encoder_coarser_than_stated_is_the_sensors_fault(irma4: Robot) -> None:
    """Counts of 0.3 mm where the file states 0.02 mm: the markers alone hide it, and every ± would be too small."""
    plan = random_plan(irma4, "coarse", 5, 2, SEED)
    world = make_world(irma4, np.random.default_rng(SEED), ())
    noise = replace(Noise.of(irma4), encoder=3e-4)
    campaign, truth = simulate_campaign(
        irma4, plan, world, np.random.default_rng(4), noise, recording=Sampling(SECONDS)
    )
    found = explain(campaign)
    assert found.verdict is Verdict.SENSOR_FAULT
    assert not found.effects
    assert [one.id for one in found.readings] == ["length-scatter"]
    s_z = found.parameters["s_z"]
    assert abs(s_z.value - np.array(truth["s"])[2]) < 4 * s_z.sd


@pytest.mark.slow
def test_a_wrong_geometry_looks_like_scatter_but_not_beside_an_open_one(irma4: Robot) -> None:
    plan = random_plan(irma4, "survey", 6, 1, SEED)
    world = make_world(irma4, np.random.default_rng(SEED), ())
    campaign, _ = simulate_campaign(irma4, plan, world, np.random.default_rng(5), recording=Sampling(SECONDS))
    off = np.random.default_rng(6)
    cables = tuple(replace(cable, d=cable.d + 5e-4 * off.standard_normal(3)) for cable in irma4.cables)
    wrong = replace(campaign, robot=replace(irma4, cables=cables))
    exact = fit_baseline(wrong, native=True, say=lambda _: None)
    assert session_changes(exact.fit, wrong, SHARED.enough) is not None
    geometry_open = opened(exact, 1.0, lambda _: None)
    assert session_changes(geometry_open.fit, wrong, SHARED.enough) is None
    rounds = Rounds(exact.short.likelihood.mechanism, lambda _: None, Budget())
    reached = with_corrections(rounds, clean(wrong))
    assert reached.changes is None
    assert reached.last.baseline.geometry


@pytest.mark.slow
@pytest.mark.parametrize("hidden", ["cable-mass:mu=0.05", "frame-compliance:k=1e5"])
def test_an_effect_beside_a_wrong_geometry_is_no_fault_of_the_readings(hidden: str) -> None:
    """Without the geometry open, a scatter of lengths says far more than heavy cables; beside it, less.

    And corrected readings take much of what posts that bend leave, but no more than the geometry does.
    """
    robot = read_robot(PAPERS_ROBOT)
    recipe = SealedRecipe("hidden", robot, (hidden,), NATIVE, (6, 3), 100.0, True, 305, survey=9e-4)
    found = explain(sealed_campaign(recipe)[0])
    assert [one.id for one in found.effects] == [hidden.split(":")[0]], found.message
    assert not found.readings


@pytest.mark.slow
def test_a_load_beside_a_wrong_geometry_is_told_with_both() -> None:
    """Estimated with the robot file's geometry alone the body takes up a part of what that gets wrong."""
    robot = read_robot(PAPERS_ROBOT)
    recipe = SealedRecipe("load", robot, ("body-step:m=0.15,at=330",), NATIVE, (8, 4), 100.0, True, 305, survey=9e-4)
    found = explain(sealed_campaign(recipe)[0])
    assert found.verdict is Verdict.EXPLAINED
    assert [one.id for one in found.effects] == ["body-step"], found.message
    assert found.geometry is not None
    assert found.effects[0].parameters["s_x"].value == pytest.approx(6.4e-4, abs=6e-5)


@pytest.mark.slow
@pytest.mark.sampled(1)
@pytest.mark.parametrize(
    ("change", "effect"),
    [
        ("body-step:m=0.15,at=330", "swivel-damping:c=0.05"),
        ("length-step:by=0.0004,cable=1,at=330", "swivel-friction:c=0.007"),
        ("camera-drift:x=0.002,y=0,z=-0.001", "air-drag-quadratic:c=1"),
    ],
)
def test_a_change_and_an_effect_are_told_beside_each_other(change: str, effect: str) -> None:
    """Each bends what is estimated of the other alone."""
    robot = read_robot(PAPERS_ROBOT)
    recipe = SealedRecipe("both", robot, (change, effect), NATIVE, (8, 4), 100.0, True, 305)
    found = explain(sealed_campaign(recipe)[0])
    told = {one.id for one in found.effects} | {reading.id for reading in found.readings}
    assert found.verdict is Verdict.EXPLAINED
    assert told == {change.split(":")[0], effect.split(":")[0]}, found.message
