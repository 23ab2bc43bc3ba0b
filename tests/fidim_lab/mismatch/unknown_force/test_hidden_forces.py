"""The unknown modelled: forces that no catalogue has, hidden by the simulator's own equations, are typed and fitted.

`HIDDEN` are terms for the plant (wrench about G, as `sim_backends.plant.mechanics.terms`), made for these tests alone:
they share nothing with the families that find them.
"""

import json
from collections.abc import Callable
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Campaign, Robot, Role
from fidim_lab.identification.mle.fit import Fit, fit
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.mismatch.unknown_force.family import Dependence
from fidim_lab.mismatch.unknown_force.unknown import UnknownForce, model_unknown
from fidim_lab.model.mechanism import Mechanism
from sim_backends.plant.hidden import HiddenEffect, parse_effect
from sim_backends.plant.mechanics import terms
from sim_backends.plant.mechanics.kinematics import Platform
from sim_backends.plant.mechanics.terms import Wrench
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign

MAGNET = np.array([1.25, -0.1, -0.05])


def _on_centre(force: ca.SX) -> Wrench:
    return Wrench(force, ca.SX.zeros(3))


def _turning(moment: ca.SX) -> Wrench:
    return Wrench(ca.SX.zeros(3), moment)


def _magnet(platform: Platform, effect: HiddenEffect) -> Wrench:
    away = platform.centre - ca.DM(MAGNET)
    return _on_centre(-effect["k"] * away / (0.12**2 + ca.dot(away, away)) ** 2 * 0.12**3)


def _gradient(platform: Platform, effect: HiddenEffect) -> Wrench:
    away = platform.centre - ca.DM(MAGNET)
    return _on_centre(effect["k"] * ca.vertcat(away[0], -0.5 * away[1] + 0.3 * away[2], 0.3 * away[1] - 0.5 * away[2]))


def _when_turning(platform: Platform, effect: HiddenEffect) -> Wrench:
    return _on_centre(effect["k"] * ca.dot(platform.omega, platform.omega) * ca.DM([0.6, 0.8, 0.0]))


def _bump(platform: Platform, effect: HiddenEffect) -> Wrench:
    course = 0.0 if platform.still else ca.exp(-(((platform.now[1] - 1.5) / 0.2) ** 2) / 2)
    return _on_centre(effect["k"] * course * ca.SX(ca.DM([0.5, -1.0, 0.3])))


def _cubed(platform: Platform, effect: HiddenEffect) -> Wrench:
    return _on_centre(-effect["k"] * ca.dot(platform.velocity, platform.velocity) * platform.velocity)


def _third_swivel(platform: Platform, effect: HiddenEffect) -> Wrench:
    end = platform.cables[2]
    rate = end.tangent.swivel_rate(end.velocity)
    force = -effect["k"] * ca.tanh(rate / 0.3) * (1 + rate**2) / end.tangent.lever * end.tangent.across
    return Wrench(force, ca.cross(end.point.arm, force))


def _square_wave(platform: Platform, effect: HiddenEffect) -> Wrench:
    wave = 0.0 if platform.still else ca.tanh(4 * ca.sin(2 * ca.pi * platform.now[1] / 0.9))
    return _on_centre(effect["k"] * wave * ca.SX(ca.DM([1.0, 0.3, 0.0])))


def _eddy_brake(platform: Platform, effect: HiddenEffect) -> Wrench:
    away = (platform.centre - ca.DM(MAGNET)) / 0.15
    return _on_centre(-effect["k"] * ca.exp(-ca.dot(away, away) / 2) * platform.velocity)


def _eddy_brake_on_p(platform: Platform, effect: HiddenEffect) -> Wrench:
    magnet = platform.point(np.zeros(3))
    away = (magnet.position - ca.DM(MAGNET)) / 0.2
    force = -effect["k"] * ca.exp(-ca.dot(away, away) / 2) * magnet.velocity
    return Wrench(force, ca.cross(magnet.arm, force))


def _spin_squared(platform: Platform, effect: HiddenEffect) -> Wrench:
    return _turning(-effect["k"] * ca.sqrt(ca.dot(platform.omega, platform.omega) + 1e-12) * platform.omega)


def _knock(platform: Platform, effect: HiddenEffect) -> Wrench:
    """Since the first window began, as nobody tells the windows."""
    apart = 0.0 if platform.still else ca.sin(ca.pi * platform.now[0] / 1.1) * 1.1 / ca.pi
    return _on_centre(effect["k"] * ca.exp(-((apart / 0.03) ** 2) / 2) * ca.SX(ca.DM([0.6, -0.8, 0.0])))


def _detents(platform: Platform, effect: HiddenEffect) -> Wrench:
    total = Wrench(ca.SX.zeros(3), ca.SX.zeros(3))
    for end, cable in zip(platform.cables, platform.world.cables, strict=True):
        across = end.tangent.across
        angle = ca.atan2(ca.dot(across, ca.DM(cable.x)), ca.dot(across, ca.DM(cable.y)))
        force = -effect["k"] * ca.sin(20 * angle + 0.4) / end.tangent.lever * across
        total = Wrench(total.force + force, total.moment + ca.cross(end.point.arm, force))
    return total


