"""What was put on a platform, as the difference of two identified bodies: a loaded one and the empty one.

Moments about P add up, mass times each of the nine parameters: m b = m₁ b₁ − m₀ b₀ with m = m₁ − m₀. Both answers count
as independent. What they have in common (the geometry's error) goes into both with the same sign and partly cancels, so
the ± is rather too large.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Body
from fidim_lab.errors import SetupError
from fidim_lab.identification.equations.consistency import ALLOWED, nearest_existing
from fidim_lab.identification.payload_mass import KnownBody
from fidim_lab.identification.results.result import Estimated, IdentificationResult, InertialParameter


@dataclass(frozen=True, eq=False)
class Difference:
    """The body that makes the difference."""

    mass: Estimated
    """kg"""
    parameters: dict[str, InertialParameter]
    """per unit of its own mass, about P; seen where both campaigns show them"""
    about_com: dict[str, InertialParameter]
    """the same of I about its centre of mass"""

    off: float
    """sd by which it is away from the nearest body that can exist; 0 where not all are seen"""

    @property
    def possible(self) -> bool:
        """Whether a body can have these parameters, within their errors."""
        return self.off <= ALLOWED


def difference(
    loaded: IdentificationResult, empty: IdentificationResult, with_it: Estimated, without: Estimated
) -> Difference:
    """What was added to the empty platform; masses (kg) are those of the whole platform in each campaign.

    Raises SetupError where the loaded platform is not the heavier one.
    """
    mass = with_it.value - without.value
    if mass <= 0:
        raise SetupError(
            f"The platform of {loaded.campaign} has {with_it.value:g} kg, the empty one of {empty.campaign} "
            f"{without.value:g} kg: nothing was added.",
            hint="State the mass of the whole platform in each campaign's robot.toml (platform, mass).",
        )
    one, other = KnownBody.of(loaded), KnownBody.of(empty)
    values = (with_it.value * one.values - without.value * other.values) / mass
    by_masses = np.column_stack([(one.values - values) * with_it.sd, (other.values - values) * without.sd]) / mass
    covariance = (with_it.value**2 * one.covariance + without.value**2 * other.covariance) / mass**2
    covariance = covariance + by_masses @ by_masses.T
    nominal = (with_it.value * loaded.nominal.vector - without.value * empty.nominal.vector) / mass
    parameters = {
        name: _parameter(values[k], covariance, k, nominal[k], seen=p.seen and empty.parameters[name].seen)
        for k, (name, p) in enumerate(loaded.parameters.items())
    }
    alone = replace(loaded, parameters=parameters, covariance=covariance, leave_one_out=None)
    known = Estimated(mass, float(np.hypot(with_it.sd, without.sd)))
    whole = all(p.seen for p in parameters.values())
    off = nearest_existing(Body.from_vector(values), covariance)[1] if whole else 0.0
    return Difference(known, parameters, alone.about_com(), off)


def _parameter(
    value: float, covariance: Float[np.ndarray, "9 9"], k: int, nominal: float, *, seen: bool
) -> InertialParameter:
    sd = float(np.sqrt(covariance[k, k]))
    return InertialParameter(float(value), sd, None, None, float(nominal), seen=seen)
