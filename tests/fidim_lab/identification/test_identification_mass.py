"""The platform's mass from a payload: against truth, against repetition, and where it must be refused."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Body
from fidim_lab.errors import RefusedError, SetupError
from fidim_lab.identification.payload_mass import KnownBody, Payload, find_mass, refuse_other_geometry

BODY = Body(np.array([0.002, -0.0025, 0.1984]), np.array([0.0569, 0.0627, 0.0314, 2e-4, -2e-4, 1.6e-4]))
MASS = 11.3
PAYLOAD = Payload(1.0, np.array([0.12, -0.15, 0.05]))
SD = np.array([2e-5, 3e-5, 1e-4, 4e-5, 4e-5, 7e-5, 1e-5, 2e-5, 2e-5])


def correlated(scale: float = 1.0) -> np.ndarray:
    """A covariance with these sd and correlations of 0.3."""
    return scale**2 * np.outer(SD, SD) * (0.3 + 0.7 * np.eye(9))


def loaded(body: Body, mass: float, payload: Payload) -> Body:
    """The platform with a point of mass added, from both masses' moments (Eq. 23)."""
    x, y, z = payload.at
    point = np.array([x, y, z, y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z])
    return Body.from_vector((mass * body.vector + payload.mass * point) / (mass + payload.mass))


def pair(payload: Payload = PAYLOAD, *, seed: int | None = None, mass: float = MASS, scale: float = 1.0):
    """Both bodies as identified: exact, or with errors drawn from their covariance."""
    C = correlated(scale)
    true = [BODY.vector, loaded(BODY, mass, payload).vector]
    if seed is not None:
        random = np.random.default_rng(seed)
        true = [values + random.multivariate_normal(np.zeros(9), C) for values in true]
    return KnownBody(true[0], C), KnownBody(true[1], C)


def test_a_payload_is_added_as_a_cloud_of_masses_says():
    """Independent: two points, by summation."""
    points, masses = np.array([[0.1, 0.0, 0.2], [-0.1, 0.05, 0.15], [0.0, -0.1, 0.3]]), np.array([3.0, 4.0, 5.0])

    def body(p, m):
        J = sum(mk * (pk @ pk * np.eye(3) - np.outer(pk, pk)) for mk, pk in zip(m, p, strict=True)) / m.sum()
        return np.concatenate([m @ p / m.sum(), J[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]])

    added = loaded(Body.from_vector(body(points[:2], masses[:2])), 7.0, Payload(5.0, points[2]))
    np.testing.assert_allclose(added.vector, body(points, masses), atol=1e-15)


def test_exact_bodies_give_the_exact_mass():
    found = find_mass(*pair(), PAYLOAD)
    assert found.mass.value == pytest.approx(MASS, rel=1e-9)
    assert found.with_inertia is not None
    assert found.with_inertia.value == pytest.approx(MASS, rel=1e-9)
    for estimate in found.components.values():
        assert estimate is not None
        assert estimate.value == pytest.approx(MASS, rel=1e-9)
    assert found.consistent


def test_stated_sd_is_what_repetition_shows():
    found = [find_mass(*pair(seed=seed), PAYLOAD) for seed in range(150)]
    errors = np.array([f.mass.value - MASS for f in found])
    stated = np.mean([f.mass.sd / np.sqrt(max(1.0, f.chi2 / f.dof)) for f in found])
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(stated, rel=0.15)
    assert abs(errors.mean()) < 3 * stated / np.sqrt(len(found))
    assert np.mean([f.chi2 for f in found]) == pytest.approx(2.0, abs=0.5)
    with_inertia = np.array([(f.with_inertia.value - MASS) / f.with_inertia.sd for f in found if f.with_inertia])
    assert np.sqrt(np.mean(with_inertia**2)) == pytest.approx(1.0, abs=0.15)


