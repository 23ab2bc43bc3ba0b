"""The answer for robots with a soft direction, from the elastic models that were compared (`soft_cables`)."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fidim_lab.data.records import PARAMETER_NAMES, Robot
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.effects.plausibility import Context
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.soft import ALL_NOISE
from fidim_lab.mismatch.conclusion.explanation import (
    Before,
    BodyParameter,
    EffectParameter,
    Explanation,
    NamedCause,
    Ranked,
    Verdict,
)
from fidim_lab.mismatch.conclusion.soft_cables import Compared, Elastic
from fidim_lab.mismatch.conclusion.thresholds import CONCLUSION
from fidim_lab.mismatch.scores.thresholds import SCORES


def soft_answer(told: Explanation, compared: Compared, robot: Robot, softness: str) -> Explanation | None:
    """The answer of the elastic models in the place of that on rigid cables; None where they name nothing.

    A term is named where the fitted windows ask for it by more than `enough` nats and held-out windows are not
    predicted worse with it; nothing is, unless both terms take half of what held-out windows lack (sum of squares).
    """
    whole, without = compared.whole, compared.without
    if not whole.held_out**2 < CONCLUSION.soft_message_half * without.held_out**2:
        return None
    named = [effect for effect in compared.dissipation if _is_asked_for(compared, effect)]
    if not named:
        return None
    explained = whole.held_out < ALL_NOISE * robot.sensors.marker_noise
    return replace(
        told,
        verdict=Verdict.EXPLAINED if explained else Verdict.PARTLY_EXPLAINED,
        effects=tuple(_cause(compared, effect) for effect in named),
        where=(),  # the places of `told` are those that rigid cables miss
        unknown=None,
        chi2_per_dof=Before(without.chi2_per_dof, whole.chi2_per_dof),
        rms_mm=Before(1e3 * without.held_out, 1e3 * whole.held_out),
        ranking=_ranking(compared),
        parameters=_parameters(whole.found, robot),
        parameters_before=_parameters(without.found, robot),
        next_experiment="Record rotation about each body axis by itself, at two sizes: dry friction damps the small "
        "one more, drag both alike.",
        message=_message(compared, named, robot, softness),
    )


def _is_asked_for(compared: Compared, effect: NamedEffect) -> bool:
    lacking = [one for one in compared.single if effect not in one.effects]
    if not lacking:
        return False
    rest = lacking[0]
    evident = compared.behind(rest) > SCORES.enough
    return evident and compared.whole.held_out < CONCLUSION.soft_message_no_worse * rest.held_out


def _cause(compared: Compared, effect: NamedEffect) -> NamedCause:
    values, sds, high = compared.whole.theta_of(effect)
    parameters = {
        p.name: EffectParameter(
            float(value), float(sd) if 0 < value < CONCLUSION.soft_message_at_bound * most else None, p.unit
        )
        for p, value, sd, most in zip(effect.parameters, values, sds, high, strict=True)
    }
    others = compared.elsewhere if effect == compared.dissipation[0] else ()
    alike = tuple(one.effects[0].id for one in others if _as_good(compared.same_law, one) and not _impossible(one))
    return NamedCause(effect.id, None, alike, parameters, effect.says)


def _as_good(one: Elastic, other: Elastic) -> bool:
    return other.held_out < CONCLUSION.soft_message_alike * one.held_out


def _impossible(one: Elastic) -> bool:
    """Whether the first effect is held at the largest size that can be."""
    return bool(_at_largest(one))


def _at_largest(one: Elastic) -> list[str]:
    """Parameters of the first effect that are held at the largest size that can be."""
    effect = one.effects[0]
    values, _, high = one.theta_of(effect)
    return [
        p.name
        for p, value, most in zip(effect.parameters, values, high, strict=True)
        if value > CONCLUSION.soft_message_at_bound * most
    ]


def _ranking(compared: Compared) -> tuple[Ranked, ...]:
    slipping = () if compared.at_once is None else (compared.at_once,)
    others = (*compared.single, *compared.elsewhere, *compared.alone)
    every = (compared.whole, *slipping, *others, compared.without)
    ranked = [
        Ranked(
            tuple(effect.label for effect in one.effects),
            one.chi2_per_dof if np.isfinite(one.chi2_per_dof) else None,
            not (one.effects and _impossible(one)),
            f"on elastic cables: held-out rms {1e3 * one.held_out:.2f} mm; fitted windows "
            f"{compared.behind(one):+.0f} nats from the model with both terms",
        )
        for one in every
    ]
    return tuple(
        sorted(ranked, key=lambda one: np.inf if one.held_out_chi2_per_dof is None else one.held_out_chi2_per_dof)
    )


def _parameters(found: Fit, robot: Robot) -> dict[str, BodyParameter]:
    nominal = robot.nominal.vector
    return {
        name: BodyParameter(float(found.values[k]), float(found.sd[k]), float(nominal[k]))
        for k, name in enumerate(PARAMETER_NAMES)
    }


def _message(compared: Compared, named: Sequence[NamedEffect], robot: Robot, softness: str) -> str:
    whole, without = compared.whole, compared.without
    windows = ", ".join(
        f"{id} {1e3 * without.rms.get(id, np.nan):.1f} → {1e3 * rms:.1f}" for id, rms in whole.rms.items()
    )
    said = [
        f"The cables hold one direction hardly at all ({softness}): elastic cables are fitted instead of rigid ones.",
        f"Without dissipation they miss held-out windows by {1e3 * without.held_out:.1f} mm rms, with friction at the "
        f"attachments and drag about the body's axes by {1e3 * whole.held_out:.1f} mm ({windows} mm). That rotation "
        "loses energy is beyond doubt; where, is not.",
        f"The fitted windows ask for {' and '.join(effect.id for effect in named)}.",
        *(_alone(compared, one) for one in compared.single),
        *(_instead(compared, one) for one in compared.elsewhere),
        *_by_themselves(compared, robot),
    ]
    said += _giving_way(compared)
    values, sds, _ = whole.theta_of(compared.dissipation[0])
    if values[0] < 2 * sds[0]:
        said.append(
            f"What rubs at the attachments is dry by this fit ({values[1]:.2g} ± {sds[1]:.1g} N m each); a viscous "
            "part there cannot be told from drag about the axes."
        )
    floor = robot.sensors.marker_noise
    if whole.held_out >= ALL_NOISE * floor:
        said.append(
            f"About {1e3 * whole.held_out:.1f} mm, {whole.held_out / floor:.0f} times the markers' noise, remain "
            "unexplained; standard deviations count such a remainder as noise."
        )
    return " ".join([*said, *compared.soft.sentences])


def _giving_way(compared: Compared) -> list[str]:
    """That friction gives way before it slips, where it does; empty where it slips at once."""
    before = compared.at_once
    if before is None:
        return []
    (*_, about_z, give), (*_, sd), _ = compared.whole.theta_of(compared.dissipation[0])
    return [
        f"Friction there goes with the cables' tension, gives way over {np.degrees(give):.1f}° ({give:.2g} ± {sd:.1g} "
        f"rad) before it slips, so it holds small swings like a spring, and rubs by {about_z:.2g} N m more about the "
        f"body's z axis (all at usual tension): that fits the windows by {compared.behind(before):.0f} nats better "
        f"than friction that slips at once with any tension, which misses held-out ones by "
        f"{1e3 * before.held_out:.1f} mm."
    ]


def _alone(compared: Compared, one: Elastic) -> str:
    return (
        f"With {one.effects[0].id} alone they are missed by {1e3 * one.held_out:.1f} mm, and the fitted windows are "
        f"{compared.behind(one):.0f} nats worse."
    )


def _by_themselves(compared: Compared, robot: Robot) -> list[str]:
    """What cannot be all that dissipates, and why; empty where nothing else was tried."""
    said: list[str] = []
    for one in compared.alone:
        reason = _why_impossible(one, robot)
        missed = "" if np.isnan(one.held_out) else f" (held-out windows {1e3 * one.held_out:.1f} mm)"
        bound = "" if reason is None else f", though as large as can be: {reason}"
        said.append(f"{one.effects[0].id} is {compared.behind(one):.0f} nats worse{missed}{bound}")
    return [f"In the place of both terms, {'; '.join(said)}."] if said else []


def _why_impossible(one: Elastic, robot: Robot) -> str | None:
    """Why the first effect cannot be larger, where it is as large as can be."""
    limits = one.effects[0].limits(Context.of(robot))
    return next((limits[name].why for name in _at_largest(one) if name in limits), None)


def _instead(compared: Compared, one: Elastic) -> str:
    name = one.effects[0].id
    if _impossible(one):
        return f"{name} in the place of the attachments asks for more torque than such a pulley can produce."
    as_good = "about as well as" if _as_good(compared.same_law, one) else "worse than"
    theirs = 1e3 * compared.same_law.held_out
    return (
        f"{name} in their place predicts {as_good} theirs by the same law ({1e3 * one.held_out:.1f}, {theirs:.1f} mm)."
    )
