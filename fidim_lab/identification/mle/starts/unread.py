"""First poses of windows without measured cable lengths, where markers alone leave the orientation open.

One marker's place is a family of poses. A platform swings about one at which it rests, with its marker in the middle of
the motion; most of the others no four cables could hold, and a fit that begins there ends with a slack cable. With four
cables these rests are still a family of one, of which the least turned is taken: from it the fit reached rests that
were turned by changes of 5 cm of each cable.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Body, Pose
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.mle.starts.start_poses import Poses, Targets, refined
from fidim_lab.identification.mle.trajectories.recordings import FollowedSamples
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.statics import Equilibrium


@dataclass(frozen=True, eq=False)
class Unread:
    """What is seen of one window at its begin."""

    recording: FollowedSamples
    places: Float[np.ndarray, "M 3"]
    """of its markers, m; NaN where one is not seen"""
    on_body: Float[np.ndarray, "M 3"]
    """where they sit, m"""

    def moved_to(self, pose: Pose) -> Pose:
        """The pose with its markers where they are seen."""
        by = np.nanmean(self.places - self.on_body @ pose.rotation.T, axis=0)
        return Pose(by, pose.rotation)


def rest_near(mechanism: Mechanism, body: Body, recording: FollowedSamples) -> Equilibrium | None:
    """Where the platform rests with its main marker in the middle of a window; None where it cannot, or is not seen."""
    place = recording.window.equilibrium
    if place is None:
        main = recording.markers[:, 0]
        if not np.isfinite(main).all(axis=1).any():
            return None
        place = np.nanmean(main, axis=0)
    try:
        return equilibrium_at(mechanism, body, place)
    except InfeasibleError:
        return None


def poses_from_rests(
    mechanism: Mechanism, shared: Float[np.ndarray, " shared"], asked: Sequence[tuple[Unread, Equilibrium]]
) -> list[Pose]:
    """The pose of each window at its begin, if it swings about this rest: by the rest's lengths and its markers."""
    if not asked:
        return []
    most = max(len(one.places) for one, _ in asked)
    places = np.full((len(asked), most, 3), np.nan)
    on_body = np.zeros((len(asked), most, 3))
    for k, (one, _) in enumerate(asked):
        places[k, : len(one.places)], on_body[k, : len(one.on_body)] = one.places, one.on_body
    begins = Poses(
        np.array([rest.pose.position for _, rest in asked]), np.array([rest.pose.rotation for _, rest in asked])
    )
    lengths = np.array([rest.lengths for _, rest in asked])
    targets = Targets(places, on_body, lengths, np.array([one.recording.begin for one, _ in asked]))
    found, _ = refined(mechanism, shared, targets, begins)
    turned = zip(found.positions, found.rotations, strict=True)
    return [one.moved_to(Pose(*pose)) for (one, _), pose in zip(asked, turned, strict=True)]
