"""Small swings about an equilibrium while the winches move: what the lengths' accelerations do to each mode.

The platform's deviation from where it would rest with the present lengths is Φ q, and (Eq. 37–39 with l̈, damping ζ)

    q̈_j + 2 ζ_j ω_j q̇_j + ω_j² q_j = −(Φᵀ M G l̈)_j          G = ∂(rest)/∂l, 6 × n

What cables then pull more than at rest is linear in q, in the lengths and in their accelerations: `Pull`.

A mode's state is the complex number y = q̇ + (ζω + iω_d) q, which in free motion is y₀ e^{st}, s = −ζω + iω_d, and
whose modulus over ω_d is the amplitude of q. `swing_about` makes one; for large swings and tensions take `driven`.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Complex, Float

from fidim_lab.data.records import Body, Pose
from fidim_lab.model.geometry import rotation_matrix
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.modes import mass_matrix, modes
from fidim_lab.model.statics import Equilibrium, balance

NEUTRAL = 0.05
"""Hz: slower than that is no swing"""


@dataclass(frozen=True, eq=False)
class Pull:
    """What tensions (per unit mass, N/kg) have on top of those at rest, while no damping acts.

    With the platform Φ q + G Δl away from its rest, [M Ξᵀ; Ξ 0] [v̇; δτ] = [−K (Φ q + G Δl); l̈], K as in Eq. 37.
    """

    by_swing: Float[np.ndarray, "n modes"]
    """for q = 1"""
    by_lengths: Float[np.ndarray, "n n"]
    """N/kg per m: at rest with other lengths"""
    by_acceleration: Float[np.ndarray, "n n"]
    """N/kg per m/s²"""


@dataclass(frozen=True, eq=False)
class Swing:
    """The modes about one equilibrium; neutral freedoms are left out."""

    rest: Pose
    frequencies: Float[np.ndarray, " modes"]
    """undamped, Hz"""
    damping: Float[np.ndarray, " modes"]
    """ζ"""
    shapes: Float[np.ndarray, "6 modes"]
    """Φ: twists about the world's axes, Φᵀ M Φ = 1"""
    markers: Float[np.ndarray, "3 modes"]
    """how the main marker moves for q = 1, m"""
    gain: Float[np.ndarray, "modes n"]
    """Φᵀ M G"""
    mass: Float[np.ndarray, "6 6"]
    """M about the rest, per unit mass"""
    pull: Pull
    """tensions"""

    @property
    def rates(self) -> Complex[np.ndarray, " modes"]:
        """s = −ζω + iω_d, 1/s."""
        omega = 2 * np.pi * self.frequencies
        return omega * (-self.damping + 1j * np.sqrt(1 - self.damping**2))

    @property
    def dragged(self) -> Complex[np.ndarray, " modes"]:
        """1 + 2ζω/s: by this much more does a move from rest to rest act, for damping drags at all of the motion."""
        return 1 - 2 * np.real(self.rates) / self.rates

    @property
    def lever(self) -> Float[np.ndarray, " modes"]:
        """How far the main marker moves for q = 1, m."""
        return np.linalg.norm(self.markers, axis=0)

    def damped(self, damping: Float[np.ndarray, " modes"]) -> "Swing":
        """The same with other damping ratios."""
        return replace(self, damping=np.asarray(damping, dtype=float))

    def damping_matrix(self) -> Float[np.ndarray, "6 6"]:
        """D per unit mass over [ṗ; ω] that has these damping ratios: M Φ diag(2ζω) Φᵀ M."""
        scaled = self.mass @ self.shapes * np.sqrt(4 * np.pi * self.damping * self.frequencies)
        return scaled @ scaled.T

    def states(
        self, pose: Pose, twist: Float[np.ndarray, "6"], by: tuple[np.ndarray, np.ndarray] | None = None
    ) -> tuple[Complex[np.ndarray, " modes"], Complex[np.ndarray, "modes P"]]:
        """y of a motion near the rest, and its derivative by P parameters that pose and twist depend on (6 × P each).

        The rotation away from the rest is taken by its Gibbs vector doubled, right to second order.
        """
        turned = pose.rotation @ self.rest.rotation.T
        skewed = turned - turned.T
        gibbs = 2 * np.array([skewed[2, 1], skewed[0, 2], skewed[1, 0]]) / (1 + np.trace(turned))
        away = np.concatenate([pose.position - self.rest.position, gibbs])
        project = self.shapes.T @ self.mass
        s = self.rates
        conjugate = np.conj(s)
        value = project @ twist - conjugate * (project @ away)
        if by is None:
            return value, np.zeros((len(s), 0), dtype=complex)
        g, turning = gibbs / 2, by[0][3:]
        away_by = np.vstack([by[0][:3], turning + np.cross(turning.T, g).T + np.outer(g, g @ turning)])
        return value, project @ by[1] - conjugate[:, np.newaxis] * (project @ away_by)

    def motion(self, states: Complex[np.ndarray, " modes"]) -> tuple[Pose, Float[np.ndarray, "6"]]:
        """Pose and twist of a small swing whose modes have these states: `states` the other way."""
        q = np.imag(states) / np.imag(self.rates)
        away = self.shapes @ q
        turned = rotation_matrix(away[3:] / 2) @ self.rest.rotation
        rate = np.real(states) + np.real(self.rates) * q
        return Pose(position=self.rest.position + away[:3], rotation=turned), self.shapes @ rate

    def amplitudes(self, states: Complex[np.ndarray, " modes"]) -> Float[np.ndarray, " modes"]:
        """How far the main marker swings in each mode, m."""
        return np.abs(states) / np.abs(np.imag(self.rates)) * self.lever


def swing_about(
    mechanism: Mechanism, body: Body, equilibrium: Equilibrium, damping: Float[np.ndarray, " modes"] | float = 0.0
) -> Swing:
    """The modes about an equilibrium. Raises SetupError (from `modes`) for a body that cannot exist."""
    found = modes(mechanism, body, equilibrium)
    swings = found.frequencies > NEUTRAL
    shapes = found.shapes[:, swings]
    pose = equilibrium.pose
    _, hessian, xi, _ = balance(mechanism, body, pose, equilibrium.tensions)
    n = mechanism.n
    system = np.block([[hessian, xi.T], [xi, np.zeros((n, n))]])
    # least squares: a neutral freedom (spin about a lone cable) leaves the system singular
    moved = np.linalg.lstsq(system, np.vstack([np.zeros((6, n)), np.eye(n)]), rcond=1e-10)[0]
    shift = moved[:6]
    mass = mass_matrix(body, pose.rotation)
    dynamic = np.block([[mass, xi.T], [xi, np.zeros((n, n))]])
    forced = np.linalg.solve(
        dynamic, np.block([[-hessian @ shapes, np.zeros((6, n))], [np.zeros((n, shapes.shape[1])), np.eye(n)]])
    )[6:]
    arm = pose.rotation @ mechanism.robot.marker
    cross = np.array([[0.0, -arm[2], arm[1]], [arm[2], 0.0, -arm[0]], [-arm[1], arm[0], 0.0]])
    return Swing(
        rest=pose,
        frequencies=found.frequencies[swings],
        damping=np.broadcast_to(np.asarray(damping, dtype=float), (int(swings.sum()),)),
        shapes=shapes,
        markers=np.hstack([np.eye(3), -cross]) @ shapes,
        gain=shapes.T @ mass @ shift,
        mass=mass,
        pull=Pull(
            by_swing=forced[:, : shapes.shape[1]],
            by_lengths=moved[6:],
            by_acceleration=forced[:, shapes.shape[1] :],
        ),
    )
