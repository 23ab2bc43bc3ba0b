"""Can the identified body exist? The pseudo-inertia [Σ′ s′; s′ᵀ 1] must be positive definite (Rucker & Wensing 2022).

That says more than a positive definite inertia: it holds for a body if and only if some distribution of positive mass
has these parameters (it contains the triangle inequality of the principal moments about G). `can_move` asks less: a
positive definite inertia about G, without which there is no equation of motion at all. What can move but not exist is
reported as such and not refused: a wrong assumption elsewhere (a simulated body included) looks like this.
"""

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Body


def pseudo_inertia(body: Body) -> Float[np.ndarray, "4 4"]:
    """[Σ′ s′; s′ᵀ 1] per unit mass, Σ′ = ½ tr(I′) 1 − I′, body frame about P."""
    inertia = body.inertia_matrix
    out = np.ones((4, 4))
    out[:3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    out[:3, 3] = out[3, :3] = body.com
    return out


def can_exist(body: Body) -> bool:
    """Whether the pseudo-inertia is positive definite."""
    return bool(np.linalg.eigvalsh(pseudo_inertia(body))[0] > 0)


def can_move(body: Body) -> bool:
    """Whether the inertia about G, and so the mass matrix, is positive definite."""
    return bool(np.linalg.eigvalsh(body.inertia_about_com)[0] > 0)


def sentence(body: Body) -> str:
    """The verdict for a person; names what is violated and by how much."""
    if can_exist(body):
        return "The identified body can exist (its pseudo-inertia is positive definite)."
    moments = np.linalg.eigvalsh(body.inertia_about_com)
    if moments[0] <= 0:
        why = f"a principal moment of inertia about G is {moments[0]:.2e} m²"
    else:
        why = f"about G, {moments[0]:.2e} + {moments[1]:.2e} < {moments[2]:.2e} m²: the triangle inequality fails"
    return f"No body can have these parameters: {why}."
