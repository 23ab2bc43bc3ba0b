"""The platform's mass from two identifications, without and with a known payload (Eq. 23–24).

Free motion does not show the mass; how far a payload moves the centre of mass does. `find_mass` takes both bodies with
their covariances and finds the m (and with it the true centre of mass) under which both are most likely: Eq. 24 with
errors on both sides, weighted by all of them, those of the payload included. The three components of Eq. 24 are also
solved one by one, to be looked at.

The inertia says something too: I′_L (m + Δm) = m I′ + Δm (‖p‖² 1 − p pᵀ) for a payload that is a point. `with_inertia`
adds these six equations. They help where the centre of mass hardly moves, and are off where the payload is large: a
payload of 5 cm radius of gyration adds 0.0025 Δm that a point does not have. So the mass stated is that of the centre
of mass alone, and the other one a check.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares
from scipy.stats import chi2

from fidim_lab.arrays import Vector3
from fidim_lab.data.records import Robot
from fidim_lab.errors import RefusedError, SetupError
from fidim_lab.identification.results.result import Estimated, IdentificationResult

MOST_UNCERTAIN = 1 / 3
"""sd over mass beyond which nothing is stated"""
CONTRADICTION = 0.01
"""p of the misfit below which the equations contradict each other"""
SAME_PLACE = 1e-9
"""m (and m/s²) within which two robot files describe the same geometry"""


@dataclass(frozen=True, eq=False)
class Payload:
    """A known payload."""

    mass: float
    """Δm, kg"""
    at: Vector3
    """p_L, its centre of mass in the body frame, m"""
    mass_sd: float = 0.0
    """kg"""
    at_sd: float = 0.0
    """m, of each coordinate"""


@dataclass(frozen=True, eq=False)
class KnownBody:
    """Nine parameters and how well they are known."""

    values: Float[np.ndarray, "9"]
    covariance: Float[np.ndarray, "9 9"]

    @staticmethod
    def of(result: IdentificationResult) -> "KnownBody":
        """From a result: its covariance, widened where the spread between windows is larger than the nominal sd."""
        parameters = result.parameters.values()
        wider = np.array([max(1.0, (p.spread or 0.0) / p.sd) if p.sd > 0 else 1.0 for p in parameters])
        return KnownBody(result.body.vector, result.covariance * np.outer(wider, wider))


@dataclass(frozen=True, eq=False)
class MassResult:
    """The platform's mass and what supports it."""

    mass: Estimated
    """from the centre of mass, all three components (Eq. 24); the sd is widened by √(χ²/dof) where that is over 1"""
    components: dict[str, Estimated | None]
    """x, y, z of Eq. 24 alone; None where the payload lies as good as in line with the centre of mass"""
    with_inertia: Estimated | None
    """the same with the inertia of a point added; None where that finds no mass"""
    chi2: float
    dof: int
    p: float
    shift: Vector3
    """s′_L − s′, m"""

    @property
    def consistent(self) -> bool:
        """Whether the three components agree."""
        return self.p >= CONTRADICTION

    @property
    def inertia_helps(self) -> bool:
        """Whether the inertia, if the payload were a point, would lessen the uncertainty by a tenth at least."""
        return self.with_inertia is not None and self.with_inertia.sd < 0.9 * self.mass.sd


def refuse_other_geometry(empty: Robot, loaded: Robot) -> None:
    """Raises SetupError, naming what differs, where the two campaigns were not recorded on the same robot."""
    if empty.n != loaded.n:
        raise SetupError(f"The campaign with the payload has {loaded.n} cables, the one without has {empty.n}.")
    for number, (a, b) in enumerate(zip(empty.cables, loaded.cables, strict=True), start=1):
        for name in ("d", "a", "radius", "x", "y", "z"):
            off = float(np.abs(np.asarray(getattr(a, name)) - np.asarray(getattr(b, name))).max())
            if off > SAME_PLACE:
                raise SetupError(
                    f"The two campaigns have different robots: {name} of cable {number} differs by {off:.3g}.",
                    hint="A mass can only be found on one robot; correct the robot.toml that is wrong.",
                )
    for name in ("gravity", "marker"):
        off = float(np.abs(np.asarray(getattr(empty, name)) - np.asarray(getattr(loaded, name))).max())
        if off > SAME_PLACE:
            raise SetupError(f"The two campaigns have different robots: {name} differs by {off:.3g}.")


def find_mass(empty: KnownBody, loaded: KnownBody, payload: Payload) -> MassResult:
    """The platform's mass (kg) from the bodies identified without and with the payload.

    Raises RefusedError where the payload lies too near the centre of mass to show anything, or where the centre of mass
    moved away from the payload.
    """
    shift = loaded.values[:3] - empty.values[:3]
    start = _start(empty, loaded, payload)
    mass, misfit = _fit(empty, loaded, payload, start, 3)
    dof = 2
    widened = Estimated(mass.value, mass.sd * float(np.sqrt(max(1.0, misfit / dof))))
    if not mass.value > 0 or not mass.sd < MOST_UNCERTAIN * mass.value:
        raise RefusedError(
            _nothing(empty, loaded, payload), hint="Put it farther from the centre of mass, or add more."
        )
    try:
        with_inertia = _fit(empty, loaded, payload, mass.value, 9)[0]
    except RefusedError:
        with_inertia = None
    components = {axis: _component(empty, loaded, payload, mass.value, k) for k, axis in enumerate("xyz")}
    return MassResult(widened, components, with_inertia, misfit, dof, float(chi2.sf(misfit, dof)), shift)


