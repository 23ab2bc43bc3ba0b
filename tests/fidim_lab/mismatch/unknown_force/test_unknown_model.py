"""The generic latent-force model piece by piece, against independent answers."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from fidim_lab.data.records import Plan, PlannedWindow, Robot, Role
from fidim_lab.effects.loads.constant_force import ConstantForce
from fidim_lab.identification.mle.fit import Fit, fit
from fidim_lab.mismatch.linearised.columns import Scorer
from fidim_lab.mismatch.linearised.hypotheses import Hypotheses, Hypothesis
from fidim_lab.mismatch.unknown_force.evidence import Evidence
from fidim_lab.mismatch.unknown_force.families import families
from fidim_lab.mismatch.unknown_force.family import Courses, Dependence, Family, bells, monomials
from fidim_lab.mismatch.unknown_force.field import field_of
from fidim_lab.mismatch.unknown_force.joint import fitted
from fidim_lab.mismatch.unknown_force.latent import LatentForce
from fidim_lab.mismatch.unknown_force.reach import Reach, centres_of
from fidim_lab.mismatch.unknown_force.responses import Responses, responses, splines
from fidim_lab.mismatch.unknown_force.unknown import chosen, conclusive
from fidim_lab.mismatch.unknown_force.words import words
from fidim_lab.model.mechanism import Mechanism
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign

LENGTHS = np.array([1.42, 1.40, 1.45, 1.47])
"""m; the platform hangs near the middle"""


@pytest.fixture(scope="module")
def base(irma4: Robot) -> Fit:
    """Three windows of 2 s in which a magnet is hidden."""
    displacement, place = np.array([0.05, -0.03]), np.array([1.2, -0.2, -0.15])
    shorter = (0.0, np.array([0.08, 0.05, -0.05, -0.03]), 0.07)
    windows = tuple(
        PlannedWindow(f"i0{k}", Role.IDENTIFY, LENGTHS - less, displacement, place) for k, less in enumerate(shorter, 1)
    )
    plan = Plan("short", windows)
    hidden = parse_effect("unknown:k=-10", irma4.n)
    world = make_world(irma4, np.random.default_rng(5), (hidden,))
    campaign, _ = simulate_campaign(irma4, plan, world, np.random.default_rng(6), recording=Sampling(2.0, 50.0))
    return fit(Mechanism(irma4, native=True), campaign.of_role(Role.IDENTIFY))


@pytest.fixture(scope="module")
def answers(base: Fit) -> Responses:
    return responses(base.likelihood, base.journey.optimum.simulation)


def _named(base: Fit, answers: Responses, label: str) -> Courses:
    found = families(Reach.of(answers, base.values[:3]), base.likelihood.mechanism.n)
    return Courses(next(one for one in found if one.label == label), base.likelihood.mechanism, base.values)


def test_a_steady_force_made_of_bumps_is_a_steady_force(base: Fit, answers: Responses) -> None:
    """The score test's own columns, without bumps, are the other way."""
    tried = Hypothesis(ConstantForce(), np.zeros(3), (0, 1, 2), np.ones(3))
    scorer = Scorer(base.likelihood.mechanism, Hypotheses((tried,), (), ()))
    steady = Family(
        Dependence.TIME,
        "steady",
        lambda state, _: ca.vertcat(ca.SX.eye(3), ca.horzcat(*(ca.cross(state.centre, e) for e in _axes()))),
        lambda _state, _shape: ca.SX(1),
        (np.zeros(0),),
    )
    courses = Courses(steady, base.likelihood.mechanism, base.values)
    bumps = answers.coefficients(*courses.at(answers.sample, np.zeros(0)))
    for window in scorer.columns(base.likelihood, base.journey.optimum.simulation):
        own = np.linalg.qr(window.by_own)[0]
        direct = window.by_scored - own @ (own.T @ window.by_scored)
        gram = answers.gram[window.window][answers.shared : -1, answers.shared : -1]
        made = bumps[window.window].T @ gram @ bumps[window.window]
        # window's lengths depend on no force; the bumps are 0.08 s wide, hence not to the last digit
        np.testing.assert_allclose(made, direct.T @ direct, rtol=0, atol=2e-2 * np.abs(direct.T @ direct).max())


