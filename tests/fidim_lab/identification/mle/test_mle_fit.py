"""The fit on recordings whose answer is known, for one to five cables."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Body, Role, Window
from fidim_lab.errors import RefusedError
from fidim_lab.identification.mle import held_out, spread
from fidim_lab.identification.mle.fit import fit
from fidim_lab.identification.mle.trajectories import stages
from fidim_lab.identification.mle.trajectories.likelihood import Point, linearised
from fidim_lab.identification.mle.trajectories.optimise import FINAL, FORETELLING, PATIENCE, Ending, carry_on, optimise
from fidim_lab.identification.mle.trajectories.recordings import prepare
from fidim_lab.model.kinematics import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.modes import modes
from fidim_lab.model.motion import simulate_free_motion
from fidim_lab.model.native import compiler
from fidim_lab.model.slots import Effect


def distance(found, body) -> float:
    """Squared error in units of the stated covariance: χ² with nine degrees of freedom."""
    error = found.values[:9] - body.vector
    return float(error @ np.linalg.solve(found.covariance[:9, :9], error))


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5])
def test_the_body_is_found_within_its_uncertainty(n, robot_with, record, truth):
    """Windows of unequal length and sampling, with gaps; three markers but where one is enough."""
    robot = robot_with(n)
    windows = record(robot, 3, markers=1 if n >= 4 else 3, seed=n)
    windows[0] = replace(windows[0], t=windows[0].t[:150], markers=windows[0].markers[:150], lengths=None)
    gap = windows[1].markers.copy()
    gap[40:60] = np.nan
    windows[1] = replace(windows[1], markers=gap)
    sparse = np.sort(np.random.default_rng(n).choice(201, 120, replace=False))
    windows[2] = replace(
        windows[2],
        t=windows[2].t[sparse],
        markers=windows[2].markers[sparse],
        lengths=windows[2].lengths[sparse],
    )
    found = fit(Mechanism(robot), windows)
    assert found.ending is Ending.CONVERGED
    assert not found.journey.lost
    assert not found.journey.slack
    assert 0.8 < found.chi2_per_dof < 1.2
    assert distance(found, truth(robot)) < chi2.ppf(0.999, 9)


@pytest.fixture(scope="module")
def from_cad(four, record):
    return fit(Mechanism(four, native=True), record(four, 3))


def test_a_fit_that_will_not_come_as_far_as_is_wanted_is_given_up(from_cad):
    likelihood, found = from_cad.likelihood, from_cad.journey.optimum
    off = Point(
        found.point.shared * np.append(np.full(9, 1.02), np.ones(len(found.point.shared) - 9)), likelihood.guesses
    )
    free = np.ones(len(off.shared), dtype=bool)

    def ended(wanted, promise):
        effort = replace(FINAL, wanted=wanted, promise=promise)
        return optimise(likelihood, off, from_cad.journey.ends, from_cad.prior, effort, free)

    reached = ended(found.cost * 1.01, FINAL.promise)
    assert reached.ending is Ending.CONVERGED
    assert reached.cost == pytest.approx(found.cost, rel=1e-6)
    given_up = ended(0.5 * found.cost, promise=0.0)
    assert given_up.ending is Ending.EXHAUSTED
    assert given_up.rounds == PATIENCE


def test_a_fit_goes_on_from_where_it_ended_as_if_it_had_not(from_cad):
    likelihood, found = from_cad.likelihood, from_cad.journey.optimum
    off = Point(
        found.point.shared * np.append(np.full(9, 1.02), np.ones(len(found.point.shared) - 9)), likelihood.guesses
    )
    ends, prior, free = from_cad.journey.ends, from_cad.prior, np.ones(len(off.shared), dtype=bool)
    begun = optimise(likelihood, off, ends, prior, replace(FINAL, rounds=2), free)
    assert begun.ending is Ending.EXHAUSTED
    assert begun.rounds == 2
    whole, further = (
        optimise(likelihood, off, ends, prior, FINAL, free),
        carry_on(likelihood, begun, prior, FINAL, free),
    )
    assert further.ending is Ending.CONVERGED
    assert further.costs[:3] == begun.costs
    assert list(further.costs) == sorted(further.costs, reverse=True)
    assert further.cost == pytest.approx(whole.cost, abs=1e-3)
    # a pace is taken over the rounds before, too: a fit that creeps is not tried two rounds more
    count = sum(len(r.markers) + len(r.lengths) for r in begun.simulation.residuals)
    slow = replace(begun, costs=tuple(count * c for c in (9.2, 9.1, 9.0)), cost=9.0 * count)
    assert carry_on(likelihood, slow, prior, replace(FINAL, creep=0.1), free).rounds == begun.rounds


@pytest.mark.slow
def test_no_step_is_taken_to_where_derivatives_are_not_finite(from_cad, monkeypatch):
    """As of a motion that runs away so fast that only its beginning can be simulated."""
    likelihood, found = from_cad.likelihood, from_cad.journey.optimum
    best = found.point.shared
    off = Point(best * np.append([1.0, 1.0, 0.98], np.ones(len(best) - 3)), likelihood.guesses)
    limit = 0.99 * best[2]
    free, seen = np.ones(len(best), dtype=bool), []

    def bounded(likelihood, simulation):
        seen.append(simulation.point.shared[2] > limit)
        for window in linearised(likelihood, simulation):
            yield replace(window, by_shared=np.where(seen[-1], np.nan, window.by_shared))

    monkeypatch.setattr("fidim_lab.identification.mle.trajectories.optimise.linearised", bounded)
    ended = optimise(likelihood, off, from_cad.journey.ends, from_cad.prior, FINAL, free)
    assert any(seen)
    assert ended.point.shared[2] <= limit
    assert np.isfinite(ended.tables).all()
    assert optimise(likelihood, found.point, from_cad.journey.ends, from_cad.prior, FINAL, free) is None


@pytest.mark.slow
def test_a_fit_far_astray_that_creeps_is_given_up_and_one_that_gains_is_not(from_cad):
    likelihood, found = from_cad.likelihood, from_cad.journey.optimum
    count, start = len(found.point.shared), likelihood.guesses
    held = np.arange(count) >= 9  # the body stays wrong: the windows' starts alone cannot make good for it
    wrong = Point(found.point.shared * np.append(np.full(9, 1.1), np.ones(count - 9)), start)

    def ended(point, free, **patience):
        effort = replace(FINAL, promise=0.0, **patience)
        return optimise(likelihood, point, from_cad.journey.ends, from_cad.prior, effort, free)

    patient, creeping = ended(wrong, held), ended(wrong, held, creep=0.03)
    assert creeping.rounds < patient.rounds
    assert creeping.ending is Ending.EXHAUSTED
    assert creeping.cost < 1.05 * patient.cost
    free = np.ones(count, dtype=bool)
    assert ended(wrong, free, creep=0.03).cost == pytest.approx(ended(wrong, free).cost, rel=1e-9)
    idle = ended(wrong, free, idle=0.3)
    assert idle.rounds <= ended(wrong, free).rounds
    assert idle.cost < found.cost + 1.0


@pytest.mark.slow
def test_a_fit_of_which_all_rounds_promise_too_little_is_given_up_and_another_is_not(from_cad):
    likelihood, found = from_cad.likelihood, from_cad.journey.optimum
    count, start = len(found.point.shared), likelihood.guesses
    held, free = np.arange(count) >= 9, np.ones(count, dtype=bool)
    wrong = Point(found.point.shared * np.append(np.full(9, 1.1), np.ones(count - 9)), start)

    def ended(free, **patience):
        effort = replace(FINAL, promise=0.0, **patience)
        return optimise(likelihood, wrong, from_cad.journey.ends, from_cad.prior, effort, free)

    patient = ended(held)
    assert len(patient.foretold) == patient.rounds + 1
    assert patient.rounds > FORETELLING
    hopeless = ended(held, hopeless=0.5 * patient.misfit)
    assert (hopeless.ending, hopeless.rounds) == (Ending.EXHAUSTED, FORETELLING - 1)
    assert ended(held, hopeless=1.1 * patient.misfit).rounds == patient.rounds
    assert ended(free, hopeless=2.0).cost == pytest.approx(ended(free).cost, rel=1e-9)
    # what was promised before counts when the fit goes on
    begun = ended(held, rounds=FORETELLING - 1)
    again = replace(FINAL, promise=0.0, hopeless=0.5 * patient.misfit)
    assert carry_on(likelihood, begun, from_cad.prior, again, held).rounds == begun.rounds


@pytest.mark.parametrize(
    "signs",
    [
        (-1, 1, -1, 1),
        (1, -1, -1, -1),
        pytest.param((1, 1, 1, 1), marks=pytest.mark.slow),
        pytest.param((-1, -1, 1, -1), marks=pytest.mark.slow),
        pytest.param((1, -1, 1, 1), marks=pytest.mark.slow),
        pytest.param((-1, 1, 1, -1), marks=pytest.mark.slow),
    ],
)
def test_forty_per_cent_wrong_starts_reach_the_same_optimum(signs, four, record, from_cad):
    nominal = four.nominal
    factors = 1 + 0.4 * np.array(signs)
    start = Body(nominal.com * factors[0], nominal.inertia * np.array([*factors[1:], 1, 1, 1]))
    found = fit(Mechanism(four, native=True), record(four, 3), start=start)
    assert found.ending is Ending.CONVERGED
    assert np.all(np.abs(found.values - from_cad.values) < 0.05 * from_cad.sd)


def test_a_window_lost_on_the_way_is_found_once_the_others_have_shown_the_parameters(
    four, record, from_cad, monkeypatch
):
    really = stages.is_lost

    def lost_as_long_as_the_body_is_vague(likelihood, simulation, w):
        vague = simulation.ends[1:].max() < likelihood.recordings[1].end
        return (w == 0 and vague) or really(likelihood, simulation, w)

    monkeypatch.setattr(stages, "is_lost", lost_as_long_as_the_body_is_vague)
    found = fit(Mechanism(four, native=True), record(four, 3))
    assert not found.journey.lost
    assert np.array_equal(found.journey.ends, from_cad.journey.ends)
    assert np.all(np.abs(found.values - from_cad.values) < 0.05 * from_cad.sd)
    monkeypatch.setattr(stages, "is_lost", lambda likelihood, simulation, w: w == 0)
    assert fit(Mechanism(four, native=True), record(four, 3)).journey.lost == (0,)


def test_a_start_that_cannot_move_is_moved(four, record, truth):
    nominal = four.nominal
    start = Body(1.4 * nominal.com, 0.6 * nominal.inertia)
    found = fit(Mechanism(four, native=True), record(four, 3), start=start)
    assert found.start_moved
    assert distance(found, truth(four)) < chi2.ppf(0.999, 9)


class Drag(Effect):
    parameters = ("c",)

    def wrench(self, state, theta):
        return -theta[0] * state.twist


@pytest.mark.slow
def test_parameters_of_effects_are_estimated_beside_the_body(four, record, truth):
    windows = record(four, 3, effects=(Drag(),), theta=[0.6])
    found = fit(Mechanism(four, (Drag(),)), windows, theta_sd=np.array([5.0]))
    assert abs(found.values[9] - 0.6) < 4 * found.sd[9]
    assert found.sd[9] < 0.02
    assert distance(found, truth(four)) < chi2.ppf(0.999, 9)
    assert found.names[9] == "c"
    without = fit(Mechanism(four, native=True), windows)
    assert without.chi2_per_dof > 3
    assert without.excess > 3


def test_a_window_ends_where_a_cable_goes_slack(four, record, truth):
    """What is recorded after that is no free motion on taut cables: here, the marker just falls."""
    mechanism, body = Mechanism(four, native=True), truth(four)
    rest = pose_from_lengths(mechanism, body, np.array([1.32, 1.58, 1.99, 1.76]))  # cable 4 holds 2 N/kg
    t = np.arange(151) / 100
    motion = simulate_free_motion(mechanism, body, rest.pose, 0.45 * modes(mechanism, body, rest).shapes.sum(axis=1), t)
    assert 1.0 < (motion.slack_time or 0) < 1.2
    taut = motion.motion.positions + motion.motion.rotations @ four.marker
    falls = taut[-1] - np.outer(0.5 * 9.81 * (t[len(taut) :] - t[len(taut) - 1]) ** 2, [0, 0, 1])
    seen = np.concatenate([taut, falls]) + 1e-4 * np.random.default_rng(1).normal(size=(len(t), 3))
    slackening = Window("slackening", Role.IDENTIFY, t, seen[:, None], np.tile(rest.lengths, (len(t), 1)), None)
    found = fit(mechanism, [*record(four, 3), slackening])
    when, cable = found.journey.slack[3]
    assert cable == 4
    assert when == pytest.approx(motion.slack_time, abs=0.01)
    assert when - 0.03 < found.journey.ends[3] < when
    assert 0.8 < found.chi2_per_dof < 1.2
    assert distance(found, body) < chi2.ppf(0.999, 9)


@pytest.mark.slow
def test_a_window_that_cannot_be_followed_is_used_as_far_as_it_can(four, record, truth):
    windows = record(four, 4, seconds=4.0)
    other = record(four, 4, seconds=4.0, kick=-0.3)[1]
    spliced = np.concatenate([windows[1].markers[:200], other.markers[200:]])
    windows[1] = replace(windows[1], markers=spliced)
    found = fit(Mechanism(four, native=True), windows)
    assert found.journey.lost == (1,)
    assert found.journey.ends[1] < 2.5
    np.testing.assert_allclose(found.values, truth(four).vector, rtol=0.1, atol=2e-3)


def test_windows_that_cannot_be_used_are_named(four, record):
    good = record(four, 2)
    short = replace(good[0], id="short", t=good[0].t[:10], markers=good[0].markers[:10], lengths=None)
    millimetres = replace(good[0], id="mm", markers=1e3 * good[0].markers)
    blind = replace(good[0], id="blind", markers=np.full_like(good[0].markers, np.nan))
    swapped = replace(good[0], id="swapped", lengths=good[0].lengths[:, [1, 0, 3, 2]] + [0.3, 0, -0.3, 0.2])
    found = fit(Mechanism(four, native=True), [*good, short, millimetres, blind, swapped])
    assert set(found.unused) == {"short", "mm", "blind", "swapped"}
    assert "at least 0.3 s" in found.unused["short"]
    assert "units" in found.unused["mm"]
    assert "samples hold a marker" in found.unused["blind"]
    assert "order of the cables" in found.unused["swapped"]
    with pytest.raises(RefusedError, match="No window of role 'identify' can be used: short: lasts"):
        fit(Mechanism(four, native=True), [short])


def test_one_equilibrium_leaves_combinations_open_and_says_which(four, record):
    found = fit(Mechanism(four, native=True), record(four, 1))
    assert found.open_combinations
    worst = found.open_combinations[0]
    assert worst.known > 0.1
    assert {name for name, _ in worst.weights} <= set(found.names)
    assert str(worst)
    beside = replace(worst, weights=(("I_xz", 0.5), ("dx", 0.4), ("dx", -0.3)))
    assert str(beside) == "0.5 I_xz with what is fitted beside the body (in units of what is plausible)"
    assert spread.bootstrap_sd(found.tables, found.prior_rows) is None


def test_a_held_out_window_is_predicted_to_the_noise(four, record):
    windows = record(four, 4, seconds=3.0)
    mechanism = Mechanism(four, native=True)
    found = fit(mechanism, windows[:3])
    predicted = held_out.predict(mechanism, found.values, prepare(windows[3], four), four.sensors)
    assert predicted.remainder.chi2_per_dof == pytest.approx(1, abs=0.2)
    wrong = found.values * np.array([1, 1, 1.02, 1, 1, 1, 1, 1, 1])
    assert held_out.predict(mechanism, wrong, prepare(windows[3], four), four.sensors).remainder.chi2_per_dof > 10


def test_dropping_parameters_is_the_constrained_optimum(four, record):
    windows = record(four, 3)
    found = fit(Mechanism(four, native=True), windows)
    drop = np.arange(9) == 6
    refitted = found.without(drop)
    assert refitted[6] == 0
    step = (refitted - found.values)[~drop]
    gradient = found.quadratic.information @ (refitted - found.values) + found.quadratic.gradient
    np.testing.assert_allclose(gradient[~drop] * np.abs(step).max(), 0, atol=1e-3)


@pytest.mark.slow
@pytest.mark.shared
@pytest.mark.parametrize("native", [False, True], ids=["virtual machine", "compiled"])
def test_nothing_left_out_is_identified_at_the_bound(shared, native, tmp_path_factory, monkeypatch):
    """Data of an independent simulator: every error within two standard deviations, held out as good as fitted."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
    campaign = read_campaign(shared / "campaigns" / "open-nothing-left-out")
    hidden = json.loads((shared / "campaigns" / "truth" / "open-nothing-left-out.json").read_text())
    if native and compiler() is None:
        pytest.skip("no C compiler here")
    mechanism = Mechanism(campaign.robot, native=native)
    found = fit(mechanism, campaign.of_role(Role.IDENTIFY))
    assert found.ending is Ending.CONVERGED
    error = (found.values - np.array(hidden["s"] + hidden["I"])) / found.sd
    assert np.abs(error).max() < 2
    assert found.sd[2] < 6e-6
    assert found.chi2_per_dof == pytest.approx(0.9923, abs=1e-3)
    for window in campaign.of_role(Role.VALIDATE):
        predicted = held_out.predict(mechanism, found.values, prepare(window, campaign.robot), campaign.robot.sensors)
        assert 0.9 < predicted.remainder.chi2_per_dof < 1.05