def _start(empty: KnownBody, loaded: KnownBody, payload: Payload) -> float:
    """Eq. 24 by plain least squares, all components alike. Raises RefusedError where it has no positive answer."""
    d, q = loaded.values[:3] - empty.values[:3], payload.mass * (payload.at - loaded.values[:3])
    spread = np.sqrt(np.trace(empty.covariance[:3, :3] + loaded.covariance[:3, :3]))
    if np.linalg.norm(d) <= spread:
        raise RefusedError(
            _nothing(empty, loaded, payload), hint="Put it farther from the centre of mass, or add more."
        )
    if d @ q <= 0:
        raise RefusedError(
            f"With the payload the centre of mass moved by {_millimetres(d)} mm, away from the payload at "
            f"{_millimetres(payload.at)} mm: no mass explains that.",
            hint="Check --at (body frame, metres), and that CAMPAIGN is the one without the payload.",
        )
    return float(d @ q / (d @ d))


def _nothing(empty: KnownBody, loaded: KnownBody, payload: Payload) -> str:
    lever = float(np.linalg.norm(payload.at - empty.values[:3]))
    moved = float(np.linalg.norm(loaded.values[:3] - empty.values[:3]))
    spread = float(np.sqrt(np.trace(empty.covariance[:3, :3] + loaded.covariance[:3, :3])))
    return (
        f"The payload lies {lever * 1e3:.1f} mm from the platform's centre of mass, which it moved by "
        f"{moved * 1e3:.2f} mm, known to {spread * 1e3:.2f} mm: that does not show the mass."
    )


def _fit(empty: KnownBody, loaded: KnownBody, payload: Payload, start: float, used: int) -> tuple[Estimated, float]:
    """The mass and χ² from the first `used` parameters (3: centre of mass, 9: inertia of a point too)."""
    C_a, C_b = empty.covariance[:used, :used], loaded.covariance[:used, :used]
    mass = start
    found = None
    for _ in range(2):  # the payload's own errors enter with a weight that depends on the mass
        J = _by_payload(empty.values[:used], mass, payload)
        known = np.diag([payload.mass_sd**2, *[payload.at_sd**2] * 3])
        whiten = [_inverse_root(C_a), _inverse_root(C_b + J @ known @ J.T)]

        def residual(u: np.ndarray, whiten: list[np.ndarray] = whiten) -> np.ndarray:
            body, m = u[:used], start * u[used]
            with_payload = _loaded(body, m, payload.mass, payload.at)
            return np.concatenate(
                [whiten[0] @ (empty.values[:used] - body), whiten[1] @ (loaded.values[:used] - with_payload)]
            )

        found = least_squares(residual, np.append(empty.values[:used], mass / start), x_scale="jac", method="lm")
        mass = start * float(found.x[used])
    if found is None or not found.success or not mass > -payload.mass:
        raise RefusedError("No mass fits both campaigns.")
    # The covariance through QR: JᵀJ would square a condition that is large already.
    R = np.linalg.qr(np.asarray(found.jac)).R
    sd = start * float(np.linalg.norm(np.linalg.inv(R)[used]))
    return Estimated(mass, sd), 2.0 * float(found.cost)


def _loaded(body: np.ndarray, mass: float, added: float, at: Vector3) -> np.ndarray:
    """The parameters (3 or 9) of the platform with a point of mass `added` at `at` (Eq. 23)."""
    point = np.concatenate([at, _point_inertia(at)])[: len(body)]
    return (mass * body + added * point) / (mass + added)


def _point_inertia(at: Vector3) -> Float[np.ndarray, "6"]:
    """‖p‖² 1 − p pᵀ as xx yy zz xy xz yz, m²."""
    x, y, z = at
    return np.array([y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z])


def _by_payload(body: np.ndarray, mass: float, payload: Payload) -> Float[np.ndarray, "k 4"]:
    """Derivatives of `_loaded` by [Δm, p_L], by central differences."""
    steps = np.array([1e-5 * payload.mass, 1e-6, 1e-6, 1e-6])
    columns: list[np.ndarray] = []
    for k, step in enumerate(steps):
        change = np.zeros(4)
        change[k] = step
        ends = [
            _loaded(body, mass, payload.mass + sign * change[0], payload.at + sign * change[1:]) for sign in (1, -1)
        ]
        columns.append((ends[0] - ends[1]) / (2 * step))
    return np.stack(columns, axis=1)


def _component(empty: KnownBody, loaded: KnownBody, payload: Payload, mass: float, k: int) -> Estimated | None:
    """One row of Eq. 24: m = Δm (p − s_L)/(s_L − s), its sd from m (s_L − s) − Δm (p − s_L) = 0."""
    d = loaded.values[k] - empty.values[k]
    both = mass + payload.mass
    J = _by_payload(empty.values[:3], mass, payload)[k]
    variance = loaded.covariance[k, k] + (mass / both) ** 2 * empty.covariance[k, k]
    variance += float(J**2 @ np.array([payload.mass_sd**2, *[payload.at_sd**2] * 3]))
    sd = both * float(np.sqrt(variance))
    if not abs(d) > 0 or sd > abs(d) * mass:
        return None
    return Estimated(float(payload.mass * (payload.at[k] - loaded.values[k]) / d), float(sd / abs(d)))


def _inverse_root(covariance: np.ndarray) -> np.ndarray:
    """A with AᵀA = C⁻¹. A direction without any uncertainty counts as known to 1e-12 of the variance of the worst."""
    values, vectors = np.linalg.eigh(covariance)
    floor = max(1e-12 * float(values[-1]), 1e-30)
    return (vectors / np.sqrt(np.maximum(values, floor))).T


def _millimetres(v: np.ndarray) -> str:
    return "(" + ", ".join(f"{1e3 * x:.2f}" for x in v) + ")"