def _axes() -> list[ca.SX]:
    return [ca.SX(ca.DM.eye(3)[:, k]) for k in range(3)]


def test_weights_are_those_of_ridge_regression(base: Fit, answers: Responses) -> None:
    evidence = Evidence(answers, base.prior.rows(base.values))
    courses = _named(base, answers, "force of time, changing within 0.5 s")
    found = evidence.weigh(courses, np.zeros(0))
    bumps = answers.coefficients(*courses.at(answers.sample, np.zeros(0)))
    rows, right = [], []
    for gram, one in zip(answers.gram, bumps, strict=True):
        values, vectors = np.linalg.eigh(gram)
        root = np.sqrt(np.maximum(values, 0.0))[:, np.newaxis] * vectors.T  # rows with the same sums of squares
        s = answers.shared
        rows.append(np.hstack([root[:, :s], root[:, s:-1] @ one]))
        right.append(-root[:, -1])
    prior = evidence.prior
    count = len(found.weights)
    rows += [
        np.hstack([prior[:, :-1], np.zeros((len(prior), count))]),
        np.hstack([np.zeros((count, answers.shared)), np.diag(1 / found.prior_sd)]),
    ]
    right += [-prior[:, -1], np.zeros(count)]
    direct = np.linalg.lstsq(np.vstack(rows), np.concatenate(right), rcond=None)[0][answers.shared :]
    np.testing.assert_allclose(found.weights, direct, rtol=1e-3, atol=1e-4 * np.abs(direct).max())
    assert 0 < found.effective < count
    assert found.gain > 0


def test_the_hidden_magnet_leads_and_its_place_is_found(base: Fit, answers: Responses) -> None:
    evidence = Evidence(answers, base.prior.rows(base.values))
    centre = _named(base, answers, "force on the centre of mass towards a place")
    drag = _named(base, answers, "drag ~ speed^2")
    found = [evidence.with_left_out(evidence.best(one)) for one in (centre, drag)]
    assert found[0].log_evidence > found[1].log_evidence + 50
    assert chosen(found) is found[0]


def test_nothing_is_chosen_where_nothing_is_evident(base: Fit, answers: Responses) -> None:
    evidence = Evidence(answers, base.prior.rows(base.values))
    weighed = evidence.weigh(_named(base, answers, "drag ~ speed^2"), np.zeros(0))
    assert chosen([replace(weighed, log_evidence=4.9)]) is None


def test_evidence_decides_among_those_that_windows_left_out_confirm(base: Fit, answers: Responses) -> None:
    evidence = Evidence(answers, base.prior.rows(base.values))
    one = replace(evidence.weigh(_named(base, answers, "drag ~ speed^2"), np.zeros(0)), log_evidence=50.0)
    rich, plain = replace(one, left_out=100.0, log_evidence=40.0), replace(one, left_out=98.0)
    assert chosen([rich, plain]) is plain
    assert chosen([rich, replace(plain, left_out=20.0)]) is rich


@pytest.mark.parametrize(
    ("evidence", "left_out", "effective", "plainer"),
    [
        (99.0, 51.0, 9.0, True),
        (97.0, 51.0, 9.0, False),  # surely less evident
        (99.0, 49.0, 9.0, False),  # windows left out are predicted worse
        (99.0, 51.0, 12.0, False),  # not plainer
    ],
)
def test_a_plainer_family_as_good_to_first_order_is_preferred(
    base: Fit, answers: Responses, evidence: float, left_out: float, effective: float, plainer: bool
) -> None:
    weighed = Evidence(answers, base.prior.rows(base.values)).weigh(
        _named(base, answers, "drag ~ speed^2"), np.zeros(0)
    )
    rich = replace(weighed, log_evidence=100.0, left_out=50.0, effective=11.0)
    plain = replace(weighed, log_evidence=evidence, left_out=left_out, effective=effective)
    assert chosen([rich, plain]) is (plain if plainer else rich)


