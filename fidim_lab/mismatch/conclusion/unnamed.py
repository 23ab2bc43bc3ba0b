"""Unknown physics in an explanation: the words and figures of the generic model, and the parameters with it."""

from dataclasses import replace

from fidim_lab.data.records import Campaign
from fidim_lab.errors import RefusedError
from fidim_lab.mismatch.conclusion.explanation import Before, BodyParameter, Explanation, Verdict
from fidim_lab.mismatch.selection.candidates import Candidate
from fidim_lab.mismatch.selection.single_force import modelled
from fidim_lab.mismatch.unknown_force.unknown import UnknownForce
from fidim_lab.say import Say


def with_unknown(
    explanation: Explanation, named: Candidate, campaign: Campaign, say: Say, known: UnknownForce | None = None
) -> Explanation:
    """The explanation with what is left modelled generically, where its verdict says that something is left.

    named: the model whose effects are named. known: the generic model, where it was found already. Figures and
    parameters "after" are those of the generic model where it helps on held-out windows, and the explanation is as it
    was where it does not.
    """
    if explanation.verdict not in (Verdict.UNKNOWN_PHYSICS, Verdict.PARTLY_EXPLAINED):
        return explanation
    if named.model.mechanism.springs:
        said = "The residual with elastic cables was scored, but no unknown wrench was fitted to it."
        return replace(explanation, message=f"{explanation.message} {said}")
    try:
        if known is None:
            say("modelling unknown physics")
        found = known or modelled(named, campaign)
    except RefusedError as error:
        return replace(explanation, message=f"{explanation.message} {error.message}")
    if found.terms and not found.after.dof:
        said = "No held-out window can be predicted, so an unknown wrench cannot be judged."
        return replace(explanation, message=f"{explanation.message} {said}")
    if not found.terms or not _helps(found):
        said = "No smooth wrench of place, velocity, rotation or time explains it either."
        return replace(explanation, message=f"{explanation.message} {said}")
    if not found.halves:
        found = replace(found, words=())  # the shape of a part would be taken for that of the whole
    return replace(
        explanation,
        chi2_per_dof=Before(explanation.chi2_per_dof.before, found.after.chi2_per_dof),
        rms_mm=Before(explanation.rms_mm.before, 1e3 * found.after.rms),
        parameters=_parameters(found, explanation),
        message=f"{explanation.message} {_says(found)}",
        unknown=found,
    )


def _helps(found: UnknownForce) -> bool:
    """Whether held-out windows are predicted better, and none less that was predicted before."""
    lost = found.after.refused.keys() - found.before.refused.keys()
    return found.after.chi2_per_dof < found.before.chi2_per_dof and not lost


def _parameters(found: UnknownForce, explanation: Explanation) -> dict[str, BodyParameter]:
    return {
        shift.name: BodyParameter(shift.with_it, shift.with_sd, explanation.parameters[shift.name].nominal)
        for shift in found.parameters
    }


def _says(found: UnknownForce) -> str:
    figures = f"held-out χ²/dof {found.before.chi2_per_dof:.3g} → {found.after.chi2_per_dof:.3g}, rms "
    figures += f"{1e3 * found.before.rms:.3g} → {1e3 * found.after.rms:.3g} mm"
    if not found.words:
        return f"An unknown wrench explains less than half of that ({figures}), so it is not described."
    return f"Modelled by an unknown wrench ({figures}): {' '.join(found.words)}"