def test_each_component_alone_has_its_sd_and_all_three_know_more():
    found = [find_mass(*pair(seed=seed), PAYLOAD) for seed in range(100)]
    for axis in "xyz":
        alone = [f.components[axis] for f in found]
        z = np.array([(e.value - MASS) / e.sd for e in alone if e is not None])
        assert np.sqrt(np.mean(z**2)) == pytest.approx(1.0, abs=0.25)
    first = found[0]
    assert first.mass.sd < min(e.sd for e in first.components.values() if e is not None)


def test_the_payloads_own_uncertainty_counts():
    exact = find_mass(*pair(), PAYLOAD).mass
    vague = find_mass(*pair(), replace(PAYLOAD, mass_sd=0.02)).mass
    assert vague.sd == pytest.approx(np.hypot(exact.sd, 0.02 * MASS), rel=0.1)  # m is proportional to Δm
    shifted = find_mass(*pair(), replace(PAYLOAD, at_sd=1e-3)).mass
    lever = PAYLOAD.at - BODY.com  # weighted by all errors: between all of it and its two better known components
    bounds = [np.hypot(exact.sd, (MASS + PAYLOAD.mass) * 1e-3 / np.linalg.norm(lever[:k])) for k in (3, 2)]
    assert 0.95 * bounds[0] < shifted.sd < 1.05 * bounds[1]


def test_a_component_in_line_with_the_centre_of_mass_says_nothing():
    above = Payload(1.0, np.array([BODY.com[0], BODY.com[1], -0.1]))
    found = find_mass(*pair(above, seed=1), above)
    assert found.components["x"] is None
    assert found.components["y"] is None
    assert abs(found.mass.value - MASS) < 4 * found.mass.sd


def test_inertia_of_a_payload_that_is_no_point_is_off_and_the_stated_mass_is_not():
    empty, loaded = pair(scale=0.1)
    values = loaded.values.copy()
    values[3:6] += PAYLOAD.mass * 0.05**2 / (MASS + PAYLOAD.mass)  # 5 cm radius of gyration
    found = find_mass(empty, KnownBody(values, loaded.covariance), PAYLOAD)
    assert found.mass.value == pytest.approx(MASS, abs=0.05)
    assert found.with_inertia is not None
    assert abs(found.with_inertia.value - MASS) > 3 * found.with_inertia.sd


def test_a_wrong_place_shows_as_contradiction():
    wrong = replace(PAYLOAD, at=PAYLOAD.at + np.array([0.05, 0.0, 0.0]))
    found = find_mass(*pair(), wrong)
    assert not found.consistent
    assert found.mass.sd > find_mass(*pair(), PAYLOAD).mass.sd


@pytest.mark.parametrize("at", [BODY.com, BODY.com + np.array([0.0, 3e-4, 0.0])])
@pytest.mark.parametrize("seed", [None, 1, 2, 3, 4, 5])
def test_a_payload_at_the_centre_of_mass_is_refused(at, seed):
    payload = Payload(1.0, at)
    with pytest.raises(RefusedError, match=r"does not show the mass|no mass explains"):
        find_mass(*pair(payload, seed=seed), payload)


def test_without_payload_and_with_the_campaigns_exchanged():
    empty, loaded = pair()
    with pytest.raises(RefusedError, match="does not show the mass"):
        find_mass(empty, empty, PAYLOAD)
    with pytest.raises(RefusedError, match="away from the payload"):
        find_mass(loaded, empty, PAYLOAD)


def test_two_robots_are_not_one(irma4):
    refuse_other_geometry(irma4, replace(irma4, mass=3.0))
    moved = replace(irma4.cables[2], d=irma4.cables[2].d + np.array([0.0, 0.001, 0.0]))
    other = replace(irma4, cables=(*irma4.cables[:2], moved, irma4.cables[3]))
    with pytest.raises(SetupError, match=r"d of cable 3 differs by 0\.001"):
        refuse_other_geometry(irma4, other)
    with pytest.raises(SetupError, match="has 3 cables"):
        refuse_other_geometry(irma4, replace(irma4, cables=irma4.cables[:3]))
    with pytest.raises(SetupError, match="gravity differs"):
        refuse_other_geometry(irma4, replace(irma4, gravity=np.array([0.0, 0.0, -9.8])))
