"""Every effect's derivatives by θ against finite differences, and that it is absent at 0."""

import casadi as ca
import numpy as np
import pytest

from fidim_lab.data.records import Motion
from fidim_lab.effects.catalogue import catalogue
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion.dynamics import accelerations
from fidim_lab.model.motion.forcing import forcing, sightings, start_gaps


def differences(function, theta, steps) -> np.ndarray:
    """Central differences of a flat function of θ (outputs × P)."""
    columns = [
        (function(theta + step) - function(theta - step)) / (2 * step.max()) for step in np.diag(np.asarray(steps))
    ]
    return np.stack(columns, axis=1)


def steps_of(effect) -> np.ndarray:
    return np.array([parameter.scale * 1e-3 for parameter in effect.parameters])


def agree(exact, expected, rtol=1e-5) -> None:
    exact = exact.reshape(expected.shape)
    np.testing.assert_allclose(exact, expected, rtol=rtol, atol=rtol * np.abs(expected).max(axis=0, initial=1e-9).max())


def solution(equations):
    return [equations.solve()]


def by_tension(equations):
    return [ca.densify(equations.by_tension)]


@pytest.mark.parametrize("present", [False, True])
def test_forcing(effect, present, probe, middle, sized, sample):
    """At θ = 0 for all; where it is there, for all but stretch, whose first-order form is linear in θ."""
    theta = sized(effect) if present else middle(effect)
    probed = probe(effect)
    if present and not all(p.name != "softness" for p in effect.parameters):
        pytest.skip("the first-order form drops what is of second order in the compliance")
    inputs = sample.inputs(probed.mechanism, theta)
    exact = probed.run(forcing(probed.mechanism), inputs)[0]
    agree(exact, differences(lambda at: probed(solution, at)[0], theta, steps_of(effect)))


def test_forcing_of_absent_effects_is_the_same(effect, probe, middle, sample):
    probed = probe(effect)
    theta = middle(effect)
    inputs = sample.inputs(probed.mechanism, theta)
    free = [k for k, scanned in enumerate(effect.scanned) if not scanned]
    short, whole = (probed.run(forcing(probed.mechanism, absent), inputs)[0] for absent in (free, ()))
    np.testing.assert_allclose(short, whole, rtol=1e-9, atol=1e-9 * np.abs(whole).max())
    for short, whole in zip(
        probed.run(start_gaps(probed.mechanism, free), inputs),
        probed.run(start_gaps(probed.mechanism), inputs),
        strict=True,
    ):
        np.testing.assert_allclose(short, whole, rtol=1e-9, atol=1e-9)


def gaps(equations):
    stretch, rate = equations.length_constraint()
    return [equations.lengths - stretch, equations.structure @ equations.symbols.twist - rate]


def test_start_gaps(effect, probe, middle, sample):
    theta, probed = middle(effect), probe(effect)
    lengths, speeds, lengths_by, speeds_by = probed.run(
        start_gaps(probed.mechanism), sample.inputs(probed.mechanism, theta)
    )
    np.testing.assert_allclose(probed(gaps, theta)[0], lengths, atol=1e-14)
    np.testing.assert_allclose(probed(gaps, theta)[1], speeds, atol=1e-14)
    agree(lengths_by, differences(lambda at: probed(gaps, at)[0], theta, steps_of(effect)))
    agree(speeds_by, differences(lambda at: probed(gaps, at)[1], theta, steps_of(effect)))


def test_sightings(effect, probe, sized, sample):
    """By θ at a fixed stamp: the state moves on with its twist until the true time."""
    theta, probed = sized(effect), probe(effect)
    compiled = sightings(probed.mechanism)
    time, position, flat, twist, extra, _, _ = sample.inputs(probed.mechanism, theta)
    inputs, rates = [time, position, flat, twist, extra], np.array([0.4, -0.7, 0.2, 1.0, -2.0, 0.5])
    _, true_time, *derivatives = probed.run(compiled, [*inputs, rates, theta])

    def seen(at: np.ndarray) -> np.ndarray:
        late = probed.run(compiled, [*inputs, rates, at])[1] - true_time
        moved = position + late * twist[:3]
        turned = sample.rotation + late * np.cross(twist[3:], sample.rotation.T).T
        return probed.run(compiled, [time, moved, turned.ravel(), twist, extra, rates, at])[0]

    expected = differences(seen, theta, [parameter.scale * 1e-2 for parameter in effect.parameters])
    agree(derivatives[2], expected, rtol=1e-6)


def test_absent_is_exactly_the_baseline(effect, probe, sample):
    baseline, probed = probe(), probe(effect)
    for theta in effect.scan_points[:4]:
        for build in (solution, by_tension, gaps):
            for here, there in zip(probed(build, theta), baseline(build, np.zeros(0)), strict=True):
                np.testing.assert_allclose(here, there, rtol=0, atol=1e-13)
        inputs = sample.inputs(probed.mechanism, theta)
        place = sample.position + sample.rotation @ sample.robot.marker
        seen, true_time = probed.run(sightings(probed.mechanism), [*inputs[:5], np.ones(6), theta])[:2]
        np.testing.assert_allclose(seen, place, rtol=0, atol=1e-14)
        assert true_time == sample.time


def test_the_whole_catalogue_at_once_is_absent_by_default(irma4, sample):
    whole = Mechanism(irma4, catalogue(irma4))
    positions, rotations, twists = sample.position[None], sample.rotation[None], sample.twist[None]
    motion = Motion(np.array([sample.time]), positions, rotations, twists, 0 * twists)
    extra = 0.1 * np.ones((1, sum(len(effect.extra_states) for effect in whole.effects)))
    found = accelerations(whole, irma4.nominal, motion, extra)
    expected = accelerations(Mechanism(irma4), irma4.nominal, motion)
    np.testing.assert_allclose(np.hstack(found), np.hstack(expected), rtol=1e-12)
    np.testing.assert_array_equal(whole.lengths(positions, rotations), Mechanism(irma4).lengths(positions, rotations))
