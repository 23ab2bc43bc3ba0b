"""The nine parameters of a fit, of one campaign or of several, with every kind of uncertainty."""

from typing import Protocol

import numpy as np
from jaxtyping import Bool, Float

from fidim_lab.data.records import PARAMETER_NAMES, Body
from fidim_lab.identification.equations import consistency
from fidim_lab.identification.equations.uncertainty import jackknife_sd
from fidim_lab.identification.mle import findings, spread
from fidim_lab.identification.mle.starts.possible import scales
from fidim_lab.identification.results.result import InertialParameter
from fidim_lab.model.sensitivity.equations import BODY

CONTRADICT = 0.01
"""probability under which windows do not show one body: one honest campaign in a hundred gets its spread for ±"""
UNSEEN = 1.0
"""of what is plausible beforehand (`scales`): a parameter known no better than that is not seen by the recordings"""


class Fitted(Protocol):
    """The interface of a fit."""

    @property
    def values(self) -> Float[np.ndarray, " shared"]:
        """The shared parameters, the body first."""
        ...

    @property
    def body(self) -> Body:
        """Of them."""
        ...

    @property
    def start(self) -> Body:
        """The start of the search."""
        ...

    @property
    def tables(self) -> Float[np.ndarray, "W s s"]:
        """The windows' reduced tables at the optimum."""
        ...

    @property
    def tempered_tables(self) -> Float[np.ndarray, "W s s"]:
        """The same in units of what is left, where that is more than the stated noise."""
        ...

    @property
    def prior_rows(self) -> Float[np.ndarray, "shared s"]:
        """The prior there."""
        ...

    @property
    def tempered_covariance(self) -> Float[np.ndarray, "shared shared"]:
        """Of all shared parameters, with χ²/dof."""
        ...

    @property
    def explained(self) -> bool:
        """Whether nothing but noise is left."""
        ...

    def without(self, dropped: Bool[np.ndarray, " shared"]) -> Float[np.ndarray, " shared"]:
        """The estimate with the parameters marked in `dropped` set to zero, to first order."""
        ...


def figures_of(found: Fitted, nominal: Body) -> findings.Figures:
    """Parameters with every kind of uncertainty."""
    replicates = spread.leave_one_out(found.tables, found.prior_rows, found.values)
    replicates = None if replicates is None else replicates[:, :BODY]
    bootstrap = spread.bootstrap_sd(found.tables, found.prior_rows)
    bootstrap = None if bootstrap is None else bootstrap[:BODY]
    covariance = found.tempered_covariance[:BODY, :BODY]
    nominal_sd = np.sqrt(np.diag(covariance))
    jackknife = None if replicates is None else jackknife_sd(replicates)
    agree = not found.explained or spread.agreement(found.tempered_tables, found.prior_rows) > CONTRADICT
    sd = nominal_sd if found.explained and agree else findings.largest(nominal_sd, bootstrap, jackknife)
    covariance = covariance * np.outer(sd / nominal_sd, sd / nominal_sd)
    body, moved = consistency.nearest_existing(found.body, covariance)
    seen = sd < UNSEEN * scales(found.start)
    dropped = findings.non_essential(found.values[:BODY], sd, bootstrap)
    held = np.concatenate([dropped, np.zeros(len(found.values) - BODY, dtype=bool)])
    refitted = found.without(held) if dropped.any() and seen.all() else None
    parameters = {
        name: InertialParameter(
            value=float(body.vector[k]),
            sd=float(sd[k]),
            sd_bootstrap=None if bootstrap is None else float(bootstrap[k]),
            sd_jackknife=None if jackknife is None else float(jackknife[k]),
            nominal=float(nominal.vector[k]),
            without_non_essential=None if refitted is None else float(refitted[k]),
            seen=bool(seen[k]),
        )
        for k, name in enumerate(PARAMETER_NAMES)
    }
    names = tuple(name for name, drop in zip(PARAMETER_NAMES, dropped, strict=True) if drop)
    return findings.Figures(parameters, names, covariance, replicates, moved, agree)