@pytest.mark.parametrize(
    ("gain", "left_out", "enough"),
    [(95.0, 92.0, True), (58.0, 266.0, False), (95.0, 60.0, False)],
    ids=["nearly all", "foretells much, explains half", "does not foretell"],
)
def test_families_that_take_long_are_spared_where_nearly_all_is_done(
    base: Fit, answers: Responses, gain: float, left_out: float, enough: bool
) -> None:
    evidence = Evidence(answers, base.prior.rows(base.values))
    weighed = evidence.weigh(_named(base, answers, "drag ~ speed^2"), np.zeros(0))
    first = replace(weighed, gain=gain, left_out=left_out, excess=100.0)
    assert conclusive(first) is enough
    assert not conclusive(None)


def test_the_joint_fit_explains_and_its_field_is_what_was_fitted(base: Fit, answers: Responses) -> None:
    evidence = Evidence(answers, base.prior.rows(base.values))
    courses = _named(base, answers, "force on the centre of mass towards a place")
    latent = LatentForce.of(evidence.best(courses))
    found = fitted(base, base.journey.optimum.point, latent, float(base.journey.ends.max()))
    assert found is not None
    assert sum(left.chi2 for left in found.remainders) < 0.5 * sum(left.chi2 for left in base.remainders)
    field = field_of(found, [latent])
    # the simulator's own law: k r/w exp(−r²/2w²), k = −10 N, about its place
    where = np.array([-0.08, -0.07, -0.7]) + np.mean(
        [cable.d for cable in base.likelihood.mechanism.robot.cables], axis=0
    )
    away = (field.centres - where) / 0.15
    true = -10 * away * np.exp(-(away**2).sum(axis=1, keepdims=True) / 2)
    strong = np.linalg.norm(true, axis=1) > 0.3
    if strong.any():
        cosine = (field.forces * true).sum(axis=1) / np.linalg.norm(field.forces, axis=1) / np.linalg.norm(true, axis=1)
        assert np.median(cosine[strong]) > 0.8
    assert len(field.thinned(20).t) <= 20
    said = words(latent, found.values[9:], field, [])
    assert "towards" in said[0]
    far_off = replace(field, centres=field.centres + 50.0)  # of a place that no window comes near
    assert "no window came nearer than 8" in words(latent, found.values[9:], far_off, [])[0]


def test_absent_weights_are_no_force() -> None:
    assert LatentForce().parameters == ()
    assert LatentForce().start.size == 0


def test_centres_cover_the_cloud() -> None:
    points = np.random.default_rng(1).uniform(-1, 1, (500, 3))
    centres = centres_of(points, 0.5, 200)
    away = np.linalg.norm(points[:, np.newaxis] - centres, axis=2).min(axis=1)
    assert away.max() <= 0.6
    assert len(centres_of(points, 0.01, 7)) == 7


def test_monomials_and_bells() -> None:
    z = ca.SX.sym("z", 3)
    values = ca.Function("m", [z], [monomials(z, (1, 2))])([2.0, 3.0, 5.0])
    assert np.array(values).ravel().tolist() == [2, 3, 5, 4, 6, 10, 9, 15, 25]
    high = ca.Function("b", [z], [bells(z, ca.SX(ca.DM([[0, 0, 0], [0, 0, 2]])), ca.SX(2.0))])([0.0, 0.0, 0.0])
    np.testing.assert_allclose(np.array(high).ravel(), [1.0, np.exp(-0.5)])


def test_splines_add_up_to_one() -> None:
    t = np.linspace(0.3, 2.3, 50)
    np.testing.assert_allclose(splines(t).sum(axis=1), 1.0)


def test_a_push_that_no_sample_meets_explains_nothing(base: Fit, answers: Responses) -> None:
    """A search may end after the last sample: no curvature at all is left there."""
    evidence = Evidence(answers, base.prior.rows(base.values))
    found = evidence.weigh(_named(base, answers, "a push at a moment"), np.array([40.0, np.log(1e-3)]))
    assert np.isfinite([found.log_evidence, found.gain, found.effective]).all()
    assert found.gain < 1e-3 * found.excess
