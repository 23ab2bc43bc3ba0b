"""The model that identify or explain tells: the body, effects that were named, the geometry found with them."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fidim_lab.app.formats.explanation_file import BodyParameterTable, ExplanationTable, read_explanation
from fidim_lab.app.formats.explanation_parts import EffectTable
from fidim_lab.data.files.input_file import read_json
from fidim_lab.data.records import PARAMETER_NAMES, Body, Campaign, Robot
from fidim_lab.effects.catalogue import by_id
from fidim_lab.effects.effect import HandContact, NamedEffect
from fidim_lab.errors import SetupError
from fidim_lab.identification.results.result import IdentificationResult
from fidim_lab.identification.results.result_file import ResultTable, read_result
from fidim_lab.identification.survey import as_found, opened_by
from fidim_lab.mismatch.session.kinds import OF_BODY, PHYSICS
from fidim_lab.model.mechanism import Mechanism

Found = IdentificationResult | ResultTable | ExplanationTable
"""by identify or explain, just now or as their files say"""


@dataclass(frozen=True, eq=False)
class Model:
    """A mechanism with its shared parameters: body, then θ of its effects."""

    mechanism: Mechanism
    shared: np.ndarray

    @property
    def body(self) -> Body:
        """Of the parameters."""
        return Body.from_vector(self.shared[: len(PARAMETER_NAMES)])


def read_found(path: Path) -> ResultTable | ExplanationTable:
    """A "fidim-result/1" or "fidim-explanation/1" file. Raises FileError with the key that is wrong."""
    found = read_json(path)
    form = found.get("format") if isinstance(found, dict) else None
    return read_explanation(path) if form == "fidim-explanation/1" else read_result(path)


def found_model(told: Found, robot: Robot, *, native: bool = False) -> Model:
    """What a result or an explanation says of this robot; native: with compiled C.

    Raises SetupError for an effect that the catalogue does not have.
    """
    if isinstance(told, ExplanationTable):
        model = _with_effects(told, robot, native=native)
    else:
        model = Model(Mechanism(robot, native=native), told.body.vector)
    made = as_found(model.mechanism, _pieces(told))
    return Model(made, np.concatenate([model.body.vector, made.theta]))


def with_own_bodies(told: Found, campaign: Campaign) -> Campaign:
    """The campaign of which an explanation tells, each window with the body that it found there; others as they are."""
    if not isinstance(told, ExplanationTable) or told.campaign != campaign.name:
        return campaign
    windows = campaign.windows
    for effect in told.effects:
        if effect.id in OF_BODY:
            whole = np.array([effect.parameters[name].value or 0.0 for name in PARAMETER_NAMES])
            windows = tuple(replace(w, body_change=effect.windows.get(w.id, 0.0) * whole) for w in windows)
    return replace(campaign, windows=windows)


def _with_effects(found: ExplanationTable, robot: Robot, *, native: bool = False) -> Model:
    """The robot file's geometry with what was named. Raises SetupError for an unknown effect."""
    # a hand is no wrench: the fit leaves its times out; what changed over a session belongs to that one alone
    lasting = [effect for effect in found.effects if effect.id not in (HandContact.id, *PHYSICS)]
    simulated = [(effect, named_effect(effect, robot)) for effect in lasting]
    # a geometry that is off is named by the piece that is off most, which is among those that come behind the effects
    counted = {one.effect for one in opened_by(robot, _pieces(found))}
    kept = [(told, effect) for told, effect in simulated if effect not in counted]
    theta = [float(told.parameters[p.name].value or 0.0) for told, effect in kept for p in effect.parameters]
    shared = np.concatenate([body_vector(found.parameters), theta])
    return Model(Mechanism(robot, tuple(effect for _, effect in kept), theta, native=native), shared)


def _pieces(found: Found) -> dict[tuple[str, int | None], tuple[float, ...]]:
    """Of the geometry that was found; none where it is the file's."""
    return {} if found.geometry is None else found.geometry.pieces


def named_effect(told: EffectTable, robot: Robot) -> NamedEffect:
    """The effect of the catalogue with these parameters. Raises SetupError where there is none."""
    names = {p: one.unit for p, one in told.parameters.items()}
    every = [one for one in by_id(robot, told.id, told.cable) if one.cable == told.cable]
    fitting = [one for one in every if {p.name: p.unit for p in one.parameters} == names]
    if fitting:  # variants of one effect may have the same parameters
        return next((one for one in fitting if one.says == told.says), fitting[0])
    raise SetupError(f"{told.label} has no variant with the parameters {', '.join(told.parameters) or '(none)'}.")


def body_vector(parameters: dict[str, BodyParameterTable]) -> np.ndarray:
    """The nine, SI, about P."""
    return np.array([parameters[name].value for name in PARAMETER_NAMES])
