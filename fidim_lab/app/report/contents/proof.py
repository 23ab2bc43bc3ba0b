"""Held-out windows once more, without and with what was named: the courses behind an explanation's figures.

Only numbers of the explanation go in (parameters, effects with their θ), so that a report shows whether they reproduce
what it claims. Each window's own initial state is fitted, nothing else.
"""

from dataclasses import dataclass

from fidim_lab.app.formats.explanation_file import ExplanationTable
from fidim_lab.app.report.contents.found_model import Model, body_vector, found_model, with_own_bodies
from fidim_lab.data.records import Campaign, Role, Window
from fidim_lab.effects.effect import HandContact
from fidim_lab.errors import RefusedError, SetupError
from fidim_lab.identification.mle import held_out
from fidim_lab.identification.mle.judge import Remainder
from fidim_lab.identification.mle.trajectories.recordings import prepare
from fidim_lab.mismatch.unknown_force.unknown import UnknownForce
from fidim_lab.model.mechanism import Mechanism

MOST = 4
"""windows that are looked at: enough for a mean spectrum, few enough not to be waited for"""


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


def proof(found: ExplanationTable, campaign: Campaign, unknown: UnknownForce | None = None) -> ProofOfCause:
    """Predict held-out windows (identified ones where none is held out) with the body before and the model after."""
    notes: list[str] = []
    before = Model(Mechanism(campaign.robot, native=True), body_vector(found.parameters_before))
    after = _completed(found, campaign, unknown, notes)
    touched = [name for effect in found.effects if effect.id == HandContact.id for name in effect.parameters]
    candidates = campaign.of_role(Role.VALIDATE) or campaign.of_role(Role.IDENTIFY)
    own = {window.id: window for window in with_own_bodies(found, campaign).windows}
    windows = [w for w in candidates if not any(name.startswith(f"{w.id} ") for name in touched)]
    compared: list[ComparedWindow] = []
    for window in windows[:MOST]:
        first = _predicted(before, window, notes)
        if first is not None:
            compared.append(
                ComparedWindow(window, first, None if after is None else _predicted(after, own[window.id], notes))
            )
    if len(windows) > MOST:
        notes.append(
            f"Pictures show the first {MOST} of {len(windows)} held-out windows; the numbers are for all of them."
        )
    return ProofOfCause(tuple(compared), tuple(dict.fromkeys(notes)))


def _completed(
    found: ExplanationTable, campaign: Campaign, unknown: UnknownForce | None, notes: list[str]
) -> Model | None:
    if unknown is not None:
        return Model(unknown.fit.likelihood.mechanism, unknown.fit.values)
    if found.geometry is None and all(effect.id == HandContact.id for effect in found.effects):
        return None
    try:
        return found_model(found, campaign.robot, native=True)
    except SetupError as error:
        notes.append(f"The model with its effects could not be drawn: {error}")
        return None


def _predicted(model: Model, window: Window, notes: list[str]) -> Remainder | None:
    robot = model.mechanism.robot
    try:
        return held_out.predict(model.mechanism, model.shared, prepare(window, robot), robot.sensors).remainder
    except RefusedError as refusal:
        notes.append(str(refusal))
        return None
