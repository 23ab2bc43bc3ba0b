"""The words of a joint fit. No number is computed here."""

from collections.abc import Sequence

import numpy as np

from fidim_lab.identification.cleaning.free_motion import whole_id
from fidim_lab.identification.equations import consistency
from fidim_lab.identification.joint.cross import Cross
from fidim_lab.identification.joint.found import JointFit
from fidim_lab.identification.joint.sharing import Common
from fidim_lab.identification.mle.dissipated import lost_energy
from fidim_lab.identification.mle.findings import MISFIT, Figures, not_known
from fidim_lab.identification.mle.geometry_words import encoders_say, furthest
from fidim_lab.identification.results.result import Geometry, ResultOutcome, ShortAnswer
from fidim_lab.identification.survey import TYPICAL_ANCHOR
from fidim_lab.units import millimetres, plain


def answer(ended: ResultOutcome, whole: JointFit, figures: Figures) -> ShortAnswer:
    """In four parts for a person."""
    windows = sum(len({whole_id(r.window.id) for r in m.likelihood.recordings}) for m in whole.members)
    every = [left for of_one in whole.remainders for left in of_one]
    lost = lost_energy(every, whole.members[0].likelihood.noise) if whole.excess > MISFIT else None
    ending = whole.optimum.ending.value if ended is ResultOutcome.NOT_CONVERGED else ""
    return ShortAnswer(
        verdict=" ".join(filter(None, (ended.value, "" if lost is None else lost.says, ending))),
        certain=f"{windows} windows of {len(whole.members)} campaigns were fitted with one body and one geometry; "
        f"χ²/dof is {plain(whole.chi2_per_dof)}. {consistency.sentence(figures.body)}",
        not_known=not_known(figures),
        next=ended.next,
    )


def warnings(common: Common, whole: JointFit, geometry: Geometry, cross: Sequence[Cross]) -> tuple[str, ...]:
    """Everything that a user should know before believing the numbers, one sentence each."""
    said = [f"Common to two campaigns or more: {', '.join(common.shared())}."]
    if common.nothing_shared:
        said.append(
            "No anchor, attachment or marker is common: the body alone joins these campaigns, and its frame is taken "
            "to be the same in all robot files."
        )
    if whole.layout.dissipating:
        said.append(
            f"Friction was fitted with the body, equal for all cables and campaigns: {_sizes(whole)}. It takes up "
            "what dissipates, and does not prove where; `fidim explain` asks that."
        )
    if any(piece.guessed for piece in whole.layout.pieces):
        said.append(
            "No robot file states [survey] for all of the geometry: a usual survey was taken, with "
            f"{whole.factor * millimetres(TYPICAL_ANCHOR):.2g} mm for anchors by the evidence of the recordings."
        )
    misfit = whole.chi2_per_dof > whole.noise_ratio**2 * MISFIT
    by_encoders = encoders_say(geometry.encoders, geometry.moved)
    said += [says for says in (furthest(geometry, explained=not misfit), by_encoders) if says]
    said += [
        f"{one.campaign}/{one.window} cannot be predicted: {one.why}"
        for each in cross
        if each.fitted == whole.chosen
        for one in each.windows
        if one.rms is None
    ]
    if misfit:
        rms = millimetres(float(np.sqrt(np.mean([left.rms**2 for of_one in whole.remainders for left in of_one]))))
        said.append(
            f"The model misses {rms:.2g} mm rms of the fitted windows, more than their noise: the ± count that, and "
            "the spread between windows."
        )
    return tuple(said)


def _sizes(whole: JointFit) -> str:
    """Each effect with the values of its parameters."""
    each = zip(whole.layout.effects, whole.layout.of_effects, strict=True)
    said = [
        (
            effect.label,
            ", ".join(
                f"{parameter.name} {value:.2g} {parameter.unit}"
                for parameter, value in zip(effect.parameters, whole.values[place], strict=True)
            ),
        )
        for effect, place in each
    ]
    return "; ".join(f"{name} ({sizes})" for name, sizes in said)
