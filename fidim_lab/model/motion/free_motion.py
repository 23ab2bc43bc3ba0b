"""Free motion at locked motors as a function of its free coordinates (paper §2.2, Eq. 5–7; spec/model.md §1).

Which λ coordinates are called free is a choice. A coordinate is named by an axis: 0, 1, 2 are the marker's x, y, z;
3, 4, 5 are rotation about the world's x, y, z (needed only where λ > 3). A *selector* S has one row for each of them,
its rate as a function of the twist, so that S v = ẏ_f. `best_axes` chooses well; `conditioning` says how well.
All arrays have the sample as their first index; world frame, SI.
"""

from itertools import combinations

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import Positions, Rotations, Series, Twists, Vector3
from fidim_lab.data.records import Motion
from fidim_lab.errors import InfeasibleError, SetupError
from fidim_lab.model.mechanism import Mechanism

AXIS_NAMES = ("x", "y", "z", "rotation about x", "rotation about y", "rotation about z")

Structure = Float[np.ndarray, "N n 6"]
Selector = Float[np.ndarray, "N free 6"]
Basis = Float[np.ndarray, "N 6 free"]


def marker_selector(rotations: Rotations, marker: Vector3, axes: tuple[int, ...]) -> Selector:
    """Rows [eᵀ, (R m × e)ᵀ] for the marker's axes 0–2, [0, eᵀ] for the rotation axes 3–5.

    Raises SetupError for an axis that does not exist or is named twice.
    """
    _check_axes(axes)
    arms = rotations @ marker
    selector = np.zeros((len(rotations), len(axes), 6))
    for row, axis in enumerate(axes):
        direction = np.eye(3)[axis % 3]
        if axis < 3:
            selector[:, row, :3] = direction
            selector[:, row, 3:] = np.cross(arms, direction)
        else:
            selector[:, row, 3:] = direction
    return selector


def marker_selector_rate(rotations: Rotations, twists: Twists, marker: Vector3, axes: tuple[int, ...]) -> Selector:
    """Ṡ of `marker_selector` along the given twists: rows [0, ((ω × R m) × e)ᵀ], zero for the rotation axes."""
    _check_axes(axes)
    velocities = np.cross(twists[:, 3:], rotations @ marker)
    rate = np.zeros((len(rotations), len(axes), 6))
    for row, axis in enumerate(axes):
        if axis < 3:
            rate[:, row, 3:] = np.cross(velocities, np.eye(3)[axis])
    return rate


def free_twist_basis(xi: Structure, selector: Selector) -> Basis:
    """Ξ⊥ with Ξ Ξ⊥ = 0 and S Ξ⊥ = 1, so that v = Ξ⊥ ẏ_f (Eq. 6).

    Raises InfeasibleError where these coordinates cannot be free: [S; Ξ] is singular.
    """
    free = selector.shape[1]
    ends = np.concatenate([np.eye(free), np.zeros((xi.shape[1], free))])
    return _solve(xi, selector, np.broadcast_to(ends, (len(xi), *ends.shape)))


def free_twist_basis_rate(xi: Structure, xi_rate: Structure, selector: Selector, selector_rate: Selector) -> Basis:
    """d/dt Ξ⊥ = −[S; Ξ]⁻¹ [Ṡ; Ξ̇] Ξ⊥ (for Eq. 7). Raises InfeasibleError as `free_twist_basis`."""
    basis = free_twist_basis(xi, selector)
    return -_solve(xi, selector, np.concatenate([selector_rate, xi_rate], axis=1) @ basis)


