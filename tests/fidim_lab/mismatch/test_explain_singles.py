"""Single effects of the catalogue, hidden by the other simulator: named alone, with their size and the body's."""

import numpy as np
import pytest

from fidim_lab.data.records import PARAMETER_NAMES, Campaign, Robot
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.mismatch.conclusion.explanation import Verdict
from fidim_lab.mismatch.conclusion.message import tell
from fidim_lab.mismatch.conclusion.verdict import judge
from fidim_lab.mismatch.explain import explain
from fidim_lab.mismatch.fitting.baseline import fit_baseline
from fidim_lab.mismatch.selection.select import select
from fidim_lab.mismatch.unknown_force.family import Dependence
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign

SINGLES = (
    ("loose-mass:m=0.2,f=3,zeta=0.05", None, {"f": 3.0, "zeta": 0.05}),
    # so heavy that the first seconds are missed by hundreds of times the noise
    ("loose-mass:m=0.4,f=2.4,zeta=0.1,bx=0.02,by=-0.09,bz=-0.04", None, {"m": 0.4, "f": 2.4, "zeta": 0.1}),
    ("umbilical:rest=0.5", None, {"k": 4.0, "c": 0.3, "rest": 0.5}),
    # tensions are told by the stated mass, which is 0.25 % more than the true one
    ("winch-hold-compliance:cable=3", 3, {"softness": 0.99754e-5}),
    ("frame-compliance:k=3e5", None, {"softness": 0.99754 / 3e5}),
    ("time-offset:offset=-0.004", None, {"offset": -0.004}),
    ("frame-sway:f=1.6,psi=1", None, {"sx": 1e-3 * np.cos(1), "cy": 5e-4 * np.sin(1), "f": 1.6}),
    ("marker-stalk:k=3e-4,zeta=0.06", None, {"k": 3e-4, "zeta": 0.06}),
    ("cable-creep:cable=2,delta=0.002,T=2", 2, {"delta": 2e-3, "T": 2.0}),
)
"""what is hidden, its cable, and what its parameters come to"""


def campaign_with(robot: Robot, *texts: str) -> tuple[Campaign, np.ndarray]:
    """Six windows of 5 s and two held out; the true body."""
    effects = tuple(parse_effect(text, robot.n) for text in texts)
    world = make_world(robot, np.random.default_rng(71), effects)
    plan = random_plan(robot, "single", 6, 2, 71)
    campaign, truth = simulate_campaign(robot, plan, world, np.random.default_rng(72), recording=Sampling(5.0))
    return campaign, np.concatenate([np.array(truth[key], dtype=float) for key in ("s", "I")])


@pytest.mark.slow
@pytest.mark.parametrize(("text", "cable", "sizes"), SINGLES, ids=[text.split(":")[0] for text, _, _ in SINGLES])
def test_a_single_effect_is_named_alone(irma4: Robot, text: str, cable: int | None, sizes: dict[str, float]) -> None:
    campaign, body = campaign_with(irma4, text)
    found = explain(campaign)
    assert found.verdict is Verdict.EXPLAINED, found.message
    assert [(cause.id, cause.cable) for cause in found.effects] == [(text.split(":")[0], cable)]
    after = found.chi2_per_dof.after
    assert after is not None
    assert after < 1.1
    for name, size in sizes.items():
        value = found.effects[0].parameters[name]
        assert value.sd is not None
        assert abs(value.value - size) < 5 * value.sd, name
    for name, true in zip(PARAMETER_NAMES, body, strict=True):
        assert abs(found.parameters[name].value - true) < 5 * found.parameters[name].sd, name


@pytest.mark.slow
def test_a_frame_that_sways_beside_wrong_pulleys_is_no_fan(irma4: Robot) -> None:
    """Told over whole windows only: over 3 s one phase for all windows does as well as a phase of each."""
    campaign, _ = campaign_with(irma4, "pulley-radius:dr=-0.0027", "frame-sway:ax=1.2e-4,ay=0.8e-4,az=0,f=1.145")
    found = explain(campaign)
    assert found.verdict in (Verdict.EXPLAINED, Verdict.PARTLY_EXPLAINED), found.message
    assert {cause.id for cause in found.effects} == {"pulley-radius", "frame-sway"}
    assert found.chi2_per_dof.after is not None
    assert found.chi2_per_dof.after < 1.05


@pytest.mark.slow
@pytest.mark.parametrize(("text", "power"), [("unknown-cubic:c=2", 3.0), ("air-drag-quadratic:c=0.8", None)])
def test_a_drag_that_no_air_has_is_told_with_its_power(irma4: Robot, text: str, power: float | None) -> None:
    """Drags of the catalogue put together with others would come near it."""
    campaign, _ = campaign_with(irma4, text)
    start = fit_baseline(campaign, native=True, say=lambda _: None)
    found = select(start, lambda _: None)
    (named,) = found.best.model.tried
    assert found.best.is_white
    if power is None:
        assert named.effect.id == "air-drag-quadratic"
        return
    assert judge(found).verdict is Verdict.UNKNOWN_PHYSICS
    values, sd = found.best.model.theta_of(0)
    assert abs(values[1] - power) < 4 * sd[1]
    assert sd[1] < 0.3
    told = tell(start, found, judge(found), 0.0)
    assert f"p = {values[1]:.3g}" in told.message
    assert not told.effects


@pytest.mark.slow
def test_effects_that_one_wrench_outdoes_over_the_first_seconds_are_not_named(irma4: Robot) -> None:
    """A saddle of force: a hose, a tilt and a force that oscillates come near it for three seconds."""
    campaign, _ = campaign_with(irma4, "unknown-gradient:k=-6,x=1.2,y=-0.1,z=-0.3")
    found = explain(campaign)
    assert found.verdict is Verdict.UNKNOWN_PHYSICS
    assert "One unknown wrench leaves only noise" in found.message
    assert found.unknown is not None
    assert found.unknown.terms[0].dependence is Dependence.GRADIENT
    assert found.chi2_per_dof.after is not None
    assert found.chi2_per_dof.after < 1.05
    assert not found.effects
