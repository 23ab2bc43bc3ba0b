"""By which factors a robot file's geometry is worse than a usual survey: one for each kind of piece, or for each piece.

A platform is machined and measured with a caliper, its room is not: pieces of one kind are surveyed alike. But one of
them may be wrong by far, a digit mistyped or a pulley moved: one factor for all would spread its error over the others.
"""

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from fidim_lab.identification.mle.evidence import FACTORS, SPREAD_OF_FACTORS, Linearised
from fidim_lab.identification.survey import TYPICAL, Nuisance
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.mismatch.whole_motion.models import WholeModel
from fidim_lab.model.sensitivity.equations import BODY

GRID = FACTORS[::4]
"""neighbours differ by 1.6: that changes the evidence of three offsets by a tenth of a nat near its best"""


def likeliest_survey(model: WholeModel, *, alike: bool) -> tuple[Nuisance, ...]:
    """The open geometry with the most likely standard deviations, by evidence at the model's optimum and `surprise`.

    alike: the same of all anchors, and of all attachments.
    """
    found, pieces = model.found, model.geometry
    others = model.prior_sd[: len(model.found.values) - BODY - sum(len(one.sd) for one in pieces)]
    values = max(1, round(model.cost / model.temper))
    problem = Linearised.of(found.tables, model.cost, values, found.values[BODY:] - found.prior.mean[BODY:])

    def evidence(surveyed: tuple[Nuisance, ...]) -> float:
        there, temper = problem.settled(np.concatenate([others, *(np.array(one.sd) for one in surveyed)]))
        # the sum of squares by few independent values, its size unknown
        size = values * np.log(temper)
        return -0.5 * (size + there.strain + there.occam - problem.occam_of_body(temper)) - surprise(surveyed)

    kinds = [one.what for one in pieces]
    groups = [{k for k, kind in enumerate(kinds) if kind == one} for one in dict.fromkeys(kinds)]
    groups = groups if alike else [{k} for k in range(len(pieces))]
    best, most = pieces, -np.inf
    for _ in range(SHARED.rounds):
        begun = most
        for group in groups:
            trials = [_scaled(best, group, float(factor)) for factor in GRID]
            said = [evidence(trial) for trial in trials]
            if max(said) > most:
                best, most = trials[int(np.argmax(said))], max(said)
        if most == begun:
            break
    return best


def surprise(surveyed: tuple[Nuisance, ...]) -> float:
    """Nats by which these standard deviations are less likely than a usual survey's.

    ln factor = one part that a kind of piece shares + one of the piece's own, each two thirds within ln 3.
    """
    nats = 0.0
    for kind in TYPICAL:
        logs = np.log([one.sd[0] / TYPICAL[kind] for one in surveyed if one.what == kind])
        covariance = SPREAD_OF_FACTORS**2 * (np.ones((len(logs), len(logs))) + np.eye(len(logs)))
        nats += 0.5 * float(logs @ np.linalg.solve(covariance, logs))
    return nats


def _scaled(pieces: tuple[Nuisance, ...], group: Collection[int], factor: float) -> tuple[Nuisance, ...]:
    """With so many times a usual survey for these pieces (indices)."""
    return tuple(
        replace(one, sd=(factor * TYPICAL[one.what],) * len(one.sd)) if k in group else one
        for k, one in enumerate(pieces)
    )
