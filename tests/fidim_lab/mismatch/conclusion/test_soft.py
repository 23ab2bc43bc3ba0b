"""What is said of robots with a soft direction, from elastic models whose figures are given."""

from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from fidim_lab.data.records import Robot
from fidim_lab.effects.dissipation.air_drag import AirDragLinear
from fidim_lab.effects.dissipation.attachment_friction import AttachmentFriction, AttachmentFrictionGivingWay
from fidim_lab.effects.dissipation.pulley_friction import PulleyFriction
from fidim_lab.effects.dissipation.swivel_friction import SwivelFriction
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.soft import SoftFit
from fidim_lab.identification.mle.trajectories.normal import Prior
from fidim_lab.mismatch.conclusion.explanation import Before, Explanation, Verdict
from fidim_lab.mismatch.conclusion.soft_cables import ALONE, DRAG, Compared, Elastic
from fidim_lab.mismatch.conclusion.soft_message import soft_answer

ATTACHMENT, GIVING = AttachmentFriction(), AttachmentFrictionGivingWay()
ALONE_BY_NAME = {"swivel_alone": SwivelFriction(), "air_alone": AirDragLinear()}
ON_RIGID = Explanation(
    "c", Verdict.UNKNOWN_PHYSICS, (), (), Before(9, 9), Before(9, 9), (), {}, {}, None, "As said.", 1.0
)


@dataclass(frozen=True)
class Figures:
    """Of one model: held-out rms (mm) and sum of squares of the fitted windows; θ at a share of what can be."""

    rms: float
    cost: float
    share: dict[str, float] = field(default_factory=dict)


def elastic(figures: Figures, *effects: NamedEffect) -> Elastic:
    sizes = [np.full(len(e.parameters), figures.share.get(e.id, 0.3)) for e in effects]
    values = np.concatenate([np.full(9, 0.1), *sizes])
    found = SimpleNamespace(
        values=values,
        sd=np.full(len(values), 0.01),
        prior=Prior(values, values, high=np.ones(len(values))),
        likelihood=SimpleNamespace(mechanism=SimpleNamespace(effects=effects)),
        journey=SimpleNamespace(optimum=SimpleNamespace(cost=figures.cost)),
        place_of=lambda effect: Fit.place_of(cast(Fit, found), effect),
    )
    return Elastic(effects, cast(Fit, found), {"v1": 1e-3 * figures.rms}, (figures.rms / 0.1) ** 2)


USUAL = {
    "whole": Figures(2.0, 500.0),
    "without": Figures(8.0, 4000.0),
    "attachment": Figures(4.0, 1500.0),
    "drag": Figures(2.5, 700.0),
    "swivel": Figures(2.1, 510.0),
    "pulley": Figures(2.1, 510.0, {"pulley-friction": 1.0}),
}


def answer(irma4: Robot, **changed: Figures) -> Explanation | None:
    """at_once: given where the friction of the whole gives way before it slips."""
    of = USUAL | changed
    friction = GIVING if "at_once" in of else ATTACHMENT
    compared = Compared(
        soft=cast(SoftFit, SimpleNamespace(sentences=("Springs were fitted.",))),
        whole=elastic(of["whole"], friction, DRAG),
        without=elastic(of["without"]),
        single=(elastic(of["attachment"], friction), elastic(of["drag"], DRAG)),
        elsewhere=(elastic(of["swivel"], SwivelFriction(), DRAG), elastic(of["pulley"], PulleyFriction(), DRAG)),
        alone=tuple(elastic(of[name], effect) for name, effect in ALONE_BY_NAME.items() if name in of),
        at_once=elastic(of["at_once"], ATTACHMENT, DRAG) if "at_once" in of else None,
    )
    return soft_answer(ON_RIGID, compared, irma4, "0.01 and 0.4")


def test_both_terms_are_named_with_what_cannot_be_told_from_them(irma4: Robot) -> None:
    told = answer(irma4)
    assert told is not None
    assert told.verdict is Verdict.PARTLY_EXPLAINED
    assert [(cause.id, cause.equivalent_to) for cause in told.effects] == [
        ("attachment-friction", ("swivel-friction",)),
        ("rotational-drag", ()),
    ]
    assert (told.rms_mm.before, told.rms_mm.after) == pytest.approx((8.0, 2.0))
    assert "pulley-friction in the place of the attachments asks for more torque" in told.message
    assert "20 times the markers' noise" in told.message
    assert [ranked.plausible for ranked in told.ranking].count(False) == 1