def _wheel_inside(platform: Platform, effect: HiddenEffect) -> Wrench:
    momentum = effect["k"] * platform.rotation @ ca.SX(ca.DM([0.6, 0.0, -0.8]))
    return _turning(ca.cross(momentum, platform.omega))


HIDDEN: dict[str, tuple[Callable[[Platform, HiddenEffect], Wrench], float]] = {
    "magnet": (_magnet, 0.5),
    "gradient": (_gradient, 0.3),
    "when turning": (_when_turning, 0.05),
    "bump in time": (_bump, 0.2),
    "speed cubed": (_cubed, 0.5),
    "third swivel": (_third_swivel, 0.01),
    "square wave": (_square_wave, 0.05),
    "eddy brake": (_eddy_brake, 0.3),
    "eddy brake on P": (_eddy_brake_on_p, 0.3),
    "spin squared": (_spin_squared, 0.001),
    "wheel inside": (_wheel_inside, 0.01),
    "knock": (_knock, 0.5),
    "detents": (_detents, 0.003),
}


def hidden_campaign(
    robot: Robot, name: str, size: float, *, windows: tuple[int, int] = (8, 4), seconds: float = 6.0, seed: int = 5
) -> Campaign:
    """Windows with one of `HIDDEN` in them, `size` times its usual strength."""
    term, strength = HIDDEN[name]
    plan = random_plan(robot, name, *windows, seed)
    hidden = parse_effect(f"unknown:k={size * strength}", robot.n)
    world = make_world(robot, np.random.default_rng(seed), (hidden,))
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(terms.TERMS, "unknown", term)  # pyright: ignore[reportArgumentType]
        rng = np.random.default_rng(seed + 1)
        return simulate_campaign(robot, plan, world, rng, recording=Sampling(seconds))[0]


def explored(campaign: Campaign) -> tuple[Fit, UnknownForce]:
    """The baseline and the unknown of a campaign."""
    base = fit(Mechanism(campaign.robot, native=True), campaign.of_role(Role.IDENTIFY))
    return base, model_unknown(base, campaign.of_role(Role.VALIDATE))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "size", "expected", "said"),
    [
        ("magnet", 40.0, {Dependence.CENTRE}, "towards"),
        ("gradient", 8.0, {Dependence.GRADIENT}, "along (1.00, 0.00, 0.00) it pushes away"),
        ("when turning", 4.0, {Dependence.TURNING}, "only while the platform turns"),
        ("bump in time", 2.0, {Dependence.MOMENT, Dependence.TIME}, "between"),
        ("square wave", 3.0, {Dependence.PERIODIC}, "repeats every 0.9"),
        ("third swivel", 1.0, {Dependence.CABLE}, "cable 3"),
        ("knock", 1.0, {Dependence.PERIODIC}, "knocks every 1.1 s"),
        ("detents", 12.0, {Dependence.DETENT}, "times in one turn, as teeth of all swivels"),
        ("wheel inside", 1.0, {Dependence.ACROSS}, "a wheel that spins inside with (0.006, "),
        ("eddy brake on P", 3.0, {Dependence.BRAKE}, "opposes the motion of P near (1."),
        ("speed cubed", 5.0, {Dependence.SPEED, Dependence.VELOCITY}, "speed"),
    ],
)
def test_a_hidden_force_is_typed_and_helps_where_it_was_not_fitted(
    irma4: Robot, name: str, size: float, expected: set[Dependence], said: str
) -> None:
    base, found = explored(hidden_campaign(irma4, name, size))
    assert base.chi2_per_dof > 1.1, "hardly anything was hidden"
    assert found.terms
    assert found.terms[0].dependence in expected
    assert said in " ".join(found.words)
    assert found.halves
    assert found.explained > 0.5


@pytest.mark.slow
def test_nothing_hidden_is_nothing_found(irma4: Robot) -> None:
    _, found = explored(hidden_campaign(irma4, "magnet", 0.0))
    assert found.terms == ()
    assert found.words == ()
    assert found.after == found.before


@pytest.mark.slow
@pytest.mark.shared
def test_the_open_campaign_outside_the_catalogue(shared: Path) -> None:
    _, found = explored(read_campaign(shared / "campaigns" / "open-outside-catalogue"))
    assert found.halves
    assert found.terms[0].dependence is Dependence.CENTRE
    np.testing.assert_allclose(found.terms[0].shape[:3], [1.1, -0.25, -0.2], atol=0.05)  # of the campaign's truth
    true = json.loads((shared / "campaigns" / "truth" / "open-outside-catalogue.json").read_text())
    for shift, value in zip(found.parameters[:3], true["s"], strict=True):
        assert abs(shift.with_it - value) < 4 * shift.with_sd