def acceleration_from_free(
    xi: Structure,
    xi_rate: Structure,
    selector: Selector,
    selector_rate: Selector,
    twists: Twists,
    free_accelerations: Float[np.ndarray, "N free"],
) -> Twists:
    """v̇ from [S; Ξ] v̇ = [ÿ_f; 0] − [Ṡ; Ξ̇] v: Eq. 7 without a parametrisation of the rotation.

    free_accelerations: ÿ_f, second derivatives of the coordinates that S selects. Raises InfeasibleError as
    `free_twist_basis`.
    """
    bias = np.concatenate([selector_rate, xi_rate], axis=1) @ twists[..., np.newaxis]
    wanted = np.zeros((len(xi), 6, 1))
    wanted[:, : selector.shape[1], 0] = free_accelerations
    return _solve(xi, selector, wanted - bias)[..., 0]


def motion_from_free(
    mechanism: Mechanism,
    times: Series,
    poses: tuple[Positions, Rotations],
    marker: Vector3,
    axes: tuple[int, ...],
    rates: Float[np.ndarray, "N free"],
    accelerations: Float[np.ndarray, "N free"],
) -> Motion:
    """Twist and acceleration of the whole platform from those of its free coordinates (Eq. 6, 7, 45).

    `poses` as `kinematics.dependent_pose` gives them. Raises InfeasibleError as `free_twist_basis`.
    """
    positions, rotations = poses
    xi = mechanism.structure_matrix(positions, rotations)
    selector = marker_selector(rotations, marker, axes)
    twists = (free_twist_basis(xi, selector) @ rates[..., np.newaxis])[..., 0]
    xi_rate = mechanism.structure_matrix_rate(positions, rotations, twists)
    selector_rate = marker_selector_rate(rotations, twists, marker, axes)
    rest = acceleration_from_free(xi, xi_rate, selector, selector_rate, twists, accelerations)
    return Motion(t=times, positions=positions, rotations=rotations, twists=twists, accelerations=rest)


def conditioning(xi: Structure, selector: Selector) -> Series:
    """Condition number of Ξ over the dependent coordinates, those that S leaves: 1 is ideal, over 100 is hopeless.

    Metres and radians are taken as they are, no scaling. Where it is large the free coordinates are nearly dependent
    at locked lengths, and errors of a measured marker are magnified by about as much (spec/model.md §1).
    """
    if selector.shape[1] == 6:
        return np.ones(len(xi))
    complement = np.linalg.svd(selector)[2][:, selector.shape[1] :, :]
    values = np.linalg.svd(xi @ complement.transpose(0, 2, 1), compute_uv=False)
    with np.errstate(divide="ignore"):
        return values[:, 0] / values[:, -1]


def best_axes(xi: Structure, rotations: Rotations, marker: Vector3) -> tuple[int, ...]:
    """The λ axes whose worst conditioning over the given poses is least.

    λ ≤ 3: a choice among the marker's x, y, z; λ > 3: all three, and the best rotations.
    """
    free = 6 - xi.shape[1]
    marker_axes, rotation_axes = (0, 1, 2), (3, 4, 5)
    if free <= 3:
        candidates = list(combinations(marker_axes, free))
    else:
        candidates = [marker_axes + chosen for chosen in combinations(rotation_axes, free - 3)]
    worst = [float(np.max(conditioning(xi, marker_selector(rotations, marker, axes)))) for axes in candidates]
    return candidates[int(np.argmin(worst))]


def _check_axes(axes: tuple[int, ...]) -> None:
    if len(set(axes)) != len(axes) or any(axis not in range(6) for axis in axes):
        raise SetupError(f"Free coordinates {axes}: each axis is one of 0…5 ({', '.join(AXIS_NAMES)}), named once.")


def _solve(xi: Structure, selector: Selector, right: Float[np.ndarray, "N 6 k"]) -> Float[np.ndarray, "N 6 k"]:
    try:
        return np.linalg.solve(np.concatenate([selector, xi], axis=1), right)
    except np.linalg.LinAlgError as error:
        worst = int(np.argmax(conditioning(xi, selector)))
        raise InfeasibleError(
            f"The chosen coordinates are not free at sample {worst + 1} of {len(xi)}: locked cables tie them together.",
            hint="Choose others; best_axes finds the best-conditioned ones.",
        ) from error
