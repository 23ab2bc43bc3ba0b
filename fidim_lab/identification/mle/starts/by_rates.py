"""First guesses of windows that only a gyroscope shows: small oscillations about the rest at their cable lengths.

The modes of the body as it is thought to be, with the amplitudes that fit the first angular rates best. A mode without
rotation stays where it rests: nothing shows it.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from fidim_lab.data.records import Body
from fidim_lab.errors import InfeasibleError, RefusedError
from fidim_lab.identification.mle.trajectories.recordings import FollowedSamples
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.modes import modes, swing_rates
from fidim_lab.model.statics import Equilibrium

OPENING = 1.0
"""s from which amplitudes are taken: less than half a period of most pendulums, so that the body may be off by 40 %"""
OFF = 0.05
"""rad/s by which a rate may differ from those modes: a tenth of a usual swing"""
BIAS = 0.02
"""rad/s of the gyroscope"""
SWING = 0.3
"""of a mode's rate (γᵀ M γ = 1), m/s: a swing of some centimetres"""

Begin = tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"], Float[np.ndarray, "6"]]
"""position, rotation, twist"""


def begins_by_rates(
    mechanism: Mechanism, body: Body, recordings: Sequence[FollowedSamples]
) -> tuple[Begin | RefusedError, ...]:
    """Of each recording its initial state, or why there is none."""
    rests: dict[bytes, Equilibrium | RefusedError] = {}
    found: list[Begin | RefusedError] = []
    for recording in recordings:
        key = recording.lengths.tobytes()
        if key not in rests:
            rests[key] = _rest(mechanism, body, recording)
        rest = rests[key]
        found.append(rest if isinstance(rest, RefusedError) else _begin(mechanism, body, recording, rest))
    return tuple(found)


def _rest(mechanism: Mechanism, body: Body, recording: FollowedSamples) -> Equilibrium | RefusedError:
    name = recording.window.id
    if not np.isfinite(recording.lengths).all():
        return RefusedError(
            f"Window {name}: a gyroscope does not show how long the cables are, and there are no lengths (l1 … ln).",
            hint="Measure them with a tape, from anchor to attachment: fidim import gyro … --lengths 2.40,2.40.",
        )
    try:
        return pose_from_lengths(mechanism, body, recording.lengths)
    except InfeasibleError as error:
        return RefusedError(f"Window {name}: {error.message}", hint=error.hint)


def _begin(mechanism: Mechanism, body: Body, recording: FollowedSamples, rest: Equilibrium) -> Begin:
    found = modes(mechanism, body, rest)
    pulsations = found.pulsations()
    use = recording.t <= OPENING
    t, rates = recording.t[use], recording.markers[use, 0]
    turns = rest.pose.rotation.T @ found.shapes[3:]
    known = np.array([SWING] * (2 * len(pulsations)) + [BIAS] * 3)
    system = np.vstack([swing_rates(turns, pulsations, t) / OFF, np.diag(1 / known)])
    answer = np.linalg.lstsq(system, np.concatenate([rates.ravel() / OFF, np.zeros(len(known))]), rcond=None)[0]
    cosines, sines = np.split(answer[:-3], 2)
    aside = found.shapes @ (-sines / pulsations)
    turned = Rotation.from_rotvec(aside[3:]).as_matrix() @ rest.pose.rotation
    return rest.pose.position + aside[:3], turned, found.shapes @ cosines