def test_friction_that_gives_way_is_said_with_what_it_gains(irma4: Robot) -> None:
    told = answer(irma4, at_once=Figures(2.6, 700.0))
    assert told is not None
    assert told.effects[0].id == "attachment-friction"
    assert set(told.effects[0].parameters) == {"viscous", "dry", "dry_z", "give"}
    assert "gives way over 17.2° (0.3 ± 0.01 rad) before it slips" in told.message
    assert "Friction there goes with the cables' tension" in told.message
    assert (
        "100 nats better than friction that slips at once with any tension, which misses held-out ones by 2.6 mm"
        in told.message
    )
    assert ("attachment-friction", "rotational-drag (per body axis)") in [ranked.effects for ranked in told.ranking]


def test_a_term_that_fitted_windows_do_not_ask_for_is_not_named(irma4: Robot) -> None:
    told = answer(irma4, drag=Figures(2.0, 505.0))
    assert told is not None
    assert [cause.id for cause in told.effects] == ["rotational-drag"]


def test_a_term_with_which_held_out_windows_get_worse_is_not_named(irma4: Robot) -> None:
    told = answer(irma4, drag=Figures(1.5, 700.0))
    assert told is not None
    assert [cause.id for cause in told.effects] == ["rotational-drag"]


def test_another_place_that_predicts_worse_is_no_equivalent(irma4: Robot) -> None:
    told = answer(irma4, swivel=Figures(3.0, 800.0))
    assert told is not None
    assert told.effects[0].equivalent_to == ()
    assert "swivel-friction in their place predicts worse than theirs by the same law (3.0, 2.0 mm)" in told.message


def test_places_are_compared_by_the_same_law(irma4: Robot) -> None:
    """Friction elsewhere slips at once: that it predicts worse than what gives way says nothing of its place."""
    told = answer(irma4, at_once=Figures(2.6, 700.0), swivel=Figures(2.7, 710.0))
    assert told is not None
    assert told.effects[0].equivalent_to == ("swivel-friction",)
    assert (
        "swivel-friction in their place predicts about as well as theirs by the same law (2.7, 2.6 mm)" in told.message
    )


def test_what_cannot_be_all_that_dissipates_is_refused_with_the_reason(irma4: Robot) -> None:
    full = {effect.id: 1.0 for effect in ALONE}
    figures = {"swivel_alone": Figures(4.9, 4500.0, full), "air_alone": Figures(float("nan"), 9000.0, full)}
    told = answer(irma4, **figures)
    assert told is not None
    assert "In the place of both terms, swivel-friction is 2000 nats worse (held-out windows 4.9 mm)" in told.message
    assert "4.9 mm), though as large as can be: friction on a pulley" in told.message
    assert "cannot exceed μ T r" in told.message
    assert "air-drag-linear is 4250 nats worse, though as large as can be: ½ ρ C A of a platform" in told.message
    assert [ranked.plausible for ranked in told.ranking].count(False) == 3
    plain = answer(irma4)
    assert plain is not None
    assert "In the place of both" not in plain.message


def test_noise_alone_left_is_an_explanation(irma4: Robot) -> None:
    noise = 1e3 * irma4.sensors.marker_noise
    told = answer(irma4, whole=Figures(1.2 * noise, 500.0))
    assert told is not None
    assert told.verdict is Verdict.EXPLAINED
    assert "unexplained" not in told.message


def test_dissipation_that_helps_little_names_nothing(irma4: Robot) -> None:
    assert answer(irma4, without=Figures(2.4, 900.0)) is None
    assert answer(irma4, whole=Figures(float("nan"), 500.0)) is None


def test_what_is_held_at_nothing_has_no_standard_deviation(irma4: Robot) -> None:
    told = answer(irma4, whole=replace(USUAL["whole"], share={"rotational-drag": 0.0}))
    assert told is not None
    assert all(parameter.sd is None for parameter in told.effects[1].parameters.values())
