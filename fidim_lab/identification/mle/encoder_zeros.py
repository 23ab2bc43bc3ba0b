"""What encoders whose zeros are unknown say of the anchors.

A locked winch holds its cable's length. By the robot file's geometry and the poses that length is known in each window;
what the encoder counted differs from it by the encoder's zero, which is the same in all windows. Where it is not, the
geometry is off: an anchor that lies δ beside its place in the file changes the length by −u·δ with u the cable's
direction (rows of Ξ, Eq. 3), another amount at each pose. No fit of motions uses the readings, so they are a witness
of their own.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Campaign
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.mle.evidence import FACTORS, over_factors
from fidim_lab.identification.motion.measured import rest_pose
from fidim_lab.identification.results.result import AnchorByEncoder
from fidim_lab.identification.survey import TYPICAL_ANCHOR
from fidim_lab.model.mechanism import Mechanism

FEWEST = 4
"""windows; a zero, its scatter and an anchor leave fewer of them nothing to say"""
SCATTERS = np.geomspace(1e-5, 3e-2, 36)
"""m: of a zero from window to window, from an encoder's step to what is no encoder any more; a quarter apart.
Half or twice as many, and ends at half or twice, change odds of 36 and 12 nats by under 0.3 (paper's robot)"""


@dataclass(frozen=True, eq=False)
class _Readings:
    """Of the encoders of one campaign, where their zeros are unknown."""

    zeros: Float[np.ndarray, "W n"]
    """m, by the poses"""
    along: Float[np.ndarray, "W n 3"]
    """rows of Ξ: by how much they grow with how far the true anchors are from the file's"""


def anchors_by_encoders(
    campaigns: Sequence[Campaign], anchors: Sequence[Sequence[int]] | None = None
) -> tuple[AnchorByEncoder, ...]:
    """Of each anchor whose cable's encoder was read in `FEWEST` windows or more with unknown zeros.

    anchors: for each campaign and cable, which anchor it has among all different ones; each its own where none are
    given. Zeros are those of a campaign; how much they scatter is taken as the same for all cables, so that one that
    scatters more stands out. Anchors are told by the first cable that has them.
    """
    read = [_read(campaign) for campaign in campaigns]
    numbers = anchors or [range(campaign.robot.n) for campaign in campaigns]
    pairs: dict[int, list[tuple[int, int]]] = {}
    for member, of_cables in enumerate(numbers):
        for cable, anchor in enumerate(of_cables):
            pairs.setdefault(anchor, []).append((member, cable))
    tried: list[_Anchor] = []
    for of_anchor in pairs.values():
        known = [(read[member], cable) for member, cable in of_anchor if len(read[member].zeros)]
        if sum(len(one.zeros) for one, _ in known) >= FEWEST:
            zeros = np.concatenate([one.zeros[:, cable] for one, cable in known])
            along = np.concatenate([one.along[:, cable] for one, cable in known])
            session = np.repeat(np.arange(len(known)), [len(one.zeros) for one, _ in known])
            tried.append(_Anchor(of_anchor[0][1] + 1, zeros, along, np.eye(len(known))[session]))
    either = [np.logaddexp(*one.evidences) - np.log(2.0) for one in tried]
    return tuple(one.told(np.sum([*either[:k], *either[k + 1 :]], axis=0)) for k, one in enumerate(tried))


def _read(campaign: Campaign) -> _Readings:
    robot = campaign.robot
    zeros, along = [np.zeros((0, robot.n))], [np.zeros((0, robot.n, 3))]
    mechanism = Mechanism(robot)
    for window in campaign.windows:
        if window.encoder_zeros is None or window.middle(robot.markers) is None:
            continue
        pose = rest_pose(mechanism, window)
        try:
            structure = mechanism.structure_matrix(pose.position[np.newaxis], pose.rotation[np.newaxis])
        except InfeasibleError:
            continue  # nothing is known of where it hung
        zeros.append(window.encoder_zeros[np.newaxis])
        along.append(structure[:, :, :3])
    return _Readings(np.concatenate(zeros), np.concatenate(along))


@dataclass(frozen=True, eq=False)
class _Anchor:
    """z = zero + u·δ + noise of the cables at one anchor, the zeros with a flat prior."""

    cable: int
    zeros: Float[np.ndarray, " W"]
    along: Float[np.ndarray, "W 3"]
    sessions: Float[np.ndarray, "W S"]
    """whose zero each is"""

    @cached_property
    def table(self) -> Float[np.ndarray, "F+1 N"]:
        """Evidence for δ by a usual survey 0 and `FACTORS` times as large, by each of `SCATTERS`."""
        spreads = (0.0, *(TYPICAL_ANCHOR * FACTORS))
        return np.array([[self._evidence(spread, noise) for noise in SCATTERS] for spread in spreads])

    @cached_property
    def evidences(self) -> tuple[np.ndarray, np.ndarray]:
        """By each of `SCATTERS`: that the file's anchor holds, and that it does not."""
        off = [over_factors(column)[0] for column in self.table[1:].T]
        return self.table[0], np.array(off)

    def told(self, others: Float[np.ndarray, " N"]) -> AnchorByEncoder:
        """What is said of it. others: evidence of all other anchors by each of `SCATTERS`, wherever they are."""
        holds, off = (np.logaddexp.reduce(one + others) for one in self.evidences)
        _, best = over_factors(np.logaddexp.reduce(self.table[1:] + others, axis=1))
        spread, noise = TYPICAL_ANCHOR * FACTORS[best], SCATTERS[np.argmax(self.table[1 + best] + others)]
        design = np.column_stack([self.along, self.sessions])
        weight = np.diag([*(3 * [spread**-2.0]), *np.zeros(self.sessions.shape[1])])
        covariance = np.linalg.inv(design.T @ design / noise**2 + weight)
        found = covariance @ design.T @ self.zeros / noise**2
        about = self.zeros - self.sessions @ np.linalg.lstsq(self.sessions, self.zeros, rcond=None)[0]
        dof, sd = len(self.zeros) - self.sessions.shape[1], np.sqrt(np.diag(covariance))
        return AnchorByEncoder(
            self.cable,
            len(self.zeros),
            float(np.sqrt(about @ about / dof)),
            float(np.linalg.norm(self.zeros - design @ found) / np.sqrt(dof)),
            (float(found[0]), float(found[1]), float(found[2])),
            (float(sd[0]), float(sd[1]), float(sd[2])),
            float(off - holds),
        )

    def _evidence(self, spread: float, noise: float) -> float:
        """Log likelihood with the zeros and δ integrated out, less what all have in common."""
        zeros, sessions = self.zeros, self.sessions
        covariance = noise**2 * np.eye(len(zeros)) + spread**2 * self.along @ self.along.T
        weighed = np.linalg.solve(covariance, np.column_stack([sessions, zeros]))
        inner = sessions.T @ weighed[:, :-1]
        about = zeros - sessions @ np.linalg.solve(inner, sessions.T @ weighed[:, -1])
        size = np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(inner)[1]
        return -0.5 * float(size + about @ np.linalg.solve(covariance, about))
