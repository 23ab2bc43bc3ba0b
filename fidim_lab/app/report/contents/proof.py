"""Held-out windows once more, without and with what was named: the courses behind an explanation's figures.

Only numbers of the explanation go in (parameters, effects with their θ), so that a report shows whether they reproduce
what it claims. Each window's own initial state is fitted, nothing else.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fidim_lab.app.formats.explanation_parts import EffectTable
from fidim_lab.app.report.contents.explanation_file import BodyParameterTable, ExplanationTable
from fidim_lab.data.records import PARAMETER_NAMES, Campaign, Robot, Role, Window
from fidim_lab.effects.catalogue import by_id
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.errors import RefusedError, SetupError
from fidim_lab.identification.mle import held_out
from fidim_lab.identification.mle.judge import Remainder
from fidim_lab.identification.mle.trajectories.recordings import prepare
from fidim_lab.mismatch.unknown_force.unknown import Unknown
from fidim_lab.model.mechanism import Mechanism

HAND = "hand-contact"
"""no wrench: times that the fit leaves out"""
MOST = 4
"""windows that are looked at: enough for a mean spectrum, few enough not to be waited for"""


@dataclass(frozen=True, eq=False)
class Model:
    """A mechanism with its shared parameters: body, then θ of its effects."""

    mechanism: Mechanism
    shared: np.ndarray


@dataclass(frozen=True, eq=False)
class ComparedWindow:
    """One window as both models predict it."""

    window: Window
    before: Remainder
    after: Remainder | None
    """None where nothing was added to the model, or what was added cannot be simulated"""


@dataclass(frozen=True, eq=False)
class ProofOfCause:
    """All windows that could be looked at."""

    windows: tuple[ComparedWindow, ...]
    notes: tuple[str, ...]
    """what could not be shown, and why"""


def proof(found: ExplanationTable, campaign: Campaign, unknown: Unknown | None = None) -> ProofOfCause:
    """Predict held-out windows (identified ones where none is held out) with the body before and the model after."""
    notes: list[str] = []
    before = Model(Mechanism(campaign.robot), _body(found.parameters_before))
    after = _completed(found, campaign, unknown, notes)
    touched = [name for effect in found.effects if effect.id == HAND for name in effect.parameters]
    candidates = campaign.of_role(Role.VALIDATE) or campaign.of_role(Role.IDENTIFY)
    windows = [w for w in candidates if not any(name.startswith(f"{w.id} ") for name in touched)]
    compared: list[ComparedWindow] = []
    for window in windows[:MOST]:
        first = _predicted(before, window, notes)
        if first is not None:
            compared.append(ComparedWindow(window, first, None if after is None else _predicted(after, window, notes)))
    if len(windows) > MOST:
        notes.append(f"Pictures show the first {MOST} of {len(windows)} held-out windows; figures are of all.")
    return ProofOfCause(tuple(compared), tuple(dict.fromkeys(notes)))


def _completed(found: ExplanationTable, campaign: Campaign, unknown: Unknown | None, notes: list[str]) -> Model | None:
    if unknown is not None:
        return Model(unknown.fit.likelihood.mechanism, unknown.fit.values)
    if all(effect.id == HAND for effect in found.effects):
        return None
    try:
        return completed_model(found, campaign.robot)
    except SetupError as error:
        notes.append(f"No picture of the completed model: {error}")
        return None


def completed_model(found: ExplanationTable, robot: Robot) -> Model:
    """The model with what was named, as the explanation's numbers say. Raises SetupError for an unknown effect."""
    simulated = [effect for effect in found.effects if effect.id != HAND]
    chosen = [_effect(effect, robot) for effect in simulated]
    pairs = zip(simulated, chosen, strict=True)
    theta = [float(told.parameters[p.name].value or 0.0) for told, effect in pairs for p in effect.parameters]
    return Model(Mechanism(robot, tuple(chosen), theta), np.concatenate([_body(found.parameters), theta]))


def _effect(told: EffectTable, robot: Robot) -> NamedEffect:
    """The effect of the catalogue with these parameters. Raises SetupError where there is none."""
    names = {p: one.unit for p, one in told.parameters.items()}
    every = [one for one in by_id(robot, told.id, told.cable) if one.cable == told.cable]
    fitting = [one for one in every if {p.name: p.unit for p in one.parameters} == names]
    if fitting:  # variants of one effect may have the same parameters
        return next((one for one in fitting if one.says == told.says), fitting[0])
    raise SetupError(f"{told.label} has no variant with the parameters {', '.join(told.parameters) or '(none)'}.")


def _body(parameters: dict[str, BodyParameterTable]) -> np.ndarray:
    return np.array([parameters[name].value for name in PARAMETER_NAMES])


def _predicted(model: Model, window: Window, notes: list[str]) -> Remainder | None:
    robot = model.mechanism.robot
    try:
        return held_out.predict(model.mechanism, model.shared, prepare(window, robot), robot.sensors).remainder
    except RefusedError as refusal:
        notes.append(str(refusal))
        return None


def rms(remainders: Sequence[Remainder | None]) -> float | None:
    """Of all markers that were recorded, m; None of none."""
    left = [one.residuals[np.isfinite(one.residuals)] for one in remainders if one is not None]
    return float(np.sqrt(np.mean(np.concatenate(left) ** 2))) if left else None
