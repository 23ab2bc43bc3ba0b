"""Can the identified body exist? The pseudo-inertia [Σ′ s′; s′ᵀ 1] must be positive definite (Rucker & Wensing 2022).

That says more than a positive definite inertia: it holds for a body if and only if some distribution of positive mass
has these parameters (it contains the triangle inequality of the principal moments about G). `can_move` asks less: a
positive definite inertia about G, without which there is no equation of motion at all. What can move but not exist is
reported as such and not refused: a wrong assumption elsewhere (a simulated body included) looks like this.
"""

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import Matrix3
from fidim_lab.data.records import Body

BARRIER = 0.5
"""nats for each e-fold of det(pseudo-inertia): keeps a body that is moved inside the cone off its boundary"""
SHRINKS, NEWTON = 200, 50
"""rounds at most, of the shrinking cone and within one of them; 10 and 8 are usual"""
SMALLEST, SETTLED = 1e-9, 1e-9
"""part of a step, and nats, below which nothing is gained"""
ALLOWED = 3.0
"""standard deviations by which an estimate may be moved to a body that exists; farther, no such body fits the data"""


def pseudo_inertia(body: Body) -> Float[np.ndarray, "4 4"]:
    """[Σ′ s′; s′ᵀ 1] per unit mass, Σ′ = ½ tr(I′) 1 − I′, body frame about P."""
    out = np.ones((4, 4))
    out[:3, :3] = second_moments(body.inertia_matrix)
    out[:3, 3] = out[3, :3] = body.com
    return out


def second_moments(inertia: Matrix3) -> Matrix3:
    """∫ x xᵀ dm / m of an inertia matrix about the same point, m²."""
    return 0.5 * np.trace(inertia) * np.eye(3) - inertia


def can_exist(body: Body) -> bool:
    """Whether the pseudo-inertia is positive definite."""
    return bool(np.linalg.eigvalsh(pseudo_inertia(body))[0] > 0)


def can_move(body: Body) -> bool:
    """Whether the inertia about G, and so the mass matrix, is positive definite."""
    return bool(np.linalg.eigvalsh(body.inertia_about_com)[0] > 0)


def nearest_existing(body: Body, covariance: Float[np.ndarray, "9 9"]) -> tuple[Body, float]:
    """The body that exists and is most likely by these normal uncertainties, and how far that is, in sd.

    covariance: of the nine parameters. Directions that recordings do not determine cost nothing to move along. The body
    itself where it exists; infinitely far where no existing body is within reach.
    """
    if can_exist(body):
        return body, 0.0
    scale = np.sqrt(np.diag(covariance))
    values, axes = np.linalg.eigh(covariance / np.outer(scale, scale))
    root = scale[:, np.newaxis] * axes * np.sqrt(np.maximum(values, 1e-12))

    # from outside the cone: a lifted cone that contains the estimate shrinks to the true one
    u = np.zeros(9)
    lift = -2.0 * float(np.linalg.eigvalsh(pseudo_inertia(body))[0])
    for _ in range(SHRINKS):
        u = _inside(body, root, u, lift)
        if lift == 0.0:
            break
        edge = max(0.0, -float(np.linalg.eigvalsh(pseudo_inertia(Body.from_vector(body.vector + root @ u)))[0]))
        lift = 0.0 if edge == 0.0 else 0.3 * lift + 0.7 * edge
    found = Body.from_vector(body.vector + root @ u)
    return (found, float(np.linalg.norm(u))) if can_exist(found) else (body, np.inf)


def _inside(body: Body, root: Float[np.ndarray, "9 9"], u: Float[np.ndarray, "9"], lift: float) -> np.ndarray:
    """The least of ½ u·u − BARRIER ln det(pseudo-inertia + lift) by Newton's steps from a u inside: it is convex."""
    centre = pseudo_inertia(body) + lift * np.eye(4)
    nothing = pseudo_inertia(Body.from_vector(np.zeros(9)))
    slopes = np.array([pseudo_inertia(Body.from_vector(column)) - nothing for column in root.T])

    def cost(u: np.ndarray) -> float:
        inside = np.linalg.eigvalsh(centre + np.tensordot(u, slopes, 1))
        return np.inf if inside[0] <= 0 else float(0.5 * u @ u - BARRIER * np.log(inside).sum())

    now = cost(u)
    for _ in range(NEWTON):
        turned = np.linalg.solve(centre + np.tensordot(u, slopes, 1), slopes)
        gradient = u - BARRIER * np.trace(turned, axis1=1, axis2=2)
        step = -np.linalg.solve(np.eye(9) + BARRIER * np.einsum("kij,lji->kl", turned, turned), gradient)
        size, there = 1.0, cost(u + step)
        while size > SMALLEST and there > now + 0.1 * size * float(gradient @ step):
            size *= 0.5
            there = cost(u + size * step)
        if size <= SMALLEST or now - there < SETTLED:
            break
        u, now = u + size * step, there
    return u


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