@pytest.mark.slow
def test_errors_are_as_large_as_stated(four, record, truth):
    """Thirty campaigns of the same motions with new noise: stated covariance, bootstrap and coverage."""
    mechanism, body = Mechanism(four, native=True), truth(four)
    distances, inside, ratios = [], [], []
    for seed in range(30):
        found = fit(mechanism, record(four, 4, seconds=2.0, seed=100 + seed))
        assert found.ending is Ending.CONVERGED
        distances.append(distance(found, body))
        inside.append(np.abs(found.values - body.vector) < 1.96 * found.sd)
        ratios.append(spread.bootstrap_sd(found.tables, found.prior_rows) / found.sd)
    total = sum(distances)
    assert chi2.ppf(0.001, 9 * 30) < total < chi2.ppf(0.999, 9 * 30)
    assert 0.90 < np.mean(inside) < 0.99
    assert 0.5 < np.median(ratios) < 1.5


@pytest.mark.slow
def test_windows_tell_how_well_the_noise_is_known(record, four):
    found = [fit(Mechanism(four, native=True), record(four, 4, seed=seed)) for seed in range(16)]
    scatter = np.std([one.noise_ratio**2 for one in found], ddof=1)
    assert np.sqrt(np.mean([one.noise_doubt**2 for one in found])) == pytest.approx(scatter, rel=0.5)
    assert fit(Mechanism(four, native=True), record(four, 1)).noise_doubt == 0.0
