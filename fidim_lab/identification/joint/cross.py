"""Fitted on some campaigns, predicted on the others: only the initial states of predicted windows are fitted."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Role
from fidim_lab.errors import RefusedError
from fidim_lab.identification.joint.fit import fit_some
from fidim_lab.identification.joint.found import JointFit
from fidim_lab.identification.joint.members import lay_out
from fidim_lab.identification.joint.sharing import Common
from fidim_lab.identification.mle import held_out
from fidim_lab.identification.mle.starts.start import Guess
from fidim_lab.identification.mle.trajectories.likelihood import stepped
from fidim_lab.identification.mle.trajectories.recordings import FollowedSamples, prepare
from fidim_lab.model.sensitivity.equations import BODY

FEWEST_MARKERS = 3
"""of which a pose can be told"""
ALL_SINGLES = 4
"""campaigns up to which each alone predicts the others too; of more, only all but one do"""


@dataclass(frozen=True)
class CrossPrediction:
    """One window as a fit predicts it that has not seen it."""

    campaign: str
    window: str
    rms: float | None
    """m, of a marker coordinate; None where it cannot be predicted"""
    of_pose: float | None
    """m, the same of what a rigid body's motion can miss: without what markers do that are not at their place"""
    chi2_per_dof: float | None
    seconds: float
    """how far it was followed"""
    why: str = ""
    """why it cannot be predicted"""


@dataclass(frozen=True, eq=False)
class Cross:
    """One fit's prediction of one campaign."""

    fitted: tuple[int, ...]
    predicted: int
    windows: tuple[CrossPrediction, ...]

    @property
    def rms(self) -> float | None:
        """m, over all windows; None where none can be predicted."""
        known = [window.rms for window in self.windows if window.rms is not None]
        return float(np.sqrt(np.mean(np.square(known)))) if known else None

    @property
    def of_pose(self) -> float | None:
        """m, `rms` of the pose alone; None where too few markers show it."""
        known = [window.of_pose for window in self.windows if window.of_pose is not None]
        return float(np.sqrt(np.mean(np.square(known)))) if known else None

    @property
    def median(self) -> float | None:
        """m, of the windows' rms."""
        known = [window.rms for window in self.windows if window.rms is not None]
        return float(np.median(known)) if known else None


def cross_predictions(common: Common, whole: JointFit, *, native: bool) -> tuple[Cross, ...]:
    """Every campaign predicted by fits that have not seen it, then held-out windows by the fit of all."""
    count = len(common.campaigns)
    every = tuple(range(count))
    subsets = [tuple(k for k in every if k != out) for out in every]
    if 2 < count <= ALL_SINGLES:
        subsets = [*((k,) for k in every), *subsets]
    found: list[Cross] = []
    for chosen in subsets:
        fitted = fit_some(common, whole, chosen, native=native)
        others = [k for k in every if k not in chosen]
        found += [predicted_by(common, fitted, k, (Role.IDENTIFY, Role.VALIDATE), whole) for k in others]
    held = [predicted_by(common, whole, k, (Role.VALIDATE,)) for k in every]
    return (*found, *(one for one in held if one.windows))


def predicted_by(
    common: Common, fitted: JointFit, member: int, roles: Sequence[Role], whole: JointFit | None = None
) -> Cross:
    """Windows of one campaign with the body of a fit and the geometry that it knows; the rest as in the file.

    whole: the fit of all campaigns; near its initial states those of the same windows are sought, for speed only.
    """
    campaign = common.campaigns[member]
    layout = lay_out(common, [member], fitted.layout.effects, native=True)
    shared = np.zeros(layout.size)
    fixed = BODY + layout.dissipating
    shared[:fixed] = fitted.values[:fixed]
    known = {piece.key: piece.place for piece in fitted.layout.pieces}
    for piece in layout.pieces:
        if piece.key in known:
            shared[piece.place] = fitted.values[known[piece.key]]
    windows = [window for role in roles for window in campaign.of_role(role)]
    recordings: list[FollowedSamples] = []
    said: list[CrossPrediction] = []
    for window in windows:
        try:
            recordings.append(prepare(window, campaign.robot))
        except RefusedError as refusal:
            said.append(CrossPrediction(campaign.name, window.id, None, None, None, 0.0, str(refusal)))
    (mechanism,), local = layout.mechanisms, shared[layout.places[0]]
    begins = {} if whole is None else _states_near(whole, member, local)
    fresh = [one for one in recordings if one.window.id not in begins]
    known = [one for one in recordings if one.window.id in begins]
    guesses = [begins[one.window.id] for one in known]
    predicted = [
        *held_out.predict_all(mechanism, local, known, campaign.robot.sensors, guesses, near=True),
        *held_out.predict_all(mechanism, local, fresh, campaign.robot.sensors),
    ]
    for recording, one in zip((*known, *fresh), predicted, strict=True):
        name = recording.window.id
        if isinstance(one, RefusedError):
            said.append(CrossPrediction(campaign.name, name, None, None, None, 0.0, str(one)))
            continue
        left = one.remainder
        seconds = float(left.t[-1] - left.t[0])
        rms_of_pose = of_pose(left.residuals, left.predicted)
        said.append(CrossPrediction(campaign.name, name, left.rms, rms_of_pose, left.chi2_per_dof, seconds))
    order = {window.id: k for k, window in enumerate(windows)}
    return Cross(fitted.chosen, member, tuple(sorted(said, key=lambda one: order[one.window])))


def _states_near(whole: JointFit, member: int, local: Float[np.ndarray, " local"]) -> dict[str, Guess]:
    """The initial states of a campaign's windows with other shared parameters, to first order; by the window's id."""
    likelihood, simulation = whole.members[member].likelihood, whole.optimum.simulations[member]
    tables, own = whole.optimum.tables[member], likelihood.own
    move = local - simulation.point.shared
    right = tables[:, :own, -1] + tables[:, :own, own:-1] @ move
    steps = -np.linalg.solve(tables[:, :own, :own], right[..., np.newaxis])[..., 0]
    states = stepped(likelihood, simulation, steps, move).states
    each = zip(likelihood.recordings, states.positions, states.rotations, states.twists, strict=True)
    return {recording.window.id: Guess(*state, misfit=0.0) for recording, *state in each}


def of_pose(residuals: Float[np.ndarray, "T M 3"], places: Float[np.ndarray, "T M 3"]) -> float | None:
    """m, rms of a marker coordinate that a small motion of the whole body explains; None with fewer than three markers.

    Of each sample, the part of the residuals that a displacement and a rotation about the markers' middle make up.
    """
    seen = np.asarray(np.isfinite(residuals).all(axis=2))
    whole = seen.sum(axis=1) >= FEWEST_MARKERS
    if not whole.any():
        return None
    weight = seen[whole].astype(float)[..., np.newaxis]
    at, left = (np.where(weight > 0, values[whole], 0.0) for values in (places, residuals))
    arms = (at - (at * weight).sum(axis=1, keepdims=True) / weight.sum(axis=1, keepdims=True)) * weight
    turns = np.cross(np.eye(3)[np.newaxis, np.newaxis], arms[:, :, np.newaxis])  # [t, m, axis, coordinate]
    moves = np.concatenate([np.broadcast_to(np.eye(3), turns.shape) * weight[..., np.newaxis], turns], axis=2)
    columns = moves.transpose(0, 1, 3, 2).reshape(len(at), -1, 6)
    right = left.reshape(len(at), -1, 1)
    rigid = columns @ (np.linalg.pinv(columns) @ right)
    return float(np.sqrt((rigid**2).sum() / (3 * weight.sum())))
