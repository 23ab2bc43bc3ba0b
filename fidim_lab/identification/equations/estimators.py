"""The estimators by name. A new one is one file with `estimate(problem) -> Estimate` and one line here."""

from collections.abc import Callable, Mapping
from enum import StrEnum
from types import MappingProxyType

from fidim_lab.errors import SetupError
from fidim_lab.identification.equations import least_squares, total_least_squares
from fidim_lab.identification.equations.estimate import Estimate
from fidim_lab.identification.equations.problem import Problem

Estimator = Callable[[Problem], Estimate]


class Method(StrEnum):
    """Estimators that can be asked for."""

    MLE = "mle"
    """maximum likelihood on whole trajectories (`mle.identify`): works on recordings, not on equations"""
    TLS = "tls"
    """FIDIM by total least squares, the paper's"""
    LS = "ls"
    """the same equations by weighted least squares"""
    IV = "iv"
    """the same equations with instruments from simulated motion"""


# MLE is not among them: it works on recordings
ESTIMATORS: Mapping[Method, Estimator] = MappingProxyType(
    {
        Method.TLS: total_least_squares.estimate,
        Method.LS: least_squares.estimate_ls,
        Method.IV: least_squares.estimate_iv,
    }
)


def method_named(name: str) -> Method:
    """The method of this name. Raises SetupError that lists what there is."""
    if name in {method.value for method in Method}:
        return Method(name)
    available = ", ".join(Method)
    raise SetupError(f"There is no method {name!r}; available: {available}.")
