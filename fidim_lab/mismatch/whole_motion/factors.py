"""By which factors a robot file's geometry is worse than a usual survey: anchors and attachments apart.

A platform is machined and measured with a caliper, its room is not: one factor for both would let attachments move as
far as anchors do.
"""

from itertools import product

import numpy as np

from fidim_lab.identification.mle.evidence import FACTORS, SPREAD_OF_FACTORS
from fidim_lab.identification.mle.linearised import Linearised
from fidim_lab.identification.survey import TYPICAL_ANCHOR, TYPICAL_ATTACHMENT, Nuisance
from fidim_lab.mismatch.whole_motion.models import WholeModel
from fidim_lab.model.sensitivity.equations import BODY

GRID = FACTORS[::4]
"""neighbours differ by 1.6: that changes the evidence of 24 offsets by less than a nat near its best"""
TYPICAL = {"anchor": TYPICAL_ANCHOR, "attachment": TYPICAL_ATTACHMENT}


def likeliest_factors(model: WholeModel) -> tuple[float, float]:
    """Of anchors and of attachments, by evidence at the model's optimum and a prior of two thirds within a factor 3."""
    found, terms = model.found, len(model.found.values) - BODY - sum(len(one.sd) for one in model.geometry)
    values = max(1, round(model.cost / model.temper))
    problem = Linearised.of(found.tables, model.cost, values, found.values[BODY:] - found.prior.mean[BODY:])
    before = model.prior_sd[:terms]

    def evidence(anchor: float, attachment: float) -> float:
        scaled = np.concatenate([before, *(_scaled(one, anchor, attachment) for one in model.geometry)])
        there, temper = problem.settled(scaled)
        # the sum of squares by few independent values, its size unknown
        size = values * np.log(temper)
        surprise = (np.log(anchor) ** 2 + np.log(attachment) ** 2) / SPREAD_OF_FACTORS**2
        return -0.5 * (size + there.strain + there.occam - problem.occam_of_body(temper) + surprise)

    anchor, attachment = max(product(GRID, GRID), key=lambda pair: evidence(*pair))
    return float(anchor), float(attachment)


def _scaled(one: Nuisance, anchor: float, attachment: float) -> np.ndarray:
    factor = {"anchor": anchor, "attachment": attachment}[one.what]
    return np.full(len(one.sd), factor * TYPICAL[one.what])
